"""Bones along a skirt, dress or coat, so that it sways: chains around the legs, from below the hips down to
the hem, and capsules around the legs that they do not pass.

            seen from above, the person facing down: chains 1 to 4 hang on the left thigh, 5 to 8 on the right

                  5   4                   each chain:  o  below the hips
                6       3                              |
                7       2                              o
                  8   1                                |
                                                       o  hem

What hangs free of the legs (`assets.skin.hang`) moves with the chains, by its place between two of them and
between two of their joints, instead of with legs and pelvis. A chain that nothing sways goes with its thigh,
and clips put it where cloth without bones of its own would be (`drape`).

Letters: W vertices, J joints, C chains around, N joints of a chain. Metres; places and heights in the T-pose.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Float64, Int64

from assets.asset.animate import rest_rotations_of
from assets.asset.asset import Asset
from assets.asset.bones import frame_along
from assets.asset.colliders import leg_colliders, shrunk
from assets.asset.posed import posed
from assets.asset.rig import Skeleton
from assets.asset.spring import Spring
from assets.skin.hang import HIPS, KNEES, TRUNK, hanging, measure_legs, smooth
from assets.skin.skin import limit_influences
from avatargen.body.model import CanonicalBody, shape

AROUND = 8  # chains around the legs; an even number, so that none lies in the middle
FREE, FREELY = (
    0.15,
    0.5,
)  # how freely cloth hangs from which it sways, and the way on to where it does so fully
SURELY = 0.5  # how freely cloth hangs that a chain is made for
FEWEST = 4  # vertices of it that a chain needs
SHORTEST, LINK = 0.12, 0.17  # m that a chain is long at least, and of one of its bones
LINKS = 3  # at most
MIDDLE, UNDER = 0.03, 0.14  # m off the middle plane, and below the hips, where no trousers have cloth
NEAREST = 8  # vertices whose mean a joint stands at
ROUND = 0.15  # m that a chain more around counts, in looking for them
STIFFNESS, DRAG, GRAVITY = 5.0, 0.3, 0.05
RADIUS = 0.015  # m


@dataclass(frozen=True, kw_only=True)
class Cloth:
    """Where each vertex is on what hangs: 0..1 how freely, the way around in chains, the way down."""

    free: Float64[np.ndarray, " W"]
    around: Float64[np.ndarray, " W"]  # 0..AROUND, from the front by the person's left
    below: Float64[np.ndarray, " W"]  # the hips


@dataclass(frozen=True, kw_only=True)
class Chain:
    """Where a chain is around the legs and where it begins below the hips, and its bones' length downward."""

    around: float
    top: float
    link: float
    links: int


def add_springs(asset: Asset, body: CanonicalBody, betas: Float[np.ndarray, " b"]) -> Asset:
    """The asset with chains for what hangs around its legs, of a person with this body and shape; as it is
    where nothing does, or where the body has not SMPL's names."""
    cloth = cloth_of(asset, body, betas)
    chains = [] if cloth is None else chains_of(cloth)
    if cloth is None or not chains:
        return asset
    firsts = np.cumsum([len(asset.skeleton.parents), *(chain.links + 1 for chain in chains)])
    springs = tuple(
        spring_of(asset, cloth, chain, int(first)) for chain, first in zip(chains, firsts, strict=False)
    )
    places = [places_of(asset, cloth, chain) for chain in chains]
    skeleton = with_chains(asset.skeleton, chains, springs, places)
    old = dense(asset, len(skeleton.parents))
    share, own = chain_weights(cloth, chains, springs, len(skeleton.parents))
    changed, found = share > 0, limit_influences((1 - share)[:, None] * old + share[:, None] * own)
    return replace(
        asset,
        joints=np.where(changed[:, None], found.joints, asset.joints),
        weights=np.where(changed[:, None], found.weights, asset.weights),
        skeleton=skeleton,
        morphs=tuple(replace(m, joints=with_carried(m.joints, springs)) for m in asset.morphs),
        springs=springs,
        colliders=shrunk(leg_colliders(skeleton, body, betas), skeleton, np.concatenate(places), RADIUS),
    )


def cloth_of(asset: Asset, body: CanonicalBody, betas: Float[np.ndarray, " b"]) -> Cloth | None:
    """Where each vertex is on what hangs around both legs; None where nothing does."""
    names, skeleton = body.joint_names, asset.skeleton
    if not set(TRUNK + HIPS + KNEES) <= set(names) & set(skeleton.joint_names):
        return None
    person = shape(body.source, betas)
    legs = measure_legs(person, names)
    if legs is None:
        return None
    straight = posed(asset, np.zeros((len(skeleton.parents), 3)), on_ground=False)
    vertices = straight.vertices - straight.skeleton.joints[0] + person.joints[0]
    own = np.isin(asset.joints, [skeleton.joint_names.index(name) for name in HIPS + KNEES])
    of_legs = np.where(own, asset.weights, 0).sum(axis=1, dtype=np.float64)
    free = hanging(vertices, of_legs, person, legs)
    line = legs.at(vertices[:, 1])[0]
    turn = np.arctan2(vertices[:, 0] - person.joints[0, 0], vertices[:, 2] - line)
    below = legs.hips - vertices[:, 1]
    under = (free > SURELY) & (np.abs(vertices[:, 0]) < MIDDLE) & (below > UNDER)
    if not (under & (vertices[:, 2] < line)).any():
        return None
    return Cloth(free=free, around=turn / (2 * np.pi) * AROUND % AROUND, below=below)


