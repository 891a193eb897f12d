"""How far a person who was found in one photograph is from the one who was photographed.

Joints are compared as published: pelvis on pelvis (MPJPE), and after the similarity that brings them
together best (Procrustes, PA-MPJPE), which takes away what one picture cannot show, how tall and how far
away somebody is. The clothed surface goes along. Words are those of `Attributes.facts`.

Letters: J joints, V vertices, N M points, F faces, H W pixels.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Float64, Int64

from avatargen.errors import InputError
from avatargen.mesh.closest import ClosestPoints
from avatargen.metrics.report import mean

COLORS = ("hair_color", "top_color", "bottom_color", "outer_color", "shoes_color")
WORDS = ("gender", "skin", "hair", "top", "bottom", "outer", "hat", "shoes", *COLORS)
NONE = "none"
SECONDS = "seconds"


@dataclass(frozen=True, kw_only=True)
class PhotoError:
    """One person. `stages` tell for each stage of the work what was measured when it ended, and after how
    many seconds of looking: joints and surface (median over its vertices) in millimetres, pelvis on pelvis
    and `aligned`; `unseen` are means over the other views. `right` tells words of the person that apply.
    Where the photograph was refused, `refused` says why, and nothing was measured."""

    seed: int
    refused: str | None = None
    stages: dict[str, dict[str, float]]
    right: dict[str, bool]
    seconds: dict[str, float]

    def __post_init__(self) -> None:
        known = isinstance(self.seed, int) and set(self.right) <= set(WORDS)
        values = [*self.seconds.values(), *(n for stage in self.stages.values() for n in stage.values())]
        known = known and all(SECONDS in stage for stage in self.stages.values())
        if not known or not all(isinstance(value, int | float) for value in values):
            raise InputError("eval photo: a person's line is damaged; name another file")

    @property
    def numbers(self) -> dict[str, float]:
        """Errors of the person as found in the end."""
        last = next(reversed(self.stages.values()), {})
        return {name: value for name, value in last.items() if name != SECONDS}

    def line(self) -> str:
        """What is printed of a person."""
        if self.refused is not None:
            return f"seed {self.seed}: {self.refused}"
        numbers = "  ".join(f"{name} {value:.3g}" for name, value in self.numbers.items())
        words = f"{sum(self.right.values())} of {len(self.right)} words"
        return f"seed {self.seed}: {numbers}  {words}  {sum(self.seconds.values()):.1f} s"


@dataclass(frozen=True, kw_only=True)
class Similarity:
    """x -> scale * rotation @ x + move."""

    scale: float
    rotation: Float64[np.ndarray, "3 3"]
    move: Float64[np.ndarray, "3"]

    def __call__(self, points: Float[np.ndarray, "N 3"]) -> Float64[np.ndarray, "N 3"]:
        return self.scale * points @ self.rotation.T + self.move


def procrustes(found: Float[np.ndarray, "J 3"], wanted: Float[np.ndarray, "J 3"]) -> Similarity:
    """The similarity, without mirroring, that brings points closest to others (Umeyama 1991)."""
    middles = found.mean(axis=0), wanted.mean(axis=0)
    a, b = found - middles[0], wanted - middles[1]
    u, sizes, vt = np.linalg.svd(b.T @ a)
    signs = np.array([1.0, 1.0, np.linalg.det(u @ vt)])
    rotation = u @ np.diag(signs) @ vt
    scale = float((sizes * signs).sum() / max(float((a**2).sum()), 1e-12))
    return Similarity(scale=scale, rotation=rotation, move=middles[1] - scale * rotation @ middles[0])


def pelvis_on_pelvis(found: Float[np.ndarray, "J 3"], wanted: Float[np.ndarray, "J 3"]) -> Similarity:
    """The move that puts the first joint in its place."""
    return Similarity(scale=1.0, rotation=np.eye(3), move=(wanted[0] - found[0]).astype(np.float64))


def joints_mm(found: Float[np.ndarray, "J 3"], wanted: Float[np.ndarray, "J 3"]) -> float:
    """The mean distance between joints."""
    return 1000 * float(np.linalg.norm(found - wanted, axis=1).mean())


def surface_mm(
    vertices: Float[np.ndarray, "V 3"], faces: Int64[np.ndarray, "F 3"], points: Float[np.ndarray, "N 3"]
) -> float:
    """The median distance of points to a surface."""
    squared, _, _ = ClosestPoints(vertices.astype(np.float64), faces).query(points.astype(np.float64))
    return 1000 * float(np.median(np.sqrt(squared)))


def overlap(one: Bool[np.ndarray, "H W"], other: Bool[np.ndarray, "H W"]) -> float:
    """Intersection of two silhouettes over their union."""
    return float((one & other).sum() / max(int((one | other).sum()), 1))


def right_words(found: Mapping[str, Any], wanted: Mapping[str, Any]) -> dict[str, bool]:
    """Which words are right, of those that say something: who wears no hat and is found without one tells
    nothing about hats."""
    told = [word for word in WORDS if {found.get(word, NONE), wanted.get(word, NONE)} != {NONE}]
    colors = [word for word in told if word in COLORS and word not in wanted]  # of what is not there
    return {word: found.get(word) == wanted.get(word) for word in told if word not in colors}


def summary(people: Sequence[PhotoError]) -> dict[str, Any]:
    """For each number the mean, its 95 % interval by resampling people, and the median; for each word the
    share that is right, and its interval."""
    measured = [person for person in people if person.refused is None]

    def told(values: list[float]) -> dict[str, float]:
        number = mean(np.array(values, dtype=np.float64))
        return {} if number is None else asdict(number) | {"median": median(values)}

    def columns(rows: list[dict[str, Any]]) -> dict[str, dict[str, float]]:
        names = dict.fromkeys(name for row in rows for name in row)
        return {name: told([float(row[name]) for row in rows if name in row]) for name in names}

    stages = dict.fromkeys(name for person in measured for name in person.stages)
    words = columns([person.right for person in measured])
    for name in words:
        words[name].pop("median")
    return {
        "people": len(people),
        "refused": len(people) - len(measured),
        "numbers": columns([person.numbers for person in measured]),
        "stages": {name: columns([p.stages[name] for p in measured if name in p.stages]) for name in stages},
        "right": {name: words[name] for name in WORDS if name in words},
        "seconds": columns([person.seconds for person in measured]),
    }


def table(told: Mapping[str, Any]) -> str:
    """A summary in Markdown."""
    lines = ["| | mean | 95 % | median | people |", "|---|---|---|---|---|"]
    for group, after in (("numbers", ""), ("right", ": right"), ("seconds", " (s)")):
        for name, n in told[group].items():
            middle = f"{n['median']:.3g}" if "median" in n else ""
            between = f"{n['low']:.3g} to {n['high']:.3g}"
            label = f"{name.replace('_', ' ')}{after}"
            lines.append(f"| {label} | {n['value']:.3g} | {between} | {middle} | {n['count']} |")
    return "\n".join([*lines, "", *stage_lines(told["stages"])])


def stage_lines(stages: Mapping[str, Any]) -> list[str]:
    """Means after each stage in Markdown, a line a stage."""
    names = list(dict.fromkeys(name for columns in stages.values() for name in columns))
    heads = [name.replace("_", " ") for name in names]
    rows = [
        [stage, *(f"{columns[name]['value']:.3g}" for name in names)] for stage, columns in stages.items()
    ]
    return [f"| {' | '.join(row)} |" for row in (["after", *heads], ["---"] * (len(heads) + 1), *rows)]


def to_json(settings: Mapping[str, Any], people: Sequence[PhotoError]) -> bytes:
    """Settings, summary and each person's line."""
    each = [asdict(person) for person in people]
    return json.dumps(dict(settings) | {"summary": summary(people), "each": each}, indent=1).encode() + b"\n"


def from_json(data: bytes, settings: Mapping[str, Any], where: str) -> list[PhotoError]:
    """Each person's line of an earlier call. Raises InputError where it is damaged or had other settings."""
    try:
        found = json.loads(data)
        others = [name for name, value in settings.items() if found[name] != value]
        people = [PhotoError(**row) for row in found["each"]]
    except (ValueError, KeyError, TypeError, AttributeError, InputError) as error:
        raise InputError(f"eval photo: {where} is no table of this command; name another file") from error
    if others:
        raise InputError(f"eval photo: {where} was made with another {others[0]}; name another file")
    return people
