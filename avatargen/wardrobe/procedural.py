"""The procedural wardrobe's own people as avatars: the truth that the shipped generator learned.

ProceduralWardrobe(body).sample(seed) -> an avatar: distance and colour at canonical points
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float32
from torch import Tensor

from avatargen import __version__
from avatargen.avatar_info import AvatarInfo
from avatargen.body.model import CanonicalBody
from avatargen.errors import InputError
from avatargen.wardrobe import MARKS
from avatargen.wardrobe.attributes import LATENT_SIZE, People
from avatargen.wardrobe.chart import Chart
from avatargen.wardrobe.describe import describe
from avatargen.wardrobe.layers import Layer
from avatargen.wardrobe.person import dress_up
from avatargen.wardrobe.stature import Sizing, stature

CHUNK = 1 << 15  # points at once
BOUNDS_MARGIN = 0.16  # m around the body: hair, skirts and soles


@dataclass(frozen=True, kw_only=True, eq=False)
class ProceduralPerson:
    """One person as fields of canonical points, in the form of an `Avatar`."""

    people: People
    chart: Chart
    body: CanonicalBody
    betas: Float32[np.ndarray, " b"]
    bounds: Float32[np.ndarray, "2 3"]
    info: AvatarInfo

    @property
    def seed(self) -> int:
        return self.info.seed

    def dressed(self, points: Float[Tensor, "n 3"]) -> Layer:
        """Distance and colour of some points."""
        return dress_up(self.chart.places(points.cpu().numpy())[None], self.people)

    @torch.inference_mode()
    def sdf(self, points: Float[Tensor, "N 3"]) -> Float[Tensor, " N"]:
        """Signed distance to the clothed surface, m, negative inside."""
        return torch.cat([self.dressed(part).sdf[0].float() for part in points.split(CHUNK)])

    @torch.inference_mode()
    def color(self, points: Float[Tensor, "N 3"]) -> Float[Tensor, "N 3"]:
        """Colour at points on or near the surface, sRGB in 0..1."""
        parts = [self.dressed(part).color[0].float() for part in points.split(CHUNK)]
        return torch.cat(parts).clamp(0, 1)


class ProceduralWardrobe:
    """The procedural wardrobe on a canonical body: people by seed, as the generator has them.

    Raises:
        InputError: the body is not the one that the wardrobe's measures belong to.
    """

    def __init__(self, body: CanonicalBody) -> None:
        with np.load(MARKS, allow_pickle=False) as file:
            count = len(file["eye_vertices"])
        if len(body.vertices) != count:
            raise InputError(
                f"wardrobe: the body has {len(body.vertices)} vertices, wanted the {count} of the one that "
                "comes with the package; leave --body out"
            )
        self.body, self.chart, self.sizing = body, Chart(body, MARKS), Sizing(body.source)

    def sample(self, seed: int) -> ProceduralPerson:
        """The person of a seed: the latent is the generator's."""
        people = People(torch.randn(1, LATENT_SIZE, generator=torch.Generator().manual_seed(seed)))
        height = float(stature(people))
        low, high = self.body.vertices.min(axis=0), self.body.vertices.max(axis=0)
        return ProceduralPerson(
            people=people,
            chart=self.chart,
            body=self.body,
            betas=self.sizing.betas(people)[0].numpy(),
            bounds=np.stack([low - BOUNDS_MARGIN, high + BOUNDS_MARGIN]).astype(np.float32),
            info=AvatarInfo(
                seed=seed,
                weights_hash="wardrobe",
                version=__version__,
                licence="CC0-1.0",
                height_m=height,
                attributes=describe(people, height),
            ),
        )
