"""Capsules around a person's limbs, which what sways does not pass.

Letters: J joints, B vertices of the body, P places. Metres.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float, Float64

from assets.asset.rig import Skeleton
from assets.asset.spring import Collider
from avatargen.body.model import CanonicalBody, ShapedBody, shape

LIMBS = tuple(
    (f"{side}_{joint}", f"{side}_{end}", of)
    for side in ("left", "right")
    for joint, end in (("hip", "knee"), ("knee", "ankle"))
    for of in ((0.0, 0.35), (0.35, 0.7), (0.7, 1.0))
) + tuple(
    (joint, end, (0.0, 1.0))
    for joint, end in (
        ("pelvis", "spine1"),
        ("spine1", "spine2"),
        ("spine2", "spine3"),
        ("spine3", "neck"),
        ("neck", "head"),
    )
)
OWN = 0.5  # weight from which a vertex of the body is a joint's own
ROUND = 75  # percentile of the distances of a limb's skin from its bone
LEAST = 0.02  # m of a radius


def body_colliders(
    skeleton: Skeleton, body: CanonicalBody, betas: Float[np.ndarray, " b"]
) -> tuple[Collider, ...]:
    """Three capsules a thigh and a shin, one for each link of spine and neck, as thick as these are on a body
    of this shape."""
    person = shape(body.source, betas)
    return tuple(
        limb_collider(skeleton, person, joint, end, part)
        for joint, end, part in LIMBS
        if {joint, end} <= set(skeleton.joint_names)
    )


def limb_collider(
    skeleton: Skeleton, person: ShapedBody, joint: str, end: str, part: tuple[float, float]
) -> Collider:
    """The capsule around a part of the way from a joint to the next."""
    names = person.body.joint_names
    near, far = (person.joints[names.index(name)] for name in (joint, end))
    own = person.body.weights[:, names.index(joint)] > OWN
    way = far - near
    along = (person.vertices - near) @ way / max(float(way @ way), 1e-12)
    there = own & (along >= part[0]) & (along <= part[1])
    off = np.linalg.norm(person.vertices - near - along[:, None] * way, axis=1)[there]
    radius = max(float(np.percentile(off, ROUND)), LEAST) if len(off) else LEAST
    index = skeleton.joint_names.index(joint)
    start, stop = skeleton.joints[index], skeleton.joints[skeleton.joint_names.index(end)]
    turn = skeleton.T_world_joint[index, :3, :3].T
    return Collider(
        joint=index,
        offset=turn @ (part[0] * (stop - start)),
        tail=turn @ (part[1] * (stop - start)),
        radius=radius,
    )


def shrunk(
    colliders: tuple[Collider, ...], skeleton: Skeleton, places: Float64[np.ndarray, "P 3"], room: float
) -> tuple[Collider, ...]:
    """The colliders, thinner where they would come within `room` of places at rest: what rests stays."""
    return tuple(
        replace(
            each, radius=max(min(each.radius, float(distances(each, skeleton, places).min()) - room), LEAST)
        )
        for each in colliders
    )


def distances(
    collider: Collider, skeleton: Skeleton, places: Float64[np.ndarray, "P 3"]
) -> Float64[np.ndarray, " P"]:
    """From places to the middle line of a collider at rest."""
    frame = skeleton.T_world_joint[collider.joint]
    start, stop = (frame[:3, :3] @ point + frame[:3, 3] for point in (collider.offset, collider.tail))
    way = stop - start
    along = np.clip((places - start) @ way / max(float(way @ way), 1e-12), 0, 1)
    return np.linalg.norm(places - start - along[:, None] * way, axis=1)
