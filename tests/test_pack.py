import numpy as np
import pytest

from assets.errors import GeometryError
from assets.texture.overlap import find_overlaps
from assets.texture.pack import Outline, pack
from assets.texture.raster import rasterise


def rectangle(width, height, upright=False):
    a, b, c, d = np.array([[0, 0], [width, 0], [width, height], [0, height]], dtype=np.float64)
    return Outline(
        triangles=np.array([[a, b, c], [a, c, d]]),
        border=np.array([[a, b], [b, c], [c, d], [d, a]]),
        upright=upright,
    )


def rectangles(count=30):
    rng = np.random.default_rng(0)
    return [rectangle(*rng.uniform(0.3, 3, 2)) for _ in range(count)]


def boxes(outlines, places):
    corners = [place.apply(each.border[:, 0]) for each, place in zip(outlines, places, strict=True)]
    return np.array([[each.min(axis=0), each.max(axis=0)] for each in corners])


@pytest.mark.parametrize("gap", [0.0, 0.01, 0.03])
def test_charts_keep_their_distance_from_each_other_and_from_the_border(gap):
    outlines = rectangles()
    places = pack(outlines, gap)
    found = boxes(outlines, places)
    assert found.min() >= gap / 2 - 1e-9 and found.max() <= 1 - gap / 2 + 1e-9
    for i in range(len(found)):
        for j in range(i):
            apart = np.maximum(found[i, 0] - found[j, 1], found[j, 0] - found[i, 1])
            assert np.linalg.norm(np.maximum(apart, 0)) > gap - 1e-9 or apart.max() > gap - 1e-9


def test_all_charts_have_one_scale_and_much_of_the_square_is_used():
    outlines = rectangles()
    places = pack(outlines, 0.005)
    assert len({place.scale for place in places}) == 1
    size = boxes(outlines, places)
    used = (size[:, 1] - size[:, 0]).prod(axis=1)
    assert used == pytest.approx([each.area * places[0].scale ** 2 for each in outlines])
    assert used.sum() > 0.7


def test_what_is_upright_stays_so():
    outlines = [*rectangles(8), rectangle(0.5, 4, upright=True)]
    assert pack(outlines, 0.01)[-1].quarters == 0


def test_turns_are_those_of_the_drawing():
    """A long chart that fits only lying down is turned, and lies where its cells are."""
    outlines = [rectangle(4, 1), rectangle(1, 4), rectangle(4, 1), rectangle(1, 4)]
    places = pack(outlines, 0.01)
    pairs = zip(outlines, places, strict=True)
    triangles = np.concatenate([place.apply(each.triangles.reshape(-1, 2)) for each, place in pairs])
    count = np.zeros(512 * 512, dtype=np.int64)
    for fragments in rasterise(triangles.reshape(-1, 3, 2) * 512, 512, 512):
        inner = (fragments.barycentric > 1e-6).all(axis=1)
        np.add.at(count, fragments.pixel[inner], 1)
    assert count.max() == 1


def test_too_many_charts_are_refused():
    with pytest.raises(GeometryError, match="no room"):
        pack([rectangle(1, 1)] * 100, 0.2)


def test_overlaps_are_those_that_each_texel_sees():
    rng = np.random.default_rng(0)
    triangles, chart = rng.uniform(0, 40, (40, 3, 2)), np.repeat([0, 1], 20)
    above: dict[tuple[int, int], set[int]] = {}
    for fragments in rasterise(triangles, 40, 40):
        inner = (fragments.barycentric > 1e-3).all(axis=1)
        for face, pixel in zip(fragments.triangle[inner], fragments.pixel[inner], strict=True):
            above.setdefault((int(chart[face]), int(pixel)), set()).add(int(face))
    found = find_overlaps(triangles, chart)
    wanted = {face for faces in above.values() if len(faces) > 1 for face in faces}
    assert (chart[found[:, 0]] == chart[found[:, 1]]).all()
    assert set(found.reshape(-1).tolist()) <= wanted
    apart = np.array([[[0, 0], [9, 0], [0, 9]], [[9, 0], [9, 9], [0, 9]]], dtype=np.float64)
    assert len(find_overlaps(apart, np.zeros(2, dtype=np.int64))) == 0
