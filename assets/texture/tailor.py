"""Panels of a sewing pattern cut out and laid flat.

A chart that does not lie flat is changed where it fails. What stands out so far that it would be pressed to a
third of its size, as a bun does, becomes a panel of its own. A chart that would lie over itself is parted by
the shortest seam between what lies over each other; a hand, whose fingers do, is laid flat again as if it
were thinner. What is left then, as of ragged hems and braids, is broken up into small patches
(`assets.texture.patches`), down to single faces. Those that have room beside a neighbour are hung onto it in
the end (`assets.texture.join`).

Letters: V vertices of the surface, W vertices after the seams have split them, F faces, C charts, N some of
them.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64

from assets.errors import GeometryError
from assets.mesh.surface import Surface, directed_edges, edge_lengths
from assets.skin.skin import connected_regions, merge_small
from assets.texture.flat_cut import FINE, FINEST, SHARED, FlatCut, around, neighbours, overlaps, sheets_of
from assets.texture.flatten import flatten, singular_values
from assets.texture.hands import joined_at, spread_fingers
from assets.texture.join import join_small
from assets.texture.patches import find_patches
from assets.texture.pattern import MOST_SIDES, Pattern
from assets.texture.relax import relax
from assets.texture.seams import PER_METRE, Cut, cut_open, cut_to_disks, minimum_cut, without_teeth

PRESSED = 0.35  # of a face's area: with less it gets room of its own
NEEDLE = 0.05  # the smaller singular value of a face that is as good as turned over
FLAT = 0.1  # the smaller singular value of a face that is pressed flat or turned over
OWN_ROOM = 40  # such faces, side by side, that become a panel; or one that is turned over
FEWEST = 4  # faces of a panel
STILL_SHARED = 8  # such pairs of a chart that no seam is worth
NEARER = 0.5  # times as far from one face as from another counts as belonging to it
GROWN = 2  # rings of faces around these that go with them
# of what will not lie flat, one after the other: degrees that a patch's faces may face off its mean, and how
# many faces it has at least
BREAKINGS = ((70.0, 6), (60.0, 3), (45.0, 2))
BROKEN = 0.3  # of a chart's faces: where more do not lie flat, all become patches
THIN, LONG = 0.6, 1.7  # singular values beyond which vertices are moved one by one
THINNER = 0.6  # times as thick as before is a chart that lies over itself and is to stay whole,
THINNEST = 0.3  # down to this


def lay_flat(surface: Surface, pattern: Pattern) -> FlatCut:
    """Disks that lie flat, no face turned over and no chart over itself.

    Raises:
        GeometryError: there is one that does.
    """
    thickness = np.ones(len(surface.faces))
    flat = lay_afresh(surface, pattern, thickness, None)
    panel, thinner = without_overlaps(surface, flat, pattern, thickness)
    panel = with_room(surface, flat, replace(pattern, panel=panel))
    panel = merge_small(panel, pattern.twin, FEWEST)
    fresh = (panel != pattern.panel) | (thinner != thickness)
    if fresh.any():
        fresh |= np.isin(panel, panel[fresh]) | np.isin(pattern.panel, pattern.panel[fresh])
        pattern, thickness = replace(pattern, panel=panel), thinner
        flat = lay_afresh(surface, pattern, thickness, flat, fresh)
    for widest, fewest in BREAKINGS:
        panel = broken_up(surface, flat, pattern, widest, fewest)
        broken = panel != pattern.panel
        if not broken.any():
            break
        pattern = replace(pattern, panel=panel)
        flat = lay_afresh(surface, pattern, thickness, flat, broken)
    for hinges in pattern.hinges:
        flat = joined_at(surface, flat, pattern.twin, hinges)
    flat = polished(surface, flat)
    alone = broken_up(surface, flat, pattern, 0.0, 1)
    flat = lay_afresh(surface, replace(pattern, panel=alone), thickness, flat, alone != pattern.panel)
    flat = join_small(surface, flat, pattern.twin, detail_of_charts(pattern, flat.cut))
    check_flat(surface, flat)
    return flat


def detail_of_charts(pattern: Pattern, cut: Cut) -> Int64[np.ndarray, " C"]:
    """How fine texels are to be in each chart: as its most detailed face asks."""
    detail = np.zeros(cut.count, dtype=np.int64)
    np.maximum.at(detail, cut.chart, pattern.detail)
    return detail


def broken_up(
    surface: Surface, flat: FlatCut, pattern: Pattern, widest: float, fewest: int
) -> Int64[np.ndarray, " F"]:
    """Panels, where what still does not lie flat has become patches: the faces around, or the whole chart
    where these are many. `widest` and `fewest` as `find_patches` takes them; single faces go alone."""
    cut = flat.cut
    here, there = neighbours(cut, pattern.twin)
    upper = upper_ones(flat, here, there, *((0, FINEST) if fewest == 1 else (SHARED, FINE)))
    bad = upper | (smaller_values(surface, flat) < FLAT)
    if not bad.any():
        return pattern.panel
    if fewest > 1:
        bad[there[bad[here]]] = True
        share = np.bincount(cut.chart, bad) / np.bincount(cut.chart)
        bad |= (share > BROKEN)[cut.chart]
    panel = pattern.panel.copy()
    panel[bad] = panel.max() + 1 + find_patches(surface, pattern.twin, bad, widest, fewest)
    return panel


def upper_ones(
    flat: FlatCut, here: Int64[np.ndarray, " N"], there: Int64[np.ndarray, " N"], most: int, side: int
) -> Bool[np.ndarray, " F"]:
    """Of the faces of one chart that lie over each other, in more pairs than `most`, seen at so many texels
    along a side, those that are to go, so that none does: regions of neighbours, but for the largest ones
    that do not lie over each other or themselves."""
    cut = flat.cut
    over = overlaps(flat, side=side)
    many = np.bincount(cut.chart[over[:, 0]], minlength=cut.count) > most
    over = over[many[cut.chart[over[:, 0]]]]
    involved = np.zeros(len(cut.chart), dtype=bool)
    involved[over.reshape(-1)] = True
    region = connected_regions(2 * cut.chart + involved, here, there)
    size, kept = np.bincount(region), np.zeros(int(region.max()) + 1, dtype=bool)
    beneath = np.unique(np.concatenate([region[over], region[over[:, ::-1]]]), axis=0)
    first = np.searchsorted(beneath[:, 0], np.arange(len(size) + 1))
    regions = np.unique(beneath[:, 0])
    for one in regions[np.argsort(-size[regions], kind="stable")]:
        others = beneath[first[one] : first[one + 1], 1]
        kept[one] = not (kept[others].any() or (others == one).any())
    return involved & ~kept[region]


def smaller_values(surface: Surface, flat: FlatCut) -> Float64[np.ndarray, " F"]:
    """The smaller singular value of each face's map, 0 or negative where it has no room or is turned over."""
    every = np.ones(flat.cut.count, dtype=bool)
    sheets, _ = sheets_of(surface, flat.cut, every, np.ones(flat.cut.count))
    return singular_values(sheets, flat.z)[1]


