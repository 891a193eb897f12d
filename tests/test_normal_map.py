"""The normal map: what a viewer decodes from it is the gradient of the field."""

import numpy as np
import pytest
import torch
from shapes import icosphere, sphere
from test_atlas import parts_of, small_person
from test_bake import bilinear

from assets.errors import GeometryError
from assets.mesh.measure import sample_surface
from assets.mesh.surface import Surface, vertex_normals
from assets.skin.rest import RestMesh
from assets.texture.atlas import Atlas, AtlasConfig, unwrap
from assets.texture.bake import BakeConfig, map_texels
from assets.texture.normal_map import NormalMap, bake_normals
from avatargen.errors import FieldError

WAVES, HEIGHT, RADIUS, SIZE = 25.0, 0.002, 0.8, 512
CONFIG = BakeConfig(texture_size=SIZE)


def bumpy(points):
    """A sphere with ripples too fine for its mesh."""
    return points.norm(dim=1) - RADIUS - HEIGHT * torch.sin(WAVES * points).prod(dim=1)


def slope(points):
    """The unit gradient of `bumpy`, by hand."""
    sine, cosine = np.sin(WAVES * points), np.cos(WAVES * points)
    found = points / np.linalg.norm(points, axis=1, keepdims=True)
    for axis in range(3):
        found[:, axis] -= HEIGHT * WAVES * cosine[:, axis] * np.delete(sine, axis, axis=1).prod(axis=1)
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def at_rest(surface: Surface, matrix=None) -> RestMesh:
    """The surface moved by a linear map."""
    vertices = surface.vertices @ (np.eye(3) if matrix is None else matrix).T
    normals = vertex_normals(Surface(vertices=vertices, faces=surface.faces))
    frames = np.eye(4)[None]
    return RestMesh(
        vertices=vertices, normals=normals, T_world_joint=frames, rest_rotations=frames[:, :3, :3]
    )


def charts(surface: Surface) -> Atlas:
    return unwrap(surface, parts_of(surface), AtlasConfig(texture_size=SIZE))


def seen(found: NormalMap, rest: RestMesh, surface: Surface, atlas: Atlas, face, barycentric):
    """World normals as three.js and Khronos' viewer build them, with linear filtering."""
    unit = lambda rows: rows / np.linalg.norm(rows, axis=1, keepdims=True)  # noqa: E731
    inside = lambda values, corners: np.einsum("nc,ncd->nd", barycentric, values[corners])  # noqa: E731
    here = atlas.faces[face]
    normals = rest.normals[atlas.vertex_map]
    tangents = found.tangents.astype(np.float64)
    bitangents = np.cross(normals, tangents[:, :3]) * tangents[:, 3:]
    n, t, b = (unit(inside(values, here)) for values in (normals, tangents[:, :3], bitangents))
    x, y, z = (2 * bilinear(found.texels, inside(atlas.uv.astype(np.float64), here)) / 255 - 1).T[..., None]
    return unit(x * t + y * b + z * n)


def degrees(first, second):
    return np.degrees(np.arccos(np.clip((first * second).sum(axis=1), -1, 1)))


def test_decoded_normals_are_the_fields():
    surface = icosphere(RADIUS, rounds=4)
    rest, atlas = at_rest(surface), charts(surface)
    found = bake_normals(surface, rest, atlas, bumpy, CONFIG)
    face, barycentric = sample_surface(surface, 20_000, seed=0)
    points = np.einsum("nc,ncd->nd", barycentric, surface.vertices[surface.faces[face]])
    off = degrees(seen(found, rest, surface, atlas, face, barycentric), slope(points))
    plain = degrees(vertex_normals(surface)[surface.faces[face]].mean(axis=1), slope(points))
    assert off.mean() < 0.4  # eight bits alone cost .2
    assert np.quantile(off, 0.999) < 1.5
    assert plain.mean() > 1.5  # the mesh does not know the ripples


