"""By what pictures are judged: networks whose features are compared, and estimators of joints."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from avatargen.body.model import Body
from avatargen.data.dataset import Pictures
from avatargen.extras import is_installed
from avatargen.metrics import pretrained
from avatargen.metrics.features import Features, load_inception, random_features
from avatargen.metrics.frechet import distance_error, frechet_distance
from avatargen.metrics.joints import JointJudge, ridge_judge
from avatargen.metrics.kernel_distance import kernel_distance
from avatargen.metrics.pose_network import pose_network
from avatargen.metrics.report import Number, distance

MOST_REFERENCES = 2000


@dataclass(frozen=True, kw_only=True, eq=False)
class FeatureJudge:
    """A network, and what distances by its features are called."""

    network: Features
    frechet: str
    kernel: str

    def numbers(
        self, made: Float[np.ndarray, "N F"], real: Float[np.ndarray, "M F"]
    ) -> dict[str, Number | None]:
        """Both distances between two sets of features."""
        kernel = kernel_distance(made, real)
        return {
            self.frechet: distance(frechet_distance(made, real), distance_error(made, real), len(made)),
            self.kernel: distance(*kernel, len(made), least=-np.inf),
        }


BUILT_IN = FeatureJudge(network=random_features, frechet="frechet distance", kernel="kernel distance")


def feature_judges(inception: Path | None = None) -> tuple[FeatureJudge, ...]:
    """The built-in features, the pretrained ones where they are installed, and the user's Inception."""
    found = [BUILT_IN]
    if is_installed(*pretrained.NEEDED):
        found.append(
            FeatureJudge(
                network=pretrained.dino_features,
                frechet=f"frechet distance, {pretrained.NAME}",
                kernel=f"kernel distance, {pretrained.NAME}",
            )
        )
    if inception is not None:
        found.append(FeatureJudge(network=load_inception(inception), frechet="FID", kernel="KID"))
    return tuple(found)


@dataclass(frozen=True, kw_only=True, eq=False)
class Judges:
    """All that pictures are judged by."""

    features: tuple[FeatureJudge, ...]
    joints: JointJudge


def judges_for(body: Body, reference: Pictures, inception: Path | None = None) -> Judges:
    """What is at hand: without a pose network, joints are estimated by regression on the reference."""
    joints = pose_network(body.joint_names) or ridge_judge(reference, body, MOST_REFERENCES)
    return Judges(features=feature_judges(inception), joints=joints)
