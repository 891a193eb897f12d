"""Which runs there are: a model, a change of its settings, a seed; and the tables in which they stand."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from avatargen.errors import InputError
from avatargen.metrics.ablations import choices
from avatargen.metrics.shown import ShowConfig
from avatargen.training.adversarial_config import AdversarialConfig

OURS = "avatargen"
TITLES = {
    OURS: "AvatarGen",
    "eg3d": "EG3D",
    "stylesdf": "StyleSDF",
    "stylenerf": "StyleNeRF",
    "giraffe-hd": "GIRAFFE-HD",
}


@dataclass(frozen=True, kw_only=True)
class Table:
    """Rows by the names of the runs that they are made of, and how many pictures each run is judged by."""

    name: str
    title: str
    rows: dict[str, str]
    show: ShowConfig


@dataclass(frozen=True, kw_only=True)
class Run:
    """One training: `name` and `seed` tell it from all others."""

    name: str
    model: str
    seed: int
    config: AdversarialConfig
    show: ShowConfig

    @property
    def key(self) -> str:
        """A path below a folder of runs."""
        return f"{self.name}/seed{self.seed}"


@dataclass(frozen=True, kw_only=True)
class Plan:
    """All runs, those of the first seed first, and their tables."""

    tables: tuple[Table, ...]
    runs: tuple[Run, ...]


def table_of_baselines(models: Sequence[str], people: int) -> Table:
    """Table 1: the methods."""
    return Table(
        name="baselines",
        title="Table 1: methods",
        rows={title: model for model, title in TITLES.items() if model in models},
        show=show_of(min(people, 300)),
    )


def table_of_ablations(base: AdversarialConfig, rows: Sequence[str], people: int) -> Table:
    """Table 2: the choices of the paper's own method. One that changes nothing shares the first one's run."""
    return Table(
        name="ablations",
        title="Table 2: choices",
        rows={
            name: OURS if config == base else f"{OURS}-{name.replace(' ', '-').replace('-=-', '')}"
            for name, config in choices(base).items()
            if name in rows
        },
        show=show_of(min(people, 120)),
    )


def show_of(people: int) -> ShowConfig:
    """A third of the people are turned."""
    return ShowConfig(pictures=people, turned=people // 3, reposed=0)


def make_plan(base: AdversarialConfig, tables: Sequence[Table], seeds: Sequence[int]) -> Plan:
    """The runs of the tables' rows, once each.

    Raises:
        InputError: no table, no row or no seed is named, or a seed twice.
    """
    if not tables or not seeds or not all(table.rows for table in tables):
        raise InputError("eval: no run is asked for; name a table, rows and seeds")
    if len(set(seeds)) < len(seeds):
        raise InputError(f"eval: found seeds {' '.join(map(str, seeds))}; name each once")
    configs = choices(base)
    runs: dict[str, Run] = {}
    for seed in seeds:
        for table in tables:
            for row, name in table.rows.items():
                own = configs.get(row, base)
                run = Run(
                    name=name,
                    model=name if table.name == "baselines" else OURS,
                    seed=seed,
                    config=replace(own, seed=seed),
                    show=table.show,
                )
                runs.setdefault(run.key, run)  # the first table shows most
    return Plan(tables=tuple(tables), runs=tuple(runs.values()))
