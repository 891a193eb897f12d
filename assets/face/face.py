"""An asset whose face moves: cut open along lips and lids, with a mouth inside, and a morph for each of
ARKit's 52 shapes and of the 15 visemes.

At rest nothing looks otherwise: new vertices lie on faces and edges that were there, and carry what these
do. Letters: W vertices of the asset, V welded ones, S the skin's, I the mouth's own. Metres.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float, Float64, Int64

from assets.asset.asset import Asset
from assets.asset.rig import Morph
from assets.face.cut import CutMesh
from assets.face.falloff import smooth
from assets.face.mouth import go_along
from assets.face.opened import OpenFace, open_face
from assets.face.shapes import face_shapes
from assets.face.swatch import COLOURS, Swatch, free_square
from assets.mesh.surface import Surface, vertex_normals
from assets.skin.skin import limit_influences
from assets.texture.normal_map import unit
from avatargen.body.face import FaceUnits, load_face
from avatargen.body.model import CanonicalBody
from avatargen.errors import InputError

STILL = 2e-5  # m; what a shape moves by less stays
TURNED = 2e-3  # of a normal's length; what a shape turns by less stays
FLAT, OPEN = np.array([[128, 128, 255]]), np.array([255])  # texels of a normal map and of occlusion
PLACE, NORMAL, UV, TANGENT, OTHERS = slice(0, 3), slice(3, 6), slice(6, 8), slice(8, 12), 12


def with_face(asset: Asset, body: CanonicalBody, units: FaceUnits | None = None) -> Asset:
    """The asset with a face that moves.

    Raises:
        InputError: the body is not the one that the units belong to.
        GeometryError: the surface over lips and eyes is no skin, or breaks off there.
    """
    units = units or load_face()
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
    return assembled(asset, open_face(mesh, body, units))


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
    assert asset.canonical is not None, "built from a field"
    swatch = free_square(asset)
    face = lined(face, swatch)
    mesh, inside, old = face.mesh, face.inside, len(asset.vertices)
    own, values, joint_count = len(inside.places), mesh.values[old:], len(asset.skeleton.parents)
    rest = at_rest(face, mesh.values[:, PLACE])
    normals = vertex_normals(Surface(vertices=rest, faces=face.faces))
    of_split = np.zeros(inside.first, np.int64)
    of_split[mesh.welded] = np.arange(len(mesh.welded))
    number = np.concatenate([of_split, len(mesh.welded) + np.arange(own)])
    skin = limit_influences(values[:, OTHERS : OTHERS + joint_count])
    head = [asset.skeleton.joint_names.index("head"), 0, 0, 0]
    kinds = np.concatenate([np.zeros(own - len(face.units.inner), np.int64), face.units.kinds])
    made = replace(
        asset,
        morphs=(),
        vertices=joined(asset.vertices, values[:, PLACE], rest[inside.first :]),
        normals=joined(asset.normals, unit(values[:, NORMAL]), unit(normals[inside.first :])),
        faces=np.concatenate([mesh.faces, number[inside.faces]]),
        welded=np.concatenate([mesh.welded, inside.first + np.arange(own)]),
        canonical=joined(asset.canonical, mesh.places[old:], inside.places),
        uv=joined(asset.uv, values[:, UV], swatch.uv(kinds, inside.places)),
        texture=swatch.painted(asset.texture, COLOURS),
        occlusion=None if asset.occlusion is None else swatch.painted(asset.occlusion, OPEN),
        normal_map=asset.normal_map
        and replace(
            asset.normal_map,
            texels=swatch.painted(asset.normal_map.texels, FLAT),
            tangents=joined(
                asset.normal_map.tangents,
                unit_tangents(values[:, TANGENT]),
                np.tile([1, 0, 0, 1.0], (own, 1)),
            ),
        ),
        joints=np.concatenate([asset.joints, skin.joints, np.tile(head, (own, 1))]),
        weights=joined(asset.weights, skin.weights, np.tile([1.0, 0, 0, 0], (own, 1))),
    )
    return replace(made, morphs=(*sliders(asset, face, rest), *face_morphs(made, face, rest, normals)))


def lined(face: OpenFace, swatch: Swatch) -> OpenFace:
    """The face with a seam of the texture along the rims of the lips: what is inside has colours of its own
    from there on. Of two vertices at one place the later one, of the inside, is the last."""
    mesh, inside = face.mesh, face.inside
    rim = np.unique(inside.faces[inside.faces < inside.first])
    split = np.zeros(inside.first, np.int64)
    split[mesh.welded] = np.arange(len(mesh.welded))
    values = mesh.values[split[rim]].copy()
    values[:, UV] = swatch.uv(np.zeros(len(rim), np.int64), mesh.places[split[rim]])
    seamed = replace(
        mesh,
        welded=np.concatenate([mesh.welded, rim]),
        places=np.concatenate([mesh.places, mesh.places[split[rim]]]),
        values=np.concatenate([mesh.values, values]),
    )
    return replace(face, mesh=seamed)


def at_rest(face: OpenFace, skin: Float64[np.ndarray, "W 3"]) -> Float64[np.ndarray, "V 3"]:
    """Welded places at rest of the skin's vertices, and of the mouth's, which go with it."""
    welded = np.zeros((face.inside.first, 3))
    welded[face.mesh.welded] = skin
    return np.concatenate([welded, go_along(face.inside.places, face.mesh.points, welded)])


def sliders(asset: Asset, face: OpenFace, rest: Float64[np.ndarray, "V 3"]) -> tuple[Morph, ...]:
    """The asset's own morphs on the open face."""
    first = OTHERS + len(asset.skeleton.parents)
    found = []
    for index, morph in enumerate(asset.morphs):
        moved = face.mesh.values[:, first + 3 * index : first + 3 * index + 3]
        inner = at_rest(face, face.mesh.values[:, PLACE] + moved) - rest
        found.append(replace(morph, vertices=joined(moved, inner[face.inside.first :])))
    return tuple(found)


