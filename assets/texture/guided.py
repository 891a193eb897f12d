"""An atlas whose charts are the panels of a sewing pattern."""

import numpy as np
from jaxtyping import Bool, Complex128, Float64, Int64

from assets.errors import GeometryError
from assets.mesh.surface import Surface
from assets.texture.atlas import Atlas, AtlasConfig, check_atlas
from assets.texture.flat_cut import FlatCut
from assets.texture.pack import Outline, pack
from assets.texture.pattern import HEAD, MOST_SIDES, NAMES, Pattern, texel_scale
from assets.texture.tailor import detail_of_charts, lay_flat
from avatargen.compiled import compiled

TINY = 1e-30
MOST_CHARTS = 1000  # beyond which xatlas's own are no worse
TURNS = 30  # of a quarter turn among which the one with the smallest box is looked for


def guided_atlas(surface: Surface, pattern: Pattern, config: AtlasConfig, head_detail: float) -> Atlas:
    """The panels, flat and packed as seen from outside, the face upright; along a line on the head there are
    so many times as many texels, and more on the face.

    Raises:
        GeometryError: a panel does not lie flat, or the charts have no room.
    """
    flat = lay_flat(surface, pattern)
    if flat.cut.count > MOST_CHARTS:
        raise GeometryError(f"atlas: {flat.cut.count} charts would be needed")
    scale = texel_scale(detail_of_charts(pattern, flat.cut), head_detail)
    face = np.zeros(flat.cut.count, dtype=bool)
    on_face = np.bincount(flat.cut.chart[pattern.panel == MOST_SIDES * NAMES.index(HEAD)])
    if len(on_face):  # of some hundred faces a head may be too few for a panel
        face[on_face.argmax()] = True
    owner = flat.cut.owner
    z = turned(surface, flat, face) * scale[owner]
    points = np.stack([np.real(z), -np.imag(z)], axis=1)
    uv = np.empty_like(points)
    vertices = np.split(np.argsort(owner, kind="stable"), np.cumsum(np.bincount(owner))[:-1])
    places = pack(outlines_of(flat, points, face), config.padding / config.packing)
    for mine, place in zip(vertices, places, strict=True):
        uv[mine] = place.apply(points[mine])
    atlas = Atlas(
        vertex_map=flat.cut.vertex_map, uv=np.clip(uv, 0, 1).astype(np.float32), faces=flat.cut.faces
    )
    check_atlas(surface, atlas)
    return atlas


def turned(surface: Surface, flat: FlatCut, upright: Bool[np.ndarray, " C"]) -> Complex128[np.ndarray, " W"]:
    """The plane with each chart turned into the smallest box, with what is higher up on the surface as far up
    as that allows, or exactly up."""
    owner, height = flat.cut.owner, surface.vertices[flat.cut.vertex_map, 1]
    count = np.bincount(owner)
    middle = (np.bincount(owner, np.real(flat.z)) + 1j * np.bincount(owner, np.imag(flat.z))) / count
    own = flat.z - middle[owner]
    rise = (height - (np.bincount(owner, height) / count)[owner]) * own
    up = np.bincount(owner, np.real(rise)) + 1j * np.bincount(owner, np.imag(rise))
    to_up = 1j * np.conj(up) / np.maximum(np.abs(up), TINY)
    turns = np.exp(0.5j * np.pi * np.arange(TURNS) / TURNS)
    boxes = np.zeros((TURNS, len(count)))
    boxes_of_turns(np.stack([np.real(own), np.imag(own)], axis=1), owner, turns, boxes)
    quarters = turns[boxes.argmin(axis=0)][:, None] * 1j ** np.arange(4)
    nearest = np.real(quarters * np.conj(to_up)[:, None]).argmax(axis=1)
    return own * np.where(upright, to_up, quarters[np.arange(len(count)), nearest])[owner]


@compiled
def boxes_of_turns(points, owner, turns, boxes):
    """Write the area of each chart's box in each turn into `boxes` [N C]: of the points [W 2] that it owns,
    turned by complex numbers [N]."""
    count = boxes.shape[1]
    for n in range(len(turns)):
        low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
        c, s = turns[n].real, turns[n].imag
        for w in range(len(points)):
            x, y = c * points[w, 0] - s * points[w, 1], s * points[w, 0] + c * points[w, 1]
            chart = owner[w]
            low[chart, 0], high[chart, 0] = min(low[chart, 0], x), max(high[chart, 0], x)
            low[chart, 1], high[chart, 1] = min(low[chart, 1], y), max(high[chart, 1], y)
        for chart in range(count):
            boxes[n, chart] = (high[chart, 0] - low[chart, 0]) * (high[chart, 1] - low[chart, 1])


def outlines_of(
    flat: FlatCut, points: Float64[np.ndarray, "W 2"], upright: Bool[np.ndarray, " C"]
) -> list[Outline]:
    """The charts as they are packed."""
    faces, chart = flat.cut.faces, flat.cut.chart
    edge = np.flatnonzero(flat.cut.open)
    ends = np.stack([faces.reshape(-1)[edge], np.roll(faces, -1, axis=1).reshape(-1)[edge]], axis=1)
    triangles = in_charts(points[faces], chart, flat.cut.count)
    borders = in_charts(points[ends], chart[edge // 3], flat.cut.count)
    return [
        Outline(triangles=triangles[each], border=borders[each], upright=bool(upright[each]))
        for each in range(flat.cut.count)
    ]


def in_charts(
    values: Float64[np.ndarray, "N K 2"], chart: Int64[np.ndarray, " N"], count: int
) -> list[Float64[np.ndarray, "_ K 2"]]:
    """Values of faces or edges, chart by chart."""
    order = np.argsort(chart, kind="stable")
    return np.split(values[order], np.searchsorted(chart[order], np.arange(1, count)))
