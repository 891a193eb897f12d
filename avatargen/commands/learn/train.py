"""avatargen train: learn people from pictures; the same command resumes.

avatargen train --preset cpu --data data/train --out runs/first
avatargen train --preset cpu --data data/train --out runs/second --start-from shipped
avatargen train --preset cpu --data data/train --out runs/third --model eg3d
accelerate launch --num_processes 2 -m avatargen.commands.learn.train --preset gpu --data ... --out ...
"""

import itertools
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from avatargen.commands.line import parse_options, run_command
from avatargen.errors import InputError
from avatargen.training.adversarial_config import PRESETS, AdversarialConfig

if TYPE_CHECKING:
    from accelerate import Accelerator

PROGRAM = "avatargen train"


@dataclass(frozen=True, kw_only=True)
class Options:
    """What the command was asked for; `parse` says what each is."""

    data: Path
    out: Path
    preset: str
    model: str
    start_from: str | None
    body: Path | None
    training: AdversarialConfig
    snapshot_pictures: int
    dry_run: bool


def main(arguments: Sequence[str] | None = None) -> int:
    words = list(sys.argv[1:] if arguments is None else arguments)
    return run_command(PROGRAM, lambda: run(parse(words)))


def parse(words: list[str]) -> Options:
    """The options, with the preset named among them as the default of every other setting."""
    chosen = PRESETS[preset_of(words)]

    def options(
        data: Path,
        out: Path,
        preset: Literal["debug", "cpu", "gpu", "paper"],
        model: Literal["avatargen", "eg3d", "stylesdf", "stylenerf", "giraffe-hd"] = "avatargen",
        start_from: str | None = None,
        body: Path | None = None,
        training: AdversarialConfig = chosen,
        snapshot_pictures: int = 100,
        dry_run: bool = False,
    ) -> Options:
        """Learn people from pictures, adversarially. Run the same command again to resume.

        Args:
            data: Folder of pictures with dataset.json.
            out: Folder of the run.
            preset: Where the settings start from; every one of them can be changed.
            model: Which method learns them: this one, or one of those that it is compared with, of about the
                same size.
            start_from: Weights to begin with: a file, or `shipped` for those of the package.
            body: The body that the labels are of, where it is not the shipped one.
            snapshot_pictures: How many pictures each snapshot is measured by, 20 or more; 0: none, and
                no best one is kept.
            dry_run: Print the settings and stop.
        """
        return Options(
            data=data,
            out=out,
            preset=preset,
            model=model,
            start_from=start_from,
            body=body,
            training=training,
            snapshot_pictures=snapshot_pictures,
            dry_run=dry_run,
        )

    return parse_options(PROGRAM, options, words)


def preset_of(words: list[str]) -> str:
    """The preset named in the arguments; it decides the other settings' defaults.

    Raises:
        InputError: it is none.
    """
    named = [after for word, after in itertools.pairwise(words) if word == "--preset"]
    named += [word.removeprefix("--preset=") for word in words if word.startswith("--preset=")]
    name = named[-1] if named else "cpu"
    if name not in PRESETS:
        raise InputError(f"found --preset {name}; choose one of {', '.join(PRESETS)}")
    return name


def run(options: Options) -> None:
    """Open the data, load the weights to start from, and train."""
    from avatargen.avatar import shipped, training_body
    from avatargen.baselines.models import new_baseline
    from avatargen.data.dataset import open_pictures
    from avatargen.extras import require_extra
    from avatargen.generator.checkpoint import load_checkpoint
    from avatargen.metrics.watch import watch
    from avatargen.training.adversarial import train
    from avatargen.training.avatar_model import avatar_model

    config = options.training
    if options.dry_run:
        print(config)
        return
    if options.model != "avatargen" and options.start_from:
        raise InputError(f"found --start-from with --model {options.model}, which starts from random weights")
    require_extra("accelerate")
    pictures = open_pictures(options.data, config.render.image_size)
    path = shipped("generator.safetensors") if options.start_from == "shipped" else options.start_from
    accelerator = accelerator_for(config)
    watched = options.snapshot_pictures and accelerator.is_main_process
    body, start = training_body(options.body), load_checkpoint(path) if path else None
    model = (
        avatar_model(config, body, start)
        if options.model == "avatargen"
        else new_baseline(options.model, config, body)
    )
    train(
        config,
        model,
        pictures,
        body,
        options.out,
        accelerator,
        lambda line: print(line, flush=True),
        start.weights_hash if start else "random weights",
        watch(pictures, body, options.snapshot_pictures, model.render.raw_size) if watched else None,
    )
    if accelerator.is_main_process:
        print(options.out / "generator.safetensors")


def accelerator_for(config: AdversarialConfig) -> "Accelerator":
    """The machine's devices and processes, if they know the wanted precision.

    Raises:
        InputError: fp16 is wanted and there is no GPU.
    """
    import torch
    from accelerate import Accelerator

    gpu = torch.cuda.is_available()
    if config.precision == "fp16" and not gpu:
        raise InputError("found no GPU, which precision fp16 needs; take bf16 or no")
    return Accelerator(cpu=not gpu)


if __name__ == "__main__":
    sys.exit(main())
