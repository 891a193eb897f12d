"""How far people's surfaces stand before their bare bodies: hair and clothes, as the camera sees them.

Depth at a label compares two people who wear different things, so the bare body, which lies between them,
does better than a right person would. Here the whole distribution is compared: of the distances by which
generated surfaces stand before the bare body, and of those by which real ones do. Right people reach zero.

Letters: N pictures, r raw size, S size of a data set's depth. Metres; results in millimetres.
"""

import numpy as np
import torch
from jaxtyping import Float, Float64
from scipy.stats import wasserstein_distance
from torch import Tensor
from torch.nn import functional as F

from avatargen.body.model import Body, pose, shape
from avatargen.data.dataset import Pictures
from avatargen.data.units import DEPTH_UNIT
from avatargen.generator.camera import camera_of_vector
from avatargen.metrics.frechet import BLOCKS

SOLID = 0.9  # coverage of a pixel that counts, of generated people
COVERED = 0.99  # of real ones

Offsets = list[Float64[np.ndarray, " _"]]  # a picture each, millimetres toward the camera


def true_depth(data: Pictures, index: int, size: int) -> tuple[Float[Tensor, "r r"], Float[Tensor, "r r"]]:
    """Depth and coverage of a picture, averaged down."""
    true = data.depth(index)[None, None]
    cover = F.interpolate((true > 0).float(), size=(size, size), mode="area")
    mean = F.interpolate(true, size=(size, size), mode="area") / cover.clamp_min(1e-6)
    return mean[0, 0], cover[0, 0]


def bare_depths(
    data: Pictures, body: Body, indices: Tensor, size: int
) -> tuple[Float[Tensor, "N r r"], Float[Tensor, "N r r"]]:
    """Depth and coverage of the bare body at labels."""
    from avatargen.data.raycast import Light, shoot

    light = Light(ambient=1.0, direction=np.array([0.0, 1.0, 0.0]), strength=0.0)
    depths, masks = [], []
    for i in indices:
        camera, turns, betas = data.row(i[None])
        posed = pose(body, shape(body, betas[0].numpy()), turns[0].numpy())
        black = np.zeros(posed.vertices.shape, dtype=np.float32)
        shot = shoot(posed.vertices, body.faces, black, camera_of_vector(camera), light, size)
        depths.append(torch.from_numpy(shot.depth.astype(np.float32)) * DEPTH_UNIT)
        masks.append(torch.from_numpy(shot.mask.astype(np.float32)) / 255)
    return torch.stack(depths), torch.stack(masks)


def offsets(
    depth: Float[Tensor, "N r r"], solid: Tensor, bare: tuple[Float[Tensor, "N r r"], Float[Tensor, "N r r"]]
) -> Offsets:
    """By how much surfaces stand before the bare body, where both are seen."""
    both = solid & (bare[1] > COVERED)
    return [
        1000 * (body - seen)[where].double().numpy()
        for body, seen, where in zip(bare[0], depth, both, strict=True)
    ]


def clothes_error(a: Offsets, b: Offsets) -> tuple[float, float]:
    """Wasserstein distance between all offsets of two sets of pictures, and its standard error (jackknife).

    NaN where one holds nothing.
    """
    parts = [distance(without(a, i), without(b, i)) for i in range(BLOCKS)]
    return distance(a, b), float(np.sqrt((BLOCKS - 1) * np.var(parts)))


def without(rows: Offsets, block: int) -> Offsets:
    """All but every tenth picture, from that one on."""
    return [row for i, row in enumerate(rows) if i % BLOCKS != block]


def distance(a: Offsets, b: Offsets) -> float:
    first, second = np.concatenate([*a, []]), np.concatenate([*b, []])
    if not len(first) or not len(second):
        return float("nan")
    return float(wasserstein_distance(first, second))
