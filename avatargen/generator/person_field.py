"""One person's field: the generator's networks with that person's layers and planes, asked at points with the
body's closest points there.

On a processor its inputs are gathered by compiled code (`avatargen.generator.gathering`); elsewhere, or where
that is left out, all is torch's. Both agree to rounding.

Letters: N points, D size of w, C plane channels, T texels.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch
from jaxtyping import Float, Float32
from torch import Tensor

from avatargen.body.distance import BodyDistance, BodyHit
from avatargen.generator.decoder import PartLayers, body_points
from avatargen.generator.gathering import Gathering, Rows, blend
from avatargen.generator.generator import AvatarGenerator
from avatargen.generator.planes import lookup_bilinear


@dataclass(frozen=True, kw_only=True, eq=False)
class PersonField:
    """One person's planes, cached as a table, and layers, on the body that all people share."""

    generator: AvatarGenerator
    distance: BodyDistance
    faces: Tensor  # of the body, F 3
    gathering: Gathering | None
    w: Float[Tensor, "1 D"]
    table: Float[Tensor, "T C"]
    layers: tuple[PartLayers, ...]
    offset: Float[Tensor, "3"]  # metres from a point to where the generator's own body has it

    @property
    def device(self) -> torch.device:
        return self.w.device

    @torch.inference_mode()
    def sdf(self, points: Float32[np.ndarray, "N 3"]) -> Float32[np.ndarray, " N"]:
        """Signed distance at canonical points, metres."""
        hit = self.distance.query_in_order(points)
        shape = torch.from_numpy(self.ask(points, hit, "shape"))
        distance = torch.from_numpy(hit.distance)
        return self.generator.decoder.signed_distance(shape[None], distance[None])[0].numpy()

    @torch.inference_mode()
    def color(self, points: Float32[np.ndarray, "N 3"]) -> Float32[np.ndarray, "N 3"]:
        """Colour at canonical points, sRGB, a little beyond 0..1."""
        return self.ask(points, self.distance.query_in_order(points), "color")

    def ask(
        self, points: Float32[np.ndarray, "N 3"], hit: BodyHit, heads: Literal["shape", "color"]
    ) -> Float32[np.ndarray, "N outputs"]:
        """A head of the decoder at canonical points."""
        if self.gathering is not None and len(points):
            moved = points.astype(np.float64) + self.offset.numpy()
            return self.answer(self.gathering.rows(moved, hit, self.table.numpy()), len(points), heads)
        moved = torch.from_numpy(points).to(self.offset) + self.offset
        generator, body = self.generator, body_points(hit, self.faces)
        features = lookup_bilinear(self.table, generator.frame(moved))
        x = generator.decoder.inputs(features[None], generator.frame.centered(moved)[None], body)
        return generator.decoder(x, moved[None], self.layers, heads)[0].cpu().numpy()

    def answer(
        self, rows: Rows, count: int, heads: Literal["shape", "color"]
    ) -> Float32[np.ndarray, "N outputs"]:
        """The parts' networks at their rows, blended at the points."""
        total, start = None, 0
        for part, end in enumerate(rows.ends.tolist()):
            if end == start:
                continue
            network, inputs = self.generator.decoder.networks[part], torch.from_numpy(rows.inputs[start:end])
            values = network(inputs[None], self.layers[part], heads)[0].numpy()
            if total is None:
                total = np.zeros((count, values.shape[1]), np.float32)
            blend(values, rows.point[start:end], rows.share[start:end], total)
            start = end
        assert total is not None  # every point has a share somewhere
        return total
