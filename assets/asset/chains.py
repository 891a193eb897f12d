"""Chains of joints along what hangs, and the weights with which it moves with them.

A vertex goes with two chains, those to its left and right, and with two bones of each. A chain that nothing
sways goes with the joint that it hangs on, and clips put it where what hangs would be without bones of its
own (`drape`). Letters: W vertices, J joints, N joints of a chain. Metres; places in the T-pose.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int64

from assets.asset.animate import rest_rotations_of
from assets.asset.asset import Asset
from assets.asset.bones import frame_along
from assets.asset.rig import Skeleton
from assets.asset.spring import Spring
from assets.skin.skin import limit_influences
from avatargen.smoothstep import smoothstep

AROUND = 8  # chains around the legs at most; an even number, so that none lies in the middle
FREE, FREELY = (
    0.15,
    0.5,
)  # how freely hangs what sways, and the way on to where it does so fully
SURELY = 0.5  # how freely hangs what a chain is made for
FEWEST = 4  # vertices of it that a chain needs
SHORTEST, LINK = 0.12, 0.17  # m that a chain is long at least, and of one of its bones
LINKS = 3  # at most
NEAREST = 8  # vertices whose mean a joint stands at
ROUND = 0.15  # m that a chain more around counts, in looking for them
DRAG, GRAVITY = 0.3, 0.05
RADIUS = 0.015  # m


@dataclass(frozen=True, kw_only=True)
class Cloth:
    """Where each vertex is on what hangs: 0..1 how freely, the way around in chains, the way down."""

    name: str  # of what hangs
    stiffness: float  # m/s
    on: tuple[str, ...]  # the joint on which each chain hangs; empty: what carries it most

    free: Float64[np.ndarray, " W"]
    around: Float64[np.ndarray, " W"]  # 0..AROUND, chain k at k + .5
    out: Float64[np.ndarray, " W"]  # from the middle of what it hangs around
    below: Float64[np.ndarray, " W"]  # where it begins to hang


@dataclass(frozen=True, kw_only=True)
class Chain:
    """Where a chain is around, where it begins, its bones' length downward, and what it hangs on."""

    around: float
    top: float
    link: float
    links: int
    on: str | None


def hang_chains(asset: Asset, cloth: Cloth, chains: list[Chain]) -> Asset:
    """The asset with these chains, and what hangs moving with them."""
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
        springs=(*asset.springs, *springs),
    )


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
        top, on = float(some.min()), cloth.on[number] if cloth.on else None
        chains.append(Chain(around=number + 0.5, top=top, link=length / links, links=links, on=on))
    return chains


def near(cloth: Cloth, around: float, below: float) -> Int64[np.ndarray, " n"]:
    """Of the vertices that are nearest to a place on what hangs, the outer half: cloth has an inside, too."""
    kept = np.flatnonzero(cloth.free > FREE)
    apart = np.abs((cloth.around[kept] - around + AROUND / 2) % AROUND - AROUND / 2)
    order = np.argsort(np.hypot(apart * ROUND, cloth.below[kept] - below), kind="stable")
    beside = kept[order[: 2 * NEAREST]]
    return beside[np.argsort(-cloth.out[beside], kind="stable")[:NEAREST]]


def rows_of(cloth: Cloth, chain: Chain) -> list[Int64[np.ndarray, " n"]]:
    """The vertices around each joint of a chain, its end the last."""
    return [near(cloth, chain.around, chain.top + chain.link * n) for n in range(chain.links + 1)]


def places_of(asset: Asset, cloth: Cloth, chain: Chain) -> Float64[np.ndarray, "N 3"]:
    """Where a chain's joints are at rest."""
    return np.stack([asset.vertices[rows].mean(axis=0, dtype=np.float64) for rows in rows_of(cloth, chain)])


def spring_of(asset: Asset, cloth: Cloth, chain: Chain, first: int) -> Spring:
    """A chain's spring, its joints numbered from `first`, carried as what hangs around each of them is."""
    weights = dense(asset, len(asset.skeleton.parents))
    carried = limit_influences(np.stack([weights[rows].mean(axis=0) for rows in rows_of(cloth, chain)]))
    return Spring(
        name=f"{cloth.name}_{int(chain.around) + 1}",
        joints=first + np.arange(chain.links + 1),
        carriers=carried.joints,
        shares=carried.weights.astype(np.float64),
        stiffness=cloth.stiffness,
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
    """The skeleton with the chains' joints after all others, +y along each bone, each chain on its joint or
    else on what carries the end of its first bone most."""
    names, parents = list(skeleton.joint_names), skeleton.parents.tolist()
    frames, turned = list(skeleton.T_world_joint), rest_rotations_of(skeleton)
    rests = list(turned)
    for chain, spring, places_here in zip(chains, springs, places, strict=True):
        above = int(spring.carriers[1, 0]) if chain.on is None else names.index(chain.on)
        ways = np.diff(places_here, axis=0)
        for n, joint in enumerate(spring.joints):
            names.append(f"{spring.name}_{n + 1}" if n < chain.links else f"{spring.name}_end")
            parents.append(above if n == 0 else int(joint) - 1)
            frame = np.eye(4)
            frame[:3, :3] = frame_along(ways[min(n, chain.links - 1)])
            frame[:3, 3] = places_here[n]
            frames.append(frame)
            rests.append(turned[above])
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
        share = smoothstep(np.maximum(1 - apart, 0))
        along = np.clip((cloth.below[rows] - chain.top) / chain.link - 0.5, 0, chain.links - 1)
        bone = np.minimum(np.floor(along).astype(np.int64), chain.links - 1)
        after, further = np.minimum(bone + 1, chain.links - 1), along - bone
        np.add.at(weights, (rows, spring.joints[bone]), share * (1 - further))
        np.add.at(weights, (rows, spring.joints[after]), share * further)
    total = weights.sum(axis=1)
    return smoothstep((cloth.free - FREE) / FREELY) * (total > 0), weights / np.maximum(total, 1e-9)[:, None]


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