def chains_of(cloth: Cloth) -> list[Chain]:
    """A chain in each direction in which enough hangs."""
    chains = []
    for number in range(AROUND):
        own = np.floor(cloth.around) == number
        sure = cloth.below[own & (cloth.free > SURELY)]
        some = cloth.below[own & (cloth.free > FREE)]
        if len(sure) < FEWEST or sure.max() - some.min() < SHORTEST:
            continue
        length = float(sure.max() - some.min())
        links = int(np.clip(round(length / LINK), 1, LINKS))
        chains.append(Chain(around=number + 0.5, top=float(some.min()), link=length / links, links=links))
    return chains


def near(cloth: Cloth, around: float, below: float) -> Int64[np.ndarray, " n"]:
    """The vertices of cloth that are nearest to a place on it."""
    kept = np.flatnonzero(cloth.free > FREE)
    apart = np.abs((cloth.around[kept] - around + AROUND / 2) % AROUND - AROUND / 2)
    return kept[np.argsort(np.hypot(apart * ROUND, cloth.below[kept] - below), kind="stable")[:NEAREST]]


def rows_of(cloth: Cloth, chain: Chain) -> list[Int64[np.ndarray, " n"]]:
    """The vertices around each joint of a chain, its end the last."""
    return [near(cloth, chain.around, chain.top + chain.link * n) for n in range(chain.links + 1)]


def places_of(asset: Asset, cloth: Cloth, chain: Chain) -> Float64[np.ndarray, "N 3"]:
    """Where a chain's joints are at rest."""
    return np.stack([asset.vertices[rows].mean(axis=0, dtype=np.float64) for rows in rows_of(cloth, chain)])


def spring_of(asset: Asset, cloth: Cloth, chain: Chain, first: int) -> Spring:
    """A chain's spring, its joints numbered from `first`, carried as the cloth around each of them is."""
    weights = dense(asset, len(asset.skeleton.parents))
    carried = limit_influences(np.stack([weights[rows].mean(axis=0) for rows in rows_of(cloth, chain)]))
    return Spring(
        name=f"skirt_{int(chain.around) + 1}",
        joints=first + np.arange(chain.links + 1),
        carriers=carried.joints,
        shares=carried.weights.astype(np.float64),
        stiffness=STIFFNESS,
        drag=DRAG,
        gravity=GRAVITY,
        radius=RADIUS,
    )


def with_chains(
    skeleton: Skeleton,
    chains: list[Chain],
    springs: tuple[Spring, ...],
    places: list[Float64[np.ndarray, "_ 3"]],
) -> Skeleton:
    """The skeleton with the chains' joints after all others, +y along each bone, each chain on its thigh."""
    names, parents = list(skeleton.joint_names), skeleton.parents.tolist()
    frames, turned = list(skeleton.T_world_joint), rest_rotations_of(skeleton)
    thighs = [names.index(name) for name in HIPS]
    rests = list(turned)
    for chain, spring, places_here in zip(chains, springs, places, strict=True):
        thigh = thighs[0] if chain.around < AROUND / 2 else thighs[1]
        ways = np.diff(places_here, axis=0)
        for n, joint in enumerate(spring.joints):
            names.append(f"{spring.name}_{n + 1}" if n < chain.links else f"{spring.name}_end")
            parents.append(thigh if n == 0 else int(joint) - 1)
            frame = np.eye(4)
            frame[:3, :3] = frame_along(ways[min(n, chain.links - 1)])
            frame[:3, 3] = places_here[n]
            frames.append(frame)
            rests.append(turned[thigh])
    return replace(
        skeleton,
        joint_names=tuple(names),
        parents=np.array(parents, dtype=np.int64),
        T_world_joint=np.stack(frames),
        rest_rotations=np.stack(rests),
    )


def chain_weights(
    cloth: Cloth, chains: list[Chain], springs: tuple[Spring, ...], joint_count: int
) -> tuple[Float64[np.ndarray, " W"], Float64[np.ndarray, "W J"]]:
    """How much of each vertex's weight its chains have, and how they share it: two chains beside it, or the
    one that there is, and two bones of each."""
    weights = np.zeros((len(cloth.free), joint_count))
    rows = np.flatnonzero(cloth.free > FREE)
    place = cloth.around[rows] - 0.5
    for chain, spring in zip(chains, springs, strict=True):
        apart = np.abs((place - (chain.around - 0.5) + AROUND / 2) % AROUND - AROUND / 2)
        share = smooth(np.maximum(1 - apart, 0))
        along = np.clip((cloth.below[rows] - chain.top) / chain.link - 0.5, 0, chain.links - 1)
        bone = np.minimum(np.floor(along).astype(np.int64), chain.links - 1)
        after, further = np.minimum(bone + 1, chain.links - 1), along - bone
        np.add.at(weights, (rows, spring.joints[bone]), share * (1 - further))
        np.add.at(weights, (rows, spring.joints[after]), share * further)
    total = weights.sum(axis=1)
    return smooth((cloth.free - FREE) / FREELY) * (total > 0), weights / np.maximum(total, 1e-9)[:, None]


def with_carried(
    moves: Float64[np.ndarray, "J 3"], springs: tuple[Spring, ...]
) -> Float64[np.ndarray, "_ 3"]:
    """How far all joints move, where those of chains move with what carries them."""
    return np.concatenate([moves, *(np.einsum("nk,nkd->nd", s.shares, moves[s.carriers]) for s in springs)])


def dense(asset: Asset, joint_count: int) -> Float64[np.ndarray, "W J"]:
    """The weights as one column a joint."""
    weights = np.zeros((len(asset.vertices), joint_count))
    np.add.at(weights, (np.arange(len(weights))[:, None], asset.joints), asset.weights)
    return weights
