"""Bones along a skirt, dress or coat and along long hair, so that they sway, and capsules around the body
that they do not pass.

            seen from above, the person facing down: chains 1 to 4 hang on the left thigh, 5 to 8 on the right

                  5   4                   each chain:  o  below the hips
                6       3                              |
                7       2                              o
                  8   1                                |
                                                       o  hem

Cloth sways that hangs free of the legs (`assets.skin.hang`), all around them; hair sways below the skull,
with up to three chains side by side. Letters: W vertices, J joints. Metres.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool, Float, Float64

from assets.asset.asset import Asset
from assets.asset.chains import AROUND, RADIUS, SURELY, Cloth, chains_of, hang_chains
from assets.asset.colliders import body_colliders, shrunk
from assets.asset.posed import posed
from assets.skin.hang import HIPS, KNEES, TRUNK, hanging, measure_legs
from avatargen.body.model import CanonicalBody, shape
from avatargen.smoothstep import smoothstep

MIDDLE, UNDER = 0.03, 0.14  # m off the middle plane, and below the hips, where no trousers have cloth
STIFFNESS, STIFFER = 5.0, 8.0  # m/s at which cloth and hair go back to how they hang
HAIR, SKULL = "hair", "head"
STRANDS, STRAND = 3, 0.07  # chains of hair, and m from one to the next
FALLS = 0.08  # m below the skull's joint within which hair begins to fall free
ON_HAIR = 0.004  # m off the hair's surface within which a vertex is one of it


def add_springs(
    asset: Asset, body: CanonicalBody, betas: Float[np.ndarray, " b"], layers: Mapping[str, Any]
) -> Asset:
    """The asset with chains for what hangs around the legs and down from the head, of a person with this
    body, shape and layers (none of somebody who is one field, whose hair is not known); as it is where
    nothing does, or where the body has not SMPL's names."""
    before = asset
    for cloth in (skirt_of(asset, body, betas), hair_of(asset, layers)):
        if cloth is not None:
            asset = hang_chains(asset, cloth, chains_of(cloth))
    if asset.springs == before.springs:
        return before
    places = np.concatenate([asset.skeleton.joints[spring.joints[1:]] for spring in asset.springs])
    colliders = body_colliders(asset.skeleton, body, betas)
    return replace(asset, colliders=shrunk(colliders, asset.skeleton, places, RADIUS))


def in_t_pose(asset: Asset) -> Float64[np.ndarray, "W 3"]:
    """The vertices in the T-pose, the first joint where it rests."""
    zeros = np.zeros((len(asset.skeleton.parents), 3))
    return posed(asset, zeros, on_ground=False).vertices.astype(np.float64)


def skirt_of(asset: Asset, body: CanonicalBody, betas: Float[np.ndarray, " b"]) -> Cloth | None:
    """Where each vertex is on what hangs around both legs; None where nothing does."""
    names, skeleton = body.joint_names, asset.skeleton
    if not set(TRUNK + HIPS + KNEES) <= set(names) & set(skeleton.joint_names):
        return None
    person = shape(body.source, betas)
    legs = measure_legs(person, names)
    if legs is None:
        return None
    vertices = in_t_pose(asset) - skeleton.joints[0] + person.joints[0]
    own = np.isin(asset.joints, [skeleton.joint_names.index(name) for name in HIPS + KNEES])
    of_legs = np.where(own, asset.weights, 0).sum(axis=1, dtype=np.float64)
    free = hanging(vertices, of_legs, person, legs)
    line = legs.at(vertices[:, 1])[0]
    x, z = vertices[:, 0] - person.joints[0, 0], vertices[:, 2] - line
    turn, out = np.arctan2(x, z), np.hypot(x, z)
    below = legs.hips - vertices[:, 1]
    under = (free > SURELY) & (np.abs(vertices[:, 0]) < MIDDLE) & (below > UNDER)
    if not (under & (vertices[:, 2] < line)).any():
        return None
    thighs = tuple(HIPS[number >= AROUND / 2] for number in range(AROUND))
    around = turn / (2 * np.pi) * AROUND % AROUND
    return Cloth(name="skirt", stiffness=STIFFNESS, on=thighs, free=free, around=around, out=out, below=below)


def hair_of(asset: Asset, layers: Mapping[str, Any]) -> Cloth | None:
    """Where each vertex is on hair that hangs; None where none does."""
    names = asset.skeleton.joint_names
    own = hair_rows(asset, layers)
    if SKULL not in names or not own.any():
        return None
    skull = asset.skeleton.joints[names.index(SKULL)]
    vertices = in_t_pose(asset)
    below = skull[1] - vertices[:, 1]
    across = np.clip(STRANDS / 2 + (vertices[:, 0] - skull[0]) / STRAND, 0, STRANDS - 1e-6)
    return Cloth(
        name=HAIR,
        stiffness=STIFFER,
        on=(),
        free=own * smoothstep(below / FALLS),
        around=across,
        out=-vertices[:, 2],
        below=below,
    )


def hair_rows(asset: Asset, layers: Mapping[str, Any]) -> Bool[np.ndarray, " W"]:
    """The vertices of hair: those of its part, or on the surface of its layer."""
    own = np.zeros(len(asset.vertices), dtype=bool)
    for part in asset.parts:
        own[slice(*part.vertices)] = part.name == HAIR
    if asset.parts or HAIR not in layers or asset.canonical is None:
        return own
    with torch.inference_mode():
        distance = layers[HAIR].sdf(torch.from_numpy(asset.canonical.astype(np.float32)))
    return np.abs(np.asarray(distance)) < ON_HAIR
