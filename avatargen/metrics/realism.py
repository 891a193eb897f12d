"""How far pictures of learned people are from the wardrobe's own as sets, by features of networks: the first
half of the people as learned against the second half as the wardrobe has them, beside the wardrobe's own
first half against the same. Of the same people in both, so what differs is who drew them.

Letters: N people, H and L height and length of a picture in pixels, S pixels a side, F features.
"""

from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor
from torch.nn import functional

from avatargen.metrics.features import all_features
from avatargen.metrics.judges import FeatureJudge
from avatargen.metrics.likeness import GREY, before_grey
from avatargen.metrics.report import Number

SIDE = 224  # pixels
FEWEST = 4  # people, two in a half


def realism(
    judge: FeatureJudge,
    learned: Sequence[UInt8[np.ndarray, "H L 4"]],
    truth: Sequence[UInt8[np.ndarray, "H L 4"]],
) -> dict[str, dict[str, Number | None]]:
    """By distance how far the learned are from the wardrobe's other people, and how far its own are. Both of
    the same seeds in the same order, at least FEWEST; None where there are too few to tell an error."""
    half = len(truth) // 2
    made = all_features(judge.network, torch.stack([squared(each) for each in learned[:half]]))
    own = all_features(judge.network, torch.stack([squared(each) for each in truth]))
    found, beside = judge.numbers(made, own[half:]), judge.numbers(own[:half], own[half:])
    return {name: {"learned": found[name], "wardrobe": beside[name]} for name in found}


def squared(picture: UInt8[np.ndarray, "H L 4"]) -> Float[Tensor, "3 S S"]:
    """The picture on a grey square."""
    colors = torch.from_numpy(before_grey(picture).astype(np.float32)).permute(2, 0, 1)
    height, length = colors.shape[1:]
    across, down = max(height - length, 0), max(length - height, 0)
    edges = (across // 2, across - across // 2, down // 2, down - down // 2)
    whole = functional.pad(colors, edges, value=GREY)[None]
    return functional.interpolate(whole, size=(SIDE, SIDE), mode="area")[0]
