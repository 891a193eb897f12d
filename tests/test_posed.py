"""A posed asset: agrees with skinning written out plainly, and with the body's own poses."""

import numpy as np
import pytest

from assets.asset.posed import posed
from avatargen.body.model import forward_kinematics
from avatargen.body.pose import Z_AXIS_POSES, axis_angle_to_matrix, named_pose
from avatargen.body.skinning import skin
from avatargen.body.stance import LIMBS, STANCES, limb_rotations, stance
from avatargen.errors import InputError
from tests.bodies import capsule_body
from tests.tube import mapped, tube

NAMES = capsule_body(0.06).joint_names


def test_a_posed_tube_is_skinned_as_the_judges_expect():
    asset = tube(joint_count=4)
    rotations = np.random.default_rng(0).uniform(-1, 1, (4, 3))
    there = posed(asset, rotations, on_ground=False)
    T = forward_kinematics(
        asset.skeleton.joints.copy(), axis_angle_to_matrix(rotations), asset.skeleton.parents
    )
    T_posed_rest = T.copy()
    T_posed_rest[:, :3, 3] -= np.einsum("jab,jb->ja", T[:, :3, :3], asset.skeleton.joints)
    dense = np.zeros((len(asset.vertices), 4))
    np.add.at(dense, (np.arange(len(dense))[:, None], asset.joints), asset.weights)
    assert there.vertices == pytest.approx(skin(asset.vertices, dense, T_posed_rest), abs=1e-6)
    assert there.skeleton.joints == pytest.approx(T[:, :3, 3], abs=1e-12)
    assert np.array_equal(there.skeleton.T_world_joint[:, :3, :3], asset.skeleton.T_world_joint[:, :3, :3])


def test_a_pose_does_not_depend_on_the_joints_own_axes():
    rotations = np.random.default_rng(1).uniform(-1, 1, (3, 3))
    straight, tilted = (posed(tube(joint_count=3, tilt=tilt), rotations) for tilt in (0.0, 0.7))
    assert np.array_equal(straight.vertices, tilted.vertices)
    assert straight.vertices[:, 1].min() == 0


def test_a_pose_counts_from_the_t_pose_whatever_the_asset_rests_in():
    asset = tube(joint_count=1)  # one joint: rigid, so a detour changes nothing
    first, last = np.array([[0.3, -0.8, 0.5]]), np.array([[-0.2, 0.4, 1.0]])
    direct, detour = posed(asset, last), posed(posed(asset, first), last)
    assert detour.vertices == pytest.approx(direct.vertices, abs=1e-6)
    assert detour.normals == pytest.approx(direct.normals, abs=1e-6)
    assert detour.skeleton.T_world_joint == pytest.approx(direct.skeleton.T_world_joint, abs=1e-6)


def test_tangents_turn_with_the_surface():
    asset, rotations = mapped(tube(joint_count=1)), np.array([[0.3, -0.8, 0.5]])
    there = posed(asset, rotations)
    turn = axis_angle_to_matrix(rotations)[0]
    assert asset.normal_map is not None
    assert there.normal_map is not None
    before, after = asset.normal_map.tangents, there.normal_map.tangents
    assert after[:, :3] == pytest.approx(before[:, :3] @ turn.T, abs=1e-6)
    assert np.array_equal(before[:, 3], after[:, 3])


def test_rotations_that_do_not_fit():
    for rotations in (np.zeros((3, 3)), np.full((2, 3), np.nan)):
        with pytest.raises(InputError, match="pose"):
            posed(tube(), rotations)


@pytest.mark.parametrize("name", Z_AXIS_POSES)
def test_rest_poses_in_words_are_the_rest_poses(name):
    assert limb_rotations(stance(name), NAMES) == pytest.approx(named_pose(name, NAMES), abs=1e-6)


def test_words_mean_what_they_say():
    """Where the body's joints go when an angle grows: up is +y, forward +z, the person's left +x."""
    moves = {
        "left arm up": ("left_wrist", [0, 1, 0]),
        "right arm up": ("right_wrist", [0, 1, 0]),
        "left arm forward": ("left_wrist", [0, 0, 1]),
        "right elbow": ("right_wrist", [0, 0, 1]),
        "left leg forward": ("left_ankle", [0, 0, 1]),
        "right leg out": ("right_ankle", [-1, 0, 0]),
        "left knee": ("left_ankle", [0, 0, -1]),
        "right foot up": ("right_foot", [0, 1, 0]),
        "bend forward": ("head", [0, 0, 1]),
        "bend left": ("head", [1, 0, 0]),
    }
    body = capsule_body(0.06)
    joints = body.J_regressor @ body.v_template
    for limb, (joint, direction) in moves.items():
        turns = axis_angle_to_matrix(limb_rotations({limb: 20.0}, NAMES))
        places = forward_kinematics(joints.astype(float), turns, body.parents)[:, :3, 3]
        moved = (places - joints)[NAMES.index(joint)]
        assert moved @ direction > 0.02, limb


def test_both_sides_mirror_each_other():
    rng = np.random.default_rng(0)
    pairs = [name for name in LIMBS if name.startswith("left")]
    angles = {name: float(rng.uniform(LIMBS[name].low, LIMBS[name].high)) for name in pairs}
    left = limb_rotations(angles, NAMES)
    right = limb_rotations({name.replace("left", "right"): angle for name, angle in angles.items()}, NAMES)
    swap = [
        NAMES.index(name.replace("left", "RIGHT").replace("right", "left").replace("RIGHT", "right"))
        for name in NAMES
    ]
    assert right[swap] == pytest.approx(left * [1, -1, -1], abs=1e-9)  # a mirror turns y and z around


def test_stances_stay_within_reach_and_others_are_refused():
    for angles in STANCES.values():
        assert all(LIMBS[name].low <= angle <= LIMBS[name].high for name, angle in angles.items())
    with pytest.raises(InputError, match="stand"):
        stance("moonwalk")
    for angles in ({"tail": 3.0}, {"nod": np.nan}):
        with pytest.raises(InputError, match="pose"):
            limb_rotations(angles, NAMES)
    assert (limb_rotations({"nod": 20.0}, ("pelvis", "tail")) == 0).all()
