"""How like the wardrobe's own people a generator's are: the fields of one seed compared near the surface, and
pictures of the two.

Letters: N points, H and L height and length of a picture in pixels. Metres, sRGB 0..1.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Bool, Float, UInt8
from torch import Tensor

from avatargen.avatar_info import AvatarInfo
from avatargen.errors import FieldError
from avatargen.wardrobe.chart import tailor

BAND = 0.02  # m around the surface where distances are compared
PAINTED = 0.004  # m around it where colours are
VARIED = 0.02  # standard deviation of brightness under which there is no pattern to see
GREY = 0.5  # behind the people of pictures
OPAQUE = 250  # of 255: what is the person and not the shadow
SAME_DB = 100.0  # what pictures count that do not differ


@dataclass(frozen=True, kw_only=True)
class FieldLikeness:
    """One person's fields against the wardrobe's. `correlation` is that of the brightness on the chest; None
    where it is covered or plain.
    """

    seed: int
    sdf_mm: float
    colour_l1: float
    pattern: str
    correlation: float | None


@dataclass(frozen=True, kw_only=True)
class PictureLikeness:
    """One picture of a person against the wardrobe's."""

    view: str
    psnr_db: float
    ssim: float


@runtime_checkable
class Person(Protocol):
    """Distance (m) and colour (sRGB) at canonical points, and who it is."""

    @property
    def info(self) -> AvatarInfo: ...

    def sdf(self, points: Float[Tensor, "N 3"]) -> Float[Tensor, " N"]: ...

    def color(self, points: Float[Tensor, "N 3"]) -> Float[Tensor, "N 3"]: ...


def field_likeness(learned: Person, truth: Person, points: Float[Tensor, "N 3"]) -> FieldLikeness:
    """Compare at canonical points.

    Raises:
        FieldError: none of them is near the surface.
    """
    sdf, color = truth.sdf(points), truth.color(points)
    found, painted = learned.sdf(points), sdf.abs() < PAINTED
    if not painted.any():
        seed = truth.info.seed
        raise FieldError(f"likeness: no point is near the surface of seed {seed}; give more points")
    band = sdf.abs() < BAND
    shown = learned.color(points[painted])
    facts = dict(truth.info.facts)
    open_chest = on_chest(points[painted]) if facts["outer"] == "none" else torch.zeros(0)
    return FieldLikeness(
        seed=truth.info.seed,
        sdf_mm=1000 * float((found - sdf).abs()[band].mean()),
        colour_l1=float((shown - color[painted]).abs().mean()),
        pattern=str(facts["pattern"]),
        correlation=correlation(shown[open_chest].mean(1), color[painted][open_chest].mean(1))
        if len(open_chest)
        else None,
    )


def on_chest(points: Float[Tensor, "N 3"]) -> Bool[Tensor, " N"]:
    """Which points lie where a print is seen."""
    x, y, z = tailor(points)
    return (z > 0.03) & (x.abs() < 0.12) & (y > 0.2) & (y < 0.45)


def correlation(a: Float[Tensor, " N"], b: Float[Tensor, " N"]) -> float | None:
    """Of two brightnesses; None where the second hardly varies, 0 where the first does not at all."""
    if len(a) < 10 or float(b.std()) < VARIED:
        return None
    return float(torch.corrcoef(torch.stack([a, b]))[0, 1]) if float(a.std()) > 1e-6 else 0.0


def picture_likeness(
    view: str, learned: UInt8[np.ndarray, "H L 4"], truth: UInt8[np.ndarray, "H L 4"]
) -> PictureLikeness:
    """Compare two pictures where either shows the person: peak signal to noise, decibels, and structural
    similarity (Wang et al. 2004), on the same grey.

    Raises:
        FieldError: neither shows anybody.
    """
    from skimage.metrics import structural_similarity

    person = (learned[..., 3] >= OPAQUE) | (truth[..., 3] >= OPAQUE)
    if not person.any():
        raise FieldError(f"likeness: the {view} pictures show nobody; check the weights")
    a, b = before_grey(learned), before_grey(truth)
    error = float(((a - b) ** 2)[person].mean())
    similar = structural_similarity(b, a, channel_axis=-1, data_range=1.0, full=True)[1]
    return PictureLikeness(
        view=view,
        psnr_db=min(SAME_DB, -10 * float(np.log10(max(error, 1e-12)))),
        ssim=float(similar[person].mean()),
    )


def before_grey(picture: UInt8[np.ndarray, "H L 4"]) -> Float[np.ndarray, "H L 3"]:
    """The picture on grey."""
    color, cover = picture[..., :3] / 255, picture[..., 3:] / 255
    return color * cover + GREY * (1 - cover)


def by_pattern(people: Iterable[FieldLikeness]) -> dict[str, dict[str, int | float]]:
    """For each pattern that was seen on a chest: how many people, and the mean correlation."""
    rows: dict[str, list[float]] = {}
    for person in people:
        if person.correlation is not None:
            rows.setdefault(person.pattern, []).append(person.correlation)
    return {
        name: {"people": len(found), "correlation": float(np.mean(found))}
        for name, found in sorted(rows.items())
    }
