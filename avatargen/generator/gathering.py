"""What the field's networks read at many points, gathered by compiled code: a few passes over memory in place
of many torch calls.

    points -> shares in the body's parts                                 share_parts
    -> a row of inputs for each point and part, part after part          place_rows
    a point's first row -> planes, distance, body features, its place    fill_planes ... fill_place
    -> copied to its other rows                                          copy_rows
    the networks' answers by row -> the points', weighted by shares      blend

The numbers are those of `Decoder.inputs` and `Shares`, to float32's rounding.

Letters: N points, M rows (a point in two parts has two), I inputs, P parts, S places (a part has a few), C
plane channels, R texels along a plane's side, T = 3 R^2 texels, V body vertices, F its faces, K features, J
knots, H outputs of a network. Metres; the box is that of the planes (`PlaneFrame`).
"""

import math
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float32, Float64, Int64

from avatargen.body.distance import BodyHit
from avatargen.compiled import compiled, inner
from avatargen.generator.decoder import DISTANCE_SCALES, PLANE_GAIN, Decoder
from avatargen.generator.parts import LEAST
from avatargen.generator.planes import PlaneFrame

FAR = 20.0  # of exponents, below the largest: exp(-20) is 2e-9, less than float32 can tell from 0


@dataclass(frozen=True, kw_only=True)
class Rows:
    """Inputs of the networks, part after part, and what each row counts for."""

    inputs: Float32[np.ndarray, "M I"]
    point: Int64[np.ndarray, " M"]  # whose row it is
    share: Float32[np.ndarray, " M"]  # of the point in the row's part, 0 to 1
    ends: Int64[np.ndarray, " P"]  # where each part's rows end


@dataclass(frozen=True, kw_only=True, eq=False)
class Gathering:
    """What all people share of it: the planes' frame, the parts' places, and features on the body."""

    low: Float64[np.ndarray, "3"]  # corner of the box
    size: Float64[np.ndarray, "3"]
    knots: Float64[np.ndarray, "J 3"]  # of each axis' warp, in 0..1 of the box
    knot_slopes: Float64[np.ndarray, "J 3"]  # by which the warp is steeper from each knot on
    place_slopes: Float64[np.ndarray, "S 3"]  # a place's exponent is its slope . point + its level
    place_levels: Float64[np.ndarray, " S"]
    place_parts: Int64[np.ndarray, " S"]
    parts: int
    faces: Int64[np.ndarray, "F 3"]
    features: Float32[np.ndarray, "V K"]
    inverse_reach: Float64[np.ndarray, " V"]  # one over the metres at which a vertex's features fade to 0
    frequencies: int  # of the sines and cosines of a place

    def rows(
        self, points: Float64[np.ndarray, "N 3"], hit: BodyHit, table: Float32[np.ndarray, "T C"]
    ) -> Rows:
        """The networks' rows at points of the generator's space (metres); `table` as `plane_table` makes
        it."""
        shares = np.empty((len(points), self.parts), np.float32)
        share_parts(points, self.place_slopes, self.place_levels, self.place_parts, shares)
        ends = (shares > 0).sum(axis=0).cumsum()
        point, first = np.empty(ends[-1], np.int64), np.empty(len(points), np.int64)
        share = np.empty(ends[-1], np.float32)
        place_rows(shares, ends, point, share, first)
        widths = (table.shape[1], len(DISTANCE_SCALES) + 1, self.features.shape[1], 3 * self.waves)
        to_distance, to_vertices, to_place, width = np.cumsum(widths)
        inputs = np.empty((ends[-1], width), np.float32)
        place = (points - self.low) / self.size
        fill_planes(place, self.knots, self.knot_slopes, table, first, inputs)
        inputs[first, to_distance] = 10 * hit.distance
        for column, scale in enumerate(DISTANCE_SCALES, to_distance + 1):
            inputs[first, column] = np.tanh(hit.distance / scale)
        near = (hit.distance, self.faces[hit.face], hit.barycentric, self.features, self.inverse_reach)
        fill_vertices(*near, first, inputs, to_vertices)
        if self.frequencies:
            angle = np.pi * (2 * place - 1)
            fill_place(angle, np.sin(angle), np.cos(angle), first, inputs, to_place)
        copy_rows(inputs, point, first)
        return Rows(inputs=inputs, point=point, share=share, ends=ends)

    @property
    def waves(self) -> int:
        """Inputs for each coordinate of a point: itself, sines and cosines."""
        return 1 + 2 * self.frequencies if self.frequencies else 0


