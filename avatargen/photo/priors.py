"""What poses and builds are usual: how far joints turn, and the shapes of women and men.

Turns are axis times angle, radians, in the T-pose's axes: y up, facing +z, the person's left at +x. The left
side is given, the right one mirrored.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float64
from torch import Tensor

from avatargen.wardrobe.attributes import LATENT_SIZE, People
from avatargen.wardrobe.stature import MEN, WOMEN, Sizing

Turn = tuple[int, int, int]
DRAWN = 2048  # people that builds are learned of
FEWEST_SPREADS = 1e-3


@dataclass(frozen=True, kw_only=True)
class Usual:
    """A joint's usual turn, how far it strays from it, the least and most that it reaches; whole degrees."""

    mean: Turn
    spread: Turn
    low: Turn
    high: Turn


USUAL = {
    "spine1": Usual(mean=(3, 0, 0), spread=(14, 12, 10), low=(-25, -25, -25), high=(45, 25, 25)),
    "spine2": Usual(mean=(0, 0, 0), spread=(10, 10, 9), low=(-15, -20, -22), high=(28, 20, 22)),
    "spine3": Usual(mean=(0, 0, 0), spread=(10, 10, 9), low=(-15, -20, -22), high=(28, 20, 22)),
    "neck": Usual(mean=(0, 0, 0), spread=(16, 18, 12), low=(-35, -45, -30), high=(40, 45, 30)),
    "head": Usual(mean=(0, 0, 0), spread=(14, 18, 10), low=(-35, -45, -25), high=(35, 45, 25)),
    "left_hip": Usual(mean=(-8, 0, 4), spread=(40, 20, 18), low=(-130, -50, -30), high=(45, 55, 65)),
    "left_knee": Usual(mean=(12, 0, 0), spread=(45, 7, 5), low=(-4, -18, -10), high=(145, 18, 10)),
    "left_ankle": Usual(mean=(0, 0, 0), spread=(16, 12, 9), low=(-40, -30, -25), high=(50, 30, 25)),
    "left_foot": Usual(mean=(0, 0, 0), spread=(6, 3, 3), low=(-40, -5, -5), high=(30, 5, 5)),
    "left_collar": Usual(mean=(0, 0, 0), spread=(6, 8, 9), low=(-12, -22, -12), high=(12, 18, 28)),
    "left_shoulder": Usual(mean=(0, -5, -35), spread=(45, 45, 50), low=(-110, -130, -95), high=(110, 75, 90)),
    "left_elbow": Usual(mean=(0, -30, 0), spread=(28, 45, 5), low=(-85, -150, -10), high=(85, 4, 10)),
    "left_wrist": Usual(mean=(0, 0, 0), spread=(18, 14, 22), low=(-50, -30, -75), high=(50, 30, 70)),
    "left_hand": Usual(mean=(0, 0, -8), spread=(3, 3, 10), low=(-5, -10, -75), high=(5, 10, 10)),
}
MIRROR = np.array([1.0, -1.0, -1.0])


@dataclass(frozen=True, kw_only=True, eq=False)
class PosePrior:
    """Usual turns of a skeleton's joints. A joint that nobody knows may turn as it likes."""

    mean: Float[Tensor, "J 3"]
    spread: Float[Tensor, "J 3"]
    low: Float[Tensor, "J 3"]
    high: Float[Tensor, "J 3"]

    def unusual(self, turns: Float[Tensor, "J 3"]) -> Float[Tensor, ""]:
        """Half the squares of spreads away from the mean, added up."""
        return 0.5 * (((turns - self.mean) / self.spread) ** 2).sum()

    def beyond(self, turns: Float[Tensor, "J 3"]) -> Float[Tensor, ""]:
        """The squares of radians beyond what joints reach, added up."""
        over = torch.relu(turns - self.high) + torch.relu(self.low - turns)
        return (over**2).sum()


def pose_prior(names: tuple[str, ...]) -> PosePrior:
    """What is usual for a skeleton with these joints."""
    rows = {key: np.zeros((len(names), 3)) for key in ("mean", "spread", "low", "high")}
    rows["spread"][:] = np.degrees(10.0)
    rows["low"][:], rows["high"][:] = -np.degrees(9.0), np.degrees(9.0)
    for number, name in enumerate(names):
        left = name.replace("right_", "left_")
        if left not in USUAL:
            continue
        usual, mirrored = USUAL[left], name != left
        values = {key: np.array(getattr(usual, key)) for key in rows}
        if mirrored:
            ends = values["low"] * MIRROR, values["high"] * MIRROR
            values |= {"mean": values["mean"] * MIRROR, "low": np.minimum(*ends), "high": np.maximum(*ends)}
        for key, value in values.items():
            rows[key][number] = value
    return PosePrior(**{key: torch.from_numpy(np.radians(value)).float() for key, value in rows.items()})


@dataclass(frozen=True, kw_only=True, eq=False)
class Builds:
    """The wardrobe's women, men or both: shapes as a normal distribution, `mean + axes @ numbers`."""

    mean: Float64[np.ndarray, " b"]
    axes: Float64[np.ndarray, "b b"]
    height: float  # m


def usual_builds(sizing: Sizing, gender: str | None, count: int) -> Builds:
    """Shapes of people of a gender, or of all, by drawing many; their first `count` betas."""
    z = torch.randn(DRAWN, LATENT_SIZE, generator=torch.Generator().manual_seed(1))
    people = People(z)
    betas = sizing.betas(people)[:, :count].double().numpy()
    woman = people.choice("woman")[:, 0].numpy() > 0.5
    chosen = {"woman": woman, "man": ~woman, None: np.ones(len(woman), dtype=bool)}[gender]
    height = {"woman": WOMEN, "man": MEN, None: (WOMEN + MEN) / 2}[gender]
    found = betas[chosen]
    values, vectors = np.linalg.eigh(np.cov(found.T))
    axes = vectors * np.sqrt(np.maximum(values, FEWEST_SPREADS**2))
    mean = sizing.sized(torch.from_numpy(found.mean(axis=0))[None], torch.tensor([[height]]))[0].numpy()
    return Builds(mean=mean, axes=axes, height=height)
