"""The metrics of section 4 on a data set: Frechet distance, Depth, Pose and Warp, with 95 % intervals; and
Clothes, see `avatargen.metrics.clothes`.

Random people are generated at the labels of held-out pictures. On synthetic data the truth stands in for
the paper's estimated ground truth: Depth is the mean distance between the depth generated and the true one
where both show a person; it holds the difference between two people's clothes, so it does not reach zero, and
the bare body does as well as anybody.
Pose is the mean distance between joints estimated in the generated picture and the label's; Warp is in
`avatargen.metrics.warp`. Depth and Clothes are left out where a data set has no depth.

Letters: N pictures, r raw size, S final size, J joints.
"""

import copy
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float, Float64
from torch import Tensor

from avatargen.body.model import Body
from avatargen.data.dataset import Pictures, open_pictures
from avatargen.data.mirror import partners
from avatargen.errors import InputError
from avatargen.extras import require_extra
from avatargen.generator.camera import camera_of_vector
from avatargen.generator.generator import AvatarGenerator
from avatargen.generator.picture import CanonicalSurface, Picture, make_people, picture_people
from avatargen.metrics.clothes import (
    COVERED,
    SOLID,
    Offsets,
    bare_depths,
    clothes_error,
    offsets,
    true_depth,
)
from avatargen.metrics.features import Features, all_features
from avatargen.metrics.frechet import distance_error, frechet_distance
from avatargen.metrics.joints import JointEstimator, fit_joints, true_joints
from avatargen.metrics.warp import warp_error
from avatargen.ranges import MANY, require_ranges

RESAMPLES = 1000
MOST_REFERENCES = 2000
POSE = "pose (% of the picture)"
CLOTHES = "clothes (mm)"


@dataclass(frozen=True, kw_only=True)
class Number:
    """A mean or distance, the ends of its 95 % interval, and over how many pictures."""

    value: float
    low: float
    high: float
    count: int


@dataclass(frozen=True, kw_only=True)
class Report:
    """What was measured, by name; `floors` hold the same of real pictures, where that can be measured."""

    numbers: dict[str, Number]
    floors: dict[str, Number]
    left_out: tuple[str, ...]  # what no picture allowed to measure: no true depth, or nobody to see
    seconds: dict[str, float]

    def table(self) -> str:
        """Markdown."""
        lines = ["| metric | value | 95 % | real pictures | pictures |", "|---|---|---|---|---|"]
        for name, number in self.numbers.items():
            floor = f"{self.floors[name].value:.4g}" if name in self.floors else ""
            interval = f"{number.low:.4g} to {number.high:.4g}"
            lines.append(f"| {name} | {number.value:.4g} | {interval} | {floor} | {number.count} |")
        return "\n".join(lines)

    def facts(self) -> dict[str, object]:
        """For JSON."""
        return asdict(self)


@dataclass(frozen=True, kw_only=True)
class EvalConfig:
    """How much is measured."""

    pictures: int = 200  # at most
    seed: int = 0
    samples: int | None = 48  # along rays: with 12, surfaces are seen 4 mm too far; none: the generator's

    def __post_init__(self) -> None:
        require_ranges(self, "eval", {"seed": (0, MANY), "samples": (2, 4096)})
        if self.pictures < 20:
            raise InputError(f"eval: {self.pictures} pictures say nothing; take 20 or more")


def holds_depth(data: Pictures) -> bool:
    """Whether true depth lies beside the pictures, against which clothes are measured as rays see the body.

    Raises:
        InputError: it does, and there is nothing to follow rays with.
    """
    if not data.holds("depth"):
        return False
    require_extra("embreex")
    return True


