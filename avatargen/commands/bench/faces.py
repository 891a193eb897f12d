"""How people's faces bear their shapes: one by one at full weight, and in mixtures."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float64, UInt8
from threadpoolctl import threadpool_limits

import assets
from assets.asset.asset import Asset
from assets.build_config import BuildConfig
from assets.errors import GeometryError
from assets.face import measure
from assets.face.face import moving, opened
from assets.face.names import ARKIT, VISEMES
from assets.picture.camera import view_camera
from assets.picture.light import lamps_around
from assets.picture.preview import Lit, PreviewConfig, render_view
from avatargen.atomic import write_together
from avatargen.avatar import Avatar
from avatargen.body.face import load_face
from avatargen.commands.bench.cost import measured
from avatargen.commands.bench.tables import table
from avatargen.loading import load_generator
from exporters.png import encode_png

MIXTURES, CHOSEN = 50, 0.15  # of random weights, and how likely each of ARKit's shapes is in one
HEIGHT, COLUMNS = 170, 12  # pixels of a picture of a shape, and pictures in a row
CLOSER, NARROW, LOWER = 0.66, 0.95, 0.09  # than a preview's picture of a face, in parts of it


EXPLAINED = f"""Made by `avatargen bench --face`. All {len(ARKIT) + len(VISEMES)} shapes at weight 1,
one by one, and {MIXTURES} random mixtures: each of ARKit's with a chance of {CHOSEN:g} at a weight
from 0 to 1, and one viseme. Edges: how many times as long the skin's edges become, of those that a shape
moves by {measure.MOVED:g} m, one shorter than {measure.SHORTEST:g} m counting as that long. Folded: area
of faces turned over. Blink and lips: the widest gap between lids that are shut, and between lips at M, B
and P and with a mouth that closes over an open jaw. Crossed: how far the lower lip's rim goes above the
upper one's: that of mouthClose, which is there to undo an open jaw.
Eye: how deep skin sinks into an eyeball. Mirrored: how far a left shape's size is off the
right one's. Seconds are the processor's."""


@dataclass(frozen=True, kw_only=True)
class FaceRow:
    """One person: the worst of all shapes, and of mixtures; lengths in millimetres."""

    seed: int
    refused: str = ""  # why the face cannot be opened
    seconds: float = 0.0  # the processor's, to open it and to carry all shapes
    faces: int = 0  # more than without
    stretch: float = 1.0  # of edges, p99 over those that a shape moves
    stretch_shape: str = ""
    stretch_most: float = 1.0
    mixtures: float = 1.0
    folded_mm2: float = 0.0
    folded_shape: str = ""
    blink_mm: float = 0.0
    lips_mm: float = 0.0
    crossed_mm: float = 0.0
    through_mm: float = 0.0
    mirrored: float = 0.0  # how far a left shape's size is off the right one's, of it


def run_faces(out: Path, weights: Path | None, seeds: Sequence[int], quick: bool) -> None:
    """Open the face of every seed, writing the table after each; a quick run takes one person, small."""
    torch.set_num_threads(1)  # so that processor seconds are those of the clock on an idle machine
    threadpool_limits(1, user_api="blas")
    out.mkdir(parents=True, exist_ok=True)
    generator, rows, picture = load_generator(weights), [], {}
    for seed in seeds[:1] if quick else seeds:
        avatar = generator.sample(seed)
        row, asset = measure_face(avatar, person(avatar, quick))
        rows.append(row)
        print(f"seed {seed}: {row.refused or f'edges {row.stretch:.2f} times as long'}", flush=True)
        if asset is not None and not picture:
            picture = {"face.png": encode_png(draw_shapes(asset))}
        data = json.dumps([asdict(row) for row in rows], indent=1).encode() + b"\n"
        files = {"face.json": data, "face.md": face_page(rows).encode(), **picture}
        write_together([(out / name, found) for name, found in files.items()])
    print(out / "face.md")


def person(avatar: Avatar, quick: bool) -> Asset:
    """The person with a closed face."""
    small = BuildConfig(pose="t", faces=4000, resolution=256, texture=512)
    return assets.build(avatar, small if quick else BuildConfig(pose="t"))


def measure_face(avatar: Avatar, asset: Asset) -> tuple[FaceRow, Asset | None]:
    """Open a face and try every shape; with the open one, where it opens."""
    try:
        with measured() as cost:
            found, motions, frame = moving(asset, opened(asset, avatar.body, load_face()))
    except GeometryError as error:
        return FaceRow(seed=avatar.seed, refused=str(error)), None
    assert found.welded is not None
    rest, shapes = welded(found, found.vertices), {m.name: welded(found, m.vertices) for m in found.morphs}
    faces = found.welded[found.faces]
    skin = faces[(faces < motions.skin).all(axis=1)]
    edges, moved = measure.edges_of(skin), np.any([d.any(axis=1) for d in shapes.values()], axis=0)
    near = skin[moved[skin].any(axis=1)]
    alone = {name: measure.stretch(rest, rest + d, edges) for name, d in shapes.items()}
    over = {name: float(measure.folded(rest, rest + d, near).sum()) for name, d in shapes.items()}
    worst, fold = max(alone, key=lambda name: alone[name].p99), max(over, key=lambda name: over[name])
    shut = rest + shapes["eyeBlinkLeft"] + shapes["eyeBlinkRight"]
    meeting = (rest + shapes["viseme_PP"], rest + shapes["jawOpen"] + shapes["mouthClose"])
    row = FaceRow(
        seed=avatar.seed,
        seconds=cost.cpu_seconds,
        faces=len(found.faces) - len(asset.faces),
        stretch=alone[worst].p99,
        stretch_shape=worst,
        stretch_most=max(each.most for each in alone.values()),
        mixtures=max(
            measure.stretch(rest, rest + mixture(shapes, seed), edges).p99 for seed in range(MIXTURES)
        ),
        folded_mm2=over[fold],
        folded_shape=fold,
        blink_mm=max(measure.lids_apart(motions, shut, eye) for eye in (0, 1)),
        lips_mm=max(measure.lips_apart(motions, at) for at in meeting),
        crossed_mm=max(measure.lips_crossed(motions, rest + d) for d in shapes.values()),
        through_mm=max(measure.eyes_through(motions, frame.own(rest + d)) for d in shapes.values()),
        mirrored=unlike(shapes),
    )
    return row, found


def welded(asset: Asset, values: np.ndarray) -> Float64[np.ndarray, "V 3"]:
    """What the vertices have, once for each welded one."""
    assert asset.welded is not None
    found = np.zeros((int(asset.welded.max()) + 1, 3))
    found[asset.welded] = values
    return found


def mixture(shapes: dict[str, Float64[np.ndarray, "V 3"]], seed: int) -> Float64[np.ndarray, "V 3"]:
    """Some of ARKit's shapes and one viseme, at weights from 0 to 1."""
    rng = np.random.default_rng(seed)
    weights = {name: rng.random() for name in ARKIT if rng.random() < CHOSEN}
    weights[list(VISEMES)[rng.integers(len(VISEMES))]] = rng.random()
    return np.sum([weight * shapes[name] for name, weight in weights.items()], axis=0)


