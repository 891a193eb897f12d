"""The pictures that a model is judged by: random people at held-out labels, some of them also seen from
another side, and some under another label.

    labels, z --model--> first        a person each
                     --> turned       the same person and pose, the camera moved about the person
                     --> reposed      the same person under the next label

They are kept as files keep pictures, in 8 bits, so it does not matter where and when they are judged. The
latent of all pictures of a person is mapped under the first one's camera.

Letters: N people, T of them turned, R reposed, S pixels a side, r of depth.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from math import cos, radians, sin

import numpy as np
import torch
from jaxtyping import Float, Int64, UInt8, UInt16
from torch import Tensor

from avatargen.data.dataset import Pictures
from avatargen.data.units import DEPTH_UNIT
from avatargen.errors import InputError
from avatargen.generator.picture import Picture
from avatargen.ranges import MANY, require_ranges
from avatargen.training.picture_model import PictureModel, to_look_at

TURN = 30.0  # degrees between two views of a person
CHUNK = 16  # people asked for at a time
FARTHEST = 65535 * DEPTH_UNIT  # metres that are told


@dataclass(frozen=True, kw_only=True)
class ShowConfig:
    """How many pictures a model makes of itself."""

    pictures: int = 200  # people, at a label each; at most as many as there are
    turned: int = 100  # of these also from another side
    reposed: int = 100  # of these also under the next label
    seed: int = 0

    def __post_init__(self) -> None:
        require_ranges(self, "eval", {"turned": (0, MANY), "reposed": (0, MANY), "seed": (0, MANY)})
        if self.pictures < 20:
            raise InputError(f"eval: {self.pictures} pictures say nothing; take 20 or more")


@dataclass(frozen=True, kw_only=True, eq=False)
class Views:
    """Pictures with depth along the rays, in steps of DEPTH_UNIT, and coverage."""

    image: UInt8[np.ndarray, "N S S 3"]
    depth: UInt16[np.ndarray, "N r r"]
    mask: UInt8[np.ndarray, "N r r"]

    def __len__(self) -> int:
        return len(self.image)

    def colors(self) -> Float[Tensor, "N 3 S S"]:
        """sRGB 0..1."""
        return torch.from_numpy(self.image).permute(0, 3, 1, 2).float() / 255

    def metres(self) -> Float[Tensor, "N r r"]:
        return torch.from_numpy(self.depth.astype(np.float32)) * DEPTH_UNIT

    def cover(self) -> Float[Tensor, "N r r"]:
        """0..1."""
        return torch.from_numpy(self.mask).float() / 255

    def part(self, which: slice | np.ndarray) -> "Views":
        return Views(**{each.name: getattr(self, each.name)[which] for each in fields(self)})


@dataclass(frozen=True, kw_only=True, eq=False)
class Shown:
    """What a model showed at the `chosen` labels of a data set."""

    chosen: Int64[np.ndarray, " N"]
    first: Views
    turned: Views
    reposed: Views

    def __len__(self) -> int:
        return len(self.first)

    def upto(self, pictures: int, turned: int) -> "Shown":
        """Those of the first people, at most."""
        return Shown(
            chosen=self.chosen[:pictures],
            first=self.first.part(slice(pictures)),
            turned=self.turned.part(slice(turned)),
            reposed=self.reposed.part(slice(turned)),
        )


def choose_labels(data: Pictures, config: ShowConfig) -> Int64[np.ndarray, " N"]:
    """Labels at random, the same for every model."""
    random = torch.Generator().manual_seed(config.seed)
    return torch.randperm(len(data), generator=random)[: config.pictures].numpy()


def turned_camera(camera: Float[Tensor, "B 25"], degrees: Float[Tensor, " B"]) -> Float[Tensor, "B 25"]:
    """Cameras moved about the vertical line through the origin, where people's pelvises are."""
    turns = [
        [[cos(a), 0.0, sin(a), 0.0], [0.0, 1.0, 0.0, 0.0], [-sin(a), 0.0, cos(a), 0.0], [0.0, 0.0, 0.0, 1.0]]
        for a in map(radians, degrees.tolist())
    ]
    T = torch.tensor(turns, dtype=camera.dtype, device=camera.device)
    return torch.cat([(T @ camera[:, :16].unflatten(1, (4, 4))).flatten(1), camera[:, 16:]], dim=1)