def polished(surface: Surface, flat: FlatCut) -> FlatCut:
    """The plane, where faces that are still long or thin are given their shape, chart by chart as far as that
    lays none over itself."""
    cut = flat.cut
    every = np.ones(cut.count, dtype=bool)
    sheets, _ = sheets_of(surface, cut, every, np.ones(cut.count))
    large, small = singular_values(sheets, flat.z)
    bad = (small < THIN / 2) | (large > 2 * LONG)
    if not bad.any():
        return flat
    better = FlatCut(cut=cut, z=relax(sheets, flat.z, around(sheets, bad)))
    pressed = (smaller_values(surface, better) < FLAT) & (small > 0)
    spoilt = np.concatenate([cut.chart[overlaps(better)[:, 0]], cut.chart[pressed]])
    return FlatCut(cut=cut, z=np.where(np.isin(cut.owner, spoilt), flat.z, better.z))


def lay_afresh(
    surface: Surface,
    pattern: Pattern,
    thickness: Float64[np.ndarray, " F"],
    before: FlatCut | None,
    fresh: Bool[np.ndarray, " F"] | None = None,
) -> FlatCut:
    """Panels laid flat, all of them or fresh faces alone, whole panels of them; the others stay where they
    were before."""
    if before is not None and fresh is not None and not fresh.any():
        return before
    cut = sew(surface, pattern, before, fresh)
    z, which = np.zeros(len(cut.vertex_map), dtype=np.complex128), np.ones(cut.count, dtype=bool)
    if before is not None and fresh is not None:
        z[cut.faces] = before.z[before.cut.faces]
        which = np.bincount(cut.chart, fresh, minlength=cut.count) > 0
    thick = np.ones(cut.count)
    np.minimum.at(thick, cut.chart, thickness)
    sheets, vertices = sheets_of(surface, cut, which, thick)
    flat = flatten(sheets)
    large, small = singular_values(sheets, flat)
    z[vertices] = relax(sheets, flat, around(sheets, (small < THIN) | (large > LONG)))
    return spread_fingers(surface, FlatCut(cut=cut, z=z), pattern.finger, which)


def sew(
    surface: Surface, pattern: Pattern, before: FlatCut | None, fresh: Bool[np.ndarray, " F"] | None
) -> Cut:
    """The surface cut into disks along the pattern's seams, all of it or fresh faces alone.

    Raises:
        GeometryError: a chart is no disk.
    """
    opened = cut_to_disks(surface, pattern.panel, pattern.twin, pattern.price, fresh)
    if before is not None and fresh is not None:
        anew = np.repeat(fresh, 3)
        opened = np.where(anew | anew[np.maximum(pattern.twin, 0)], opened, before.cut.open)
    cut = cut_open(surface.faces, pattern.twin, opened)
    laid = cut.chart if fresh is None else cut.chart[fresh]
    if (cut.euler_numbers()[laid] != 1).any():
        raise GeometryError("atlas: a panel does not become a disk")
    return cut


