"""Motions on an asset: joint rotations from the T-pose become those of the asset's own skeleton.

A motion says how each joint is turned against its parent from the T-pose, R_j. In the T-pose all joint frames
are the world's; the asset rests in another pose, whose rotations from the T-pose are A_j in world axes, and
its joint frames may be turned by B_j at rest. What moves the skin is the turn from the rest pose on, so with
the parent p of j

    G_j = G_p R_j           the joint's world rotation from the T-pose
    W_j = G_j A_j^-1        the same from the rest pose
    world joint frame = W_j B_j,  parent <- joint = B_p^-1 A_p R_j A_j^-1 B_j   (B_p = A_p = I above the root)

and a bone's translation in its parent's frame stays as it is at rest. Letters: T frames, J joints, W
vertices, M morphs.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float64
from scipy.sparse import coo_array, csr_array
from scipy.spatial.transform import Rotation

from assets.asset.asset import Asset
from assets.asset.drape import drape
from assets.asset.rig import Animation, Skeleton
from assets.asset.twist import drive_twists
from avatargen.body.joints import driving_name
from avatargen.errors import InputError
from avatargen.motion.figure import Figure
from avatargen.motion.motion import Motion, continuous

FRAMES_AT_ONCE = 256


def animate(asset: Asset, motions: Sequence[Motion], on_ground: bool = True) -> Asset:
    """The asset with an animation for each motion, after those it has.

    `on_ground` lifts or lowers a whole animation so that its lowest vertex touches y = 0 once: the figure of
    a motion file has other legs than this one, and `retargeted` makes such a motion this figure's.

    Raises:
        InputError: a motion shares no joint with the skeleton, or moves shapes that the asset has not.
        GeometryError: two animations share a name.
    """
    made = []
    for motion in retargeted(asset, motions):
        animation = drape(animation_of(asset.skeleton, motion), asset.skeleton, asset.springs)
        if on_ground and motion.joint_names:
            animation = replace(animation, root=animation.root - [0.0, lowest(asset, animation), 0.0])
        made.append(replace(animation, weights=morph_weights(asset, motion)))
    return replace(asset, animations=(*asset.animations, *made))


def morph_weights(asset: Asset, motion: Motion) -> Float64[np.ndarray, "T M"] | None:
    """The motion's weights as those of the asset's morphs; None where it moves no face.

    Raises:
        InputError: the asset lacks a shape that the motion moves.
    """
    if motion.weights is None:
        return None
    names = [morph.name for morph in asset.morphs]
    missing = [shape for shape in motion.shapes if shape not in names]
    if missing:
        raise InputError(
            f"motion {motion.name}: the face has no shape {missing[0]}; make one that moves, as --face does"
        )
    weights = np.zeros((len(motion.times), len(names)))
    weights[:, [names.index(shape) for shape in motion.shapes]] = motion.weights
    return weights


def retargeted(asset: Asset, motions: Sequence[Motion]) -> tuple[Motion, ...]:
    """The motions as the asset's own: those of other people get the way and the standing feet of its legs."""
    if all(motion.leg is None for motion in motions):
        return tuple(motions)
    from avatargen.motion.retarget import retarget  # scipy's splines take .2 s to load

    figure = figure_of(asset)
    return tuple(retarget(motion, figure) for motion in motions)


def animation_of(skeleton: Skeleton, motion: Motion) -> Animation:
    """The motion on this skeleton, the pelvis at its place in the T-pose plus the motion's translation; one
    of a face alone leaves it at rest.

    Raises:
        InputError: the motion shares no joint with the skeleton.
    """
    if not motion.joint_names:
        return at_rest(skeleton, motion)
    turned = zero_rotations(len(motion.times), len(skeleton.parents))
    found = [driving_name(name, motion.joint_names) for name in skeleton.joint_names]
    shared = [(j, motion.joint_names.index(name)) for j, name in enumerate(found) if name is not None]
    if not shared:
        raise InputError(
            f"motion {motion.name}: none of its {len(motion.joint_names)} joints is one of the skeleton's; "
            "joints are matched by SMPL's names"
        )
    for joint, source in shared:
        turned[:, joint] = Rotation.from_quat(motion.rotations[:, source]).as_matrix()
    drive_twists(turned, skeleton)
    frames, rest = skeleton.T_world_joint[:, :3, :3], rest_rotations_of(skeleton)
    above = np.where(skeleton.parents >= 0, skeleton.parents, 0)
    root = (skeleton.parents < 0)[:, None, None]
    before = np.where(root, np.eye(3), frames.transpose(0, 2, 1)[above] @ rest[above])
    local = before @ turned @ (rest.transpose(0, 2, 1) @ frames)
    quaternions = Rotation.from_matrix(local.reshape(-1, 3, 3)).as_quat().reshape(*local.shape[:2], 4)
    return Animation(
        name=motion.name,
        times=motion.times,
        rotations=continuous(quaternions),
        root=skeleton.joints[0] + motion.translation,
    )


