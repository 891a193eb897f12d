"""The nearest vertices on a GPU: every point against every vertex, in registers.

Letters: B people, N points, V vertices, K nearest. Metres.
"""

import torch
import triton  # pyright: ignore[reportMissingImports]
import triton.language as tl  # pyright: ignore[reportMissingImports]
from jaxtyping import Float, Int
from torch import Tensor

POINTS, VERTICES = 128, 32  # of a block
FAR = 1e30  # square metres


@triton.jit
def nearest_block(points, vertices, before, before_index, squared, index, N, V, HAS: tl.constexpr, P: tl.constexpr, Q: tl.constexpr):  # fmt: skip # noqa: E501
    """The vertex that is next after (before, before_index) in order of (distance, number), of P points."""
    person = tl.program_id(1)
    row = tl.program_id(0) * P + tl.arange(0, P)
    inside = row < N
    place = person.to(tl.int64) * N + row
    x = tl.load(points + place * 3, mask=inside, other=0.0)
    y = tl.load(points + place * 3 + 1, mask=inside, other=0.0)
    z = tl.load(points + place * 3 + 2, mask=inside, other=0.0)
    if HAS:
        last = tl.load(before + place, mask=inside, other=0.0)
        last_index = tl.load(before_index + place, mask=inside, other=0)
    best = tl.full((P, Q), 1e30, tl.float32)
    which = tl.zeros((P, Q), tl.int32)
    start = vertices + person.to(tl.int64) * V * 3
    for first in range(0, V, Q):
        column = first + tl.arange(0, Q)
        there = column < V
        dx = x[:, None] - tl.load(start + column * 3, mask=there, other=1e15)[None, :]
        dy = y[:, None] - tl.load(start + column * 3 + 1, mask=there, other=0.0)[None, :]
        dz = z[:, None] - tl.load(start + column * 3 + 2, mask=there, other=0.0)[None, :]
        away = dx * dx + dy * dy + dz * dz
        if HAS:
            same = (away == last[:, None]) & (column[None, :] <= last_index[:, None])
            away = tl.where((away < last[:, None]) | same, 1e30, away)
        nearer = away < best
        best = tl.where(nearer, away, best)
        which = tl.where(nearer, column[None, :], which)
    least = tl.min(best, axis=1)
    chosen = tl.min(tl.where(best == least[:, None], which, V), axis=1)  # of equals the first
    tl.store(squared + place, least, mask=inside)
    tl.store(index + place, chosen, mask=inside)


def nearest_by_kernel(
    points: Float[Tensor, "B N 3"], vertices: Float[Tensor, "B V 3"], count: int
) -> tuple[Float[Tensor, "B N K"], Int[Tensor, "B N K"]]:
    """Squared distances, nearest first: a pass over all vertices for each of the K."""
    (B, N, _), V = points.shape, vertices.shape[1]
    points, vertices = points.contiguous(), vertices.contiguous()
    found: list[tuple[Tensor, Tensor]] = []
    for _ in range(count):
        squared = torch.empty((B, N), device=points.device)
        index = torch.empty((B, N), dtype=torch.int32, device=points.device)
        before = found[-1] if found else (squared, index)
        grid = (triton.cdiv(N, POINTS), B)
        nearest_block[grid](  # pyright: ignore[reportIndexIssue]
            points, vertices, *before, squared, index, N, V, HAS=bool(found), P=POINTS, Q=VERTICES
        )
        found.append((squared, index))
    squared, index = (torch.stack(part, dim=2) for part in zip(*found, strict=True))
    return squared, index.long()
