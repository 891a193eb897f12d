"""Camera, pose and shape of a person from what was seen of the person.

    Sighting --start--> a turned, standing body --by landmarks--> posed --by the outline too--> Fit

Landmarks in the picture say where joints are across it, landmarks in metres which way limbs lean along the
view, priors what is usual where neither tells. All but the depth's unit is found: one picture does not show
how tall somebody is, so the height is given, or that of the usual person.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch

from avatargen.body.model import Body
from avatargen.errors import InputError
from avatargen.photo.outline import Clothes
from avatargen.photo.priors import Builds, usual_builds
from avatargen.photo.problem import Fit, Problem, known_of
from avatargen.photo.seeing.pose import NAMES
from avatargen.photo.sighting import Sighting
from avatargen.wardrobe.stature import Sizing

STEPS = (150, 120)  # by landmarks alone, and with the outline of clothes


class Fitter:
    """Fits one body to people. `body` has SMPL's joint names, and shape directions that `sizing` knows."""

    def __init__(self, body: Body, sizing: Sizing) -> None:
        self.known, self.sizing = known_of(body, sizing), sizing
        self.figure = self.known.figure

    def fit_together(
        self, sightings: Sequence[Sighting], height: float | None = None, gender: str | None = None
    ) -> tuple[Fit, ...]:
        """One person in several photographs: a pose and a place in each, and the shape of all."""
        return self.solved(self.begun(sightings, height, gender), height is not None)

    def begun(
        self, sightings: Sequence[Sighting], height: float | None, gender: str | None
    ) -> tuple[Problem, ...]:
        """The usual body before each camera, turned as hips and shoulders lie."""
        builds = usual_builds(self.sizing, gender, self.figure.betas)
        builds = builds if height is None else self.as_tall(builds, height)
        return tuple(Problem(self.known, sighting, builds) for sighting in sightings)

    def solved(self, problems: Sequence[Problem], height_known: bool) -> tuple[Fit, ...]:
        """Posed and shaped as the landmarks lie."""
        for problem in problems:
            problem.solve(STEPS[0])
        agree(problems, STEPS[0] // 2)
        return tuple(problem.found(height_known) for problem in problems)

    def refine(
        self, sightings: Sequence[Sighting], fits: Sequence[Fit], gender: str, clothes: Clothes
    ) -> tuple[Fit, ...]:
        """The same fits, once it is known what is worn: the outline is that of clothes and hair."""
        builds = usual_builds(self.sizing, gender, self.figure.betas)
        builds = self.as_tall(builds, fits[0].height) if fits[0].height_known else builds
        problems = [Problem(self.known, sighting, builds) for sighting in sightings]
        for problem, fit in zip(problems, fits, strict=True):
            problem.resume(fit)
            problem.clothes = clothes
            problem.solve(STEPS[1])
        agree(problems, STEPS[1] // 2)
        return tuple(problem.found(fits[0].height_known) for problem in problems)

    def as_tall(self, builds: Builds, height: float) -> Builds:
        """The same builds, all of one height."""
        mean = self.sizing.sized(torch.from_numpy(builds.mean)[None], torch.tensor([[height]]))
        return replace(builds, mean=mean[0].numpy(), height=height)

    def fit(self, sighting: Sighting, height: float | None = None, gender: str | None = None) -> Fit:
        """The person of one photograph."""
        return self.fit_together([sighting], height, gender)[0]


def check_whole(sighting: Sighting) -> None:
    """Raises InputError where shoulders, hips or legs are outside the picture."""
    width, height = sighting.picture.size
    inside = np.all((sighting.pixels >= 0) & (sighting.pixels <= [width, height]), axis=1)
    parts = [name for name in NAMES if name.split("_")[-1] in ("shoulder", "hip", "knee", "ankle")]
    missing = [name.replace("_", " ") for name in parts if not inside[NAMES.index(name)]]
    if missing:
        raise InputError(
            f"photo: of the person in {sighting.picture.name} the {', '.join(missing)} lie outside the "
            "picture; give one of the whole person"
        )


def agree(problems: Sequence[Problem], steps: int) -> None:
    """One shape for all pictures of a person."""
    if len(problems) < 2:
        return
    shape = torch.stack([problem.shape for problem in problems]).mean(dim=0)
    for problem in problems:
        problem.shape, problem.shaped = shape, True
        problem.solve(steps)
