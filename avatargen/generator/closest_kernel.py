"""The closest points of surfaces on a GPU: a few points a warp, which skips the groups and leaves that are
farther from all of them than what they have.

Letters as in `closest`; P points of a warp, K faces of a leaf. Metres.
"""

import torch
import triton  # pyright: ignore[reportMissingImports]
import triton.language as tl  # pyright: ignore[reportMissingImports]
from jaxtyping import Float, Int64
from torch import Tensor

from avatargen.generator.closest import LEAF, LEAVES, Surfaces

POINTS = 64
# kernels keep their names short and cannot be checked at run time


@triton.jit
def to_box(box, x, y, z):
    """Squared distances from a box, low corner and high; 0 within."""
    dx = tl.maximum(tl.maximum(tl.load(box) - x, x - tl.load(box + 3)), 0.0)
    dy = tl.maximum(tl.maximum(tl.load(box + 1) - y, y - tl.load(box + 4)), 0.0)
    dz = tl.maximum(tl.maximum(tl.load(box + 2) - z, z - tl.load(box + 5)), 0.0)
    return dx * dx + dy * dy + dz * dz


@triton.jit
def on_edge(x, y, z, ex, ey, ez, inverse):
    """Squared distances from the edge from 0 to e, and where along it (0 to 1) the closest points are."""
    k = tl.minimum(tl.maximum((ex * x + ey * y + ez * z) * inverse, 0.0), 1.0)
    dx, dy, dz = x - k * ex, y - k * ey, z - k * ez
    return dx * dx + dy * dy + dz * dz, k


@triton.jit
def on_face(row, px, py, pz):
    """Squared distances from the face of a row, and the weights of its second and third corners."""
    x, y, z = px - tl.load(row), py - tl.load(row + 1), pz - tl.load(row + 2)
    ux, uy, uz = tl.load(row + 3), tl.load(row + 4), tl.load(row + 5)
    vx, vy, vz = tl.load(row + 6), tl.load(row + 7), tl.load(row + 8)
    s = tl.load(row + 9) * x + tl.load(row + 10) * y + tl.load(row + 11) * z
    t = tl.load(row + 12) * x + tl.load(row + 13) * y + tl.load(row + 14) * z
    dx, dy, dz = x - s * ux - t * vx, y - s * uy - t * vy, z - s * uz - t * vz
    over = (s >= 0) & (t >= 0) & (s + t <= 1)
    best = tl.where(over, dx * dx + dy * dy + dz * dz, 1e30)
    first, k1 = on_edge(x, y, z, ux, uy, uz, tl.load(row + 15))
    second, k2 = on_edge(x, y, z, vx, vy, vz, tl.load(row + 16))
    third, k3 = on_edge(x - ux, y - uy, z - uz, vx - ux, vy - uy, vz - uz, tl.load(row + 17))
    s, t = tl.where(first < best, k1, s), tl.where(first < best, 0.0, t)
    best = tl.minimum(first, best)
    s, t = tl.where(second < best, 0.0, s), tl.where(second < best, k2, t)
    best = tl.minimum(second, best)
    s, t = tl.where(third < best, 1 - k3, s), tl.where(third < best, k3, t)
    return tl.minimum(third, best), s, t


@triton.jit
def closest_block(
    points, bound, rows, leaves, groups, place, second, third, N, G,
    W: tl.constexpr, K: tl.constexpr, P: tl.constexpr,
):  # fmt: skip
    """Fill in place, second and third [B N] of P points, which have a face within the squared `bound`."""
    person = tl.program_id(1).to(tl.int64)
    row = tl.program_id(0) * P + tl.arange(0, P)
    inside = row < N
    at = person * N + row
    x = tl.load(points + at * 3, mask=inside, other=0.0)
    y = tl.load(points + at * 3 + 1, mask=inside, other=0.0)
    z = tl.load(points + at * 3 + 2, mask=inside, other=0.0)
    best = tl.load(bound + at, mask=inside, other=-1.0)
    chosen = tl.zeros((P,), tl.int32)
    s, t = tl.zeros((P,), tl.float32), tl.zeros((P,), tl.float32)
    for g in range(G):
        group = person * G + g
        near = to_box(groups + group * 6, x, y, z) <= best
        if tl.max(near.to(tl.int32), axis=0) > 0:
            for w in range(W):
                leaf = group * W + w
                near = to_box(leaves + leaf * 6, x, y, z) <= best
                if tl.max(near.to(tl.int32), axis=0) > 0:
                    for k in range(K):
                        away, own_s, own_t = on_face(rows + (leaf * K + k) * 18, x, y, z)
                        nearer = away < best
                        best = tl.where(nearer, away, best)
                        chosen = tl.where(nearer, (g * W + w) * K + k, chosen)
                        s, t = tl.where(nearer, own_s, s), tl.where(nearer, own_t, t)
    tl.store(place + at, chosen, mask=inside)
    tl.store(second + at, s, mask=inside)
    tl.store(third + at, t, mask=inside)


def search_by_kernel(
    surfaces: Surfaces, points: Float[Tensor, "B N 3"], near: Int64[Tensor, "B N"]
) -> tuple[Int64[Tensor, "B N"], Float[Tensor, "B N"], Float[Tensor, "B N"]]:
    """As `search_all`."""
    (B, N, _), points = points.shape, points.contiguous()
    vertex = surfaces.vertices.gather(1, near[..., None].expand(-1, -1, 3))
    bound = (points - vertex).square().sum(dim=2) * (1 + 1e-4) + 1e-9  # some face is nearer for certain
    place = torch.empty((B, N), dtype=torch.int32, device=points.device)
    second, third = torch.empty_like(bound), torch.empty_like(bound)
    tables = (surfaces.rows, surfaces.leaves, surfaces.groups)
    G = surfaces.groups.shape[1]
    closest_block[(triton.cdiv(N, POINTS), B)](  # pyright: ignore[reportIndexIssue]
        points, bound, *tables, place, second, third, N, G, W=LEAVES, K=LEAF, P=POINTS, num_warps=1
    )
    return place.long(), second, third