def gathering_of(decoder: Decoder, frame: PlaneFrame, faces: Int64[np.ndarray, "F 3"]) -> Gathering:
    """The arrays of a trained decoder."""

    def exact(values: torch.Tensor) -> Float64[np.ndarray, "..."]:
        return np.ascontiguousarray(values.detach().cpu().numpy(), dtype=np.float64)

    features, reach = np.zeros((0, 0), np.float32), np.zeros(0)
    if decoder.config.vertex_features:
        features = exact(decoder.vertex_features).astype(np.float32)
        reach = exact(decoder.inverse_reach)
    slopes, levels, owners = np.zeros((1, 3)), np.zeros(1), np.ones((1, 1))  # one part for the whole body
    if decoder.shares is not None:
        slopes, levels = exact(decoder.shares.slope.T), exact(decoder.shares.level)
        owners = exact(decoder.shares.owner)
    return Gathering(
        low=exact(frame.low),
        size=exact(frame.size),
        knots=exact(frame.knots),
        knot_slopes=exact(frame.slopes),
        place_slopes=slopes,
        place_levels=levels,
        place_parts=owners.argmax(axis=1),
        parts=owners.shape[1],
        faces=faces,
        features=features,
        inverse_reach=reach,
        frequencies=decoder.config.frequencies,
    )


@compiled
def share_parts(points, slope, level, owner, shares):
    """Fill in `shares` [N P] of points [N 3] (metres), as `avatargen.generator.parts.Shares` has them.

    Places: slope [S 3] (1 / metres), level [S] and owner [S], the part that each belongs to.
    """
    exponent, weight = np.empty(len(level)), np.empty(shares.shape[1])
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        largest = -np.inf
        for s in range(len(level)):
            exponent[s] = slope[s, 0] * x + slope[s, 1] * y + slope[s, 2] * z + level[s]
            largest = max(largest, exponent[s])
        for part in range(len(weight)):
            weight[part] = 0.0
        total, kept = 0.0, 0.0
        for s in range(len(level)):
            if exponent[s] > largest - FAR:
                nearness = math.exp(exponent[s] - largest)
                weight[owner[s]] += nearness
                total += nearness
        for part in range(len(weight)):
            weight[part] = max(weight[part] / total - LEAST, 0.0) ** 2
            kept += weight[part]
        for part in range(len(weight)):
            shares[i, part] = weight[part] / kept


@compiled
def place_rows(shares, ends, point, share, first):
    """Fill in `point` [M] and `share` [M] of the rows, and `first` [N], the first row of each point.

    `shares` [N P]; part p has the rows from ends[p - 1] to ends[p].
    """
    row = np.empty(len(ends), np.int64)
    for part in range(len(ends)):
        row[part] = ends[part - 1] if part else 0
    for i in range(len(shares)):
        first[i] = -1
        for part in range(len(ends)):
            if shares[i, part] > 0:
                point[row[part]], share[row[part]] = i, shares[i, part]
                if first[i] < 0:
                    first[i] = row[part]
                row[part] += 1


@inner(inline="always")
def texel_of(place, knots, slopes, axis, resolution):
    """The texel below a place (0..1) along an axis (0 to 2), and how far it is to the next (0..1)."""
    place = min(max(place, 0.0), 1.0)
    warped = 0.0
    for j in range(len(knots)):
        warped += max(place - knots[j, axis], 0.0) * slopes[j, axis]
    texel = min(max(warped * resolution - 0.5, 0.0), resolution - 1.0)
    lower = min(int(texel), resolution - 2)
    return lower, texel - lower


@inner(inline="always")
def corners_of(u, v):
    """Bilinear weights of a plane's four texels, times the gain, at fractions u and v (0..1): at low and low,
    high and low, low and high, high and high u and v."""
    u, v, w = np.float32(u), np.float32(v), np.float32(PLANE_GAIN)
    one = np.float32(1)
    return (one - u) * (one - v) * w, u * (one - v) * w, (one - u) * v * w, u * v * w


