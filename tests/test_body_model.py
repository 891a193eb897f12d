"""The body: rest, shape, pose and their invariants."""

from dataclasses import replace

import numpy as np
import pytest

from avatargen.body.model import Body, canonical_body, pose, shape
from avatargen.body.pose import axis_angle_to_matrix, named_pose
from avatargen.errors import InputError
from tests.bodies import SMPL_JOINTS, capsule_body


@pytest.fixture(scope="module")
def body() -> Body:
    return capsule_body(pose_blend=True)


def random_pose(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(24, 3)) * 0.7


def slow_posed_vertex(body: Body, betas: np.ndarray, rotations: np.ndarray, vertex: int) -> np.ndarray:
    """One vertex by the definition, in float64, a joint at a time."""
    rest = body.v_template.astype(np.float64) + body.shapedirs.astype(np.float64) @ betas
    joints = body.J_regressor.astype(np.float64) @ rest
    matrices = [axis_angle_to_matrix(r) for r in rotations]
    feature = np.concatenate([(m - np.eye(3)).ravel() for m in matrices[1:]])
    moved = rest[vertex] + body.posedirs[vertex].astype(np.float64) @ feature  # pyright: ignore[reportOptionalSubscript]
    result = np.zeros(3)
    for joint in range(24):
        point, at = moved, joint
        while at != -1:  # turn about each joint on the way to the root, in the rest skeleton
            point = matrices[at] @ (point - joints[at]) + joints[at]
            at = int(body.parents[at])
        result += float(body.weights[vertex, joint]) * point
    return result


def test_rest_pose_reproduces_the_template(body: Body):
    posed = pose(body, shape(body, np.zeros(10)), np.zeros((24, 3)))

    assert np.abs(posed.vertices - body.v_template).max() < 1e-6


@pytest.mark.parametrize("seed", [0, 1])
def test_posed_vertices_match_the_slow_obvious_version(body: Body, seed: int):
    betas, rotations = np.random.default_rng(seed).normal(size=10), random_pose(seed)
    posed = pose(body, shape(body, betas), rotations)

    for vertex in range(0, len(body.v_template), 199):
        expected = slow_posed_vertex(body, betas, rotations, vertex)
        assert np.abs(posed.vertices[vertex] - expected).max() < 1e-6


def test_joints_follow_from_the_regressor_and_the_kinematics(body: Body):
    shaped = shape(body, np.zeros(0))
    assert np.abs(shaped.joints - SMPL_JOINTS).max() < 0.08  # the regressor averages the nearest surface

    rotations = np.zeros((24, 3))
    rotations[16, 2] = np.pi / 2  # left shoulder: the arm points up
    posed = pose(body, shaped, rotations, translation=np.array([0.0, 1.0, 0.0]))
    arm = posed.joints[20] - posed.joints[16]
    assert arm[1] > 0.4
    assert abs(arm[0]) < 0.05
    length = np.linalg.norm(shaped.joints[20] - shaped.joints[16])
    assert abs(np.linalg.norm(arm) - length) < 1e-9


def test_translation_moves_everything(body: Body):
    shaped, step = shape(body, np.ones(3)), np.array([0.1, -2.0, 3.0])
    still, moved = (pose(body, shaped, random_pose(3), translation) for translation in (None, step))

    assert np.abs(moved.vertices - still.vertices - step).max() < 1e-6  # weight sums are 1 within float32
    assert np.abs(moved.joints - still.joints - step).max() < 1e-12


def test_shape_is_linear_in_the_betas(body: Body):
    betas = np.arange(10) / 10
    doubled = shape(body, 2 * betas).vertices - shape(body, np.zeros(10)).vertices
    single = shape(body, betas).vertices - shape(body, np.zeros(10)).vertices
    assert np.abs(doubled - 2 * single).max() < 1e-12


def test_canonical_body_stands_in_the_x_pose(body: Body):
    canonical = canonical_body(body)
    posed = pose(body, shape(body, np.zeros(10)), named_pose("x", body.joint_names))

    assert np.abs(canonical.vertices - posed.vertices).max() < 1e-6
    feet = canonical.joints[[7, 8], 0]
    assert feet[0] > 0.3  # the left leg goes to the left, +x
    assert feet[1] < -0.3
    assert np.abs(canonical.joints[[20, 21], 1] - canonical.joints[[16, 17], 1]).max() < 0.05  # arms level


@pytest.mark.parametrize(
    "change",
    [
        {"weights": lambda b: b.weights * 1.1},
        {"weights": lambda b: b.weights * np.nan},
        {"parents": lambda b: np.roll(b.parents, 1)},
        {"faces": lambda b: b.faces + len(b.v_template)},
        {"v_template": lambda b: b.v_template * np.inf},
        {"joint_names": lambda b: b.joint_names[:-1]},
        {"joint_names": lambda b: ("hip",) * 24},
    ],
)
def test_bodies_that_do_not_hold_together_are_refused(change: dict):
    plain = capsule_body()
    with pytest.raises(InputError), np.errstate(invalid="ignore"):
        replace(plain, **{name: make(plain) for name, make in change.items()})


def test_wrong_betas_and_rotations_are_refused(body: Body):
    with pytest.raises(InputError, match="10 finite numbers"):
        shape(body, np.zeros(11))
    with pytest.raises(InputError, match="finite"):
        shape(body, np.array([np.nan]))
    with pytest.raises(InputError, match="24, 3"):
        pose(body, shape(body, np.zeros(0)), np.full((24, 3), np.inf))