def evaluate(
    generator: AvatarGenerator,
    surface: CanonicalSurface,
    data: Pictures,
    reference: Pictures,
    features: tuple[str, Features],
    config: EvalConfig,
    joints: JointEstimator | None = None,
) -> Report:
    """Measure a generator against held-out pictures.

    `reference` are other real pictures: the floors compare them with the held-out ones, and the joint
    estimator is fitted on them where none is given. `features` come with the name of their distance.

    Raises:
        InputError: labels that are of another body than the generator's.
    """
    for pictures in (data, reference):
        if not pictures.labels.may_be_of(generator.config.body_hash):
            raise InputError(f"eval: the labels in {pictures.folder} are of another body than the weights")
    has_depth = holds_depth(data)
    started = time.perf_counter()
    count = min(config.pictures, len(data))
    chosen = torch.randperm(len(data), generator=torch.Generator().manual_seed(config.seed))[:count]
    images = load_images(data, chosen)
    spread = spread_over(reference, MOST_REFERENCES)
    others = load_images(reference, spread)
    seconds = {"load": time.perf_counter() - started}
    if config.samples is not None:
        generator = finer(generator, config.samples)
    seen, warps = generate(generator, surface, data, chosen, config.seed)
    seconds["generate"] = time.perf_counter() - started - seconds["load"]
    name, network = features
    made, real, other = (all_features(network, part) for part in (seen.image.clamp(0, 1), images, others))
    if joints is None:
        others_joints = true_joints(reference, surface.body, spread.numpy())
        joints = fit_joints(others, others_joints, partners(surface.body.joint_names))
    truth = true_joints(data, surface.body, chosen.numpy())
    numbers = {
        name: distance(made, real),
        "depth (mm)": interval(depth_errors(seen, data, chosen)) if has_depth else None,
        CLOTHES: number(*clothes_error(*clothes_of(seen, data, surface.body, chosen)), count)
        if has_depth
        else None,
        POSE: interval(joint_errors(joints(seen.image), truth)),
        "warp": interval(np.array(warps)),
    }
    floors = {name: distance(other, real), POSE: interval(joint_errors(joints(images), truth))}
    if has_depth and reference.holds("depth"):
        size = generator.config.render.raw_size
        real_offset = clothes_error(*real_clothes(data, reference, surface.body, chosen, size))
        floors[CLOTHES] = number(*real_offset, count)
    seconds["total"] = time.perf_counter() - started
    return Report(
        numbers={name: number for name, number in numbers.items() if number is not None},
        floors={name: number for name, number in floors.items() if number is not None},
        left_out=tuple(name for name, number in numbers.items() if number is None),
        seconds=seconds,
    )


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


def finer(generator: AvatarGenerator, samples: int) -> AvatarGenerator:
    """The same networks, with so many samples a ray."""
    other = copy.copy(generator)
    render = replace(generator.config.render, samples=samples)
    other.config = replace(generator.config, render=render)
    return other


def clothes_of(seen: Picture, data: Pictures, body: Body, chosen: Tensor) -> tuple[Offsets, Offsets]:
    """How far generated and real people stand before the bare body."""
    size, chosen = seen.depth.shape[-1], chosen[: len(seen.depth)]
    bare = bare_depths(data, body, chosen, size)
    made = offsets(seen.depth.cpu(), (seen.mask > SOLID).cpu(), bare)
    return made, real_offsets(data, chosen, bare)


def real_clothes(
    data: Pictures, reference: Pictures, body: Body, chosen: Tensor, size: int
) -> tuple[Offsets, Offsets]:
    """The same of as many other real people, and of the chosen ones."""
    sets = ((reference, spread_over(reference, len(chosen))), (data, chosen))
    first, second = (real_offsets(one, which, bare_depths(one, body, which, size)) for one, which in sets)
    return first, second


def spread_over(pictures: Pictures, most: int) -> Tensor:
    """Numbers of at most so many pictures, evenly over the set, which holds each person's in a row."""
    return torch.linspace(0, len(pictures) - 1, min(len(pictures), most)).long()


