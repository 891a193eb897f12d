"""An asset whose face moves: cut open along lips and lids, with a mouth and eyeballs inside, bones of jaw and
eyes, and a morph for each of ARKit's 52 shapes and of the 15 visemes.

At rest nothing looks otherwise: new vertices lie on faces and edges that were there, and carry what these
do. Letters: W vertices of the asset, V welded ones, S the skin's, I the mouth's and the eyes' own. Metres.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float, Float64, Int64

from assets.asset.asset import Asset
from assets.asset.rig import Morph
from assets.face.bones import jaw_motion, with_bones
from assets.face.cut import CutMesh
from assets.face.eyes import SOCKET, make_eyes
from assets.face.frame import Frame, at_rest, head_frame
from assets.face.motions import Motions
from assets.face.mouth import go_along
from assets.face.opened import UV, OpenFace, open_face
from assets.face.pictures import inner_uv, with_pictures
from assets.face.shapes import face_shapes
from assets.face.swatch import Swatch, free_squares
from assets.mesh.surface import Surface, vertex_normals
from assets.skin.skin import limit_influences
from assets.texture.normal_map import unit
from avatargen.body.face import FaceUnits, load_face
from avatargen.body.model import CanonicalBody
from avatargen.errors import InputError
from avatargen.smoothstep import smoothstep

STILL = 5e-5  # m; what a shape moves by less stays
TURNED = 2.5e-2  # of a normal's length; what a shape turns by less stays
PLACE, NORMAL, TANGENT, OTHERS = slice(0, 3), slice(3, 6), slice(8, 12), 12


def with_face(asset: Asset, body: CanonicalBody, units: FaceUnits | None = None) -> Asset:
    """The asset with a face that moves.

    Raises:
        InputError: the body is not the one that the units belong to.
        GeometryError: the surface over lips and eyes is no skin, or breaks off there.
    """
    return assembled(asset, opened(asset, body, units or load_face()))


def opened(asset: Asset, body: CanonicalBody, units: FaceUnits) -> OpenFace:
    """The asset's face, cut open. Raises the errors of `with_face`."""
    if len(body.vertices) != units.body_vertices:
        raise InputError(
            f"face: found a body of {len(body.vertices)} vertices, wanted the default one of "
            f"{units.body_vertices}, which alone has a face that moves; leave --body or --face out"
        )
    assert asset.canonical is not None and asset.welded is not None, "built from a field"
    mesh = CutMesh(
        faces=asset.faces,
        welded=asset.welded,
        places=asset.canonical.astype(np.float64),
        values=carried(asset),
    )
    return open_face(mesh, body, units)


def carried(asset: Asset) -> Float64[np.ndarray, "W C"]:
    """What a new vertex takes from its neighbours: place and normal at rest, uv, tangent, weights and how far
    sliders move it."""
    tangents = np.zeros((len(asset.vertices), 4))
    if asset.normal_map is not None:
        tangents = asset.normal_map.tangents.astype(np.float64)
    dense = np.zeros((len(asset.vertices), len(asset.skeleton.parents)))
    np.add.at(dense, (np.arange(len(dense))[:, None], asset.joints), asset.weights)
    sliders = [morph.vertices for morph in asset.morphs]
    return np.concatenate(
        [asset.vertices, asset.normals, asset.uv, tangents, dense, *sliders], axis=1
    ).astype(np.float64)


def assembled(asset: Asset, face: OpenFace) -> Asset:
    """The asset on the open face's mesh."""
    return moving(asset, face)[0]


