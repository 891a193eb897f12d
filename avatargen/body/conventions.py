"""A body's arrays in other conventions than ours, brought to ours where the body itself tells which it has: z
up, centimetres or millimetres, faces wound the other way.

Letters: V vertices, F faces, J joints.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int64

from avatargen.body.model import Body
from avatargen.errors import InputError

TALL = 10.0  # of its unit: from here on that is not the metre
PERSON = (0.4, 3.0)  # metres that somebody's height is between
UNITS = (100.0, 1000.0)  # in a metre
STANDING = 0.5  # of the whole size, that the head is above the ankles
LOW, HIGH = ("left_ankle", "right_ankle"), "head"
TURNS = {  # ours from theirs, by which of their axes points up; the person faces forward
    2: np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
}


def in_our_convention(body: Body) -> Body:
    """The body in metres, y up, faces counter-clockwise from outside.

    Raises:
        InputError: it lies on its side, stands on its head, or has the size of no person in any unit.
    """
    body = outward(in_metres(body))
    return upright(body) if {HIGH, *LOW} <= set(body.joint_names) else body


def in_metres(body: Body) -> Body:
    """The same size where it can be a person's; else read as centimetres or millimetres."""
    size = float(np.ptp(body.v_template.astype(np.float64), axis=0).max())
    if size < TALL:
        return body
    unit = next((unit for unit in UNITS if PERSON[0] <= size / unit <= PERSON[1]), None)
    if unit is None:
        raise InputError(
            f"body: the template is {size:.3g} units large, which is no person's size in metres, centimetres "
            "or millimetres; scale v_template, shapedirs and posedirs to metres"
        )
    return replace(
        body,
        v_template=scaled(body.v_template, unit),
        shapedirs=scaled(body.shapedirs, unit),
        posedirs=None if body.posedirs is None else scaled(body.posedirs, unit),
    )


def scaled(array: Float[np.ndarray, "*shape"], unit: float) -> Float[np.ndarray, "*shape"]:
    return (array.astype(np.float64) / unit).astype(np.float32)


def outward(body: Body) -> Body:
    """Faces turned over where they enclose a negative volume."""
    return (
        replace(body, faces=body.faces[:, ::-1].copy()) if volume(body.v_template, body.faces) < 0 else body
    )


def volume(vertices: Float[np.ndarray, "V 3"], faces: Int64[np.ndarray, "F 3"]) -> float:
    """What the faces enclose, about the vertices' middle: small holes change it little."""
    middle = vertices.astype(np.float64) - vertices.mean(axis=0, dtype=np.float64)
    a, b, c = middle[faces].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6


def upright(body: Body) -> Body:
    """Turned so that the head is above the ankles along y.

    Raises:
        InputError: the head is above the ankles along neither y nor z; or it is z, and pose blend shapes,
            whose numbers belong to the old axes, cannot be turned along.
    """
    joints = body.J_regressor.astype(np.float64) @ body.v_template.astype(np.float64)
    low = np.mean([joints[body.joint_names.index(name)] for name in LOW], axis=0)
    rise = joints[body.joint_names.index(HIGH)] - low
    if not np.abs(rise).max() > 0:
        return body
    up, enough = int(np.abs(rise).argmax()), STANDING * np.ptp(body.v_template, axis=0).max()
    if rise[up] > enough and up == 1:
        return body
    if not (rise[up] > enough and up in TURNS) or body.posedirs is not None:
        axis = f"{'-' if rise[up] < 0 else ''}{'xyz'[up]}"
        raise InputError(
            f"body: its head is above its ankles along {axis}, wanted y; turn v_template, shapedirs and "
            "posedirs so that y is up and the person faces z"
        )
    turn = TURNS[up]
    return replace(
        body,
        v_template=(body.v_template @ turn.T).astype(np.float32),
        shapedirs=np.einsum("ij,vjb->vib", turn, body.shapedirs).astype(np.float32),
    )
