"""A body with fingers as one without: on SMPL's joints, of which one moves all fingers of a hand.

Data sets, training and people far away know no fingers. The joint `left_hand` stands where the middle finger
begins and takes the weights of four fingers; the thumb goes with the wrist, jaw and eyes with the head.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float32, Int64

from avatargen.body.joints import FINGER_NAMES, FINGERS
from avatargen.body.model import Body

SIDES = ("left", "right")


def takers() -> dict[str, str]:
    """The joint that takes the weights, by the joint that is left out."""
    table = {"jaw": "head", "left_eye": "head", "right_eye": "head"}
    for side in SIDES:
        for finger in FINGERS:
            taker = f"{side}_wrist" if finger == "thumb" else f"{side}_hand"
            table |= {f"{side}_{finger}{link}": taker for link in (1, 2, 3)}
    return table


TAKER = takers()
HANDS = {f"{side}_hand": f"{side}_middle1" for side in SIDES}  # where the joint stands


def without_fingers(body: Body) -> Body:
    """The body on SMPL's joints; one that does not have all fingers comes back as it is.

    Its surface is the same in every pose that turns no finger against its wrist, and no jaw or eye.
    """
    if not set(FINGER_NAMES) <= set(body.joint_names) or set(HANDS) & set(body.joint_names):
        return body
    names = (*(name for name in body.joint_names if name not in TAKER), *HANDS)
    stands = np.array([body.joint_names.index(HANDS.get(name, name)) for name in names])
    goes = [names.index(TAKER.get(name, name)) for name in body.joint_names]
    weights = np.zeros((len(body.weights), len(names)), dtype=np.float32)
    for joint, target in enumerate(goes):
        weights[:, target] += body.weights[:, joint]
    above = body.parents[stands]
    return replace(
        body,
        weights=weights,
        parents=np.where(above < 0, -1, np.array(goes)[above]),
        joint_names=names,
        J_regressor=body.J_regressor[stands],
        posedirs=None if body.posedirs is None else merged_posedirs(body, names),
    )


def hand_of_joint(joint_names: tuple[str, ...]) -> Int64[np.ndarray, " J"]:
    """Which joint stands for each when fingers are one with their hand: most for themselves."""
    place = {name: index for index, name in enumerate(joint_names)}
    found = list(range(len(joint_names)))
    for name, taker in TAKER.items():
        stands = place.get(taker, place.get(HANDS.get(taker, "")))
        if name in place and stands is not None:
            found[place[name]] = stands
    return np.array(found, dtype=np.int64)


def merged_posedirs(body: Body, names: tuple[str, ...]) -> Float32[np.ndarray, "V 3 P"]:
    """Pose blend shapes of the joints kept; a hand's turn is that of the first link of four fingers."""
    assert body.posedirs is not None
    V = len(body.v_template)
    of_joint = body.posedirs.reshape(V, 3, -1, 9)
    merged = []
    for name in names[1:]:
        side = name.removesuffix("_hand")
        turned = [f"{side}_{finger}1" for finger in FINGERS[:4]] if name in HANDS else [name]
        merged.append(sum(of_joint[:, :, body.joint_names.index(each) - 1] for each in turned))
    return np.stack(merged, axis=2).reshape(V, 3, -1)