def moving(asset: Asset, face: OpenFace) -> tuple[Asset, Motions, Frame]:
    """The asset on the open face's mesh, what moves it, and how its head is at rest."""
    for_eyes, for_mouth = free_squares(asset)
    face = lined(face, for_mouth)
    skin = at_rest(face, face.mesh.values[:, PLACE])
    frame = head_frame(asset, face, skin)
    own = frame.own(skin)
    motions = Motions(face, make_eyes(face, own[: face.inside.first]), own)
    rest = np.concatenate([skin, frame.rest(motions.eyes.places)])
    faces = np.concatenate([face.faces, motions.eyes.faces])
    normals = vertex_normals(Surface(vertices=rest, faces=faces))
    uv = inner_uv(motions, for_eyes, for_mouth)
    made = on_mesh(with_pictures(asset, face, for_eyes, for_mouth), motions, faces, rest, normals, uv)
    shapes = face_morphs(made, motions, frame, faces, rest, normals)
    made = replace(made, morphs=(*sliders(asset, motions, rest), *shapes))
    pivot, share = jaw_motion(motions)
    with_mouth = np.concatenate([face.inside.places, pivot[None]])
    jaw = go_along(with_mouth, face.mesh.points, rest[: face.inside.first])[-1:]
    balls = frame.rest(np.array([ball.centre for ball in motions.eyes.balls]))
    return with_bones(made, motions, np.concatenate([jaw, balls]), share), motions, frame


def on_mesh(
    asset: Asset,
    motions: Motions,
    faces: Int64[np.ndarray, "F 3"],
    rest: Float64[np.ndarray, "V 3"],
    normals: Float64[np.ndarray, "V 3"],
    uv: Float64[np.ndarray, "I 2"],
) -> Asset:
    """The asset with the open face's vertices and faces, without morphs; the head moves what is inside."""
    assert asset.canonical is not None, "built from a field"
    mesh, kept = motions.face.mesh, motions.face.kept
    values, count = mesh.values[len(kept) :], len(uv)
    inner = slice(len(rest) - count, len(rest))
    number = np.zeros(inner.start, np.int64)
    number[mesh.welded] = np.arange(len(mesh.welded))
    number = np.concatenate([number, len(mesh.welded) + np.arange(count)])
    skin = limit_influences(values[:, OTHERS : OTHERS + len(asset.skeleton.parents)])
    head = [asset.skeleton.joint_names.index("head"), 0, 0, 0]
    return replace(
        asset,
        morphs=(),
        vertices=joined(asset.vertices[kept], values[:, PLACE], rest[inner]),
        normals=joined(asset.normals[kept], unit(values[:, NORMAL]), unit(normals[inner])),
        faces=np.concatenate([mesh.faces, number[faces[len(mesh.faces) :]]]),
        welded=np.concatenate([mesh.welded, inner.start + np.arange(count)]),
        canonical=joined(asset.canonical[kept], mesh.places[len(kept) :], motions.at[inner]),
        uv=joined(asset.uv[kept], values[:, UV], uv),
        normal_map=asset.normal_map
        and replace(
            asset.normal_map,
            tangents=joined(
                asset.normal_map.tangents[kept],
                unit_tangents(values[:, TANGENT]),
                np.tile([1, 0, 0, 1.0], (count, 1)),
            ),
        ),
        joints=np.concatenate([asset.joints[kept], skin.joints, np.tile(head, (count, 1))]),
        weights=joined(asset.weights[kept], skin.weights, np.tile([1.0, 0, 0, 0], (count, 1))),
    )


def lined(face: OpenFace, swatch: Swatch) -> OpenFace:
    """The face with a seam of the texture along the rims of lips and lids: what is inside has colours of its
    own from there on. Of two vertices at one place the later one, of the inside, is the last."""
    mesh, inside = face.mesh, face.inside
    lips = np.unique(inside.faces[inside.faces < inside.first])
    rim = np.concatenate([lips, *face.margins])
    kinds = np.repeat([0, SOCKET], [len(lips), len(rim) - len(lips)])
    split = np.zeros(inside.first, np.int64)
    split[mesh.welded] = np.arange(len(mesh.welded))
    values = mesh.values[split[rim]].copy()
    values[:, UV] = swatch.uv(kinds, mesh.places[split[rim]])
    seamed = replace(
        mesh,
        welded=np.concatenate([mesh.welded, rim]),
        places=np.concatenate([mesh.places, mesh.places[split[rim]]]),
        values=np.concatenate([mesh.values, values]),
    )
    return replace(face, mesh=seamed)


