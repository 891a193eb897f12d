"""The metrics of section 4 on a data set: Frechet and kernel distance, Depth, Pose and Warp, with 95 %
intervals; and Clothes, see `avatargen.metrics.clothes`.

    model --show--> pictures of random people at held-out labels --measure--> report

The pictures are all that is asked of a model, whichever it is. On synthetic data the truth stands in for
the paper's estimated ground truth: Depth is the mean distance between the depth generated and the true one
where both show a person; it holds the difference between two people's clothes, so it does not reach zero, and
the bare body does as well as anybody.
Pose is the mean distance between joints estimated in the generated picture and the label's; Warp is in
`avatargen.metrics.warp`. Depth and Clothes are left out where a data set has no depth.

Letters: N pictures, r raw size.
"""

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float, Float64
from torch import Tensor
from torch.nn import functional as F

from avatargen.body.model import Body, canonical_body, pose, shape
from avatargen.data.dataset import Pictures, open_pictures
from avatargen.errors import InputError
from avatargen.generator.camera import camera_of_vector
from avatargen.generator.canonical import CanonicalMap, canonical_map
from avatargen.generator.config import body_hash
from avatargen.metrics.clothes import COVERED, SOLID, clothes_error, offsets
from avatargen.metrics.features import all_features
from avatargen.metrics.judges import Judges
from avatargen.metrics.report import Number, Report, distance, mean, measured
from avatargen.metrics.shown import ShowConfig, Shown, Views, choose_labels, show, sides, turned_camera
from avatargen.metrics.truth import CLOTHES, Depths, Truth, gather_truth
from avatargen.metrics.warp import Pair, pose_error, side_error
from avatargen.training.picture_model import PictureModel

DEPTH, WARP, POSE_WARP = "depth (mm)", "warp", "warp across poses"


@dataclass(frozen=True, kw_only=True, eq=False)
class Exam:
    """What models are asked for, the real pictures that this is held against, and who judges."""

    data: Pictures
    truth: Truth
    judges: Judges
    config: ShowConfig
    seconds: float  # that it took to prepare


def set_exam(
    data: Pictures, reference: Pictures, body: Body, judges: Judges, config: ShowConfig, raw_size: int
) -> Exam:
    """Held-out pictures to measure against. `reference` are other real pictures: floors compare them with the
    held-out ones.

    Raises:
        InputError: labels that are of another body.
    """
    require_body(body, data, reference)
    started = time.perf_counter()
    truth = gather_truth(data, reference, body, choose_labels(data, config), judges, raw_size)
    seconds = time.perf_counter() - started
    return Exam(data=data, truth=truth, judges=judges, config=config, seconds=seconds)


def examine(model: PictureModel, exam: Exam) -> Report:
    """Measure a model."""
    started = time.perf_counter()
    shown = show(model, exam.data, exam.config)
    seconds = {"truth": exam.seconds, "generate": time.perf_counter() - started}
    numbers = measure(shown, exam.truth, exam.judges)
    return Report(
        numbers=measured(numbers),
        floors=exam.truth.floors,
        left_out=tuple(name for name, number in numbers.items() if number is None),
        seconds={**seconds, "total": time.perf_counter() - started},
    )


def require_body(body: Body, *sets: Pictures) -> None:
    """Raises InputError where labels are of another body."""
    own = body_hash(canonical_body(body))
    for pictures in sets:
        if not pictures.labels.may_be_of(own):
            raise InputError(f"eval: the labels in {pictures.folder} are of another body than the weights")


def measure(shown: Shown, truth: Truth, judges: Judges) -> dict[str, Number | None]:
    """Every metric of a model's pictures; none where no picture allowed to measure."""
    images, numbers = shown.first.colors(), {}
    for judge, real in zip(judges.features, truth.features, strict=True):
        numbers |= judge.numbers(all_features(judge.network, images), real)
    depths = truth.depths
    numbers[DEPTH] = mean(depth_errors(shown.first, depths)) if depths else None
    numbers[CLOTHES] = clothes_of(shown.first, depths) if depths else None
    numbers[judges.joints.name] = mean(judges.joints.errors(images, truth.joints))
    numbers[WARP] = mean(side_errors(shown, truth.data))
    if len(shown.reposed):
        numbers[POSE_WARP] = mean(pose_errors(shown, truth.data, truth.body))
    return numbers