def at_rest(skeleton: Skeleton, motion: Motion) -> Animation:
    """The skeleton at rest for as long as the motion lasts."""
    local = skeleton.T_parent_joint
    quaternions = Rotation.from_matrix(local[:, :3, :3]).as_quat(canonical=True)
    frames = len(motion.times)
    return Animation(
        name=motion.name,
        times=motion.times,
        rotations=np.tile(quaternions, (frames, 1, 1)),
        root=np.tile(local[0, :3, 3], (frames, 1)),
    )


def zero_rotations(frames: int, joints: int) -> Float64[np.ndarray, "T J 3 3"]:
    return np.tile(np.eye(3), (frames, joints, 1, 1))


def rest_rotations_of(skeleton: Skeleton) -> Float64[np.ndarray, "J 3 3"]:
    """World rotations of the joints from the T-pose to the rest pose."""
    if skeleton.rest_rotations is not None:
        return skeleton.rest_rotations
    return np.tile(np.eye(3), (len(skeleton.parents), 1, 1))


def figure_of(asset: Asset) -> Figure:
    """The asset's person in the T-pose, the pelvis where it is at rest."""
    skeleton = asset.skeleton
    rest, joints = rest_rotations_of(skeleton), skeleton.joints.copy()
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            along = skeleton.joints[joint] - skeleton.joints[parent]
            joints[joint] = joints[parent] + rest[parent].T @ along
    still = Motion(
        name="T-pose",
        joint_names=skeleton.joint_names,
        times=np.zeros(1),
        rotations=np.tile([0.0, 0.0, 0.0, 1.0], (1, len(rest), 1)),
        translation=np.zeros((1, 3)),
    )
    ground = lowest(asset, animation_of(skeleton, still))
    return Figure(joint_names=skeleton.joint_names, joints=joints, ground=ground)


def lowest(asset: Asset, animation: Animation) -> float:
    """The least height of any skinned vertex in any frame, metres."""
    T_posed_rest = animation.T_posed_rest(asset.skeleton)
    return min(float(heights.min()) for heights in along_axis(asset, T_posed_rest, 1))


def boxes(asset: Asset, animation: Animation) -> Float64[np.ndarray, "T 2 3"]:
    """The low and the high corner of the box around the skinned vertices in each frame, metres; morphs move
    none of them out of it."""
    T_posed_rest = animation.T_posed_rest(asset.skeleton)
    found = np.empty((len(T_posed_rest), 2, 3))
    for axis in range(3):
        parts = [(p.min(axis=0), p.max(axis=0)) for p in along_axis(asset, T_posed_rest, axis)]
        found[:, :, axis] = np.concatenate([np.stack(part, axis=1) for part in parts])
    for frame, moved in enumerate(morphed_points(asset, animation, T_posed_rest)):
        if len(moved):
            found[frame, 0] = np.minimum(found[frame, 0], moved.min(axis=0))
            found[frame, 1] = np.maximum(found[frame, 1], moved.max(axis=0))
    return found


def morphed_points(
    asset: Asset, animation: Animation, T_posed_rest: Float64[np.ndarray, "T J 4 4"]
) -> Iterator[Float64[np.ndarray, "_ 3"]]:
    """In each frame the places of those vertices that morphs move in any of the animation."""
    if animation.weights is None:
        return
    used = np.flatnonzero(animation.weights.any(axis=0))
    ways = np.stack([np.zeros_like(asset.vertices), *(asset.morphs[i].vertices for i in used)])[1:]
    rows = np.flatnonzero(ways.any(axis=(0, 2)))
    rest, shares = asset.vertices[rows].astype(np.float64), asset.weights[rows].astype(np.float64)
    for transforms, weights in zip(T_posed_rest, animation.weights[:, used], strict=True):
        at = rest + np.einsum("m,mwd->wd", weights, ways[:, rows].astype(np.float64))
        blended = np.einsum("wk,wkab->wab", shares, transforms[asset.joints[rows], :3])
        yield np.einsum("wab,wb->wa", blended[:, :, :3], at) + blended[:, :, 3]


def along_axis(
    asset: Asset, T_posed_rest: Float64[np.ndarray, "T J 4 4"], axis: int
) -> Iterator[Float64[np.ndarray, "W t"]]:
    """The x, y or z of every skinned vertex, some frames at a time."""
    rows = T_posed_rest[:, :, axis].reshape(len(T_posed_rest), -1).T  # what gives it of a point: 4J T
    blend = place_matrix(asset)
    for start in range(0, rows.shape[1], FRAMES_AT_ONCE):
        yield blend @ rows[:, start : start + FRAMES_AT_ONCE]


def place_matrix(asset: Asset) -> csr_array:
    """[W, 4J]: times the first, second or third rows of the joints' transforms it gives the x, y or z of the
    skinned vertices."""
    W, J = len(asset.vertices), len(asset.skeleton.parents)
    points = np.concatenate([asset.vertices.astype(np.float64), np.ones((W, 1))], axis=1)
    values = asset.weights[:, :, None].astype(np.float64) * points[:, None]  # W slots 4
    columns = 4 * asset.joints[:, :, None] + np.arange(4)
    rows = np.broadcast_to(np.arange(W)[:, None, None], values.shape)
    places = (rows.ravel(), columns.ravel())
    return csr_array(coo_array((values.ravel(), places), shape=(W, 4 * J)))