def unlike(shapes: dict[str, Float64[np.ndarray, "V 3"]]) -> float:
    """The most that a shape of the left half is larger or smaller than that of the right one."""
    size = {name: float(np.linalg.norm(moved)) for name, moved in shapes.items()}
    pairs = [(size[name], size[f"{name[:-4]}Right"]) for name in size if name.endswith("Left")]
    pairs = [pair for pair in pairs if min(pair) > 0]
    return max(abs(left - right) / right for left, right in pairs)


def draw_shapes(asset: Asset) -> UInt8[np.ndarray, "H W 3"]:
    """The face at rest and under each shape, in rows, lit without shadows."""
    camera, config = view_camera(asset, "face"), PreviewConfig(height=HEIGHT)
    lower = camera.centre - LOWER * camera.height * camera.up
    camera = replace(
        camera, centre=lower, width=NARROW * camera.width * CLOSER, height=camera.height * CLOSER
    )
    pictures = [render_view(lit_plainly(asset), camera, config)]
    for morph in asset.morphs:
        turned = asset.normals if morph.normals is None else asset.normals + morph.normals
        shown = replace(asset, vertices=asset.vertices + morph.vertices, normals=turned, morphs=())
        pictures.append(render_view(lit_plainly(shown), camera, config))
    pictures += [np.full_like(pictures[0], 255)] * (-len(pictures) % COLUMNS)
    rows = [np.concatenate(pictures[i : i + COLUMNS], axis=1) for i in range(0, len(pictures), COLUMNS)]
    return np.concatenate(rows)


def lit_plainly(asset: Asset) -> Lit:
    """The asset in light from all around that nothing casts a shadow in."""
    lamps, normals = lamps_around(), asset.normals.astype(np.float64)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    return Lit(
        asset=asset,
        lamps=lamps,
        light=(3 * np.maximum(normals @ lamps.T, 0) + 0.8) / len(lamps),
        floor=np.ones((3, 3, len(lamps))),
        corner=asset.vertices.min(axis=0).astype(np.float64),
    )


def face_page(rows: Sequence[FaceRow]) -> str:
    """Every person, and the worst of all, as Markdown."""
    head = ["seed", "s", "faces", "edges p99", "at", "most", "mixtures", "folded mm2", "at", "blink mm"]
    head += ["lips mm", "crossed mm", "eye mm", "mirrored %"]
    lines = [line(row, str(row.seed)) for row in rows]
    made = [row for row in rows if not row.refused]
    worst = [line(worst_of(made), f"worst of {len(made)}")] if made else []
    parts = [
        "# Faces that move",
        EXPLAINED,
        table(head, worst),
        table(head, lines),
    ]
    return "\n\n".join(parts) + "\n"


def worst_of(rows: Sequence[FaceRow]) -> FaceRow:
    """The worst of each number."""
    pulled, fold = max(rows, key=lambda row: row.stretch), max(rows, key=lambda row: row.folded_mm2)
    names = ("seconds", "faces", "stretch", "stretch_most", "mixtures", "folded_mm2", "blink_mm", "lips_mm")
    most = {n: max(getattr(row, n) for row in rows) for n in (*names, "crossed_mm", "through_mm", "mirrored")}
    return FaceRow(seed=0, stretch_shape=pulled.stretch_shape, folded_shape=fold.folded_shape, **most)


def line(row: FaceRow, name: str) -> list[str]:
    """A row of the table."""
    if row.refused:
        return [name, row.refused, *[""] * 12]
    numbers = (row.blink_mm, row.lips_mm, row.crossed_mm, row.through_mm)
    return [
        name,
        f"{row.seconds:.2f}",
        str(row.faces),
        f"{row.stretch:.2f}",
        row.stretch_shape,
        f"{row.stretch_most:.1f}",
        f"{row.mixtures:.2f}",
        f"{row.folded_mm2:.2f}",
        row.folded_shape,
        *(f"{number:.3f}" for number in numbers),
        f"{100 * row.mirrored:.0f}",
    ]
