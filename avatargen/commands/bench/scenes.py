"""What each scene of avatar-export costs and leaves out, measured by building it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from assets.build_config import BuildConfig
from assets.pipeline import build_content
from assets.scenes import SCENES
from avatargen.avatar import Sampler
from avatargen.commands.bench.cost import measured
from avatargen.commands.bench.tables import table
from exporters import encode


@dataclass(frozen=True, kw_only=True)
class SceneRow:
    """One scene on one seed, from the latent to the bytes."""

    scene: str
    seed: int
    cpu_seconds: float
    peak_mb: float
    bytes: int
    faces: int
    mean_mm: float
    p99_mm: float
    left_out: tuple[str, ...]


def measure_scenes(generator: Sampler, seed: int, names: Sequence[str]) -> Iterator[SceneRow]:
    """Every scene in its own format."""
    for name in names:
        scene = SCENES[name]
        config = BuildConfig.for_scene(name)
        with measured() as cost:
            asset = build_content(generator.sample(seed), config)
            files = encode(asset, f"avatar.{scene.format}")
        assert asset.report is not None  # only assets that were not built have none
        yield SceneRow(
            scene=name,
            seed=seed,
            cpu_seconds=cost.cpu_seconds,
            peak_mb=cost.peak_mb,
            bytes=sum(len(data) for _, data in files),
            faces=len(asset.faces),
            mean_mm=asset.report.error.mean_mm,
            p99_mm=asset.report.error.p99_mm,
            left_out=tuple(item.what for item in asset.report.left_out[2:]),  # beyond what every file does
        )


def scene_page(rows: Sequence[SceneRow]) -> str:
    """The table as Markdown."""
    head = ["scene", "for", "format", "faces", "texture", "s", "peak MB", "MB", "mean mm", "p99 mm"]
    parts = [
        "# Scenes",
        f"Made by `avatargen bench --scenes` on seed {rows[0].seed}, from the latent to the bytes. Seconds "
        "are the processor's, of one thread. None renders anything or runs the deformation network.",
        table([*head, "left out"], [line(row) for row in rows]),
    ]
    return "\n\n".join(parts) + "\n"


def line(row: SceneRow) -> list[str]:
    """A scene's line of the table."""
    scene = SCENES[row.scene]
    texture = "none" if scene.content == "mesh" else str(scene.texture)
    made = [scene.format, f"{row.faces:,}", texture]
    costs = [f"{row.cpu_seconds:.1f}", f"{row.peak_mb:.0f}", f"{row.bytes / 1e6:.2f}"]
    errors = [f"{row.mean_mm:.3f}", f"{row.p99_mm:.2f}"]
    return [row.scene, scene.purpose, *made, *costs, *errors, ", ".join(row.left_out) or "nothing"]
