"""What is wrong with a USD file: UsdValidation's verdict, and what it does not look at.

UsdValidation passes joints that do not exist, weights of NaN, arrays of the wrong length, skeletons that are
not there, absolute paths of textures, textures that are missing and extents that what plays leaves. Each
finding is one sentence that begins with the prim it is about.
"""

# USD's modules fill themselves when they load, so their names are unknown before.
# pyright: reportAttributeAccessIssue=false

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from pxr import Sdf, Tf, Usd, UsdGeom, UsdSkel, UsdValidation, Vt

WEIGHT_SUM_LIMIT = 1e-4
EXTENT_LIMIT = 1e-4  # metres that a point may lie outside an extent
MOST_FRAMES = 200  # that are looked at


def check_usd(path: str | Path) -> list[str]:
    """Every finding about the file, none if it is sound. Never raises for what a file holds."""
    try:
        stage = Usd.Stage.Open(str(path))
    except Tf.ErrorException:
        return ["the file cannot be read as USD; it is damaged, cut short or of another kind"]
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    findings = [e.GetErrorAsString() for e in UsdValidation.ValidationContext(validators).Validate(stage)]
    if not stage.GetDefaultPrim():
        findings.append("the file has no default prim, so nothing shows where it is referenced")
    for prim in stage.Traverse():
        findings += [f"{prim.GetPath()}: {finding}" for finding in prim_findings(prim)]
    if not findings:  # nothing can be bent that is not sound
        roots = [UsdSkel.Root(prim) for prim in stage.Traverse() if prim.IsA(UsdSkel.Root)]
        findings += [finding for root in roots for finding in extent_findings(root)]
    return findings


def prim_findings(prim: Usd.Prim) -> Iterator[str]:
    if prim.IsA(UsdGeom.Mesh):
        yield from mesh_findings(UsdGeom.Mesh(prim))
        if prim.HasAPI(UsdSkel.BindingAPI):
            yield from binding_findings(prim)
    if prim.IsA(UsdSkel.Skeleton):
        yield from skeleton_findings(UsdSkel.Skeleton(prim))
    yield from path_findings(prim)


def mesh_findings(mesh: UsdGeom.Mesh) -> Iterator[str]:
    """Counts that fit, corners that exist, numbers that are numbers."""
    points = numbers(mesh.GetPointsAttr())
    counts, corners = numbers(mesh.GetFaceVertexCountsAttr()), numbers(mesh.GetFaceVertexIndicesAttr())
    if len(points) == 0 or len(corners) == 0:
        yield "the mesh is empty"
        return
    if not np.isfinite(points).all():
        yield "points hold NaN or infinity"
    if counts.sum() != len(corners):
        yield f"faceVertexCounts add up to {counts.sum()}, but there are {len(corners)} corners"
    if corners.min() < 0 or corners.max() >= len(points):
        yield f"corners reach from {corners.min()} to {corners.max()}, but there are {len(points)} points"
    for primvar in UsdGeom.PrimvarsAPI(mesh).GetPrimvars():
        wanted = {"vertex": len(points), "faceVarying": len(corners)}.get(primvar.GetInterpolation())
        if wanted is None:  # one value for the whole mesh
            continue
        found = len(primvar.ComputeFlattened() or ()) // max(primvar.GetElementSize(), 1)
        if found != wanted:
            yield f"{primvar.GetPrimvarName()} has {found} values; {wanted} are needed"


def binding_findings(prim: Usd.Prim) -> Iterator[str]:
    """The skeleton exists, and each point's joints and weights can be used."""
    binding = UsdSkel.BindingAPI(prim)
    skeleton = binding.GetInheritedSkeleton()
    if not skeleton or not skeleton.GetPrim().IsValid():
        yield "skel:skeleton names no Skeleton"
        return
    joints, weights = numbers(binding.GetJointIndicesAttr()), numbers(binding.GetJointWeightsAttr())
    size = binding.GetJointWeightsPrimvar().GetElementSize()
    if len(joints) != len(weights) or size < 1 or len(weights) % max(size, 1):
        yield f"{len(joints)} joint indices and {len(weights)} weights do not come in groups of {size}"
        return
    joint_count = len(binding.GetJointsAttr().Get() or skeleton.GetJointsAttr().Get() or ())
    if len(joints) and not 0 <= joints.min() <= joints.max() < joint_count:
        yield f"joint indices reach from {joints.min()} to {joints.max()}, but there are {joint_count} joints"
    sums = weights.reshape(-1, size).sum(axis=1)
    if not (weights >= 0).all() or not (np.abs(sums - 1) < WEIGHT_SUM_LIMIT).all():  # also catches NaN
        yield "weights are not 0 or more with a sum of 1 at every point"


