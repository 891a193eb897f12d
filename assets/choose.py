"""Settings from measured curves: the cheapest that keep a tolerance, or the best within a budget.

`pretrained/curves.json`, written by `avatargen bench`, holds seconds by stage and errors for pairs of
resolution and faces, and for texture sizes. This machine's speed beside the bench's is told by how long the
field takes at a few points.
"""

import json
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Float64

from assets.build_config import AvatarFields, BuildConfig
from assets.texture import normal_map, occlusion
from avatargen.errors import InputError
from avatargen.shipped import shipped

SPEED_POINTS = 20_000
SPREAD = 0.01  # metres from the body's vertices
ASKED = 0.6  # share of a map's texels that the field is asked at
QUESTIONS = {"normals": normal_map.QUESTIONS, "occlusion": occlusion.QUESTIONS}  # a texel, by stage
HEADROOM = 1.1  # on a prediction: the time a budget must have room for
TRIES = 3  # of ever finer settings, until a tolerance is kept


@dataclass(frozen=True, kw_only=True)
class Choice:
    """Settings and what is expected of them: seconds from now on, millimetres of the 99th percentile."""

    resolution: int
    faces: int
    seconds: float
    p99_mm: float


@dataclass(frozen=True, kw_only=True)
class Curves:
    """What the bench measured, with seconds scaled to this machine."""

    surfaces: tuple[dict[str, Any], ...]
    textures: tuple[dict[str, Any], ...]
    field_us: float  # microseconds a point of the field took the bench
    scale: float

    def choices(
        self, texture: int | None, normal_map: int | None = None, ambient_occlusion: int | None = None
    ) -> list[Choice]:
        """Every measured pair with the pictures' times (None: no such picture), the cheapest first."""
        sizes = {"normals": normal_map, "occlusion": ambient_occlusion}
        maps = sum(self.map_seconds(stage, size) for stage, size in sizes.items() if size is not None)
        found = []
        for row in self.surfaces:
            needless = ("charts", "atlas") if texture is None else ()
            total = sum(seconds for stage, seconds in row["seconds"].items() if stage not in needless)
            total += 0 if texture is None else self.texture_seconds(texture)
            found.append(
                Choice(
                    resolution=row["resolution"],
                    faces=row["faces"],
                    seconds=self.scale * total + maps,
                    p99_mm=float(row["p99_mm"]),
                )
            )
        return sorted(found, key=lambda choice: choice.seconds)

    @property
    def most_faces(self) -> int:
        return max(row["faces"] for row in self.surfaces)

    def texture_seconds(self, size: int) -> float:
        """Baking and encoding, in proportion to the texels between measured sizes."""
        return self.texture_cost(size, lambda row: sum(row["seconds"].values()))

    def texture_bytes(self, size: int) -> int:
        return int(self.texture_cost(size, lambda row: row["bytes"]))

    def texture_cost(self, size: int, value: Any) -> float:
        texels = [row["size"] ** 2 for row in self.textures]
        return float(np.interp(size**2, texels, [value(row) for row in self.textures]))

    def map_seconds(self, stage: str, size: int) -> float:
        """Such a map is questions for distances and little else."""
        return self.scale * 1e-6 * self.field_us * QUESTIONS[stage] * ASKED * size**2

    def stage_seconds(self, stage: str, resolution: int, faces: int, texture: int) -> float:
        """What a stage takes at the measured settings nearest to these; 0 where it was not measured."""
        if stage in QUESTIONS:
            return self.map_seconds(stage, texture)
        if stage in ("bake", "encode"):
            return self.scale * self.texture_cost(texture, lambda row: row["seconds"][stage])
        nearest = min(
            self.surfaces,
            key=lambda row: abs(np.log(row["resolution"] / resolution)) + abs(np.log(row["faces"] / faces)),
        )
        return self.scale * nearest["seconds"].get(stage, 0.0)


def choose_settings(
    config: BuildConfig | None = None,
    *,
    tolerance_mm: float | None = None,
    budget_s: float | None = None,
    avatar: AvatarFields | None = None,
) -> BuildConfig:
    """The settings, by default `BuildConfig()`, with the resolution and faces that measured curves choose:
    the cheapest expected to keep 99 % of the surface within `tolerance_mm` millimetres, or the most exact
    for which `budget_s` seconds have room. Those are seconds of this machine where an `avatar` is given, as
    its field tells the speed; else of the machine that the curves were measured on.

    Raises:
        InputError: not one of tolerance and budget, or a budget that has no room for anything.
    """
    if (tolerance_mm is None) == (budget_s is None):
        raise InputError("choose_settings: give a tolerance or a budget, one of them")
    wanted = config or BuildConfig()
    tries = candidates(wanted, curves_for(avatar), tolerance_mm=tolerance_mm, budget_s=budget_s)
    return next(tries)[0]


