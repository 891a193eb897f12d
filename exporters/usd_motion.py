"""An asset's animations and morphs in USD: a SkelAnimation each, a BlendShape each.

A skeleton plays one animation, the first; the others stand beside it, for a scene to bind. What a stage says
of time and extent is that of the first. Letters: T frames, J joints, W vertices.
"""

# pyright: reportAttributeAccessIssue=false

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float32, Float64
from pxr import Gf, Tf, Usd, UsdGeom, UsdSkel, Vt

from assets.asset.animate import boxes
from assets.asset.asset import Asset
from assets.asset.rig import Animation, Skeleton

FRAMES_PER_SECOND = 24.0  # what times are counted in, and what importers assume that do not ask
NEGLIGIBLE = 1e-7  # metres; a vertex that a morph moves by less is not stored


def add_animations(stage: Usd.Stage, asset: Asset, prim: UsdSkel.Skeleton) -> None:
    """Every animation beside the skeleton, the first bound to it."""
    if not asset.animations:
        return
    played = asset.animations[0]
    stage.SetTimeCodesPerSecond(FRAMES_PER_SECOND)
    stage.SetFramesPerSecond(FRAMES_PER_SECOND)
    stage.SetStartTimeCode(0)
    stage.SetEndTimeCode(float(played.times[-1]) * FRAMES_PER_SECOND)
    folder = prim.GetPath().GetParentPath()
    taken = {prim.GetName() for prim in stage.GetPrimAtPath(folder).GetChildren()}
    materials = {"material", *(f"{name}_material" for name in taken)}
    names = unique_names([motion.name for motion in asset.animations], taken | materials)
    paths = [folder.AppendChild(name) for name in names]
    joints = prim.GetJointsAttr().Get()
    shapes = [morph.name for morph in asset.morphs]
    for path, motion in zip(paths, asset.animations, strict=True):
        animation = UsdSkel.Animation.Define(stage, path)
        add_animation(animation, motion, asset.skeleton, joints)
        add_weights(animation, motion, shapes)
    UsdSkel.BindingAPI.Apply(prim.GetPrim()).CreateAnimationSourceRel().SetTargets(paths[:1])


def add_animation(
    prim: UsdSkel.Animation, motion: Animation, skeleton: Skeleton, joints: Vt.TokenArray
) -> None:
    """A joint's translation is its rest's, but for the root's and the hips'."""
    prim.CreateJointsAttr(joints)
    prim.CreateScalesAttr(Vt.Vec3hArray(len(joints), Gf.Vec3h(1)))
    translations = skeleton.T_parent_joint[:, :3, 3].astype(np.float32)
    moving, turning = prim.CreateTranslationsAttr(), prim.CreateRotationsAttr()
    for frame, (time, rotations) in enumerate(zip(motion.times, motion.rotations, strict=True)):
        code = Usd.TimeCode(float(time) * FRAMES_PER_SECOND)
        for joint, way in motion.ways.items():
            translations[joint] = way[frame]
        moving.Set(Vt.Vec3fArray.FromNumpy(translations), code)
        turning.Set(Vt.QuatfArray([Gf.Quatf(w, x, y, z) for x, y, z, w in rotations.tolist()]), code)


def add_weights(prim: UsdSkel.Animation, motion: Animation, shapes: Sequence[str]) -> None:
    """Weights of the shapes that the animation moves; meshes find them by name."""
    if motion.weights is None:
        return
    moved = np.flatnonzero(motion.weights.any(axis=0)).tolist()
    prim.CreateBlendShapesAttr([shapes[number] for number in moved])
    weighing = prim.CreateBlendShapeWeightsAttr()
    for time, weights in zip(motion.times, motion.weights[:, moved].astype(np.float32), strict=True):
        weighing.Set(Vt.FloatArray.FromNumpy(weights), Usd.TimeCode(float(time) * FRAMES_PER_SECOND))


def add_extents(root: UsdGeom.Boundable, meshes: Sequence[tuple[UsdGeom.Boundable, Asset]]) -> None:
    """The box around what the first animation shows at each of its frames, on the root and on each mesh, by
    which viewers leave out what is not in the picture; without a time, the box around all of them and the
    rest pose."""
    if not meshes[0][1].animations:
        return
    times = meshes[0][1].animations[0].times
    found = [boxes(asset, asset.animations[0]).astype(np.float32) for _, asset in meshes]
    rests = [np.stack([asset.vertices.min(axis=0), asset.vertices.max(axis=0)]) for _, asset in meshes]
    add_extent(root, times, around(found), around(rests))
    for (prim, _), box, rest in zip(meshes, found, rests, strict=True):
        add_extent(prim, times, box, rest)


def around(boxes: Sequence[Float32[np.ndarray, "*T 2 3"]]) -> Float32[np.ndarray, "*T 2 3"]:
    """The boxes around several boxes."""
    low = np.min([box[..., 0, :] for box in boxes], axis=0)
    return np.stack([low, np.max([box[..., 1, :] for box in boxes], axis=0)], axis=-2)


def add_extent(
    prim: UsdGeom.Boundable,
    times: Float64[np.ndarray, " T"],
    boxes: Float32[np.ndarray, "T 2 3"],
    rest: Float32[np.ndarray, "2 3"],
) -> None:
    """Boxes at some times, and the box around all of them and that of the rest pose."""
    ever, extent = np.concatenate([boxes.reshape(-1, 3), rest]), prim.GetExtentAttr()
    extent.Set(Vt.Vec3fArray.FromNumpy(np.stack([ever.min(axis=0), ever.max(axis=0)])))
    for time, box in zip(times, boxes, strict=True):
        code = Usd.TimeCode(float(time) * FRAMES_PER_SECOND)
        extent.Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(box)), code)


def add_morphs(stage: Usd.Stage, asset: Asset, mesh: UsdGeom.Mesh) -> None:
    """Every morph below the mesh, listed by its own name."""
    if not asset.morphs:
        return
    names = unique_names([morph.name for morph in asset.morphs], taken=set())
    paths = [mesh.GetPath().AppendChild(name) for name in names]
    for path, morph in zip(paths, asset.morphs, strict=True):
        changed = np.abs(morph.vertices).max(axis=1) > NEGLIGIBLE
        if morph.normals is not None:
            changed |= morph.normals.any(axis=1)
        moved = np.flatnonzero(changed)
        shape = UsdSkel.BlendShape.Define(stage, path)
        shape.CreateOffsetsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(morph.vertices[moved])))
        if morph.normals is not None:
            turned = np.ascontiguousarray(morph.normals[moved])
            shape.CreateNormalOffsetsAttr(Vt.Vec3fArray.FromNumpy(turned))
        shape.CreatePointIndicesAttr(Vt.IntArray.FromNumpy(moved.astype(np.int32)))
    binding = UsdSkel.BindingAPI(mesh.GetPrim())
    binding.CreateBlendShapesAttr([morph.name for morph in asset.morphs])
    binding.CreateBlendShapeTargetsRel().SetTargets(paths)


def unique_names(names: list[str], taken: set[str]) -> list[str]:
    """Names that prims can have, none twice and none that is taken."""
    unique: list[str] = []
    for name in map(Tf.MakeValidIdentifier, names):
        while name in taken or name in unique:
            name += "_"
        unique.append(name)
    return unique
