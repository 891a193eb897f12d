"""Do the metrics measure what they say? Real pictures made worse by known amounts, and measured as a model's.

    blur        Gaussian, pixels
    noise       added to every colour, standard deviation in percent of white
    depth       everything nearer by so many millimetres
    poses       so many percent of the pictures exchanged for those of other labels

Warp needs two sides of a person, of which a data set has one: it is measured on the labels' bare bodies,
painted by the place of each point on the body, and worsened alike. A metric is right if it grows with what it
is to see.

Letters: N pictures, S pixels a side, r of depth.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float, Int64
from torch import Tensor
from torch.nn import functional as F

from avatargen.body.model import Body, pose, pose_canonically, shape
from avatargen.data.dataset import Pictures
from avatargen.data.raycast import Light, shoot
from avatargen.data.units import DEPTH_UNIT
from avatargen.generator.camera import camera_of_vector
from avatargen.generator.picture import Picture
from avatargen.metrics.clothes import true_depth
from avatargen.metrics.evaluate import WARP, measure, side_errors
from avatargen.metrics.joints import load_images
from avatargen.metrics.judges import Judges
from avatargen.metrics.report import Number, mean
from avatargen.metrics.shown import Shown, Views, in_eight_bits, sides, turned_camera
from avatargen.metrics.truth import gather_truth
from avatargen.training.adversarial import blur

AMOUNTS: dict[str, tuple[float, ...]] = {
    "blur (pixels)": (0.5, 1.0, 2.0),
    "noise (%)": (2.0, 5.0, 10.0),
    "depth nearer (mm)": (20.0, 40.0, 80.0),
    "poses swapped (%)": (25.0, 50.0, 100.0),
}
PLAIN_LIGHT = Light(ambient=1.0, direction=np.array([0.0, 1.0, 0.0]), strength=0.0)


@dataclass(frozen=True, kw_only=True)
class Row:
    """What was done to the pictures, and every metric of them."""

    what: str
    amount: float
    numbers: dict[str, Number | None]


def validate(
    data: Pictures,
    reference: Pictures,
    body: Body,
    judges: Judges,
    chosen: Int64[np.ndarray, " N"],
    raw_size: int,
    tell: Callable[[Row], None],
) -> list[Row]:
    """The real pictures at some labels as they are, and then made worse. The first row is as they are."""
    truth = gather_truth(data, reference, body, chosen, judges, raw_size)
    real, bodies = real_pictures(data, chosen, raw_size), bare_bodies(data, body, chosen, raw_size)
    changes = [("as they are", 0.0)] + [(what, amount) for what, some in AMOUNTS.items() for amount in some]
    rows = []
    for what, amount in changes:
        numbers = measure(worse(real, what, amount), truth, judges)
        numbers[WARP] = mean(side_errors(worse(bodies, what, amount), data))
        rows.append(Row(what=what, amount=amount, numbers=numbers))
        tell(rows[-1])
    return rows


def worse(shown: Shown, what: str, amount: float) -> Shown:
    """The pictures after a change of `AMOUNTS`, or as they are."""
    if what == "poses swapped (%)":
        count = round(len(shown) * amount / 100)
        order = np.arange(len(shown))
        order[:count] = np.roll(order[:count], 1)
        # of two sides only the second is another's
        first = shown.first if len(shown.turned) else shown.first.part(order)
        return replace(shown, first=first, turned=shown.turned.part(order[: len(shown.turned)]))
    first, turned = (
        worse_views(views, what, amount, seed) for seed, views in enumerate((shown.first, shown.turned))
    )
    return replace(shown, first=first, turned=turned)


def worse_views(views: Views, what: str, amount: float, seed: int) -> Views:
    colors, metres = views.colors(), views.metres()
    if what == "blur (pixels)":
        colors = blur(colors, amount) if amount >= 1 / 3 else colors
    elif what == "noise (%)":
        random = torch.Generator().manual_seed(seed)
        colors = colors + amount / 100 * torch.randn(colors.shape, generator=random)
    elif what == "depth nearer (mm)":
        metres = metres - amount / 1000
    return views_of(colors, metres, views.cover())


def views_of(
    colors: Float[Tensor, "N 3 S S"], metres: Float[Tensor, "N r r"], cover: Float[Tensor, "N r r"]
) -> Views:
    raw = F.interpolate(colors, size=cover.shape[1:], mode="area")
    return in_eight_bits(Picture(image=colors, raw=raw, depth=metres, mask=cover))


def real_pictures(data: Pictures, chosen: Int64[np.ndarray, " N"], raw_size: int) -> Shown:
    """A data set's own pictures, as if a model had made them."""
    seen = [true_depth(data, int(i), raw_size) for i in chosen]
    depth, cover = (torch.stack(part) for part in zip(*seen, strict=True))
    views = views_of(load_images(data, chosen), depth, cover)
    nobody = views.part(slice(0))
    return Shown(chosen=chosen, first=views, turned=nobody, reposed=nobody)


def bare_bodies(data: Pictures, body: Body, chosen: Int64[np.ndarray, " N"], raw_size: int) -> Shown:
    """The labels' bodies from two sides, painted by the place of each point in the canonical pose."""
    place = pose_canonically(body).vertices
    low, high = place.min(axis=0), place.max(axis=0)
    paint = ((place - low) / (high - low)).astype(np.float32)
    camera = data.row(torch.from_numpy(chosen))[0]
    turned = turned_camera(camera, sides(np.arange(len(chosen))))

    def views(vectors: Tensor) -> Views:
        shots = []
        for i, vector in zip(chosen, vectors, strict=True):
            labels = data.labels
            posed = pose(body, shape(body, labels.betas[i]), labels.pose[i])
            shots.append(
                shoot(
                    posed.vertices, body.faces, paint, camera_of_vector(vector[None]), PLAIN_LIGHT, raw_size
                )
            )
        image = torch.from_numpy(np.stack([shot.image for shot in shots])).permute(0, 3, 1, 2) / 255
        depth = torch.from_numpy(np.stack([shot.depth for shot in shots]).astype(np.float32)) * DEPTH_UNIT
        mask = torch.from_numpy(np.stack([shot.mask for shot in shots])) / 255
        return views_of(image, depth, mask)

    first = views(camera)
    return Shown(chosen=chosen, first=first, turned=views(turned), reposed=first.part(slice(0)))


def table(rows: list[Row]) -> str:
    """Markdown."""
    names = list(rows[0].numbers)
    lines = [f"| pictures | | {' | '.join(names)} |", "|---" * (len(names) + 2) + "|"]
    for row in rows:
        cells = [f"{number.value:.3g}" if (number := row.numbers[name]) else "-" for name in names]
        amount = f"{row.amount:g}" if row.amount else ""
        lines.append(f"| {row.what} | {amount} | {' | '.join(cells)} |")
    return "\n".join(lines)
