"""What lies beneath something moves with it: a vertex that another surface hides takes weights and shape from
the closest point there, so that neither comes through the other in any pose. What hides it is faded in from
its edges on, where both are seen.

Linear blend skinning moves a point and its neighbour by the same matrix where their weights agree, so what is
inside stays inside. Letters: V vertices, K of the surface above, B of the body, C channels.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float64, Int64

from assets.mesh.surface import Surface
from assets.skin.attach import Carrier
from assets.skin.skin import Skin, limit_influences
from avatargen.mesh.closest import ClosestPoints


@dataclass(frozen=True, kw_only=True)
class Above:
    """A skinned surface that hides vertices of another one, and by how much each: 0 not at all, 1 it does."""

    surface: Surface
    skin: Skin
    attachment: Carrier
    share: Float[np.ndarray, " V"]


@dataclass(frozen=True, kw_only=True)
class Following:
    """Values given on the body, for a surface that follows another one."""

    own: Carrier
    above: Carrier
    share: Float64[np.ndarray, "V 1"]
    corners: Int64[np.ndarray, "V 3"]  # of the closest face above
    barycentric: Float64[np.ndarray, "V 3"]

    def carry(self, values: Float[np.ndarray, "B C"]) -> Float64[np.ndarray, "V C"]:
        """Its own where nothing hides it, elsewhere those of the closest point above."""
        return self.mixed(self.own.carry(values), self.above.carry(values))

    def mixed(
        self, own: Float64[np.ndarray, "V C"], above: Float64[np.ndarray, "K C"]
    ) -> Float64[np.ndarray, "V C"]:
        """Values at the vertices, of which there are its own and those of the vertices above."""
        there = np.einsum("vk,vkc->vc", self.barycentric, above[self.corners])
        return own + self.share * (there - own)


def follow(
    surface: Surface, skin: Skin, attachment: Carrier, above: list[Above], joint_count: int
) -> tuple[Skin, Carrier]:
    """Weights and attachment of a surface beneath others; of several that hide a vertex the last counts."""
    weights = skin.dense(joint_count)
    for over in above:
        _, face, barycentric = ClosestPoints(over.surface.vertices, over.surface.faces).query(
            surface.vertices
        )
        following = Following(
            own=attachment,
            above=over.attachment,
            share=np.asarray(over.share, dtype=np.float64)[:, None],
            corners=over.surface.faces[face],
            barycentric=np.asarray(barycentric, dtype=np.float64),
        )
        weights = following.mixed(weights, over.skin.dense(joint_count))
        attachment = following
    return limit_influences(weights), attachment
