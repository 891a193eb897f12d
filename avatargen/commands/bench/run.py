"""avatargen bench: error against run time, beside the recipe that relatives use."""

import json
import platform
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from avatargen.commands.line import FEWEST_FACES, LARGEST_SEED, MOST_FACES, parse_options, run_command
from avatargen.errors import InputError
from avatargen.ranges import require_ranges

if TYPE_CHECKING:
    from avatargen.avatar import Sampler
    from avatargen.commands.bench.compare import Comparison
    from avatargen.commands.bench.recipes import RecipeRow, Refusal
    from avatargen.commands.bench.sweep import MappingRow, RayRow, SurfaceRow, TextureRow

PROGRAM = "avatargen bench"


@dataclass(frozen=True, kw_only=True)
class Grid:
    """The settings that are swept."""

    resolutions: tuple[int, ...] = (128, 256, 384, 512, 768)
    faces: tuple[int, ...] = (2_000, 5_000, 10_000, 20_000, 40_000, 80_000)
    textures: tuple[int, ...] = (256, 512, 1024, 2048)
    neighbours: tuple[int, ...] = (1, 2, 3, 4)
    steps: tuple[int, ...] = (8, 16, 24, 48, 96)
    truth: int = 1024  # resolution of the surface that errors are measured from
    points: int = 40_000  # of it
    default: tuple[int, int] = (512, 20_000)  # resolution and faces of the mesh under textures and poses
    peer: tuple[int, int, int] = (256, 20_000, 1024)  # resolution, faces and texture of the peers' recipe
    ours: tuple[int, int, int] = (512, 20_000, 1024)

    def __post_init__(self) -> None:
        sizes = dict.fromkeys(("resolutions", "truth"), (32, 2048)) | {"neighbours": (1, 4)}
        sizes |= {"faces": (FEWEST_FACES, MOST_FACES), "textures": (16, 8192), "steps": (2, 4096)}
        recipes = dict.fromkeys(("default", "peer", "ours"), (16, MOST_FACES))
        require_ranges(self, "bench", sizes | recipes | {"points": (100, 10**8)})


QUICK = Grid(
    resolutions=(64, 128),
    faces=(1_000, 5_000),
    textures=(64, 256),
    neighbours=(1, 4),
    steps=(8, 24),
    truth=192,
    points=5_000,
    default=(128, 5_000),
    peer=(64, 5_000, 256),
    ours=(128, 5_000, 256),
)


@dataclass(frozen=True, kw_only=True)
class Options:
    """Sweep the pipeline's settings; write bench.json, bench.md, bench.png and curves.json."""

    out: Path
    """Folder for the results."""
    quick: bool = False
    """A small sweep on one seed, in about a minute: shows that all works, its numbers are coarse."""
    seeds: tuple[int, ...] = (3, 4)
    """People that are measured; the tables hold medians."""
    weights: Path | None = None
    """Other weights than those that come with the package."""
    grid: Grid = field(default_factory=Grid)
    """What is swept, where the run is not quick."""
    scenes: bool = False
    """Build avatar-export's scenes instead, on the first seed; write scenes.md and scenes.json."""
    charts: bool = False
    """Cut charts alone, along the seams of clothes and by xatlas; write charts.md and charts.json."""
    face: bool = False
    """Measure how faces bear their shapes instead, and draw those of the first seed; write face.md, face.json
    and face.png. A quick run takes one person, small."""
    training: bool = False
    """Step adversarial training instead, on a GPU where there is one; write training.md and training.json. A
    quick run leaves out other batches, rays, samples and precisions than the presets'. Without a GPU
    the presets for one are counted, not stepped."""
    presets: tuple[Literal["debug", "cpu", "gpu", "paper"], ...] = ("cpu", "gpu", "paper")
    """Whose training is stepped."""
    steps: int = 8
    """Steps of training that are timed."""


@dataclass(frozen=True, kw_only=True)
class Results:
    """All rows."""

    surfaces: "list[SurfaceRow]"
    textures: "list[TextureRow]"
    mapping: "list[MappingRow]"
    rays: "list[RayRow]"
    comparison: "list[Comparison]"
    recipes: "list[RecipeRow | Refusal]"


def main(arguments: Sequence[str] | None = None) -> int:
    return run_command(PROGRAM, lambda: run(parse_options(PROGRAM, Options, arguments)))


