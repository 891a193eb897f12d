"""Skins learned: photographs as mixtures of the same few patterns on the body's surface, by a truncated
singular value decomposition; irises seen from the front.

Letters: F faces, S skins, N nodes, K patterns, P points. sRGB 0..1.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from avatargen.body.distance import BodyHit
from avatargen.body.model import CanonicalBody
from avatargen.generator.dressed.config import SkinConfig, TableConfig
from avatargen.generator.dressed.lattice import lattice
from avatargen.training.dressed.painting import fitted
from avatargen.wardrobe.face_paint import FaceLines
from avatargen.wardrobe.makehuman.face import SkinPaint
from avatargen.wardrobe.makehuman.load import read_texture
from avatargen.wardrobe.makehuman.person import Wardrobe
from avatargen.wardrobe.makehuman.texture import texels

IRIS_SIDE = 96  # texels across an eyeball
POINTS_PER_NODE = 8
NOTHING_DRAWN = FaceLines(brow_width=0.0, brow_arch=0.0, lashes=0.0)


@dataclass(frozen=True, kw_only=True)
class SkinCut:
    """How many patterns, and how finely the body, the hands and the head are cut."""

    patterns: int = 16
    body: int = 2
    hands: int = 3
    head: int = 6


@dataclass(frozen=True, kw_only=True, eq=False)
class LearnedSkins:
    """Values for `LearnedSkin`, table by table with the faces that each covers."""

    config: SkinConfig
    tables: tuple[Float[np.ndarray, "_ K"], ...]
    covered: tuple[Bool[np.ndarray, " F"], ...]
    mixing: Float[np.ndarray, "S K 3"]
    middle: Float[np.ndarray, "S 3"]
    irises: np.ndarray


def grown(on: Bool[np.ndarray, " F"], faces: np.ndarray) -> Bool[np.ndarray, " F"]:
    """The faces and those that touch them."""
    touched = np.zeros(int(faces.max()) + 1, dtype=bool)
    touched[faces[on]] = True
    return np.asarray(touched[faces].any(axis=1))


def on_joints(body: CanonicalBody, names: Callable[[str], bool]) -> Bool[np.ndarray, " F"]:
    """The faces that mostly follow the joints of these names."""
    columns = [i for i, name in enumerate(body.joint_names) if names(name)]
    return np.asarray((body.weights[:, columns].sum(axis=1) > 0.5)[body.faces].all(axis=1))


def points_on(
    body: CanonicalBody, covered: Bool[np.ndarray, " F"], count: int, rng: np.random.Generator
) -> BodyHit:
    """Random points on the body's surface, as many on each face."""
    face = rng.choice(np.flatnonzero(covered), size=count)
    return BodyHit(
        distance=np.zeros(count, np.float32),
        face=face,
        barycentric=rng.dirichlet((1.0, 1.0, 1.0), size=count).astype(np.float32),
    )


def learn_skins(wardrobe: Wardrobe, cut: SkinCut, show: Callable[[str], None]) -> LearnedSkins:
    """Learn all skins and irises of a wardrobe."""
    body, rng = wardrobe.body, np.random.default_rng(0)
    head = on_joints(body, lambda name: name in ("head", "jaw"))
    hands = on_joints(body, lambda name: "wrist" in name or name[-1].isdigit())
    covered = [np.ones(len(body.faces), dtype=bool), grown(hands, body.faces), grown(head, body.faces)]
    tables = [
        lattice(body.faces, on, n) for on, n in zip(covered, (cut.body, cut.hands, cut.head), strict=True)
    ]
    hits = [
        points_on(body, on, POINTS_PER_NODE * t.count, rng) for on, t in zip(covered, tables, strict=True)
    ]
    paint = paint_of(wardrobe)
    seen: list[list[np.ndarray]] = [[] for _ in tables]
    for path in wardrobe.skins.values():
        texture = read_texture(path)
        for number, (table, hit) in enumerate(zip(tables, hits, strict=True)):
            uv = np.einsum("nk,nka->na", hit.barycentric, paint.corners[hit.face])
            seen[number].append(fitted(body, table, hit, texels(texture, uv)[:, :3]))
        show(path.stem)
    found, mixing, middle, error = patterns([np.stack(each, axis=1) for each in seen], cut.patterns)
    show(f"{cut.patterns} patterns of {3 * len(wardrobe.skins)}: {error:.4f} mean square root error")
    config = SkinConfig(
        skins=tuple(wardrobe.skins),
        irises=tuple(wardrobe.irises),
        tables=tuple(TableConfig(segments=t.segments, numbers=cut.patterns, nodes=t.count) for t in tables),
        iris_side=IRIS_SIDE,
    )
    return LearnedSkins(
        config=config,
        tables=tuple(found),
        covered=tuple(covered),
        mixing=mixing,
        middle=middle,
        irises=np.stack([iris_patch(paint_of(wardrobe, name)) for name in wardrobe.irises]),
    )


def patterns(
    seen: list[Float[np.ndarray, "_ S 3"]], count: int
) -> tuple[list[np.ndarray], np.ndarray, np.ndarray, float]:
    """Numbers of each table's nodes, [N K]; what turns them into skins, [S K 3] and [S 3]; the error."""
    skins = seen[0].shape[1]
    whole = np.concatenate([each.reshape(len(each), -1) for each in seen]).astype(np.float64)
    middle = np.median(whole, axis=0)
    centred = whole - middle
    _, vectors = np.linalg.eigh(centred.T @ centred)
    directions = vectors[:, ::-1][:, :count]
    numbers = centred @ directions
    error = float(np.sqrt(np.mean((numbers @ directions.T - centred) ** 2)))
    parts = np.split(numbers, np.cumsum([len(each) for each in seen])[:-1])
    for part in parts:
        part[0] = 0  # node 0 has none
    mixing = np.ascontiguousarray(directions.reshape(skins, 3, count).transpose(0, 2, 1))
    return parts, mixing, middle.reshape(skins, 3), error


def paint_of(wardrobe: Wardrobe, iris: str | None = None) -> SkinPaint:
    """A face painted white, with one iris."""
    return SkinPaint(
        hm08=wardrobe.hm08,
        body=wardrobe.body,
        skin=np.full((1, 1, 3), 255, np.uint8),
        iris=read_texture(wardrobe.irises[iris or next(iter(wardrobe.irises))]),
        lines=NOTHING_DRAWN,
        hair_colour=(0.0, 0.0, 0.0),
        chest_covered=False,
    )


def iris_patch(paint: SkinPaint) -> np.ndarray:
    """An eyeball seen from the front, a texel's middle at (i + 0.5) / side of its width, bytes."""
    axis = (np.arange(IRIS_SIDE) + 0.5) / IRIS_SIDE * 2 - 1
    off = np.stack(np.meshgrid(axis, axis, indexing="xy"), axis=-1).reshape(-1, 2)
    colour = paint.own_iris(off).reshape(IRIS_SIDE, IRIS_SIDE, 3)
    return (colour.clip(0, 1) * 255).round().astype(np.uint8)
