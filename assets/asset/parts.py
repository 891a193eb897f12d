"""Several assets on one skeleton as one: a person's body, garments and hair. `assets.asset.asset.apart` takes
them apart again.

Joined, they are one asset like any other, so it is animated, named and drawn as one: vertices and faces
follow one another, and the pictures are laid out as squares of one. The first part's square has half the side
of that picture, the others' a quarter: there is room for twelve.

    +-------+---+---+
    |       | 2 | 3 |
    |   1   +---+---+
    |       | 4 | 5 |
    +---+---+---+---+
    | 6 | 7 | 8 | 9 |   ...

Letters: S texels along a side of the whole.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import accumulate, pairwise
from typing import TypeVar

import numpy as np
from jaxtyping import UInt8

from assets.asset.asset import Asset, Part, Report
from assets.texture.normal_map import NormalMap
from avatargen.errors import InputError

QUARTERS = [  # top left corners, in uv, of all but the first
    (x / 4, y / 4) for y in range(4) for x in range(4) if not (x < 2 and y < 2)
]
FIRST, OTHER = 0.5, 0.25  # sides, in uv


def join(parts: Mapping[str, Asset], report: Report | None = None) -> Asset:
    """Assets by name, on the same skeleton and with the same kinds of pictures, as one. The first one's
    pictures have twice the side of the others', and parts that have the same picture share its square.

    Raises:
        InputError: there are more than fit on one picture, or their pictures have other sizes.
    """
    assets = list(parts.values())
    if not 0 < len(assets) <= 1 + len(QUARTERS):
        raise InputError(f"parts: found {len(assets)}, wanted 1 to {1 + len(QUARTERS)}; leave some out")
    as_first = [np.array_equal(each.texture, assets[0].texture) for each in assets]
    quarters = iter(QUARTERS)
    corners = [(0.0, 0.0) if shared else next(quarters) for shared in as_first]
    sides = [FIRST if shared else OTHER for shared in as_first]
    drawn = [assets[0], *(each for each, shared in zip(assets, as_first, strict=True) if not shared)]
    vertices = bounds(len(each.vertices) for each in assets)
    faces = bounds(len(each.faces) for each in assets)
    first, maps = assets[0], found(each.normal_map for each in assets)
    welded, occlusion = found(a.welded for a in assets), found(a.occlusion for a in assets)
    canonical = found(each.canonical for each in assets)
    return replace(
        first,
        vertices=np.concatenate([each.vertices for each in assets]),
        normals=np.concatenate([each.normals for each in assets]),
        faces=shifted([each.faces for each in assets], vertices),
        welded=shifted(welded, bounds(int(each.max()) + 1 for each in welded)) if welded else None,
        canonical=np.concatenate(canonical) if canonical else None,
        uv=np.concatenate(
            [(a.uv * side + c).astype(np.float32) for a, c, side in zip(assets, corners, sides, strict=False)]
        ),
        texture=sheet([each.texture for each in drawn]),
        normal_map=NormalMap(
            texels=sheet([each.normal_map.texels for each in drawn if each.normal_map is not None]),
            tangents=np.concatenate([each.tangents for each in maps]),
        )
        if maps
        else None,
        occlusion=sheet([each.occlusion for each in drawn if each.occlusion is not None])
        if occlusion
        else None,
        joints=np.concatenate([each.joints for each in assets]),
        weights=np.concatenate([each.weights for each in assets]),
        morphs=tuple(
            replace(morph, vertices=np.concatenate([each.morphs[number].vertices for each in assets]))
            for number, morph in enumerate(first.morphs)
        ),
        report=report,
        parts=tuple(
            Part(name=name, vertices=v, faces=f, corner=c, side=side)
            for name, v, f, c, side in zip(parts, vertices, faces, corners, sides, strict=False)
        ),
    )


def keep(asset: Asset, names: Collection[str]) -> Asset:
    """The asset with only some of its parts, in the order that they have. Pictures stay whole.

    Raises:
        InputError: it has none of them.
    """
    kept = [part for part in asset.parts if part.name in names]
    if not kept:
        raise InputError(
            f"parts: found none of {', '.join(sorted(names)) or 'nothing'} among "
            f"{', '.join(part.name for part in asset.parts) or 'no parts'}; name some of those"
        )
    rows = np.concatenate([np.arange(*part.vertices) for part in kept])
    vertices = bounds(part.vertices[1] - part.vertices[0] for part in kept)
    faces = bounds(part.faces[1] - part.faces[0] for part in kept)
    normal_map = asset.normal_map
    if normal_map is not None:
        normal_map = replace(normal_map, tangents=normal_map.tangents[rows])
    welded = None if asset.welded is None else np.unique(asset.welded[rows], return_inverse=True)[1]
    return replace(
        asset,
        vertices=asset.vertices[rows],
        normals=asset.normals[rows],
        faces=shifted([asset.faces[slice(*p.faces)] - p.vertices[0] for p in kept], vertices),
        welded=None if welded is None else welded.reshape(-1).astype(np.int64),
        canonical=None if asset.canonical is None else asset.canonical[rows],
        uv=asset.uv[rows],
        normal_map=normal_map,
        joints=asset.joints[rows],
        weights=asset.weights[rows],
        morphs=tuple(morph.of(rows) for morph in asset.morphs),
        parts=tuple(replace(p, vertices=v, faces=f) for p, v, f in zip(kept, vertices, faces, strict=True)),
    )


T = TypeVar("T")


def found(values: Iterable[T | None]) -> list[T]:
    """All of them, or none where one is None."""
    values = list(values)
    kept = [value for value in values if value is not None]
    return kept if len(kept) == len(values) else []


def shifted(numbers: list[np.ndarray], ranges: list[tuple[int, int]]) -> np.ndarray:
    """Numbers of each of several within all of them."""
    return np.concatenate([each + start for each, (start, _) in zip(numbers, ranges, strict=True)])


def bounds(counts: Iterable[int]) -> list[tuple[int, int]]:
    """Where each of several begins and ends, one after another."""
    return list(pairwise(accumulate(counts, initial=0)))


def sheet(pictures: Sequence[UInt8[np.ndarray, "_ _ *C"]]) -> UInt8[np.ndarray, "S S *C"]:
    """Square pictures laid out on one; it is black where there is none.

    Raises:
        InputError: the others' sides are not half of the first's.
    """
    quarter = len(pictures[0]) // 2
    if len(pictures[0]) != 2 * quarter or any(len(each) != quarter for each in pictures[1:]):
        sizes = [len(each) for each in pictures]
        raise InputError(
            f"parts: found pictures of {sizes} texels; all but the first must have half its side"
        )
    whole = np.zeros((4 * quarter, 4 * quarter, *pictures[0].shape[2:]), np.uint8)
    for picture, (u, v) in zip(pictures, [(0.0, 0.0), *QUARTERS], strict=False):
        x, y = round(u * len(whole)), round(v * len(whole))
        whole[y : y + len(picture), x : x + len(picture)] = picture
    return whole