def run(options: Options) -> None:
    """Measure, then write everything.

    Raises:
        InputError: no seeds, the folder cannot be written, or there is nothing to draw with.
    """
    from avatargen.atomic import check_writable, write_together
    from avatargen.avatar import load_single
    from avatargen.commands.bench import plot
    from avatargen.commands.bench.curves import curves
    from avatargen.extras import require_extra
    from avatargen.shipped import shipped

    if not options.seeds:
        raise InputError("found no seeds to measure; give one or more")
    require_ranges(options, "bench", {"seeds": (0, LARGEST_SEED), "steps": (1, 10_000)})
    if options.scenes:
        run_scenes(options)
        return
    if options.charts:
        run_charts(options)
        return
    if options.face:
        from avatargen.commands.bench.faces import run_faces

        run_faces(options.out, options.weights, options.seeds, options.quick)
        return
    if options.training:
        run_training(options)
        return
    require_extra("matplotlib")
    options.out.mkdir(parents=True, exist_ok=True)
    check_writable(options.out / "bench.json")
    grid = QUICK if options.quick else options.grid
    seeds = options.seeds[:1] if options.quick else options.seeds
    generator = load_single(options.weights or shipped("generator.safetensors"))
    found = measure(generator, seeds, grid)
    facts = {"machine": machine(), "seeds": seeds, "weights_hash": generator.weights_hash}
    data = {name: [asdict(row) for row in rows] for name, rows in vars(found).items()}
    curve = curves(generator.sample(seeds[0]), found.surfaces, found.textures, generator.weights_hash)
    picture = plot.draw(**vars(found))
    write_together(
        [
            (options.out / "bench.json", json.dumps(facts | data, indent=1).encode() + b"\n"),
            (options.out / "bench.md", report(found, seeds).encode()),
            (options.out / "bench.png", picture),
            (options.out / "curves.json", curve),
        ]
    )
    print(options.out / "bench.md")


def run_scenes(options: Options) -> None:
    """Build the scenes; a quick run takes the smallest alone."""
    import torch
    from threadpoolctl import threadpool_limits

    import avatargen
    from assets.scenes import SCENES
    from avatargen.atomic import write_together
    from avatargen.commands.bench.scenes import measure_scenes, scene_page

    torch.set_num_threads(1)  # so that processor seconds are those of the clock on an idle machine
    threadpool_limits(1, user_api="blas")
    options.out.mkdir(parents=True, exist_ok=True)
    names = ("crowd",) if options.quick else tuple(SCENES)
    rows = list(measure_scenes(avatargen.load_generator(options.weights), options.seeds[0], names))
    data = json.dumps([asdict(row) for row in rows], indent=1).encode() + b"\n"
    page = scene_page(rows).encode()
    write_together([(options.out / "scenes.json", data), (options.out / "scenes.md", page)])
    print(options.out / "scenes.md")


def run_charts(options: Options) -> None:
    """Cut charts of every seed; a quick run takes small meshes."""
    import torch
    from threadpoolctl import threadpool_limits

    import avatargen
    from assets.build_config import BuildConfig
    from avatargen.atomic import write_together
    from avatargen.commands.bench.charts import chart_page, measure_charts

    torch.set_num_threads(1)  # so that processor seconds are those of the clock on an idle machine
    threadpool_limits(1, user_api="blas")
    options.out.mkdir(parents=True, exist_ok=True)
    generator, rows = avatargen.load_generator(options.weights), []
    resolution, faces, texture = (QUICK if options.quick else options.grid).ours
    for seed in options.seeds:
        config = BuildConfig(resolution=resolution, faces=faces, texture=texture)
        rows.extend(measure_charts(generator.sample(seed), config))
        print(f"seed {seed}: {rows[-2].islands} islands, {100 * rows[-2].used:.0f} % used", flush=True)
    data = json.dumps([asdict(row) for row in rows], indent=1).encode() + b"\n"
    write_together(
        [(options.out / "charts.json", data), (options.out / "charts.md", chart_page(rows).encode())]
    )
    print(options.out / "charts.md")


def run_training(options: Options) -> None:
    """Step the presets' training, writing the table after each."""
    import torch

    from avatargen.atomic import write_together
    from avatargen.avatar import training_body
    from avatargen.commands.bench.training import training_rows, training_table
    from avatargen.commands.bench.training_cost import cost_table, step_cost
    from avatargen.extras import require_extra
    from avatargen.training.adversarial_config import PRESETS

    require_extra("accelerate")
    options.out.mkdir(parents=True, exist_ok=True)
    gpu, body = torch.cuda.is_available(), training_body()
    device = torch.device("cuda" if gpu else "cpu")
    costs = [] if gpu else [step_cost(name, PRESETS[name], body) for name in options.presets]
    rows = []
    timed = options.presets if gpu else [name for name in options.presets if name in ("debug", "cpu")]
    for row in training_rows(body, timed, device, options.steps, grow=not options.quick):
        rows.append(row)
        print(f"  {row.preset}, batch {row.batch}: {row.pictures_a_second:.3g} pictures/s", flush=True)
        facts = {"machine": machine(), "rows": [asdict(row) for row in rows]}
        facts["costs"] = [asdict(cost) for cost in costs]
        page = training_table(rows) + ("\n" + cost_table(costs) if costs else "")
        files = {"training.json": json.dumps(facts, indent=1) + "\n", "training.md": page}
        write_together([(options.out / name, text.encode()) for name, text in files.items()])
    print(options.out / "training.md")