def with_room(surface: Surface, flat: FlatCut, pattern: Pattern) -> Int64[np.ndarray, " F"]:
    """Panels, where regions that are pressed together have become panels of their own."""
    cut = flat.cut
    sheets, _ = sheets_of(surface, cut, np.ones(cut.count, dtype=bool), np.ones(cut.count))
    large, small = singular_values(sheets, flat.z)
    pressed = (small < NEEDLE) | (((large * small < PRESSED) | (small < FLAT)) & ~pattern.whole)
    here, there = neighbours(cut, pattern.twin)
    region = connected_regions(2 * cut.chart + pressed, here, there)
    own = np.where(pressed & (np.bincount(region) >= OWN_ROOM)[region], region, -1)
    if not (own >= 0).any():
        return pattern.panel
    for _ in range(GROWN):
        reach = (own[here] >= 0) & (own[there] < 0)
        own[there[reach]] = own[here[reach]]
    panel = pattern.panel.copy()
    panel[own >= 0] = panel.max() + 1 + np.unique(own[own >= 0], return_inverse=True)[1]
    return merge_small(without_teeth(panel, pattern.twin), pattern.twin, FEWEST)


def without_overlaps(
    surface: Surface, flat: FlatCut, pattern: Pattern, thickness: Float64[np.ndarray, " F"]
) -> tuple[Int64[np.ndarray, " F"], Float64[np.ndarray, " F"]]:
    """Panels and how thick they are, changed for charts that lie over themselves."""
    panel, thickness, cut = pattern.panel.copy(), thickness.copy(), flat.cut
    over = overlaps(flat)
    here, there = neighbours(cut, pattern.twin)
    lengths = edge_lengths(surface, directed_edges(surface.faces)[~cut.open])
    weight = np.maximum(np.rint(PER_METRE * lengths), 1).astype(np.int32)
    for chart in np.flatnonzero(np.bincount(cut.chart[over[:, 0]]) > SHARED):
        mine, among = cut.chart == chart, cut.chart[here] == chart
        pairs = over[mine[over[:, 0]]]
        if (pattern.finger[mine] > 0).any() and thickness[mine].min() * THINNER > THINNEST:
            thickness[mine] *= THINNER
            hand_over(panel, cut, pattern, np.unique(pairs))
        else:
            beyond = beyond_seam(surface, mine, pairs, here[among], there[among], weight[among])
            panel[beyond] = panel.max() + 1
    return panel, thickness


def hand_over(
    panel: Int64[np.ndarray, " F"], cut: Cut, pattern: Pattern, faces: Int64[np.ndarray, " N"]
) -> None:
    """Give faces to the panel of the same part on whose border they lie, as between two fingers to the other
    side of the hand."""
    edge = (3 * faces[:, None] + np.arange(3)).reshape(-1)
    there = pattern.panel[pattern.twin[edge] // 3]
    here = pattern.panel[edge // 3]
    other = (there != here) & (there // MOST_SIDES == here // MOST_SIDES)
    panel[edge[other] // 3] = there[other]


def beyond_seam(
    surface: Surface,
    mine: Bool[np.ndarray, " F"],
    pairs: Int64[np.ndarray, "N 2"],
    here: Int64[np.ndarray, " M"],
    there: Int64[np.ndarray, " M"],
    weight: Int32[np.ndarray, " M"],
) -> Bool[np.ndarray, " F"]:
    """Faces of one chart beyond the shortest seam that parts what lies over each other: the pair that is
    farthest apart on the surface, each with those nearer to it than to the other. Faces here[i] and there[i]
    of the chart share an edge of that weight."""
    apart = np.linalg.norm(middle_of(surface, pairs[:, 0]) - middle_of(surface, pairs[:, 1]), axis=1)
    ends = pairs[apart.argmax()]
    involved = np.unique(pairs)
    off = np.linalg.norm(middle_of(surface, involved)[:, None] - middle_of(surface, ends), axis=2)
    source, sink = np.zeros(len(mine), dtype=bool), np.zeros(len(mine), dtype=bool)
    source[involved[off[:, 0] < NEARER * off[:, 1]]] = True
    sink[involved[off[:, 1] < NEARER * off[:, 0]]] = True
    first = minimum_cut(mine, source, sink, here, there, weight)
    beyond = np.zeros(len(mine), dtype=bool)
    beyond[np.flatnonzero(mine)[~first]] = True
    return beyond


def middle_of(surface: Surface, faces: Int64[np.ndarray, " N"]) -> Float64[np.ndarray, "N 3"]:
    return surface.vertices[surface.faces[faces]].mean(axis=1)


def check_flat(surface: Surface, flat: FlatCut) -> None:
    """Raises GeometryError for a face that is turned over or a chart that lies over itself."""
    cut = flat.cut
    turned = int((smaller_values(surface, flat) <= 0).sum())
    over = int((np.bincount(cut.chart[overlaps(flat)[:, 0]]) > STILL_SHARED).sum())
    if turned or over:
        raise GeometryError(f"atlas: {turned} faces would be turned over, {over} charts lie over themselves")
