"""Where joints are in a picture by a real pose network: the one that reads photographs (`avatargen.photo`).

It is there once `avatargen photo-models` has been run and the extra `photo` is installed. The person fills
the picture, so nobody is looked for. What it takes for a shoulder or a hip is not the joint to the last
centimetre: its error on real pictures is what a model's is read against. In small pictures it takes some
backs for fronts, so the sides are not told apart.

Letters: N pictures, J joints of the body, K those that the network knows, S pixels a side.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float64, UInt8
from torch import Tensor

from avatargen.data.mirror import partners
from avatargen.extras import is_installed
from avatargen.metrics.joints import JointJudge
from avatargen.photo.models import LANDMARKS, model_path, models_folder
from avatargen.photo.seeing.crop import Square
from avatargen.photo.seeing.network import FileNetwork, Network
from avatargen.photo.seeing.pose import NAMES, find_landmarks

POSE = "pose (% of the picture)"
LANDMARK_OF = {
    f"{side}_{joint}": f"{side}_{landmark}"
    for side in ("left", "right")
    for joint, landmark in (
        *(("shoulder", "shoulder"), ("elbow", "elbow"), ("wrist", "wrist")),
        *(("hip", "hip"), ("knee", "knee"), ("ankle", "ankle")),
    )
}


@dataclass(frozen=True, kw_only=True, eq=False)
class LandmarkEstimator:
    """Places of some landmarks, 0..1 from the top left."""

    network: Network
    landmarks: tuple[int, ...]

    def __call__(self, images: Float[Tensor, "N 3 S S"]) -> Float64[np.ndarray, "N K 2"]:
        pixels = (images.clamp(0, 1) * 255).round().byte().permute(0, 2, 3, 1).cpu().numpy()
        return np.stack([self.one(each) for each in pixels])

    def one(self, pixels: UInt8[np.ndarray, "S S 3"]) -> Float64[np.ndarray, "K 2"]:
        side = len(pixels)
        whole = Square(x=side / 2, y=side / 2, side=float(side))
        return find_landmarks(self.network, pixels, whole).pixels[list(self.landmarks)] / side


def pose_network(joint_names: tuple[str, ...]) -> JointJudge | None:
    """The network as a judge of a body's joints; none where its file or runtime is not there.

    Raises:
        InputError: the file is there and damaged.
    """
    if not is_installed("ai_edge_litert") or not (models_folder() / LANDMARKS.name).exists():
        return None
    known = [name for name in joint_names if name in LANDMARK_OF]
    return JointJudge(
        name=POSE,
        partner=partners(tuple(known)),
        which=np.array([joint_names.index(name) for name in known], dtype=np.int64),
        estimate=LandmarkEstimator(
            network=FileNetwork(model_path(LANDMARKS)),
            landmarks=tuple(NAMES.index(LANDMARK_OF[name]) for name in known),
        ),
    )
