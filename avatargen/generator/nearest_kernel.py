"""The nearest vertices on a GPU: every point against every vertex, in registers.

Letters: B people, N points, V vertices, K nearest. Metres.
"""

import torch
import triton  # pyright: ignore[reportMissingImports]
import triton.language as tl  # pyright: ignore[reportMissingImports]
from jaxtyping import Float, Int
from torch import Tensor
from torch.nn import functional as F

POINTS, VERTICES = 512, 8  # of a block; that are read at once
NOWHERE = 1e15  # metres, a place whose squared distance is farther than all


@triton.jit
def nearest_block(
    points, vertices, before, before_index, squared, index, N, V,
    LATER: tl.constexpr, P: tl.constexpr, Q: tl.constexpr,
):  # fmt: skip
    """Fill in squared and index [B N] of P points: the nearest vertices or, with LATER, those that follow
    (before, before_index) in order of distance and number. V is a multiple of Q.
    """
    person = tl.program_id(1).to(tl.int64)
    row = tl.program_id(0) * P + tl.arange(0, P)
    inside = row < N
    at = person * N + row
    x = tl.load(points + at * 3, mask=inside, other=0.0)
    y = tl.load(points + at * 3 + 1, mask=inside, other=0.0)
    z = tl.load(points + at * 3 + 2, mask=inside, other=0.0)
    if LATER:
        last = tl.load(before + at, mask=inside, other=0.0)
        last_index = tl.load(before_index + at, mask=inside, other=0)
    best = tl.full((P,), 1e29, tl.float32)
    chosen = tl.zeros((P,), tl.int32)
    vertex = vertices + person * V * 3
    for first in range(0, V, Q):
        for step in tl.static_range(Q):
            dx = x - tl.load(vertex + 3 * step)
            dy = y - tl.load(vertex + 3 * step + 1)
            dz = z - tl.load(vertex + 3 * step + 2)
            away = dx * dx + dy * dy + dz * dz
            if LATER:
                same = (away == last) & (first + step <= last_index)
                away = tl.where((away < last) | same, 1e30, away)
            nearer = away < best  # of equals the first
            best = tl.where(nearer, away, best)
            chosen = tl.where(nearer, first + step, chosen)
        vertex += 3 * Q
    tl.store(squared + at, best, mask=inside)
    tl.store(index + at, chosen, mask=inside)


def nearest_by_kernel(
    points: Float[Tensor, "B N 3"], vertices: Float[Tensor, "B V 3"], count: int
) -> tuple[Float[Tensor, "B N K"], Int[Tensor, "B N K"]]:
    """Squared distances, nearest first: a pass over all vertices for each of the K."""
    B, N, _ = points.shape
    points = points.contiguous()
    vertices = F.pad(vertices, (0, 0, 0, -vertices.shape[1] % VERTICES), value=NOWHERE).contiguous()
    found: list[tuple[Tensor, Tensor]] = []
    for _ in range(count):
        squared = torch.empty((B, N), device=points.device)
        index = torch.empty((B, N), dtype=torch.int32, device=points.device)
        before = found[-1] if found else (squared, index)
        nearest_block[(triton.cdiv(N, POINTS), B)](  # pyright: ignore[reportIndexIssue]
            points, vertices, *before, squared, index, N, vertices.shape[1],
            LATER=bool(found), P=POINTS, Q=VERTICES,
        )  # fmt: skip
        found.append((squared, index))
    squared, index = (torch.stack(part, dim=2) for part in zip(*found, strict=True))
    return squared, index.long()