def skeleton_findings(skeleton: UsdSkel.Skeleton) -> Iterator[str]:
    """One bind and one rest a joint, no joint twice, parents before children."""
    joints = skeleton.GetJointsAttr().Get() or []
    valid, reason = UsdSkel.Topology(joints).Validate()
    if not valid:
        yield f"joints are out of order or not paths: {reason}"
        return
    if len(set(joints)) < len(joints):
        yield "two joints share a path"
    for attribute in (skeleton.GetBindTransformsAttr(), skeleton.GetRestTransformsAttr()):
        matrices = numbers(attribute)
        if len(matrices) != len(joints):
            yield f"{attribute.GetName()} has {len(matrices)} matrices; {len(joints)} are needed"
        elif not np.isfinite(matrices).all() or (np.abs(np.linalg.det(matrices)) < 1e-12).any():
            yield f"{attribute.GetName()} holds NaN, infinity or a matrix without inverse"


def extent_findings(root: UsdSkel.Root) -> Iterator[str]:
    """The extents of the root and of what its skeletons bend hold every point at every frame."""
    cache = UsdSkel.Cache()
    cache.Populate(root, Usd.PrimDefaultPredicate)
    for binding in cache.ComputeSkelBindings(root, Usd.PrimDefaultPredicate):
        query = cache.GetSkelQuery(binding.GetSkeleton())
        animation = query.GetAnimQuery() if query else None
        frames = animation.GetJointTransformTimeSamples() if animation else []
        times = [Usd.TimeCode(time) for time in frames[:: len(frames) // MOST_FRAMES + 1]]
        for skinning in binding.GetSkinningTargets():
            for time in times or [Usd.TimeCode.Default()]:
                found = list(left_extents(root, query, skinning, time))
                yield from found
                if found:  # one frame is enough
                    break


def left_extents(
    root: UsdSkel.Root, query: UsdSkel.SkeletonQuery, skinning: UsdSkel.SkinningQuery, time: Usd.TimeCode
) -> Iterator[str]:
    """The root and the mesh whose extent some bent point lies outside of at that time."""
    mesh, transforms = UsdGeom.PointBased(skinning.GetPrim()), query.ComputeSkinningTransforms(time)
    mapper = skinning.GetJointMapper()  # none where the mesh has the skeleton's own joints
    bent = Vt.Vec3fArray(numbers(mesh.GetPointsAttr()).tolist())
    if not skinning.ComputeSkinnedPoints(mapper.RemapTransforms(transforms) if mapper else transforms, bent):
        return
    places = UsdGeom.XformCache(time)
    points = np.concatenate([np.asarray(bent), np.ones((len(bent), 1))], axis=1)
    points = points @ np.asarray(places.GetLocalToWorldTransform(query.GetPrim()))  # row vectors
    for prim in (UsdGeom.Boundable(root), UsdGeom.Boundable(mesh)):
        box = prim.GetExtentAttr().Get(time)
        own = (points @ np.linalg.inv(places.GetLocalToWorldTransform(prim.GetPrim())))[:, :3]
        outside = 0.0 if box is None else max((box[0] - own).max(), (own - box[1]).max())
        if outside > EXTENT_LIMIT:
            yield f"{prim.GetPath()}: extent at time {time} leaves out points by {outside:.3f}"


def path_findings(prim: Usd.Prim) -> Iterator[str]:
    """Assets are named relative to the file and are there."""
    for attribute in prim.GetAttributes():
        value = attribute.Get()
        if not isinstance(value, Sdf.AssetPath) or not value.path:
            continue
        if Path(value.path).is_absolute():
            yield f"{attribute.GetName()} is the absolute path {value.path}, which no other machine has"
        if not value.resolvedPath:
            yield f"{attribute.GetName()} names {value.path}, which is not there"


def numbers(attribute: Usd.Attribute) -> np.ndarray:
    """The attribute's values; empty where it has none."""
    value = attribute.Get()
    return np.zeros(0) if value is None else np.asarray(value)