def face_morphs(
    asset: Asset, face: OpenFace, rest: Float64[np.ndarray, "V 3"], normals: Float64[np.ndarray, "V 3"]
) -> Iterator[Morph]:
    """Every shape at rest: turned and scaled as the head is, faded out below it."""
    assert asset.welded is not None
    skeleton, head = asset.skeleton, asset.skeleton.joint_names.index("head")
    turn = np.eye(3) if skeleton.rest_rotations is None else skeleton.rest_rotations[head]
    fade = np.zeros(len(rest))
    fade[asset.welded] = head_share(asset)
    size = face_size(face, rest)
    own = rest @ turn / size
    turn = turn * size
    still, faces = np.zeros((len(skeleton.parents), 3)), face.faces
    for name, canonical in face_shapes(face, own):
        moved = fade[:, None] * (canonical @ turn.T)
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
    return smooth((asset.weights * moving).sum(axis=1, dtype=np.float64), 0.0, 0.6)


def face_size(face: OpenFace, rest: Float64[np.ndarray, "V 3"]) -> float:
    """How large the face is at rest, by its size in canonical space."""
    near = np.flatnonzero(face.curves.distance(face.mesh.points) < 0.02)
    spread = [np.linalg.norm(at[near] - at[near].mean(axis=0)) for at in (rest, face.mesh.points)]
    return float(spread[0] / max(spread[1], 1e-9))


def joined(*parts: Float[np.ndarray, "_ C"]) -> np.ndarray:
    """One below the other, in single precision."""
    return np.concatenate(parts).astype(np.float32)


def unit_tangents(tangents: Float64[np.ndarray, "N 4"]) -> Float64[np.ndarray, "N 4"]:
    """Of length 1, with a whole sign."""
    return np.concatenate([unit(tangents[:, :3]), np.where(tangents[:, 3:] < 0, -1.0, 1.0)], axis=1)
