"""What hangs free of the legs: skirts, and dresses and coats below the waist.

Rings around the straight body, level with one another: each is no tighter than the convex hull of the body
there and its ease, nor than the ring above it, from which cloth falls. The whole is then carried to the
canonical pose by both legs' weights, as artists' skirts are.

Letters: C columns around, R rows downward. Angles in radians from the front toward the person's left.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int64
from scipy.ndimage import gaussian_filter1d
from scipy.sparse import coo_array, csc_array, diags_array
from scipy.sparse.linalg import splu
from scipy.spatial import KDTree

from avatargen.body.skinning import skin
from avatargen.smoothstep import smoothstep
from avatargen.wardrobe.makehuman.fit import on_both_legs, smoother, straight_legs
from avatargen.wardrobe.tailored.draping import draped, normals_of, skin_under
from avatargen.wardrobe.tailored.form import Sheet, default_body, whole_form

COLUMNS = 156
ROW = 0.014  # m
AXIS_Z = 0.015  # m before the pelvis, of the line around which rings lie
TRUNK, ARMS_FROM = 0.26, 0.36  # m from the middle, and height, that arms lie beyond
SLAB = 0.014  # m above and below a ring in which the body counts
PARTING, HANGS = -0.1, 0.1  # m: where the legs part, and below that until cloth hangs
ROUNDS = 14  # of averaging weights
CLEAR = 0.005  # m off the skin
RETURNS = 6  # rounds of finding where cloth comes back from
ALONG = 0.766  # cosine of 40 degrees: cloth that turns farther from the skin does not follow it
REACH = 0.1  # m off the skin, farther than which it does not either
JUMP, JUMP_LENGTH = (
    0.25,
    0.2,
)  # share of weight that may change along an edge, and m of edge for the whole of it


@dataclass(frozen=True, kw_only=True)
class Fall:
    """How a skirt hangs. Metres."""

    top: float  # height
    hem: float
    ease: float = 0.006
    flare: float = 0.0  # outward for each downward, from `flares` on
    flares: float = 0.0  # height
    folds: int = 0  # around the hem
    deep: float = 0.0  # of a fold at the hem
    sharp: bool = False  # pleats from the top on, not soft folds


def angles() -> Float64[np.ndarray, " C"]:
    """Of the columns, from the back round to the back."""
    return np.linspace(-np.pi, np.pi, COLUMNS, endpoint=False)


def hulls(heights: Float64[np.ndarray, " R"]) -> Float64[np.ndarray, "R C"]:
    """Distance from the axis to the convex hull of the straight body at heights, by angle."""
    at = whole_form().finer().at
    trunk = at[(np.abs(at[:, 0]) < TRUNK) & (at[:, 1] < ARMS_FROM)]
    theta = angles()
    toward = np.stack([np.sin(theta), np.cos(theta)])
    cosine = np.cos(theta[:, None] - theta[None])
    found = np.zeros((len(heights), COLUMNS))
    for row, height in enumerate(heights):
        near = trunk[np.abs(trunk[:, 1] - height) < SLAB][:, [0, 2]] - (0, AXIS_Z)
        reach = (near @ toward).max(axis=0)
        found[row] = np.where(cosine > 0.05, reach[:, None] / np.maximum(cosine, 0.05), np.inf).min(axis=0)
    return found


def radii(
    fall: Fall, first: Float64[np.ndarray, " C"] | None
) -> tuple[np.ndarray, Float64[np.ndarray, "R C"]]:
    """Heights of the rings, and their distance from the axis; `first` is that of cloth above them."""
    heights = np.linspace(fall.top, fall.hem, int((fall.top - fall.hem) / ROW) + 1)
    least = (
        gaussian_filter1d(gaussian_filter1d(hulls(heights), 1.5, axis=1, mode="wrap"), 1.0, axis=0)
        + fall.ease
    )
    radius = least.copy()
    if first is not None:
        radius[0] = np.maximum(first, 0)
    for row in range(1, len(heights)):
        flared = fall.flare if heights[row] < fall.flares else 0.0
        radius[row] = np.maximum(least[row], radius[row - 1] + flared * (heights[row - 1] - heights[row]))
    start = radius[0].copy()
    radius = np.maximum(gaussian_filter1d(radius, 1.5, axis=0, mode="nearest"), least - 0.002)
    blend = smoothstep(np.arange(len(heights)) / 3.0)[:, None]
    radius = start * (1 - blend) + radius * blend
    return heights, np.maximum(radius + folded(fall, heights), np.where(blend < 1, 0, least - 0.002))


def folded(fall: Fall, heights: Float64[np.ndarray, " R"]) -> Float64[np.ndarray, "R C"]:
    """How far out folds lie, m."""
    if not fall.folds:
        return np.zeros((len(heights), COLUMNS))
    theta, down = angles(), (fall.top - heights) / (fall.top - fall.hem)
    if fall.sharp:
        wave = np.abs((theta * fall.folds / (2 * np.pi)) % 1 - 0.35)
        wave = np.minimum(wave / 0.35, (1 - (theta * fall.folds / (2 * np.pi)) % 1) / 0.35).clip(0, 1) - 0.5
        return fall.deep * (0.25 + 0.75 * down)[:, None] * wave
    rng = np.random.default_rng(fall.folds)
    bent = theta + 0.09 * np.sin(3 * theta + rng.uniform(0, 6)) + 0.05 * np.sin(5 * theta + rng.uniform(0, 6))
    size = 0.75 + 0.25 * np.sin(2 * theta + rng.uniform(0, 6))
    return fall.deep * (smoothstep(down) ** 1.2)[:, None] * size * np.cos(fall.folds * bent)


def skirt(fall: Fall, first: Float64[np.ndarray, " C"] | None = None) -> Sheet:
    """A skirt on the straight legs: `vertices` and `at` are the same. Parts 0 and 1 are back and front."""
    heights, radius = radii(fall, first)
    theta = angles()
    places = np.stack(
        [
            radius * np.sin(theta),
            np.broadcast_to(heights[:, None], radius.shape),
            AXIS_Z + radius * np.cos(theta),
        ],
        axis=-1,
    ).reshape(-1, 3)
    row, column = np.meshgrid(np.arange(len(heights) - 1), np.arange(COLUMNS), indexing="ij")
    after = (column + 1) % COLUMNS
    a, b = row * COLUMNS + column, row * COLUMNS + after
    c, d = a + COLUMNS, b + COLUMNS
    faces = np.concatenate(
        [np.stack([a, c, b], axis=-1).reshape(-1, 3), np.stack([b, c, d], axis=-1).reshape(-1, 3)]
    )
    front = (np.abs(theta[column] + np.pi / COLUMNS) < np.pi / 2).ravel()
    return Sheet(
        vertices=places, at=places, faces=faces.astype(np.int64), part=np.tile(front, 2).astype(np.int64)
    )


def carried(sheet: Sheet) -> Sheet:
    """A sheet that hangs on straight legs, on the canonical body: where the weights that it is given there
    bring it back from, so that its hem is level again on legs that stand."""
    body = default_body()
    weights = body.weights.astype(np.float64)[KDTree(whole_form().at).query(sheet.at)[1]]
    average = smoother(sheet.faces, len(weights))
    for _ in range(ROUNDS):
        weights = average @ weights
    hangs = smoothstep((PARTING - sheet.at[:, 1]) / HANGS)
    weights = on_both_legs(weights, sheet.at[:, 0], hangs)
    for _ in range(RETURNS):
        there = replace(sheet, vertices=np.asarray(skin(sheet.at, weights, straight_legs())))
        weights = 0.5 * (weights + filled_weights(there))
    hung = replace(sheet, vertices=np.asarray(skin(sheet.at, weights, straight_legs())))
    return replace(draped(hung, np.full(len(sheet.at), CLEAR), 2, held=True), at=sheet.at)


def filled_weights(sheet: Sheet) -> Float64[np.ndarray, "V J"]:
    """Weights as an asset's vertices are given them (Abdrashitov et al. 2023): the closest skin's where cloth
    runs along it and its neighbours agree, and a harmonic filling elsewhere."""
    body, vertices = default_body(), sheet.vertices
    hit = body.distance.query(vertices.astype(np.float32))
    weights = np.einsum("vk,vkj->vj", hit.barycentric, body.weights.astype(np.float64)[body.faces[hit.face]])
    along = (skin_under(vertices, body)[1] * normals_of(sheet)).sum(axis=1) > ALONG
    known = along & (np.abs(hit.distance) < REACH)
    ends = np.concatenate([sheet.faces[:, [0, 1]], sheet.faces[:, [1, 2]], sheet.faces[:, [2, 0]]])
    length = np.linalg.norm(vertices[ends[:, 0]] - vertices[ends[:, 1]], axis=1)
    jump = 0.5 * np.abs(weights[ends[:, 0]] - weights[ends[:, 1]]).sum(axis=1) > JUMP + length / JUMP_LENGTH
    known[ends[jump].ravel()] = False
    stiff = 1 / np.maximum(length, 1e-6)
    graph = coo_array((stiff, (ends[:, 0], ends[:, 1])), shape=(len(vertices),) * 2).tocsr()
    graph = graph + graph.T
    rows = graph[np.flatnonzero(~known)]
    if known.any() and not known.all():
        laplacian = diags_array(rows.sum(axis=1)) - rows[:, np.flatnonzero(~known)]
        filled = splu(csc_array(laplacian)).solve(rows[:, np.flatnonzero(known)] @ weights[known])
        weights[~known] = filled
    return weights / weights.sum(axis=1, keepdims=True)


def around(places: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, " n"]:
    """Angles of places about the axis."""
    return np.arctan2(places[:, 0], places[:, 2] - AXIS_Z)


def ring_at(edge: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, " C"]:
    """The distance of an edge from the axis at the columns."""
    theta, radius = around(edge), np.hypot(edge[:, 0], edge[:, 2] - AXIS_Z)
    return np.interp(angles(), theta, radius, period=2 * np.pi)


def zipped(upper: Sheet, edge: Int64[np.ndarray, " n"], lower: Sheet) -> Sheet:
    """Two sheets joined by a strip of faces: the upper one's edge, and the lower one's first ring. The lower
    one's pattern pieces are counted after those of the upper."""
    count = len(upper.vertices)
    edge = edge[np.argsort(around(upper.at[edge]))]
    ring = count + np.arange(COLUMNS)
    above, under = around(upper.at[edge]), angles()
    i = j = 0
    strip, part = [], []
    following = upper.part.max() + 1
    while i < len(edge) or j < COLUMNS:
        last_above = above[i] if i < len(edge) else np.inf
        last_under = under[j] if j < COLUMNS else np.inf
        middle = min(last_above, last_under)
        if last_above <= last_under:
            strip.append((edge[i - 1], ring[j - 1], edge[i]))
            i += 1
        else:
            strip.append((edge[i - 1], ring[j - 1], ring[j]))
            j += 1
        part.append(following + int(abs(middle) < np.pi / 2))
    faces = np.array(strip, dtype=np.int64)
    return Sheet(
        vertices=np.concatenate([upper.vertices, lower.vertices]),
        at=np.concatenate([upper.at, lower.at]),
        faces=np.concatenate([upper.faces, faces, lower.faces + count]),
        part=np.concatenate([upper.part, np.array(part), lower.part + following]),
    )
