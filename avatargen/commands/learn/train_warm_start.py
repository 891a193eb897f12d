"""avatargen train warm-start: regress the wardrobe's people; the same command resumes."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from avatargen.commands.line import parse_options, run_command
from avatargen.training.warm_start import WarmStartConfig

PROGRAM = "avatargen train warm-start"


@dataclass(frozen=True, kw_only=True)
class Options:
    """Train a generator on the procedural wardrobe. Run the same command again to resume."""

    out: Path
    """Folder of the run."""
    preset: Literal["debug", "shipped", "paper"] = "shipped"
    """Size of the networks; the latent's size is always the wardrobe's."""
    plane_resolution: int | None = None
    """Leave out plane resolutions above this one: start coarse, then continue with --start-from."""
    start_from: Path | None = None
    """Weights of a coarser run to begin with."""
    training: WarmStartConfig = field(default_factory=WarmStartConfig)
    dry_run: bool = False
    """Print the settings and stop."""


def main(arguments: Sequence[str] | None = None) -> int:
    return run_command(PROGRAM, lambda: run(parse_options(PROGRAM, Options, arguments)))


def run(options: Options) -> None:
    """Fit the preset to the default body and train."""
    from dataclasses import replace

    from avatargen.avatar import training_body
    from avatargen.body.model import canonical_body
    from avatargen.generator.checkpoint import load_checkpoint
    from avatargen.generator.config import PRESETS, for_body
    from avatargen.training.warm_start import train
    from avatargen.wardrobe.attributes import LATENT_SIZE

    body = canonical_body(training_body())
    config = for_body(PRESETS[options.preset], body)
    blocks = config.synthesis.blocks
    if options.plane_resolution is not None:
        blocks = tuple(block for block in blocks if block[0] <= options.plane_resolution) or blocks[:1]
    config = replace(
        config,
        mapping=replace(config.mapping, z_size=LATENT_SIZE),
        synthesis=replace(config.synthesis, blocks=blocks),
    )
    if options.dry_run:
        print(config, options.training, sep="\n")
        return
    coarser = load_checkpoint(options.start_from).generator.state_dict() if options.start_from else None
    errors = train(config, options.training, body, options.out, print, coarser)
    print(f"held out: {errors.distance_mm:.3f} mm, colour {errors.colour:.4f}")
    print(options.out / "generator.safetensors")
