"""avatargen eval rays: picture error against time for 12 to 48 samples a ray, with and without the shell."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from avatargen.commands.line import parse_options, run_command

if TYPE_CHECKING:
    from avatargen.metrics.ray_cost import Cost

PROGRAM = "avatargen eval rays"


@dataclass(frozen=True, kw_only=True)
class Options:
    """Measure what samples along rays cost and buy; prints a table, writes it as JSON and a plot."""

    data: Path
    """Pictures whose cameras, poses and shapes are taken."""
    out: Path
    """Folder for ray_cost.json and, where matplotlib is installed, ray_cost.png."""
    weights: Path | None = None
    """Other weights than those that come with the package."""
    pictures: int = 8
    """How many."""


def main(arguments: Sequence[str] | None = None) -> int:
    return run_command(PROGRAM, lambda: run(parse_options(PROGRAM, Options, arguments)))


def run(options: Options) -> None:
    """Measure, print, write, draw."""
    from importlib.util import find_spec

    from avatargen.atomic import write_together
    from avatargen.avatar import shipped, training_body
    from avatargen.data.dataset import open_pictures
    from avatargen.generator.checkpoint import load_checkpoint
    from avatargen.generator.picture import CanonicalSurface
    from avatargen.metrics.ray_cost import ray_costs, table
    from avatargen.ranges import MANY, require_ranges

    require_ranges(options, "eval rays", {"pictures": (1, MANY)})
    generator = load_checkpoint(options.weights or shipped("generator.safetensors")).generator
    data = open_pictures(options.data, generator.config.render.image_size)
    surface = CanonicalSurface(training_body())
    costs = ray_costs(generator, surface, data, min(options.pictures, len(data)))
    options.out.mkdir(parents=True, exist_ok=True)
    text = json.dumps([asdict(cost) for cost in costs], indent=1) + "\n"
    files = [(options.out / "ray_cost.json", text.encode())]
    if find_spec("matplotlib"):
        files.append((options.out / "ray_cost.png", plot(costs)))
    write_together(files)
    print(table(costs))
    print(options.out / "ray_cost.json")


def plot(costs: "list[Cost]") -> bytes:
    """PNG: colour error against time, a line with and one without the shell, a dot a number of steps."""
    import io

    from matplotlib.figure import Figure

    figure = Figure(figsize=(6, 4), layout="constrained")
    axes = figure.subplots()
    for shell, name in ((True, "samples in the shell"), (False, "samples in the whole box")):
        chosen = [cost for cost in costs if cost.shell == shell]
        axes.plot([1000 * c.seconds for c in chosen], [c.color for c in chosen], "o-", label=name)
        for cost in chosen:
            place = (1000 * cost.seconds, cost.color)
            axes.annotate(str(cost.steps), place, xytext=(4, 4), textcoords="offset points")
    axes.set_xlabel("processor time a picture (ms)")
    axes.set_ylabel("mean colour error (0..1)")
    axes.set_yscale("log")
    axes.legend()
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=110)
    return stream.getvalue()
