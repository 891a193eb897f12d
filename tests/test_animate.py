"""Motions on a skeleton move it as the body model itself would, whatever pose it rests in."""

from dataclasses import replace

import numpy as np
import pytest

from assets.asset.animate import animate, animation_of, figure_of, lowest
from assets.asset.asset import Asset
from assets.errors import GeometryError
from avatargen.body.joints import SMPLH_JOINT_NAMES
from avatargen.body.model import pose, shape
from avatargen.body.pose import named_pose
from avatargen.body.skinning import skin
from avatargen.errors import InputError
from avatargen.motion.legs import leg_length
from avatargen.motion.retarget import retarget
from tests.bodies import capsule_body
from tests.figures import BETAS, posed_by, random_motion, skeleton_at
from tests.tube import tube

NAMES = capsule_body().joint_names
RESTS = {name: named_pose(name, NAMES) for name in "xta"}
RESTS["random"] = np.random.default_rng(1).uniform(-1, 1, (24, 3)).astype(np.float32)


def person(rest: str = "a") -> Asset:
    """A mesh of points that hang rigidly on the capsule's joints, one influence each."""
    skeleton = skeleton_at(RESTS[rest])
    rng = np.random.default_rng(0)
    joints = np.zeros((300, 4), dtype=np.int64)
    joints[:, 0] = rng.integers(24, size=300)
    vertices = skeleton.joints[joints[:, 0]] + rng.normal(size=(300, 3)) * 0.05
    plain = tube()
    return Asset(
        vertices=vertices.astype(np.float32),
        normals=np.tile(np.array([0, 1, 0], dtype=np.float32), (300, 1)),
        uv=np.zeros((300, 2), dtype=np.float32),
        faces=np.arange(300).reshape(100, 3),
        joints=joints,
        weights=np.tile(np.array([1, 0, 0, 0], dtype=np.float32), (300, 1)),
        texture=plain.texture,
        skeleton=skeleton,
        info=plain.info,
    )


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("rest", RESTS)
def test_every_joint_goes_where_the_body_model_takes_it(rest: str, turned: bool) -> None:
    motion, skeleton = random_motion(), skeleton_at(RESTS[rest], turned)
    found = animation_of(skeleton, motion)
    from_rest = np.linalg.inv(pose(capsule_body(), shape(capsule_body(), BETAS), RESTS[rest]).T_posed_rest)
    for frame in range(len(motion.times)):
        ours = posed_by(motion, frame)
        joints = found.T_world_joint(skeleton)[frame, :, :3, 3]
        np.testing.assert_allclose(joints, ours.joints, atol=1e-9)
        moved = found.T_posed_rest(skeleton)[frame]
        np.testing.assert_allclose(moved, ours.T_posed_rest @ from_rest, atol=1e-6)


@pytest.mark.parametrize("rest", RESTS)
def test_the_rest_pose_as_a_motion_moves_nothing(rest: str) -> None:
    from scipy.spatial.transform import Rotation

    skeleton = skeleton_at(RESTS[rest], turned=True)
    still = random_motion(1)
    quaternions = Rotation.from_rotvec(RESTS[rest]).as_quat()[None]
    still = replace(still, rotations=quaternions, translation=np.zeros((1, 3)))
    moved = animation_of(skeleton, still).T_posed_rest(skeleton)
    np.testing.assert_allclose(moved[0], np.tile(np.eye(4), (24, 1, 1)), atol=1e-6)


def test_quaternions_never_jump_to_the_other_half() -> None:
    found = animation_of(skeleton_at(RESTS["a"]), random_motion(40, angle=3.0))
    along = np.einsum("tjk,tjk->tj", found.rotations[1:], found.rotations[:-1])
    assert along.min() >= 0


def test_the_ground_is_where_the_lowest_vertex_ever_is() -> None:
    asset = person()
    motion = random_motion(300)
    found = animation_of(asset.skeleton, motion)
    weights = np.zeros((len(asset.vertices), 24))
    np.add.at(weights, (np.arange(len(weights))[:, None], asset.joints), asset.weights)
    slowly = min(
        skin(asset.vertices.astype(np.float64), weights, T)[:, 1].min()
        for T in found.T_posed_rest(asset.skeleton)
    )
    assert lowest(asset, found) == pytest.approx(slowly, abs=1e-9)
    assert lowest(asset, animate(asset, [motion]).animations[0]) == pytest.approx(0, abs=1e-9)
    lifted = animate(asset, [motion]).animations[0].root - found.root
    np.testing.assert_allclose(lifted, np.tile([0, -slowly, 0], (300, 1)), atol=1e-9)
    free = animate(asset, [motion], on_ground=False).animations[0]
    np.testing.assert_array_equal(free.root, found.root)


def test_figure_is_the_same_from_any_rest_pose() -> None:
    straight = shape(capsule_body(), BETAS).joints
    for rest in RESTS:
        found = figure_of(person(rest))
        shift = found.joints[0] - straight[0]
        np.testing.assert_allclose(found.joints, straight + shift, atol=1e-6)


def test_joints_are_matched_by_name_and_a_hand_follows_its_middle_finger() -> None:
    full = random_motion(3, names=SMPLH_JOINT_NAMES)
    skeleton = skeleton_at(RESTS["t"])
    found = animation_of(skeleton, full)
    for name, source in (("left_knee", "left_knee"), ("left_hand", "left_middle1"), ("head", "head")):
        ours, theirs = NAMES.index(name), SMPLH_JOINT_NAMES.index(source)
        np.testing.assert_allclose(
            np.abs(np.einsum("tk,tk->t", found.rotations[:, ours], full.rotations[:, theirs])), 1, atol=1e-9
        )
    with pytest.raises(InputError, match="none of its 52 joints"):
        animation_of(replace(skeleton, joint_names=tuple(f"bone_{i}" for i in range(24))), full)


def test_two_animations_of_one_name_are_refused() -> None:
    with pytest.raises(GeometryError, match="share a name"):
        animate(person(), [random_motion(), random_motion()])


@pytest.mark.parametrize(
    "change",
    [
        {"times": np.array([0.0, 0.0, 1.0])},
        {"times": np.array([0.5, 1.0, 2.0])},
        {"rotations": np.full((3, 24, 4), np.nan)},
        {"rotations": np.ones((3, 24, 4))},
        {"root": np.full((3, 3), np.inf)},
    ],
)
def test_an_animation_checks_itself(change: dict) -> None:
    found = animation_of(skeleton_at(RESTS["a"]), random_motion(3))
    with pytest.raises(GeometryError, match="animation random"):
        replace(found, **change)


def test_another_persons_motion_becomes_the_figures_own() -> None:
    """Its way is scaled with the legs, so that feet which stand still there stand still here; one's own way
    stays."""
    asset, motion = person(), random_motion(30)
    theirs = replace(motion, leg=0.5)
    own, other = (animate(asset, [each], on_ground=False).animations[0] for each in (motion, theirs))
    figure = figure_of(asset)
    length = sum(leg_length(figure, side) for side in ("left", "right")) / 2
    np.testing.assert_allclose(own.root, asset.skeleton.joints[0] + motion.translation, rtol=1e-12)
    scaled = asset.skeleton.joints[0] + motion.translation * length / 0.5
    np.testing.assert_allclose(other.root, scaled, rtol=1e-9)
    made = animation_of(asset.skeleton, retarget(theirs, figure))
    np.testing.assert_array_equal(other.rotations, made.rotations)