def test_every_texel_is_its_own_inverse():
    """Without filtering: decoded at a texel's own place it is the gradient, to the last of eight bits."""
    surface = small_person()
    rest, atlas = at_rest(surface), charts(surface)
    field = lambda points: points @ torch.tensor([0.6, 0.48, 0.64])  # noqa: E731
    found = bake_normals(surface, rest, atlas, field, CONFIG)
    texel_map = map_texels(atlas, SIZE)
    face, barycentric = texel_map.face[texel_map.asked], texel_map.barycentric(texel_map.asked)
    corners, split = surface.faces[face], atlas.faces[face]
    unit = lambda rows: rows / np.linalg.norm(rows, axis=1, keepdims=True)  # noqa: E731
    n = unit(np.einsum("nc,ncd->nd", barycentric, rest.normals[corners]))
    t = unit(np.einsum("nc,ncd->nd", barycentric, found.tangents[split, :3].astype(np.float64)))
    b = unit(np.cross(n, t)) * found.tangents[split[:, 0], 3:]
    x, y, z = (found.texels.reshape(-1, 3)[texel_map.asked] / 127.5 - 1).T[..., None]
    off = degrees(unit(x * t + y * b + z * n), np.array([[0.6, 0.48, 0.64]]))
    towards = (n @ [0.6, 0.48, 0.64]) > 0.2
    assert towards.mean() > 0.3
    assert off[towards].max() < 0.5


def test_a_stretched_rest_pose_carries_the_normals_along():
    """A linear map takes normals by its inverse transpose, wherever it keeps what is across a face."""
    surface = icosphere(RADIUS, rounds=4)
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    rest, atlas = at_rest(surface, turn), charts(surface)
    found = bake_normals(surface, rest, atlas, bumpy, CONFIG)
    face, barycentric = sample_surface(surface, 5_000, seed=1)
    points = np.einsum("nc,ncd->nd", barycentric, surface.vertices[surface.faces[face]])
    off = degrees(seen(found, rest, surface, atlas, face, barycentric), slope(points) @ turn.T)
    assert np.quantile(off, 0.99) < 1.5
    plate = Surface(
        vertices=np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]),
        faces=np.array([[0, 1, 2], [0, 2, 3]]),
    )
    uv = np.array([[0.1, 0.9], [0.9, 0.9], [0.9, 0.1], [0.1, 0.1]], dtype=np.float32)
    flat = Atlas(vertex_map=np.arange(4), uv=uv, faces=plate.faces)
    pulled = at_rest(plate, np.diag([2.0, 0.5, 1.0]))
    tilted = lambda points: points @ torch.tensor([-0.3, -0.2, 1.0])  # noqa: E731
    texel = bake_normals(plate, pulled, flat, tilted, CONFIG).texels[SIZE // 2, SIZE // 2]
    wanted = np.array([-0.3 / 2, -0.2 / 0.5, 1.0])
    assert np.abs(texel / 127.5 - 1 - wanted / np.linalg.norm(wanted)).max() < 0.008


def test_where_mesh_and_field_agree_the_map_is_flat_to_the_last_texel():
    surface = icosphere(RADIUS, rounds=5)
    found = bake_normals(surface, at_rest(surface), charts(surface), sphere(RADIUS), CONFIG)
    assert np.abs(found.texels.astype(int) - [128, 128, 255]).max() <= 1


def test_gradients_that_vanish_or_point_inward_are_held_above_the_surface():
    surface = icosphere(RADIUS, rounds=2)
    rest, atlas = at_rest(surface), charts(surface)
    empty = bake_normals(surface, rest, atlas, lambda points: points[:, 0] * 0, CONFIG)
    assert (empty.texels == [128, 128, 255]).all()
    inward = bake_normals(surface, rest, atlas, lambda points: -sphere()(points), CONFIG)
    assert inward.texels[..., 2].min() > 128
    with pytest.raises(FieldError, match="NaN"):
        bake_normals(surface, rest, atlas, lambda points: points[:, 0] * torch.nan, CONFIG)


@pytest.mark.parametrize("tangent", [[2.0, 0, 0, 1], [1, 0, 0, 0.5], [np.nan, 0, 0, 1]])
def test_unfinished_tangents_are_refused(tangent):
    texels = np.full((16, 16, 3), 128, dtype=np.uint8)
    with pytest.raises(GeometryError, match="tangents"):
        NormalMap(texels=texels, tangents=np.array([tangent], dtype=np.float32))
