"""The default body's fingers: bit for bit the body without them, and no finger moves another's skin."""

import hashlib

import numpy as np
import pytest

from avatargen.avatar import load_single, shipped, training_body
from avatargen.body.fingers import hand_of_joint, without_fingers
from avatargen.body.joints import FINGERS, SMPL_JOINT_NAMES, SMPLH_JOINT_NAMES, SMPLX_JOINT_NAMES
from avatargen.body.load import load_body
from avatargen.body.model import Body, canonical_body, pose, shape
from avatargen.body.stance import STANCES, limb_rotations
from avatargen.generator.config import body_hash
from tests.bodies import SMPL_PARENTS, capsule_body


def smplx_like_body(V: int = 9) -> Body:
    """A speck of triangles on SMPL-X's 55 joints, with pose blend shapes, all at random."""
    rng, J = np.random.default_rng(3), len(SMPLX_JOINT_NAMES)
    wrists = [20] * 5 + [21] * 5
    chains = [link for i, wrist in enumerate(wrists) for link in (wrist, 25 + 3 * i, 26 + 3 * i)]
    weights = rng.random((V, J))
    return Body(
        v_template=rng.normal(size=(V, 3)).astype(np.float32),
        faces=np.arange(9).reshape(3, 3),
        weights=(weights / weights.sum(axis=1, keepdims=True)).astype(np.float32),
        parents=np.array([*SMPL_PARENTS[:22], 15, 15, 15, *chains]),
        joint_names=SMPLX_JOINT_NAMES,
        J_regressor=rng.random((J, V)).astype(np.float32),
        shapedirs=rng.normal(size=(V, 3, 2)).astype(np.float32),
        posedirs=rng.normal(size=(V, 3, 9 * (J - 1))).astype(np.float32),
    )


@pytest.fixture(scope="module")
def body() -> Body:
    return load_body(shipped("body.npz"))


def test_the_shipped_body_has_the_joints_of_smpl_h(body: Body) -> None:
    assert body.joint_names == SMPLH_JOINT_NAMES
    parents = dict(zip(body.joint_names, body.parents, strict=True))
    for side in ("left", "right"):
        for finger in FINGERS:
            chain = [f"{side}_wrist", *(f"{side}_{finger}{link}" for link in (1, 2, 3))]
            assert [body.joint_names[parents[joint]] for joint in chain[1:]] == chain[:-1]


def test_without_fingers_it_is_the_body_that_weights_are_trained_on(body: Body) -> None:
    fewer = training_body()
    assert fewer.joint_names == SMPL_JOINT_NAMES
    arrays = (fewer.v_template, fewer.faces, fewer.weights, fewer.parents, fewer.J_regressor, fewer.shapedirs)
    digest = hashlib.sha256(b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)).hexdigest()
    assert digest == "e081aace680444f15a89d28bbb0c1d7fff11211d928f34f90637abf962d76eca"
    assert np.array_equal(canonical_body(fewer).vertices, canonical_body(body).vertices)
    assert (
        body_hash(canonical_body(body))
        == load_single(shipped("generator.safetensors")).generator.config.body_hash
    )


def test_the_surface_stays_where_no_finger_turns(body: Body) -> None:
    rng, betas = np.random.default_rng(0), np.linspace(-2, 2, 10)
    turns = rng.uniform(-0.6, 0.6, (22, 3))
    fewer = without_fingers(body)
    found = [
        pose(each, shape(each, betas), np.concatenate([turns, np.zeros((each.joint_count - 22, 3))]))
        for each in (body, fewer)
    ]
    assert np.abs(found[0].vertices - found[1].vertices).max() < 1e-7


def test_a_hand_turns_like_its_fingers_together_in_smpl_x() -> None:
    full = smplx_like_body()
    fewer = without_fingers(full)
    assert fewer.joint_names == SMPL_JOINT_NAMES and without_fingers(fewer) is fewer
    matrices = np.random.default_rng(1).normal(size=(24, 9))
    hand: dict[str, np.ndarray] = dict(zip(SMPL_JOINT_NAMES, matrices, strict=True))
    each = {name: hand.get(name, np.zeros(9)) for name in SMPLX_JOINT_NAMES}
    each |= {f"{s}_{f}1": hand[f"{s}_hand"] for s in ("left", "right") for f in FINGERS[:4]}
    assert full.posedirs is not None and fewer.posedirs is not None
    wide = full.posedirs @ np.concatenate([each[name] for name in SMPLX_JOINT_NAMES[1:]])
    assert np.abs(fewer.posedirs @ matrices[1:].ravel() - wide).max() < 1e-4


def test_bodies_without_fingers_stay_as_they_are() -> None:
    assert without_fingers(capsule_body()) is capsule_body()
    assert hand_of_joint(SMPL_JOINT_NAMES).tolist() == list(range(24))
    hands = hand_of_joint(SMPLX_JOINT_NAMES)
    assert SMPLX_JOINT_NAMES[hands[SMPLX_JOINT_NAMES.index("left_pinky3")]] == "left_middle1"
    assert SMPLX_JOINT_NAMES[hands[SMPLX_JOINT_NAMES.index("right_thumb2")]] == "right_wrist"


@pytest.mark.parametrize("finger", FINGERS)
def test_a_finger_moves_no_other(body: Body, finger: str) -> None:
    """Beyond the first knuckle nothing of another finger follows it."""
    own = [body.joint_names.index(f"left_{finger}{link}") for link in (1, 2, 3)]
    others = [f for f in FINGERS if f != finger]
    beyond = [body.joint_names.index(f"left_{f}{link}") for f in others for link in (2, 3)]
    there = body.weights[:, beyond].sum(axis=1) > 0.5
    assert there.sum() > 400 and body.weights[there][:, own].max() == 0


def test_a_fist_closes_and_a_spread_hand_opens(body: Body) -> None:
    tips, middles = {}, {}
    shaped = shape(body, np.zeros(10))
    for name in ("t", "fist", "spread"):
        hands = {key: a for key, a in STANCES[name].items() if "arm" not in key and "leg" not in key}
        posed = pose(body, shaped, limb_rotations(hands, body.joint_names))
        last = [body.weights[:, body.joint_names.index(f"left_{f}3")] > 0.9 for f in FINGERS[:4]]
        tips[name] = np.stack([posed.vertices[on].mean(axis=0) for on in last])
        middles[name] = posed.joints[body.joint_names.index("left_wrist")]
    reach = {name: np.linalg.norm(tips[name] - middles[name], axis=1) for name in tips}
    assert (reach["fist"] < 0.75 * reach["t"]).all()
    wide = {name: np.ptp(tips[name][:, 2]) for name in tips}
    assert wide["spread"] > 1.2 * wide["t"] and wide["fist"] < 0.9 * wide["t"]