def sides(numbers: Int64[np.ndarray, " N"]) -> Float[Tensor, " N"]:
    """By how many degrees the camera of each person is moved: one to the left, the next to the right."""
    return torch.from_numpy(np.where(numbers % 2, -TURN, TURN).astype(np.float32))


def show_in_parts(model: PictureModel, data: Pictures, config: ShowConfig) -> Iterator[Shown]:
    """Some people after another; `together` joins them."""
    chosen = choose_labels(data, config)
    random = torch.Generator().manual_seed(config.seed)
    latents = torch.randn(len(chosen), model.z_size, generator=random)
    for start in range(0, len(chosen), CHUNK):
        own = np.arange(start, min(start + CHUNK, len(chosen)))
        z, labels = latents[own], data.row(torch.from_numpy(chosen[own]))
        camera = labels[0]
        first = ask(model, z, camera, labels)
        turned = turned_camera(camera, sides(own))[: int((own < config.turned).sum())]
        again = own[own < config.reposed]
        after = data.row(torch.from_numpy(chosen[(again + 1) % len(chosen)]))
        yield Shown(
            chosen=chosen[own],
            first=first,
            turned=ask(model, z, camera, (turned, *labels[1:])),
            reposed=ask(model, z, camera, after),
        )


def show(model: PictureModel, data: Pictures, config: ShowConfig) -> Shown:
    """All pictures that a model is judged by."""
    return together(list(show_in_parts(model, data, config)))


def together(parts: Sequence[Shown]) -> Shown:
    """Everybody of several parts, in order."""

    def views(name: str) -> Views:
        own = [getattr(part, name) for part in parts]
        return Views(
            **{each.name: np.concatenate([getattr(one, each.name) for one in own]) for each in fields(Views)}
        )

    return Shown(
        chosen=np.concatenate([part.chosen for part in parts]),
        first=views("first"),
        turned=views("turned"),
        reposed=views("reposed"),
    )


def ask(
    model: PictureModel,
    z: Float[Tensor, "N Z"],
    mapped: Float[Tensor, "N 25"],
    labels: tuple[Float[Tensor, "n 25"], Float[Tensor, "m J 3"], Float[Tensor, "m b"]],
) -> Views:
    """Pictures of the first n people, at n cameras."""
    camera, pose, betas = labels
    n, (raw, size) = len(camera), (model.render.raw_size, model.render.image_size)
    if n == 0:
        nothing = np.zeros((0, raw, raw))
        return Views(
            image=np.zeros((0, size, size, 3), np.uint8),
            depth=nothing.astype(np.uint16),
            mask=nothing.astype(np.uint8),
        )
    device = next(model.parameters()).device
    asked = to_look_at(*(part[:n].to(device) for part in (z, mapped, camera, pose, betas)))
    with torch.no_grad():
        return in_eight_bits(model.generate(asked).picture)


def in_eight_bits(picture: Picture) -> Views:
    """As files keep it; what lies too far to be told is as far as can be told."""

    def whole(values: Tensor, largest: int) -> np.ndarray:
        return values.float().nan_to_num(0.0).clamp(0, 1).mul(largest).round().cpu().numpy()

    depth = picture.depth.double() / FARTHEST
    return Views(
        image=whole(picture.image.permute(0, 2, 3, 1), 255).astype(np.uint8),
        depth=depth.nan_to_num(0.0).clamp(0, 1).mul(65535).round().cpu().numpy().astype(np.uint16),
        mask=whole(picture.mask, 255).astype(np.uint8),
    )