def measure(generator: "Sampler", seeds: Sequence[int], grid: Grid) -> Results:
    """Every sweep on every seed, but the peers' recipe on the first alone; says what is being done."""
    import torch
    from threadpoolctl import threadpool_limits

    from assets.build_config import BuildConfig
    from avatargen.commands.bench import sweep
    from avatargen.commands.bench.compare import compare
    from avatargen.commands.bench.peer import PeerConfig
    from avatargen.commands.bench.recipes import measure_recipes
    from avatargen.commands.bench.truth import find_truth

    torch.set_num_threads(1)  # so that processor seconds are those of the clock on an idle machine
    threadpool_limits(1, user_api="blas")
    found = Results(surfaces=[], textures=[], mapping=[], rays=[], comparison=[], recipes=[])
    for seed in seeds:
        avatar = generator.sample(seed)
        truth = find_truth(avatar.sdf, avatar.color, avatar.bounds, grid.truth, grid.points)
        print(f"seed {seed}: {len(truth.points)} true points", flush=True)
        if seed == seeds[0]:
            resolution, faces, texture = grid.ours
            ours = BuildConfig(resolution=resolution, faces=faces, texture=texture)
            resolution, faces, texture = grid.peer
            peer = PeerConfig(resolution=resolution, faces=faces, texture=texture)
            for row in compare(generator, truth, seed, ours, peer):
                found.comparison.append(row)
                print(f"  {row.name}: {row.cpu_seconds:.1f} s, {row.p99_mm:.2f} mm p99", flush=True)
        resolution, faces, _ = grid.ours
        for row in measure_recipes(avatar, BuildConfig(resolution=resolution, faces=faces)):
            found.recipes.append(row)
            print(f"  {row.mesher}, {row.simplifier}", flush=True)
        for row in sweep.sweep_surfaces(avatar, truth, grid.resolutions, grid.faces):
            found.surfaces.append(row)
            print(f"  {row.resolution}, {row.faces}: {row.total:.2f} s, {row.p99_mm:.2f} mm p99", flush=True)
        surface = sweep.default_surface(avatar, *grid.default)
        found.textures.extend(sweep.sweep_textures(avatar, truth, surface, grid.textures))
        found.mapping.extend(sweep.sweep_mapping(avatar, surface, grid.neighbours))
        found.rays.extend(sweep.sweep_rays(avatar, grid.steps))
    return found


def machine() -> dict[str, object]:
    """What the numbers were measured on."""
    import torch

    return {"processor": platform.machine(), "threads": torch.get_num_threads(), "torch": torch.__version__}


def report(found: Results, seeds: Sequence[int]) -> str:
    """The tables in one Markdown page."""
    from avatargen.commands.bench import tables

    parts = [
        "# Error against run time",
        f"Made by `avatargen bench`. Medians over seeds {', '.join(map(str, seeds))}; "
        f"{machine()['processor']}. Seconds are the processor's, of one thread. Canonical pose.",
        "![Error against run time](bench.png)",
        "## Beside the usual recipe",
        "Seed to file: sampling, mesh, charts, texture, weights. In brackets: how many times ours. The usual "
        "recipe asks the field on a dense grid, its networks by torch alone, then scikit-image, pymeshlab, "
        "xatlas at its defaults, nearest weights. It takes the body's distance from libigl's tree; our "
        "distance is that of `avatargen.body`; the cheap one is read off a grid that is made beforehand and "
        "not timed.",
        tables.comparison_table(found.comparison),
        "## Meshers and simplifiers",
        "`--mesher` and `--simplifier` of `avatar-export` at the same resolution and faces, from the field "
        "to charts. Handles are one number a seed.",
        tables.recipe_table(found.recipes),
        "## Resolution and faces",
        "Seconds are those from the field to charts. Slivers have an angle under 5 degrees.",
        tables.surface_table(found.surfaces),
        "## Texture",
        "Filtered texture on the default mesh against the field's colour at true surface points.",
        tables.texture_table(found.textures),
        "## The generator's mapping",
        "The default mesh bent into 20 poses as an engine does it, carried back by the generator's mapping "
        "through its K nearest posed body vertices; distance from where each vertex came from.",
        tables.mapping_table(found.mapping),
        "## Volume rendering",
        "A picture in the canonical pose against one with 256 steps a ray.",
        tables.ray_table(found.rays),
    ]
    return "\n\n".join(parts) + "\n"
