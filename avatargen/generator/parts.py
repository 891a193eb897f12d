"""Which part of the body a canonical point belongs to: head, torso, arms, hips, legs, feet.

A part is a few places of the body. A point belongs to the part whose places are nearest, and near a border
to two or three: its shares sum to 1, change smoothly, and are exactly 0 in parts it is far from, whose
networks then need not be asked. Shares depend on the point alone, so nothing jumps where the closest body
point does.

Letters: N points, P parts. Metres.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from avatargen.generator.layers import may_branch

Place = tuple[float, float, float]
Parts = tuple[tuple[Place, ...], ...]

SPREAD = 0.078  # metres: between places s apart a border is about SPREAD^2 / s wide
LEAST = 0.1  # weight that counts as none

# joints whose places make the parts, in SMPL's names
JOINTS_OF_PARTS = (
    ("head",),
    ("left_collar", "right_collar", "left_shoulder", "right_shoulder", "spine3", "spine2"),
    ("left_elbow", "right_elbow", "left_wrist", "right_wrist"),
    ("pelvis", "left_hip", "right_hip"),
    ("left_knee", "right_knee"),
    ("left_ankle", "right_ankle", "left_foot", "right_foot"),
)


class Shares(nn.Module):
    """Points to their shares in each part: a softmax over the squared distances to all places, in which the
    point's own square cancels.
    """

    slope: Tensor
    level: Tensor
    owner: Tensor

    def __init__(self, parts: Parts) -> None:
        super().__init__()
        places = torch.tensor([place for part in parts for place in part])
        owner = torch.tensor([number for number, part in enumerate(parts) for _ in part])
        self.register_buffer("slope", 2 * places.T / SPREAD**2, persistent=False)  # 3 places
        self.register_buffer("level", -places.square().sum(dim=1) / SPREAD**2, persistent=False)
        self.register_buffer("owner", nn.functional.one_hot(owner, len(parts)).float(), persistent=False)

    def forward(self, points: Float[Tensor, "*batch N 3"]) -> Float[Tensor, "*batch N P"]:
        """Shares of every point, each 0..1 and 1 in sum."""
        # places before points, so that sums over them run through memory
        if may_branch(points):
            nearness = self.slope.T @ points.mT + self.level[:, None]
        else:  # number by number, for products of matrices may be rounded to ten bits
            nearness = self.level[:, None]
            for slope, along in zip(self.slope, points.unbind(dim=-1), strict=True):
                nearness = torch.addcmul(nearness, slope[:, None], along[..., None, :])
        weight = self.owner.T @ torch.softmax(nearness, dim=-2)
        kept = (weight - LEAST).clamp_min(0).square()
        return (kept / kept.sum(dim=-2, keepdim=True)).mT  # with up to nine parts one has more than LEAST
