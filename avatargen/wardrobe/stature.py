"""How tall people are: the wardrobe's people at human statures, carried by the body's shape coefficients.

    z --stature--> metres,    betas --Sizing.sized--> betas of that stature --Sizing.faced--> with a face

A person's stature is that of the body alone, standing straight: crown of the head to the soles. Women are
1.63 m and men 1.76 m tall in the mean, with a standard deviation of 0.07 m, about as adults are.

Letters: B people, b directions of shape, K and L vertices, R numbers in a row. Metres, y up.
"""

import numpy as np
import torch
from jaxtyping import Float, Float64
from torch import Tensor

from avatargen.body.model import Body
from avatargen.wardrobe import MARKS
from avatargen.wardrobe.attributes import People, phenotype
from avatargen.wardrobe.faces import face_betas

WOMEN, MEN = 1.63, 1.76  # m, the means
SPREAD = 0.07  # m, the standard deviation
TAIL = 3.0  # standard deviations from the mean that nobody exceeds
MEAN_PERSON = (WOMEN + MEN) / 2
ENDS = 0.06  # m below the crown and above the soles, where the highest and lowest vertices of all bodies are
SHAPE_RANGE = 2.8  # standard deviations that the phenotype's betas are kept within
STEPS = 6  # of Newton's method; a stature is nearly linear in the betas


def stature(people: People) -> Float64[Tensor, "B 1"]:
    """How tall each person is, metres: the quantile of the person's own height coordinate in the normal
    distribution of the person's sex, cut off at three standard deviations.
    """
    mean = MEN + (WOMEN - MEN) * people.choice("woman").double()
    below = torch.special.ndtr(torch.tensor(-TAIL, dtype=torch.float64))
    share = torch.special.ndtr(people.normal("height").double().clamp(-8, 8))
    return mean + SPREAD * torch.special.ndtri(below + (1 - 2 * below) * share)


class Sizing:
    """Statures of one body's shapes, and the wardrobe's shapes for it. Its shape directions must be those of
    the default body, whose phenotypes are known: builds first, then faces, of which it may have fewer."""

    def __init__(self, body: Body) -> None:
        height = body.v_template[:, 1]
        self.crown = rows(body, height > height.max() - ENDS)
        self.soles = rows(body, height < height.min() + ENDS)
        with np.load(MARKS, allow_pickle=False) as marks:
            self.phenotype_to_betas = torch.from_numpy(marks["phenotype_to_betas"])
            taller = self.phenotype_to_betas[:, list(marks["phenotype_names"]).index("height")].double()
        self.taller = taller / torch.linalg.vector_norm(taller)
        self.builds = len(taller)
        self.faces = max(body.shapedirs.shape[2] - self.builds, 0)

    def stature(self, betas: Float[Tensor, "B b"]) -> Float64[Tensor, "B 1"]:
        """Crown of the head to the soles of each shape, metres."""
        top, bottom = self.ends(betas)
        return top.amax(dim=1, keepdim=True) - bottom.amin(dim=1, keepdim=True)

    def sized(self, betas: Float[Tensor, "B b"], metres: Float[Tensor, "B 1"]) -> Float[Tensor, "B b"]:
        """The same shapes as tall as asked, changed along the direction in which the body's own height
        changes, so that heads, legs and shoulders keep a human's share. Faces stay.
        """
        taller = torch.zeros(betas.shape[1], dtype=torch.float64)
        taller[: self.builds] = self.taller
        found = betas.double()
        for _ in range(STEPS):
            top, bottom = self.ends(found)
            high, low = top.argmax(dim=1), bottom.argmin(dim=1)
            rows = self.crown[high, : len(taller)] - self.soles[low, : len(taller)]
            slope = rows @ taller  # m, positive: it is height
            short = metres - (top.amax(dim=1, keepdim=True) - bottom.amin(dim=1, keepdim=True))
            found = found + short / slope[:, None] * taller
        return found.to(betas.dtype)

    def betas(self, people: People) -> Float[Tensor, "B b"]:
        """The people's shapes: sex, age and build by the phenotype, their statures and their faces."""
        ones = torch.ones(len(people.z), 1)
        drawn = torch.cat([phenotype(people), ones], dim=1) @ self.phenotype_to_betas.T
        return self.faced(self.sized(drawn.clamp(-SHAPE_RANGE, SHAPE_RANGE), stature(people)), people)

    def faced(self, betas: Float[Tensor, "B b"], people: People, share: float = 1.0) -> Float[Tensor, "B _"]:
        """The same builds with a share of the people's own faces."""
        faces = share * face_betas(people)[:, : self.faces].to(betas)
        return torch.cat([betas[:, : self.builds], faces], dim=1)

    def ends(self, betas: Float[Tensor, "B b"]) -> tuple[Float64[Tensor, "B K"], Float64[Tensor, "B L"]]:
        """Heights of the vertices at the crown and at the soles."""
        numbers, count = betas.double(), betas.shape[1]
        top, bottom = (numbers @ end[:, :count].T + end[:, -1] for end in (self.crown, self.soles))
        return top, bottom


def rows(body: Body, chosen: np.ndarray) -> Float64[Tensor, "K R"]:
    """The chosen vertices' heights as linear functions of the betas; the constant comes last."""
    heights = np.column_stack([body.shapedirs[chosen, 1], body.v_template[chosen, 1]])
    return torch.from_numpy(heights.astype(np.float64))
