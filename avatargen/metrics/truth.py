"""What a model's pictures are held against: the real pictures at the same labels, and others. Gathered once
for all models that are asked for the same labels.

Letters: N pictures, M others, F features, K joints, r pixels a side of depth.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float64, Int64
from torch import Tensor

from avatargen.body.model import Body
from avatargen.data.dataset import Pictures
from avatargen.metrics.clothes import COVERED, Offsets, bare_depths, clothes_error, offsets, true_depth
from avatargen.metrics.features import all_features
from avatargen.metrics.joints import load_images, spread_over, true_joints
from avatargen.metrics.judges import Judges
from avatargen.metrics.report import Number, distance, mean, measured

CLOTHES = "clothes (mm)"


@dataclass(frozen=True, kw_only=True, eq=False)
class Depths:
    """True depth at labels, of dressed people and of their bare bodies; coverage beside each."""

    depth: Float[Tensor, "N r r"]
    cover: Float[Tensor, "N r r"]
    bare: tuple[Float[Tensor, "N r r"], Float[Tensor, "N r r"]]

    def offsets(self) -> Offsets:
        """How far dressed people stand before their bare bodies."""
        return offsets(self.depth, self.cover > COVERED, self.bare)


@dataclass(frozen=True, kw_only=True, eq=False)
class Truth:
    """The real pictures at the chosen labels, by what judges see in them; `floors` are the metrics of other
    real pictures, or of these."""

    data: Pictures
    body: Body
    chosen: Int64[np.ndarray, " N"]
    features: tuple[Float[np.ndarray, "N F"], ...]  # by each judge
    joints: Float64[np.ndarray, "N K 2"]
    depths: Depths | None  # none: the data set has none
    floors: dict[str, Number]

    def upto(self, count: int) -> "Truth":
        """The first labels alone; floors stay those of all."""
        depths = self.depths
        if depths is not None:
            bare = (depths.bare[0][:count], depths.bare[1][:count])
            depths = Depths(depth=depths.depth[:count], cover=depths.cover[:count], bare=bare)
        return Truth(
            data=self.data,
            body=self.body,
            chosen=self.chosen[:count],
            features=tuple(each[:count] for each in self.features),
            joints=self.joints[:count],
            depths=depths,
            floors=self.floors,
        )


def gather_truth(
    data: Pictures,
    reference: Pictures,
    body: Body,
    chosen: Int64[np.ndarray, " N"],
    judges: Judges,
    raw_size: int,
) -> Truth:
    """Look at the real pictures at the chosen labels, and at as many of the reference."""
    images, spread = load_images(data, chosen), spread_over(reference, len(chosen))
    others = load_images(reference, spread)
    own = tuple(all_features(judge.network, images) for judge in judges.features)
    joints = true_joints(data, body, chosen)[:, judges.joints.which]
    floors: dict[str, Number | None] = {}
    for judge, features in zip(judges.features, own, strict=True):
        floors |= judge.numbers(all_features(judge.network, others), features)
    floors[judges.joints.name] = mean(judges.joints.errors(images, joints))
    depths = look_at_depths(data, body, chosen, raw_size)
    beside = look_at_depths(reference, body, spread, raw_size)
    if depths is not None and beside is not None:
        floors[CLOTHES] = distance(*clothes_error(beside.offsets(), depths.offsets()), len(chosen))
    return Truth(
        data=data,
        body=body,
        chosen=chosen,
        features=own,
        joints=joints,
        depths=depths,
        floors=measured(floors),
    )


def look_at_depths(data: Pictures, body: Body, chosen: Int64[np.ndarray, " N"], size: int) -> Depths | None:
    """True depths where the data set has any."""
    if not data.holds("depth"):
        return None
    seen = [true_depth(data, int(i), size) for i in chosen]
    return Depths(
        depth=torch.stack([depth for depth, _ in seen]),
        cover=torch.stack([cover for _, cover in seen]),
        bare=bare_depths(data, body, torch.from_numpy(chosen), size),
    )
