"""Numbers on the body's surface, kept in one byte or two each, and read at the closest body points.

A column of a table is value = whole number * scale, so a table of colours takes three bytes a node.

Letters: F faces, M nodes of a face (see `lattice`), K numbers a node, N points, V body vertices.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Float32, Int32, Int64
from torch import Tensor, nn

from avatargen.body.distance import BodyHit
from avatargen.compiled import compiled
from avatargen.errors import InputError
from avatargen.generator.dressed.config import TableConfig
from avatargen.generator.dressed.lattice import lattice

WHOLE = {8: torch.int8, 16: torch.int16}


class Table(nn.Module):
    """A table as a file holds it: whole numbers, and the scale of each column."""

    values: Tensor
    scale: Tensor

    def __init__(self, config: TableConfig) -> None:
        super().__init__()
        self.config = config
        self.register_buffer("values", torch.zeros(config.nodes, config.numbers, dtype=WHOLE[config.bits]))
        self.register_buffer("scale", torch.ones(config.numbers))

    def set(self, values: Float[Tensor, "nodes K"]) -> None:
        """Round the values."""
        scale = values.abs().amax(dim=0).clamp_min(1e-12) / torch.iinfo(self.values.dtype).max
        self.scale.copy_(scale)
        self.values.copy_((values / scale).round().to(self.values.dtype))

    def read(self, faces: Int64[np.ndarray, "F 3"], covered: Bool[np.ndarray, " F"]) -> "Surface":
        """The table ready to be read at body points; it covers some of the faces."""
        nodes = lattice(faces, covered, self.config.segments)
        if nodes.count != self.config.nodes:
            raise InputError(
                f"weights: a table has {self.config.nodes} nodes where its faces have {nodes.count}; "
                "download the weights anew"
            )
        values = self.values.numpy().astype(np.float32) * self.scale.numpy().astype(np.float32)
        return Surface(segments=self.config.segments, face_nodes=nodes.face_nodes, values=values)


@dataclass(frozen=True, kw_only=True, eq=False)
class Surface:
    """A table in full precision, and where its nodes are. Where it covers nothing it reads zero."""

    segments: int
    face_nodes: Int32[np.ndarray, "F M"]
    values: Float32[np.ndarray, "nodes K"]

    def at(self, hit: BodyHit) -> Float32[np.ndarray, "N K"]:
        """The numbers at body points."""
        found = np.zeros((len(hit.face), self.values.shape[1]), np.float32)
        fill_numbers(hit.face, hit.barycentric, self.segments, self.face_nodes, self.values, found)
        return found


@compiled
def fill_numbers(face, barycentric, n, face_nodes, values, found):
    """Fill in a table's numbers [N K] at the closest body points: a face [N] cut into n x n, and weights
    [N 3].

    `face_nodes` [F M]; `values` [nodes K], node 0 without any.
    """
    for row in range(len(face)):
        u, v = barycentric[row, 1] * n, barycentric[row, 2] * n
        i = min(max(int(u), 0), n - 1)
        j = min(max(int(v), 0), n - 1 - i)
        u, v = u - i, v - j
        f = face[row]
        right = (i + 1) * (n + 1) - (i + 1) * i // 2 + j
        up = i * (n + 1) - i * (i - 1) // 2 + j + 1
        if u + v > 1 and i + j < n - 1:
            a, b, c = face_nodes[f, right + 1], face_nodes[f, right], face_nodes[f, up]
            of_a, of_b, of_c = u + v - 1, 1 - v, 1 - u
        else:
            a, b, c = face_nodes[f, up - 1], face_nodes[f, right], face_nodes[f, up]
            of_a, of_b, of_c = 1 - u - v, u, v
        of_a = np.float32(of_a if a > 0 else 0.0)
        of_b = np.float32(of_b if b > 0 else 0.0)
        of_c = np.float32(of_c if c > 0 else 0.0)
        for k in range(values.shape[1]):
            found[row, k] = of_a * values[a, k] + of_b * values[b, k] + of_c * values[c, k]
