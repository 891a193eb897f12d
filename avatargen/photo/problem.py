"""One fit on its way: what is looked for, how far off it is, and steps to make that less.

Letters: K landmarks, J joints, b betas, N bones.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float64, Int
from torch import Tensor

from avatargen.body.fingers import HANDS, without_fingers
from avatargen.body.model import Body
from avatargen.body.pose import axis_angle_to_matrix
from avatargen.photo.camera import Pinhole
from avatargen.photo.figure import Figure, Posed, matrices, six_of, tensor, turns
from avatargen.photo.outline import Clothes, Outline, Pairs
from avatargen.photo.priors import Builds, PosePrior, pose_prior
from avatargen.photo.seeing.pose import NAMES
from avatargen.photo.sighting import Sighting
from avatargen.wardrobe.stature import Sizing

SEEN = 0.5  # visibility from which a landmark counts as seen
ALONG = 0.94  # cosine of a limb with the view, from which its lean is uncertain
DRAWN_ANEW = 12  # steps after which the outline is
RATE = 0.06
BONES = (  # whose direction the landmarks in metres tell
    *(
        (f"{side}_{a}", f"{side}_{b}")
        for side in ("left", "right")
        for a, b in (
            ("shoulder", "elbow"),
            ("elbow", "wrist"),
            ("hip", "knee"),
            ("knee", "ankle"),
            ("heel", "foot"),
            ("wrist", "index"),
            ("wrist", "pinky"),
            ("shoulder", "hip"),
        )
    ),
    ("right_hip", "left_hip"),
    ("right_shoulder", "left_shoulder"),
    ("right_ear", "left_ear"),
    ("left_ear", "nose"),
    ("right_ear", "nose"),
)
WEIGHTS = {
    "eye": 0.25,
    "ear": 0.4,
    "mouth": 0.3,
    "nose": 0.4,
    "pinky": 0.3,
    "index": 0.3,
    "thumb": 0.2,
    "heel": 0.6,
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """A body in a camera's space. `rotations` are axis times angle against each joint's parent, of all of the
    body's joints; `move` is added after posing, m; `uncertain` names limbs whose lean nobody can tell."""

    betas: Float64[np.ndarray, " b"]
    rotations: Float64[np.ndarray, "J 3"]
    move: Float64[np.ndarray, "3"]
    camera: Pinhole
    height: float
    height_known: bool
    uncertain: tuple[str, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Known:
    """What all fits of a body share."""

    body: Body
    sizing: Sizing
    figure: Figure
    prior: PosePrior
    bones: Int[Tensor, "N 2"]  # landmarks at the ends of `BONES`
    weights: Float[Tensor, " K"]  # of the landmarks


def known_of(body: Body, sizing: Sizing) -> Known:
    """Of a body with SMPL's joint names, and shape directions that `sizing` knows."""
    figure = Figure(without_fingers(body), betas=sizing.builds)
    weights = [next((w for part, w in WEIGHTS.items() if part in name), 1.0) for name in NAMES]
    return Known(
        body=body,
        sizing=sizing,
        figure=figure,
        prior=pose_prior(figure.names),
        bones=torch.tensor([[NAMES.index(name) for name in bone] for bone in BONES]),
        weights=tensor(np.array(weights)),
    )


class Problem:
    """One fit on its way."""

    def __init__(self, known: Known, sighting: Sighting, builds: Builds) -> None:
        self.known, self.figure, self.camera = known, known.figure, sighting.camera
        self.sighting = sighting
        self.mean, self.axes, self.height = tensor(builds.mean), tensor(builds.axes), builds.height
        self.pixels = tensor(sighting.pixels)
        self.visible = tensor(sighting.visibility)
        self.metres = sighting.metres @ self.along_the_view().T
        self.span = self.size()
        self.six, self.move = self.start()
        self.shape, self.shaped = torch.zeros(len(self.mean)), False
        self.clothes: Clothes | None = None
        self.pairs: Pairs | None = None

    def resume(self, fit: Fit) -> None:
        """Go on from a fit."""
        names = self.known.body.joint_names
        rows = [
            names.index(name) if name in names else names.index(HANDS[name]) for name in self.figure.names
        ]
        self.six = six_of(tensor(axis_angle_to_matrix(fit.rotations[rows])))
        self.move = tensor(fit.move)
        self.shape = torch.linalg.solve(self.axes, tensor(fit.betas) - self.mean).clamp(-2.5, 2.5)

    def along_the_view(self) -> np.ndarray:
        """From axes in which the person is straight ahead to the camera's."""
        middle = self.sighting.pixels.mean(axis=0) - [self.camera.width / 2, self.camera.height / 2]
        ray = np.array([middle[0], -middle[1], -self.camera.focal])
        ahead = ray / np.linalg.norm(ray)
        right = np.cross(ahead, [0.0, 1.0, 0.0])
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(right, ahead), -ahead], axis=1)

    def size(self) -> float:
        """How large the person is in the picture, pixels."""
        rows = np.flatnonzero((self.sighting.mask > 0.5).any(axis=1))
        low, high = self.sighting.pixels.min(axis=0), self.sighting.pixels.max(axis=0)
        return float(max(len(rows), (high - low).max(), 1.0))

    def start(self) -> tuple[Tensor, Tensor]:
        """The body turned as hips and shoulders lie, arms as usual, and where it stands."""
        names, figure = (
            [f"{side}_{part}" for side in ("left", "right") for part in ("shoulder", "hip")],
            self.figure,
        )
        rotations = torch.eye(3).repeat(len(figure.names), 1, 1)
        at_rest = figure.pose(self.mean, rotations, torch.zeros(3)).landmarks.numpy()
        rows = [NAMES.index(name) for name in names]
        source, target = (values[rows] - values[rows].mean(axis=0) for values in (at_rest, self.metres))
        u, _, vt = np.linalg.svd(target.T @ source)
        turned = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
        rotations[0] = tensor(turned)
        scale = np.linalg.norm(source) / max(np.linalg.norm(target), 1e-6)
        hips = [NAMES.index(name) for name in ("left_hip", "right_hip")]
        move = place_before(self.camera, scale * self.metres, self.sighting.pixels, self.sighting.visibility)
        move += scale * self.metres[hips].mean(axis=0) - figure.joints[0].numpy()
        six = six_of(rotations)
        for number, name in enumerate(figure.names):
            if "shoulder" in name:
                z = torch.tensor(-0.9 if "left" in name else 0.9)
                six[number] = torch.stack([z.cos(), z.sin(), z * 0, -z.sin(), z.cos(), z * 0])
        return six, tensor(move)

    def solve(self, steps: int) -> None:
        """Adam's steps, ever shorter."""
        free = [each.clone().requires_grad_() for each in (self.six, self.move, self.shape)]
        free[2].requires_grad_(not self.shaped)
        rates = [
            {"params": [each], "lr": RATE * share} for each, share in zip(free, (1, 0.6, 1), strict=True)
        ]
        rates = rates[:2] if self.shaped else rates
        ways = torch.optim.Adam(rates, betas=(0.9, 0.98))
        plan = torch.optim.lr_scheduler.OneCycleLR(
            ways, [rate["lr"] for rate in rates], total_steps=steps + 1, pct_start=0.2, cycle_momentum=False
        )
        outline = None if self.clothes is None else Outline(self.sighting.mask, self.camera)
        for step in range(steps):
            if outline is not None and step % DRAWN_ANEW == 0:
                self.pairs = self.paired(outline, *free)
            ways.zero_grad()
            loss = self.loss(*free)
            loss.backward()
            ways.step()
            plan.step()
        self.six, self.move, self.shape = (each.detach() for each in free)

    @torch.no_grad()
    def paired(self, outline: Outline, six: Tensor, move: Tensor, shape: Tensor) -> Pairs | None:
        """The outline of the clothes as they are now, and where it should be."""
        assert self.clothes is not None
        betas = self.mean + self.axes @ shape
        posed = self.figure.pose(betas, matrices(six), move)
        return outline.pairs(
            self.figure.skin(posed, betas, self.clothes.cloud).double().numpy(), self.clothes
        )

    def loss(self, six: Tensor, move: Tensor, shape: Tensor) -> Tensor:
        """How badly body, pose and camera agree with what was seen."""
        rotations, betas = matrices(six), self.mean + self.axes @ shape
        posed = self.figure.pose(betas, rotations, move)
        places = self.project(posed.landmarks)
        off = torch.linalg.vector_norm(places - self.pixels, dim=1) / self.span
        weights = self.known.weights * self.visible
        across = (weights * robust(off, 0.03)).sum()
        along = self.leaning(posed)
        turned = turns(rotations)[1:]
        prior = self.known.prior
        rest = PosePrior(mean=prior.mean[1:], spread=prior.spread[1:], low=prior.low[1:], high=prior.high[1:])
        loss = (
            (40 if self.pairs is None else 15) * across
            + 1.2 * along
            + 0.012 * rest.unusual(turned)
            + 6 * rest.beyond(turned)
        )
        loss = loss + 0.05 * 0.5 * (shape**2).sum() + self.misfit(betas)
        if self.pairs is not None:
            places = self.project(self.figure.skin(posed, betas, self.pairs.cloud))
            apart = torch.linalg.vector_norm(places - self.pairs.places + 1e-6, dim=1) / self.span
            loss = loss + 2500 * robust(apart, 0.008).mean()
        return loss

    def leaning(self, posed: Posed) -> Tensor:
        """1 less the cosines of bones with what was seen of them, added up."""
        bones = self.known.bones
        seen = tensor(self.metres)[bones[:, 1]] - tensor(self.metres)[bones[:, 0]]
        ours = posed.landmarks[bones[:, 1]] - posed.landmarks[bones[:, 0]]
        weights = torch.minimum(self.visible[bones[:, 0]], self.visible[bones[:, 1]]) + 0.15
        return (weights * (1 - torch.nn.functional.cosine_similarity(seen, ours, dim=1, eps=1e-4))).sum()

    def misfit(self, betas: Tensor) -> Tensor:
        """How far the body is from being as tall as it is said to be."""
        sizing, count = self.known.sizing, len(betas)
        top = sizing.crown[:, :count].float() @ betas + sizing.crown[:, -1].float()
        low = sizing.soles[:, :count].float() @ betas + sizing.soles[:, -1].float()
        return 20 * ((top.max() - low.min() - self.height) / 0.01) ** 2 * 0.05

    def project(self, points: Tensor) -> Tensor:
        """Pixels of points."""
        away = (-points[:, 2]).clamp_min(0.05)
        x = self.camera.width / 2 + self.camera.focal * points[:, 0] / away
        y = self.camera.height / 2 - self.camera.focal * points[:, 1] / away
        return torch.stack([x, y], dim=1)

    def found(self, height_known: bool) -> Fit:
        """The fit, on all of the body's joints."""
        rotations = matrices(self.six)
        turned = turns(rotations).double().numpy()
        names = self.figure.names
        full = np.zeros((self.known.body.joint_count, 3))
        for number, name in enumerate(self.known.body.joint_names):
            if name in names:
                full[number] = turned[names.index(name)]
        betas = (self.mean + self.axes @ self.shape).double().numpy()
        posed = self.figure.pose(tensor(betas), rotations, self.move)
        return Fit(
            betas=betas,
            rotations=full,
            move=self.move.double().numpy(),
            camera=self.camera,
            height=float(self.known.sizing.stature(torch.from_numpy(betas)[None])),
            height_known=height_known,
            uncertain=self.uncertain(posed),
        )

    def uncertain(self, posed: Posed) -> tuple[str, ...]:
        """Limbs that point along the view, and those whose ends are hidden."""
        found, landmarks = [], posed.landmarks.numpy()
        for a, b in BONES[:4] + BONES[8:12]:
            i, j = NAMES.index(a), NAMES.index(b)
            limb, ray = landmarks[j] - landmarks[i], landmarks[i] + landmarks[j]
            cosine = abs(limb @ ray) / max(float(np.linalg.norm(limb) * np.linalg.norm(ray)), 1e-9)
            if cosine > ALONG or self.sighting.visibility[j] < SEEN:
                found.append(b.replace("_", " "))
        return tuple(found)


def robust(off: Tensor, scale: float) -> Tensor:
    """Squares of what is small, in scales, and as it is what is large."""
    square = (off / scale) ** 2
    return scale * (torch.sqrt(1 + square) - 1)


def place_before(
    camera: Pinhole, points: np.ndarray, pixels: np.ndarray, visibility: np.ndarray
) -> Float64[np.ndarray, "3"]:
    """Where points have to be moved for the camera to see them at these pixels, by least squares."""
    u = (pixels - [camera.width / 2, camera.height / 2]) / camera.focal * [1, -1]
    rows, right = [], []
    for axis in (0, 1):
        row = np.zeros((len(points), 3))
        row[:, axis], row[:, 2] = 1, u[:, axis]
        rows.append(row * visibility[:, None])
        right.append(-(points[:, axis] + u[:, axis] * points[:, 2]) * visibility)
    found = np.linalg.lstsq(np.concatenate(rows), np.concatenate(right), rcond=None)[0]
    return np.array([found[0], found[1], min(found[2], -0.3)])
