"""Every mesher with every simplifier, at the same resolution and faces: what it costs and how exact it is."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

from assets.build_config import MESHERS, BuildConfig
from assets.errors import GeometryError
from assets.mesh.surface import euler_number, find_defects
from assets.simplify.simplify import SIMPLIFIERS
from avatargen.avatar import Avatar
from avatargen.commands.bench.sweep import run_to_charts


@dataclass(frozen=True, kw_only=True)
class RecipeRow:
    """One combination on one seed, from the field to charts."""

    mesher: str
    simplifier: str
    seed: int
    faces: int
    seconds: float  # of the processor
    peak_mb: float
    mean_mm: float
    p99_mm: float
    max_mm: float
    handles: int
    defects: str  # empty for none


@dataclass(frozen=True, kw_only=True)
class Refusal:
    """A combination that kept no closed surface, and what was said."""

    mesher: str
    simplifier: str
    seed: int
    said: str


def measure_recipes(avatar: Avatar, config: BuildConfig) -> Iterator[RecipeRow | Refusal]:
    """All of them, ours first."""
    for mesher, simplifier in product(MESHERS, SIMPLIFIERS):
        try:
            yield measure_recipe(avatar, replace(config, mesher=mesher, simplifier=simplifier))
        except GeometryError as error:
            yield Refusal(mesher=mesher, simplifier=simplifier, seed=avatar.seed, said=str(error))


def measure_recipe(avatar: Avatar, config: BuildConfig) -> RecipeRow:
    """One of them. Raises GeometryError where it refuses."""
    draft, costs = run_to_charts(avatar, config)
    return RecipeRow(
        mesher=config.mesher,
        simplifier=config.simplifier,
        seed=avatar.seed,
        faces=len(draft.surface.faces),
        seconds=sum(cost.cpu_seconds for cost in costs.values()),
        peak_mb=max(cost.peak_mb for cost in costs.values()),
        mean_mm=draft.error.mean_mm,
        p99_mm=draft.error.p99_mm,
        max_mm=draft.error.max_mm,
        handles=1 - euler_number(draft.surface) // 2,
        defects=str(find_defects(draft.surface)),
    )
