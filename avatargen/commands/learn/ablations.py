"""avatargen eval ablations: every choice of the paper's Table 2, trained and measured; one table.

avatargen eval ablations --preset debug --data data/train --held-out data/held_out --out runs/ablations
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

from avatargen.commands.line import parse_options, run_command

PROGRAM = "avatargen eval ablations"


@dataclass(frozen=True, kw_only=True)
class Options:
    """Train and measure every choice of Table 2. Run the same command again to resume."""

    data: Path
    """Pictures to learn from."""
    held_out: Path
    """Pictures of other people, to measure with."""
    out: Path
    """Folder of the runs and of ablations.json and ablations.md."""
    preset: Literal["debug", "cpu", "gpu", "paper"] = "debug"
    """Settings that every choice shares."""
    images: int | None = None
    """Pictures shown to each; those of the preset if left out."""


def main(arguments: Sequence[str] | None = None) -> int:
    return run_command(PROGRAM, lambda: run(parse_options(PROGRAM, Options, arguments)))


def run(options: Options) -> None:
    """Train all, measure all, print and write the table."""
    from dataclasses import replace

    from avatargen.atomic import write_together
    from avatargen.avatar import training_body
    from avatargen.commands.learn.train import accelerator_for
    from avatargen.data.dataset import open_pictures
    from avatargen.extras import require_extra
    from avatargen.metrics.ablations import run_ablations, table
    from avatargen.training.adversarial_config import PRESETS

    require_extra("accelerate")
    base = PRESETS[options.preset]
    base = base if options.images is None else replace(base, images=options.images)
    size = base.render.image_size
    rows = run_ablations(
        base,
        open_pictures(options.data, size),
        open_pictures(options.held_out, size),
        training_body(),
        options.out,
        accelerator_for(base),
        lambda name: print(name, flush=True),
    )
    facts = {"preset": options.preset, "images": base.images, "rows": [asdict(row) for row in rows]}
    files = {"ablations.json": json.dumps(facts, indent=1), "ablations.md": table(rows)}
    write_together([(options.out / name, text.encode() + b"\n") for name, text in files.items()])
    print(table(rows))
    print(options.out / "ablations.md")
