"""Which snapshot of a run is best, by the metrics of each as it was taken.

OUT/best.safetensors    the weights of the best
OUT/best.json           which it is and why: the rule, and what was measured of every snapshot

A run that goes on behind an earlier state measures again what came after it, so both are the same in the end.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from avatargen.atomic import write_together
from avatargen.errors import InputError
from avatargen.training.picture_model import PictureModel

SNAPSHOTS = "snapshots"  # folder of a run's averaged weights, each named by the pictures shown
RECORD = "best.json"
DECIDES = "frechet distance"
RULE = f"the lowest {DECIDES} to the pictures learned from; of equal ones the earliest"


@dataclass(frozen=True, kw_only=True)
class Watch:
    """How snapshots are measured."""

    pictures: int  # that a model shows for it; snapshots are compared with those of as many
    measure: Callable[[PictureModel], dict[str, float]]  # by names of metrics; what is not finite is left out


def snapshot_path(out: Path, images: int) -> Path:
    return out / SNAPSHOTS / f"{images:09d}.safetensors"


def watch_snapshot(watch: Watch, model: PictureModel, images: int, out: Path) -> dict[str, float]:
    """Measure a snapshot whose weights are written, and keep the best so far; returns what was measured.

    Raises:
        InputError: the record of earlier snapshots is damaged.
    """
    earlier = read_record(out / RECORD, watch.pictures, images)
    known = {shown: found for shown, found in earlier.items() if snapshot_path(out, shown).exists()}
    known[images] = watch.measure(model)
    able = [shown for shown, found in known.items() if DECIDES in found]
    if not able:
        return known[images]
    best = min(able, key=lambda shown: (known[shown][DECIDES], shown))
    record = {
        "best": best,
        "rule": RULE,
        "pictures": watch.pictures,
        "snapshots": {str(shown): known[shown] for shown in sorted(known)},
    }
    write_together(
        [
            (out / "best.safetensors", snapshot_path(out, best).read_bytes()),
            (out / RECORD, json.dumps(record, indent=1).encode() + b"\n"),
        ]
    )
    return known[images]


def read_record(path: Path, pictures: int, before: int) -> dict[int, dict[str, float]]:
    """What was measured with so many pictures of the snapshots before one.

    Raises:
        InputError: the file is damaged.
    """
    if not path.exists():
        return {}
    try:
        content: dict[str, Any] = json.loads(path.read_bytes())
        found = {
            int(shown): {str(name): float(value) for name, value in numbers.items()}
            for shown, numbers in content["snapshots"].items()
        }
        same = int(content["pictures"]) == pictures
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        reason = str(error)[:200]
        raise InputError(
            f"train: {path} is damaged ({reason}); remove it, and snapshots count anew"
        ) from error
    return {shown: numbers for shown, numbers in found.items() if same and shown < before}
