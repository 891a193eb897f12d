"""Pose-guided canonical mapping (section 3.3): points near a posed body back to the canonical space.

A point takes the affine map of its nearest posed body vertices, blended by inverse distance. A vertex's map
undoes its skinning, swaps the blend shapes that moved it for the canonical ones, and applies the
canonical pose's skinning: posed vertices return exactly to the canonical ones.

Letters: N points, K nearest vertices, V vertices. Metres.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float32
from scipy.spatial import KDTree
from torch import Tensor

from avatargen.body.model import PosedBody, pose_canonically
from avatargen.body.skinning import blend, invert_blend
from avatargen.errors import InputError

AT_VERTEX = 1e-9  # metres; keeps inverse distances finite


@dataclass(frozen=True, kw_only=True, eq=False)
class CanonicalMap:
    """Canonical <- posed for one posed body: an affine map per vertex, and a tree to find the nearest."""

    tree: KDTree
    T_canonical_posed: Float32[np.ndarray, "V 3 4"]

    def __call__(
        self, points: Float[Tensor, "N 3"], nearest: int = 1
    ) -> tuple[Float[Tensor, "N 3"], Float[Tensor, " N"]]:
        """Canonical points, and the distance from each point to its nearest posed vertex.

        Differentiable in the points, with the choice and the blend of vertices held fixed.

        Raises:
            InputError: `nearest` is not 1 to 4.
        """
        if not 1 <= nearest <= 4:
            raise InputError(f"canonical map: nearest = {nearest}; choose 1 to 4 body vertices")
        found, index = self.tree.query(points.detach().cpu().numpy(), k=range(1, nearest + 1))
        weights = 1 / (found + AT_VERTEX)
        weights /= weights.sum(axis=1, keepdims=True)
        blended = np.einsum("nk,nkij->nij", weights, self.T_canonical_posed[index])
        maps = torch.as_tensor(blended, dtype=points.dtype, device=points.device)
        canonical = torch.einsum("nij,nj->ni", maps[:, :, :3], points) + maps[:, :, 3]
        return canonical, torch.as_tensor(found[:, 0], dtype=points.dtype, device=points.device)


def canonical_map(posed: PosedBody, canonical: PosedBody | None = None) -> CanonicalMap:
    """The map that takes a posed person to the canonical pose and shape of the same body.

    `canonical` is `pose_canonically` of that body, for those who have it at hand.
    """
    body = posed.shaped.body
    canonical = canonical or pose_canonically(body)
    T_rest_posed = invert_blend(body.weights, posed.T_posed_rest)
    T_canonical_rest = blend(body.weights, canonical.T_posed_rest)
    shift = (canonical.shaped.vertices + canonical.offsets) - (posed.shaped.vertices + posed.offsets)
    T_rest_posed[:, :3, 3] += shift
    maps = T_canonical_rest @ T_rest_posed
    return CanonicalMap(tree=KDTree(posed.vertices), T_canonical_posed=maps[:, :3].astype(np.float32))