def candidates(
    config: BuildConfig, curves: Curves, *, tolerance_mm: float | None, budget_s: float | None
) -> Iterator[tuple[BuildConfig, Choice]]:
    """Settings to try in turn, each with what is expected of it.

    Raises:
        InputError: the budget has no room for anything, or the recipe is not the one that was measured.
    """
    for name, recipe in (("mesher", config.mesher), ("simplifier", config.simplifier)):
        if recipe != "adaptive":
            raise InputError(
                f"found a tolerance or budget with {name} {recipe}, whose cost and error were not measured; "
                "give resolution and faces, or leave the recipe out"
            )
    texture = None if config.content == "mesh" else config.texture
    choices = curves.choices(texture, config.normal_map, config.ambient_occlusion)
    if budget_s is not None:
        choices = [within_budget(choices, budget_s)]
    elif tolerance_mm is not None:
        choices = within_tolerance(choices, tolerance_mm)[:TRIES]
    for choice in choices:
        yield replace(config, resolution=choice.resolution, faces=choice.faces), choice


def curves_for(avatar: AvatarFields | None) -> Curves:
    """The curves that come with the package, scaled to this machine where there is an avatar to time."""
    return load_curves(shipped("curves.json"), avatar)


def load_curves(path: Path, avatar: Any) -> Curves:
    """The measured curves, scaled by how fast the avatar's field answers here (None: not scaled).

    Raises:
        InputError: the file is missing or damaged.
    """
    try:
        data = json.loads(path.read_text())
        check_curves(data)
        scale = 1.0 if avatar is None else measure_speed(avatar) / data["field_us"]
        return Curves(
            surfaces=tuple(data["surfaces"]),
            textures=tuple(data["textures"]),
            field_us=float(data["field_us"]),
            scale=scale,
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError, OverflowError) as error:
        raise InputError(
            f"found no measured curves in {path} ({str(error)[:200]}); write them with avatargen bench"
        ) from error


def check_curves(data: Any) -> None:
    """Raises ValueError, KeyError, TypeError or AttributeError where what will be asked for is no number."""
    for row in data["surfaces"]:
        require_numbers(row["p99_mm"], *row["seconds"].values())
        require_numbers(row["resolution"], row["faces"], whole=True)
    for row in data["textures"]:
        require_numbers(row["seconds"]["bake"], row["seconds"]["encode"], *row["seconds"].values())
        require_numbers(row["size"], row["bytes"], whole=True)
    if not data["surfaces"] or not data["textures"]:
        raise ValueError("it holds no rows")
    require_numbers(data["field_us"])
    if not data["field_us"] > 0:
        raise ValueError("the field took no time")


def require_numbers(*values: Any, whole: bool = False) -> None:
    """Raises ValueError unless all can be measured: sizes above 0 where they are whole, else 0 or more."""
    for value in values:
        if type(value) not in ((int,) if whole else (int, float)) or not whole <= value < 1e12:
            raise ValueError(f"{str(value)[:50]} is no measured number")


def measure_speed(avatar: Any) -> float:
    """Microseconds a point of the field takes on this machine now, in one thread as in the bench: what more
    threads save is not promised, as half of the work is not theirs."""
    import torch

    points = torch.from_numpy(speed_points(avatar.body.vertices).astype(np.float32))
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        avatar.sdf(points[:1000])  # warms up what the first call sets up
        started = time.perf_counter()
        avatar.sdf(points)
        return 1e6 * (time.perf_counter() - started) / len(points)
    finally:
        torch.set_num_threads(threads)


def speed_points(vertices: Float[np.ndarray, "V 3"]) -> Float64[np.ndarray, "N 3"]:
    """The same points near the body each time."""
    rng = np.random.default_rng(0)
    chosen = np.sort(rng.integers(len(vertices), size=SPEED_POINTS))
    return vertices[chosen] + rng.normal(scale=SPREAD, size=(SPEED_POINTS, 3))


def within_tolerance(choices: list[Choice], tolerance_mm: float) -> list[Choice]:
    """Choices to try in turn: those expected to keep the tolerance, the cheapest first, each finer than the
    one before; the finest of all where none is expected to."""
    ladder: list[Choice] = []
    for choice in choices:
        if choice.p99_mm <= tolerance_mm and (not ladder or choice.p99_mm < ladder[-1].p99_mm):
            ladder.append(choice)
    return ladder or [min(choices, key=lambda choice: choice.p99_mm)]


def within_budget(choices: list[Choice], seconds: float) -> Choice:
    """The smallest error that the seconds have room for, with headroom.

    Raises:
        InputError: not even the cheapest has room.
    """
    fitting = [choice for choice in choices if HEADROOM * choice.seconds <= seconds]
    if not fitting:
        raise InputError(
            f"found --budget with {max(seconds, 0):.1f} s left for the work; the least is "
            f"{HEADROOM * choices[0].seconds:.1f} s, so raise it or lower --texture"
        )
    return min(fitting, key=lambda choice: (choice.p99_mm, choice.seconds))