def sliders(asset: Asset, motions: Motions, rest: Float64[np.ndarray, "V 3"]) -> tuple[Morph, ...]:
    """The asset's own morphs on the open face; eyes go with the skin around them."""
    face, eyes = motions.face, motions.eyes
    first, inner = OTHERS + len(asset.skeleton.parents), face.inside.first
    own, found = eyes.canonical(face), []
    for index, morph in enumerate(asset.morphs):
        moved = face.mesh.values[:, first + 3 * index : first + 3 * index + 3]
        there = at_rest(face, face.mesh.values[:, PLACE] + moved)
        ways = [go_along(own, face.mesh.points, at[:inner]) for at in (rest, there)]
        found.append(
            replace(morph, vertices=joined(moved, (there - rest[: len(there)])[inner:], ways[1] - ways[0]))
        )
    return tuple(found)


def face_morphs(
    asset: Asset,
    motions: Motions,
    frame: Frame,
    faces: Int64[np.ndarray, "F 3"],
    rest: Float64[np.ndarray, "V 3"],
    normals: Float64[np.ndarray, "V 3"],
) -> Iterator[Morph]:
    """Every shape at rest: turned and scaled as the head is, faded out below it."""
    assert asset.welded is not None
    fade = np.zeros(len(rest))
    fade[asset.welded] = head_share(asset)
    still = np.zeros((len(asset.skeleton.parents), 3))
    for name, canonical in face_shapes(motions):
        moved = fade[:, None] * frame.rest(canonical)
        moved[np.abs(moved).max(axis=1) < STILL] = 0
        turned = turned_normals(rest + moved, faces, np.asarray(moved.any(axis=1)), normals)
        yield Morph(
            name=name,
            vertices=moved[asset.welded].astype(np.float32),
            normals=turned[asset.welded].astype(np.float32),
            joints=still,
        )


def turned_normals(
    at: Float64[np.ndarray, "V 3"],
    faces: Int64[np.ndarray, "F 3"],
    moved: Bool[np.ndarray, " V"],
    before: Float64[np.ndarray, "V 3"],
) -> Float64[np.ndarray, "V 3"]:
    """What normals gain where vertices have moved: only faces around those are looked at."""
    turned = np.zeros_like(at)
    near = np.zeros(len(at), bool)
    near[faces[moved[faces].any(axis=1)]] = True
    around = faces[near[faces].any(axis=1)]
    if len(around):
        used, corners = np.unique(around, return_inverse=True)
        found = vertex_normals(Surface(vertices=at[used], faces=corners.reshape(-1, 3)))
        inner = near[used]
        turned[used[inner]] = found[inner] - before[used[inner]]
        turned[np.abs(turned).max(axis=1) < TURNED] = 0
    return turned


def head_share(asset: Asset) -> Float64[np.ndarray, " W"]:
    """1 where head and neck move a vertex, 0 where they do not."""
    names = asset.skeleton.joint_names
    moving = np.isin(asset.joints, [names.index(name) for name in ("head", "neck") if name in names])
    return smoothstep((asset.weights * moving).sum(axis=1, dtype=np.float64), 0.0, 0.6)


def joined(*parts: Float[np.ndarray, "_ C"]) -> np.ndarray:
    """One below the other, in single precision."""
    return np.concatenate(parts).astype(np.float32)


def unit_tangents(tangents: Float64[np.ndarray, "N 4"]) -> Float64[np.ndarray, "N 4"]:
    """Of length 1, with a whole sign."""
    return np.concatenate([unit(tangents[:, :3]), np.where(tangents[:, 3:] < 0, -1.0, 1.0)], axis=1)
