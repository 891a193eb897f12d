"""avatargen eval: how good a generator's people are, beside real pictures that it has not seen.

avatargen eval --weights runs/first/generator.safetensors --data data/held_out --out runs/first/eval.json
avatargen eval --weights ... --data data/held_out --reference data/train --out runs/first/eval.json
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from avatargen.commands.line import parse_options, run_command
from avatargen.metrics.shown import ShowConfig
from avatargen.ranges import require_ranges

PROGRAM = "avatargen eval"


@dataclass(frozen=True, kw_only=True)
class Options:
    """Frechet distance, Depth, Pose and Warp of a generator; prints a table and writes it as JSON."""

    weights: Path
    """The generator."""
    data: Path
    """Held-out pictures with dataset.json."""
    out: Path
    """Where to write, .json."""
    reference: Path | None = None
    """Other real pictures, for what real pictures reach and, where no pose network is installed, to learn
    where joints are; without them half of the held-out ones."""
    body: Path | None = None
    """The body that the labels are of, where it is not the shipped one."""
    inception: Path | None = None
    """Inception as a TorchScript file: adds the FID and the KID."""
    samples: int | None = 48
    """Samples along rays: with 12, surfaces are seen 4 mm too far. `None`: the generator's own."""
    measure: ShowConfig = field(default_factory=ShowConfig)

    def __post_init__(self) -> None:
        require_ranges(self, "eval", {"samples": (2, 4096)})


def main(arguments: Sequence[str] | None = None) -> int:
    return run_command(PROGRAM, lambda: run(parse_options(PROGRAM, Options, arguments)))


def run(options: Options) -> None:
    """Load, measure, print, write."""
    from avatargen.atomic import check_writable, write_atomically
    from avatargen.avatar import training_body
    from avatargen.generator.checkpoint import load_checkpoint
    from avatargen.metrics.evaluate import data_and_reference, examine, set_exam
    from avatargen.metrics.finer import model_of
    from avatargen.metrics.judges import judges_for

    check_writable(options.out)
    checkpoint = load_checkpoint(options.weights)
    body = training_body(options.body)
    model = model_of(checkpoint.generator, body, options.samples)
    data, reference = data_and_reference(options.data, options.reference, model.render.image_size)
    judges = judges_for(body, reference, options.inception)
    exam = set_exam(data, reference, body, judges, options.measure, model.render.raw_size)
    report = examine(model, exam)
    facts = {"weights": str(options.weights), "weights_hash": checkpoint.weights_hash, **report.facts()}
    write_atomically(options.out, json.dumps(facts, indent=1).encode() + b"\n")
    print(report.table())
    print(options.out)
