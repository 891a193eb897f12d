"""USD's own skinning of a file, for tests to compare with ours."""

# USD's modules fill themselves when they load, so their names are unknown before.
# pyright: reportAttributeAccessIssue=false

from pathlib import Path

import numpy as np
from pxr import Usd, UsdSkel, Vt


def usdskel_vertices(path: Path, T_posed_rest: np.ndarray) -> np.ndarray:
    """The file's points [P W 3] as UsdSkel bends them; `T_posed_rest` is [P J 4 4] by the file's joints."""
    stage = Usd.Stage.Open(str(path))
    root = UsdSkel.Root(stage.GetDefaultPrim())
    (prim,) = [p for p in stage.Traverse() if p.IsA(UsdSkel.Skeleton)]
    skeleton = UsdSkel.Skeleton(prim)
    animation = UsdSkel.Animation.Define(stage, root.GetPath().AppendChild("judge"))
    animation.CreateJointsAttr(skeleton.GetJointsAttr().Get())
    topology = UsdSkel.Topology(skeleton.GetJointsAttr().Get())
    binds = np.asarray(skeleton.GetBindTransformsAttr().Get())
    for time, transforms in enumerate(T_posed_rest):
        world = binds @ transforms.transpose(0, 2, 1)  # row vectors
        arrays = [Vt.Matrix4dArray.FromNumpy(matrices) for matrices in (world, np.linalg.inv(world))]
        animation.SetTransforms(UsdSkel.ComputeJointLocalTransforms(topology, *arrays), time)
    UsdSkel.BindingAPI.Apply(prim).CreateAnimationSourceRel().SetTargets([animation.GetPath()])
    return np.array([played_points(root, time) for time in range(len(T_posed_rest))])


def played_vertices(stage: Usd.Stage, animation: str, time_code: float) -> np.ndarray:
    """The points [W 3] of the stage's default prim while its skeleton plays an animation of the stage."""
    (prim,) = [p for p in stage.Traverse() if p.IsA(UsdSkel.Skeleton)]
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        UsdSkel.BindingAPI(prim).GetAnimationSourceRel().SetTargets([animation])
        points = played_points(UsdSkel.Root(stage.GetDefaultPrim()), time_code)
        UsdSkel.BindingAPI(prim).GetAnimationSourceRel().ClearTargets(True)
    return points


def played_points(root: UsdSkel.Root, time_code: float) -> np.ndarray:
    cache = UsdSkel.Cache()
    cache.Populate(root, Usd.PrimDefaultPredicate)
    (binding,) = cache.ComputeSkelBindings(root, Usd.PrimDefaultPredicate)
    (skinning,) = binding.GetSkinningTargets()
    points = Vt.Vec3fArray(skinning.GetPrim().GetAttribute("points").Get())
    transforms = cache.GetSkelQuery(binding.GetSkeleton()).ComputeSkinningTransforms(time_code)
    assert skinning.ComputeSkinnedPoints(transforms, points, time_code)
    return np.asarray(points).copy()