def data_and_reference(data: Path, reference: Path | None, size: int) -> tuple[Pictures, Pictures]:
    """Held-out pictures and others to compare with; without others, the halves of the held-out ones.

    Raises:
        InputError: a folder holds no data set, or one picture where it is to be divided.
    """
    pictures = open_pictures(data, size)
    return halves(pictures) if reference is None else (pictures, open_pictures(reference, size))


def halves(pictures: Pictures) -> tuple[Pictures, Pictures]:
    """A set alone in two: pictures to measure with, and others that stand for a reference. Labels hold each
    person's pictures in a row, so at most one person is in both.

    Raises:
        InputError: it has one picture.
    """
    if len(pictures) < 2:
        raise InputError(f"eval: {pictures.folder} has one picture; give --reference or a larger set")
    middle = len(pictures) // 2
    return pictures.part(slice(middle, None)), pictures.part(slice(middle))


def depth_errors(seen: Views, true: Depths) -> Float64[np.ndarray, " N"]:
    """Mean absolute difference in millimetres of each picture, where both show a person."""
    both = (true.cover > COVERED) & (seen.cover() > SOLID)
    away = 1000 * (true.depth - seen.metres()).abs().double()
    return np.array([float(one[where].mean()) for one, where in zip(away, both, strict=True)])


def clothes_of(seen: Views, true: Depths) -> Number | None:
    """Whether generated people stand before their bare bodies as real ones do."""
    made = offsets(seen.metres(), seen.cover() > SOLID, true.bare)
    return distance(*clothes_error(made, true.offsets()), len(seen))


def side_errors(shown: Shown, data: Pictures) -> Float64[np.ndarray, " T"]:
    """Warp of everybody who was turned."""
    camera = data.row(torch.from_numpy(shown.chosen))[0]
    turned = turned_camera(camera, sides(np.arange(len(shown))))[: len(shown.turned)]
    pairs = pairs_of(shown.first, shown.turned, camera[: len(turned)], turned)
    return np.array([side_error(pair) for pair in pairs])


def pose_errors(shown: Shown, data: Pictures, body: Body) -> Float64[np.ndarray, " R"]:
    """Warp of everybody who was reposed."""
    count = len(shown.reposed)
    after = np.roll(shown.chosen, -1)[:count]
    maps = {int(i): body_map(body, data, int(i)) for i in {*shown.chosen[:count], *after}}
    cameras = [data.row(torch.from_numpy(which))[0] for which in (shown.chosen[:count], after)]
    pairs = pairs_of(shown.first, shown.reposed, *cameras)
    labels = zip(shown.chosen[:count], after, strict=True)
    errors = [
        pose_error(pair, (maps[int(a)], maps[int(b)])) for pair, (a, b) in zip(pairs, labels, strict=True)
    ]
    return np.array(errors)


def body_map(body: Body, data: Pictures, index: int) -> CanonicalMap:
    """Canonical from posed, at a label."""
    labels = data.labels
    return canonical_map(pose(body, shape(body, labels.betas[index]), labels.pose[index]))


def pairs_of(
    first: Views, second: Views, camera: Float[Tensor, "T 25"], other: Float[Tensor, "T 25"]
) -> list[Pair]:
    """Pictures of the same people side by side, averaged down to the size of their depth."""
    both = [views.part(slice(len(other))) for views in (first, second)]
    colors, depth, mask = (
        torch.stack(parts, dim=1)
        for parts in zip(*((small(views), views.metres(), views.cover()) for views in both), strict=True)
    )
    cameras = torch.stack([camera, other], dim=1)  # T 2 25
    return [
        Pair(colors=colors[i], depth=depth[i], mask=mask[i], camera=camera_of_vector(cameras[i]))
        for i in range(len(other))
    ]


def small(views: Views) -> Float[Tensor, "N 3 r r"]:
    return F.interpolate(views.colors(), size=views.depth.shape[1:], mode="area")