@compiled
def fill_planes(place, knots, slopes, table, first, inputs):
    """Fill in the sums of the three planes' bilinear samples, in the first C columns of each point's first
    row.

    `place` [N 3] in 0..1 of the box; `table` [T C] float32, as `plane_table` makes it: planes xy, yz and xz,
    one after the other, row by row. Knots and slopes [J 3] as in `Gathering`.
    """
    size = round(math.sqrt(len(table) / 3))
    for i in range(len(place)):
        x, u = texel_of(place[i, 0], knots, slopes, 0, size)
        y, v = texel_of(place[i, 1], knots, slopes, 1, size)
        z, w = texel_of(place[i, 2], knots, slopes, 2, size)
        p, q, r = y * size + x, (size + z) * size + y, (2 * size + z) * size + x
        p00, p01, p10, p11 = corners_of(u, v)
        q00, q01, q10, q11 = corners_of(v, w)
        r00, r01, r10, r11 = corners_of(u, w)
        row = first[i]
        for c in range(table.shape[1]):
            value = p00 * table[p, c] + p01 * table[p + 1, c]
            value += p10 * table[p + size, c] + p11 * table[p + size + 1, c]
            value += q00 * table[q, c] + q01 * table[q + 1, c]
            value += q10 * table[q + size, c] + q11 * table[q + size + 1, c]
            value += r00 * table[r, c] + r01 * table[r + 1, c]
            value += r10 * table[r + size, c] + r11 * table[r + size + 1, c]
            inputs[row, c] = value


@compiled
def fill_vertices(distance, corners, barycentric, features, inverse_reach, first, inputs, start):
    """Fill in, from column `start` on, the features at the closest body points, faded out before these jump.

    `distance` [N] to the body in metres, negative inside; the closest point by the `corners` [N 3] of its
    face and their weights, `barycentric` [N 3]. Within the body the features count whole.
    """
    for i in range(len(distance) if features.shape[1] else 0):
        a, b, c = corners[i, 0], corners[i, 1], corners[i, 2]
        of_a, of_b, of_c = barycentric[i, 0], barycentric[i, 1], barycentric[i, 2]
        reach = of_a * inverse_reach[a] + of_b * inverse_reach[b] + of_c * inverse_reach[c]
        share = min(max(distance[i], 0.0) * reach, 1.0)
        fade = np.float32((1 - share * share) ** 2)
        of_a, of_b, of_c = fade * of_a, fade * of_b, fade * of_c
        row = first[i]
        for k in range(features.shape[1]):
            inputs[row, start + k] = of_a * features[a, k] + of_b * features[b, k] + of_c * features[c, k]


@compiled
def fill_place(angle, sine, cosine, first, inputs, start):
    """Fill in, from column `start` on, the place in the box, -1..1, and its sines and cosines at pi, 2 pi, 4
    pi ..., each by the double angle of the one before.

    `angle` [N 3] is pi times the place, `sine` and `cosine` are its own.
    """
    count = (inputs.shape[1] - start) // 6
    for i in range(len(angle)):
        row = first[i]
        for axis in range(3):
            inputs[row, start + axis] = angle[i, axis] / math.pi
            s, c = sine[i, axis], cosine[i, axis]
            for k in range(count):
                inputs[row, start + 3 + 3 * k + axis] = s
                inputs[row, start + 3 + 3 * (count + k) + axis] = c
                s, c = 2 * s * c, 1 - 2 * s * s


@compiled
def copy_rows(inputs, point, first):
    """Copy the inputs [M I] of each point's first row to its other rows."""
    for row in range(len(point)):
        same = first[point[row]]
        if same != row:
            for column in range(inputs.shape[1]):
                inputs[row, column] = inputs[same, column]


@compiled
def blend(values, point, share, total):
    """Add the rows' values [M H] to `total` [N H] of their points, weighted by their shares [M]."""
    for row in range(len(values)):
        for k in range(values.shape[1]):
            total[point[row], k] += share[row] * values[row, k]