def real_offsets(data: Pictures, chosen: Tensor, bare: tuple[Tensor, Tensor]) -> Offsets:
    size = bare[0].shape[-1]
    depth, cover = (
        torch.stack(part) for part in zip(*(true_depth(data, int(i), size) for i in chosen), strict=True)
    )
    return offsets(depth, cover > COVERED, bare)


def number(value: float, error: float, count: int = 0) -> Number | None:
    """A distance with its interval; none where it was not measured."""
    if not np.isfinite(value):
        return None
    return Number(value=value, low=max(value - 1.96 * error, 0.0), high=value + 1.96 * error, count=count)


def load_images(pictures: Pictures, indices: Tensor) -> Float[Tensor, "N 3 S S"]:
    return torch.stack([pictures.image(int(i)) for i in indices])


@torch.no_grad()
def generate(
    generator: AvatarGenerator, surface: CanonicalSurface, data: Pictures, chosen: Tensor, seed: int
) -> tuple[Picture, list[float]]:
    """A random person at each label; and the warp error of every person between two labels."""
    draw = torch.Generator().manual_seed(seed)
    parts, warps = [], []
    for first, second in zip(chosen[0::2], chosen[1::2], strict=False):
        labels = [part.to(generator.density.p.device) for part in data.row(torch.stack([first, second]))]
        camera, pose, betas = labels
        z = torch.randn(2, generator.config.mapping.z_size, generator=draw).to(camera)
        w = generator.mapping(z, camera)
        same = w[:1].expand(2, -1)  # one person under both labels, then another under the second
        people = make_people(generator, surface, same, generator.planes(same), pose, betas)
        pair = picture_people(generator, surface, people, camera_of_vector(camera), [None] * 2)
        maps = (people[0].map, people[1].map)
        warps.append(warp_error(pair.raw.clamp(0, 1), pair.depth, pair.mask, camera_of_vector(camera), maps))
        other = make_people(generator, surface, w[1:], generator.planes(w[1:]), pose[1:], betas[1:])
        alone = picture_people(generator, surface, other, camera_of_vector(camera[1:]), [None])
        parts += [Picture(**{name: value[:1] for name, value in vars(pair).items()}), alone]
    whole = {name: torch.cat([getattr(part, name) for part in parts]) for name in vars(parts[0])}
    return Picture(**whole), warps


def depth_errors(seen: Picture, data: Pictures, chosen: Tensor) -> Float64[np.ndarray, " N"]:
    """Mean absolute difference in millimetres of each picture, where both show a person."""
    errors = []
    for i, index in enumerate(chosen[: len(seen.depth)]):
        depth, cover = true_depth(data, int(index), seen.depth.shape[-1])
        both = (cover > COVERED) & (seen.mask[i].cpu() > SOLID)
        difference = (depth - seen.depth[i].cpu())[both].abs()
        errors.append(1000 * float(difference.mean()) if both.any() else float("nan"))
    return np.array(errors)


def joint_errors(
    found: Float64[np.ndarray, "N J 2"], truth: Float64[np.ndarray, "M J 2"]
) -> Float64[np.ndarray, " N"]:
    """Mean distance of each picture's joints, in percent of the picture's width."""
    return 100 * np.linalg.norm(found - truth[: len(found)], axis=2).mean(axis=1)


def distance(a: Float[np.ndarray, "N F"], b: Float[np.ndarray, "M F"]) -> Number | None:
    return number(frechet_distance(a, b), distance_error(a, b), len(a))


def interval(values: Float64[np.ndarray, " N"]) -> Number | None:
    """Mean over what was measured (NaN was not), and its interval by resampling pictures; none of nothing."""
    values = values[np.isfinite(values)]
    if not len(values):
        return None
    rng = np.random.default_rng(0)
    means = values[rng.integers(len(values), size=(RESAMPLES, len(values)))].mean(axis=1)
    low, high = np.quantile(means, (0.025, 0.975))
    return Number(value=float(values.mean()), low=float(low), high=float(high), count=len(values))
