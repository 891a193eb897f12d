"""What a latent says about a person: the fixed Gaussian coding of the wardrobe's attributes.

Every attribute owns one coordinate of z ~ N(0, I). A choice is the sign of its coordinate; a measure is
Phi(z) in 0..1; a colour owns three coordinates: lightness by Phi and two opponent axes. So z is plain
Gaussian noise to the generator, and every z is a person.

Letters: B people, Z latent size. A column is [B 1], so that it broadcasts over N points.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from avatargen.errors import InputError

CHOICES = [
    "woman",
    "hair_a",
    "hair_b",
    "hair_c",
    "bottom_a",
    "bottom_b",
    "outer_a",
    "outer_b",
    "collar_a",
    "collar_b",
    "pattern_a",
    "pattern_b",
    "pattern_c",
    "shoe_a",
    "shoe_b",
    "beard_a",
    "beard_b",
    "tucked",
    "belt",
    "fringe",
    "makeup",
    "hat_a",
    "hat_b",
    "hat_c",
]
MEASURES = [
    "skin_light",
    "skin_warm",
    "age",
    "muscle",
    "weight",
    "height",
    "african",
    "asian",
    "cupsize",
    "eye_hue",
    "eye_light",
    "brow",
    "lip",
    "hairline",
    "hair_length",
    "sleeve",
    "sleeve_width",
    "hem",
    "neckline",
    "ease",
    "thickness",
    "leg_length",
    "leg_width",
    "flare",
    "skirt_length",
    "collar_height",
    "boldness",
    "creased",
    "wavy",
    "outer_length",
    "wear",
]
COLOURS = ["hair", "top", "second", "bottom", "outer", "shoe"]
FACE = ["nose", "nose_width", "jaw", "chin", "cheek"]  # measures
FACE_SHAPE_ALONE = ["eye_size", "head"]  # of the body's shape, not of the canonical field
LATENT_SIZE = 80
CODING = "wardrobe"  # what a checkpoint's notes call a z that is read like this

_SINGLE = {name: i for i, name in enumerate((*CHOICES, *MEASURES))}
_COLOURED = {name: len(_SINGLE) + 3 * i for i, name in enumerate(COLOURS)}
_FACES = {name: len(_SINGLE) + 3 * len(COLOURS) + i for i, name in enumerate((*FACE, *FACE_SHAPE_ALONE))}
_COORDINATE = _SINGLE | _COLOURED | _FACES

# opponent axes (reddish-greenish, yellowish-bluish) in display RGB, of equal weight
_OPPONENT = torch.tensor([[0.75, -0.45, -0.05], [0.45, 0.25, -0.80]])


def coordinate(name: str) -> int:
    """Where in z an attribute's coordinate is; the first of a colour's three."""
    return _COORDINATE[name]


@dataclass(frozen=True)
class People:
    """A batch of people as the coding reads them off z."""

    z: Float[Tensor, "B Z"]

    def __post_init__(self) -> None:
        if self.z.ndim != 2 or self.z.shape[1] != LATENT_SIZE:
            raise InputError(
                f"wardrobe: z has shape {tuple(self.z.shape)}; the coding reads [B, {LATENT_SIZE}]"
            )

    def normal(self, name: str) -> Float[Tensor, "B 1"]:
        """The attribute's own coordinate, N(0, 1)."""
        i = _COORDINATE[name]
        return self.z[:, i : i + 1]

    def choice(self, name: str) -> Float[Tensor, "B 1"]:
        """1 where the coordinate is positive, else 0."""
        return (self.normal(name) > 0).to(self.z.dtype)

    def choosing(self, rows: slice, *names: str) -> "People":
        """The same people, those of the rows with these choices made: a draw under that condition."""
        z = self.z.clone()
        for name in names:
            z[rows, _COORDINATE[name]] = z[rows, _COORDINATE[name]].abs()
        return People(z)

    def measure(self, name: str) -> Float[Tensor, "B 1"]:
        """Phi(z): uniform in 0..1."""
        return 0.5 * (1 + torch.erf(self.normal(name) / 2**0.5))

    def between(self, name: str, low: float, high: float) -> Float[Tensor, "B 1"]:
        """Uniform in low..high."""
        return low + (high - low) * self.measure(name)

    def kind(self, *bits: str) -> Float[Tensor, "B 1"]:
        """Whole number read from choices, first bit lowest."""
        return sum((self.choice(bit) * 2**i for i, bit in enumerate(bits)), torch.zeros_like(self.z[:, :1]))

    def colour(
        self, name: str, low: float = 0.06, high: float = 0.92, chroma: float = 0.16
    ) -> Float[Tensor, "B 1 3"]:
        """A colour of random lightness and, half the time hardly any, hue; smooth in its three
        coordinates.
        """
        lightness = self.between(name, low, high)
        i = _COORDINATE[name]
        axes = torch.tanh(self.z[:, i + 1 : i + 3] * 0.8) * chroma
        return (lightness + axes @ _OPPONENT.to(self.z)).clamp(0.02, 0.97)[:, None]


def phenotype(people: People) -> Float[Tensor, "B 9"]:
    """anny's phenotype of every person, in the order of `marks.npz`: sets the betas, not the
    canonical field.
    """
    woman = people.choice("woman")
    columns = {
        "gender": 0.06 + 0.88 * woman,
        "age": people.between("age", 0.62, 0.93),
        "muscle": people.between("muscle", 0.3, 0.85) - 0.12 * woman,
        "weight": (0.40 + 0.13 * people.normal("weight")).clamp(0.15, 0.95),
        "height": torch.full_like(woman, 0.35),  # a usual one: `stature.py` sizes people afterwards
        "proportions": torch.full_like(woman, 0.8),
        "african": people.measure("african") * 0.8,
        "asian": people.measure("asian") * (1 - people.measure("african")) * 0.8,
        "cupsize": people.between("cupsize", 0.3, 0.75),
    }
    return torch.cat(list(columns.values()), dim=1)
