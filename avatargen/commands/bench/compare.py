"""Our pipeline beside the peers' recipe, in one run on one avatar."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from assets.build_config import BuildConfig
from assets.mesh.measure import surface_error
from assets.mesh.surface import Surface, find_defects
from assets.pipeline import build_content
from avatargen.avatar import Avatar, Sampler
from avatargen.commands.bench.cost import Cost, measured
from avatargen.commands.bench.peer import (
    PeerConfig,
    paper_field,
    run_peer,
    with_cheap_distance,
    with_distance,
    with_libigl,
)
from avatargen.commands.bench.sweep import default_surface
from avatargen.commands.bench.truth import Truth, match
from exporters.glb import encode

RUNS = 3


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """One recipe's cost and errors, millimetres, on one seed."""

    name: str
    seed: int
    seconds: float
    cpu_seconds: float
    peak_mb: float
    stages: dict[str, float]
    mean_mm: float
    p99_mm: float
    max_mm: float
    back_mean_mm: float
    back_p99_mm: float
    back_max_mm: float
    defects: str


def compare(
    generator: Sampler, truth: Truth, seed: int, ours: BuildConfig, peer: PeerConfig
) -> Iterator[Comparison]:
    """Ours from the seed to the bytes of a GLB, then the peers' recipe: with a library's tree for the body's
    distance, with our own, and cheap.

    Ours is the median of a few runs: one is so short that what the machine does beside it would tell.
    """
    built = [build_once(generator, seed, ours) for _ in range(RUNS)]
    runs = sorted(built, key=lambda run: run[0].cpu_seconds)
    cost, stages = runs[RUNS // 2]
    avatar = generator.sample(seed)
    surface = default_surface(avatar, ours.resolution, ours.faces or 0)
    yield row("avatargen", avatar, truth, surface, cost, stages)
    name = f"dense {peer.resolution}³"
    people = {
        name: with_libigl(avatar),
        f"{name}, our distance": with_distance(avatar, paper_field(avatar).distance),
        f"{name}, cheap distance": with_cheap_distance(avatar),
    }
    for recipe, person in people.items():
        with measured() as cost:
            result = run_peer(person, peer)
        yield row(recipe, avatar, truth, result.surface, cost, result.seconds)


def build_once(generator: Sampler, seed: int, config: BuildConfig) -> tuple[Cost, dict[str, float]]:
    """What an avatar costs from the seed to the bytes of a GLB, and seconds by stage."""
    with measured() as cost:
        asset = build_content(generator.sample(seed), config)
        encode(asset)
    assert asset.report is not None
    return cost, dict(asset.report.seconds)


def row(
    name: str, avatar: Avatar, truth: Truth, surface: Surface, cost: Cost, stages: dict[str, float]
) -> Comparison:
    """Errors against the exact field, whatever field the surface was made from."""
    error, back = surface_error(surface, avatar.sdf), 1000 * match(truth, surface).distance
    return Comparison(
        name=name,
        seed=avatar.seed,
        seconds=cost.seconds,
        cpu_seconds=cost.cpu_seconds,
        peak_mb=cost.peak_mb,
        stages=stages,
        mean_mm=error.mean_mm,
        p99_mm=error.p99_mm,
        max_mm=error.max_mm,
        back_mean_mm=float(back.mean()),
        back_p99_mm=float(np.quantile(back, 0.99)),
        back_max_mm=float(back.max()),
        defects=str(find_defects(surface)),
    )
