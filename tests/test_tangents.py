"""Tangents: those that MikkTSpace gives, asked of Blender, and the frame's meaning on a square."""

import subprocess
from pathlib import Path

import numpy as np
import pytest
from shapes import icosphere
from test_atlas import parts_of, small_person

from assets.mesh.surface import Surface, vertex_normals
from assets.texture.atlas import AtlasConfig, unwrap
from assets.texture.tangents import find_tangents
from tests.verdicts import JUDGES, blender_python

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])
FRONT = np.tile([0.0, 0.0, 1.0], (4, 1))


def square() -> Surface:
    """A unit square that faces +z."""
    return Surface(vertices=np.pad(SQUARE, ((0, 0), (0, 1))), faces=FACES)


@pytest.mark.parametrize("turn", [0.0, 0.4, 2.0])
@pytest.mark.parametrize("mirrored", [False, True])
def test_the_tangent_runs_with_u_and_the_bitangent_up_the_picture(turn, mirrored):
    c, s = np.cos(turn), np.sin(turn)
    place = 0.3 * (SQUARE - 0.5) @ np.array([[c, s], [-s, c]]) * [-1 if mirrored else 1, 1]
    uv = place * [1, -1] + 0.5  # v down
    found = find_tangents(square(), FRONT, uv).astype(np.float64)
    up = np.cross(FRONT, found[:, :3]) * found[:, 3:]
    assert (found[:, 3] == (-1 if mirrored else 1)).all()
    for direction, wanted in ((found[:, :3], [1.0, 0.0]), (up, [0.0, 1.0])):
        moved = np.linalg.lstsq(SQUARE[1:] - SQUARE[0], place[1:] - place[0], rcond=None)[0]
        there = direction[:, :2] @ moved
        assert there / np.linalg.norm(there, axis=1, keepdims=True) == pytest.approx(
            np.tile(wanted, (4, 1)), abs=1e-6
        )


def test_faces_without_room_in_the_texture_still_get_tangents():
    found = find_tangents(square(), FRONT, np.zeros((4, 2)))
    assert np.linalg.norm(found[:, :3], axis=1) == pytest.approx(1)
    assert found[:, 2] == pytest.approx(0)
    assert (found[:, 3] == 1).all()


@pytest.mark.parametrize("shape", ["sphere", "person"])
def test_blenders_mikktspace_gives_the_same(shape, tmp_path: Path):
    python = blender_python()
    surface = icosphere(0.8, rounds=3) if shape == "sphere" else small_person()
    atlas = unwrap(surface, parts_of(surface), AtlasConfig(texture_size=256))
    split = Surface(vertices=surface.vertices[atlas.vertex_map], faces=atlas.faces)
    normals = vertex_normals(surface)[atlas.vertex_map]
    ours = find_tangents(split, normals, atlas.uv.astype(np.float64))
    asked, found = tmp_path / "asked.npz", tmp_path / "found.npz"
    np.savez(asked, vertices=split.vertices, faces=split.faces, normals=normals, uv=atlas.uv)
    command = [str(python), str(JUDGES / "blender_tangents.py"), str(asked), str(found)]
    run = subprocess.run(command, capture_output=True, text=True, timeout=240)
    assert found.exists(), run.stdout + run.stderr
    with np.load(found) as arrays:
        theirs = arrays["tangents"]  # F 3 4
    here = ours[atlas.faces].astype(np.float64)
    degrees = np.degrees(np.arccos(np.clip((here * theirs)[..., :3].sum(axis=-1), -1, 1)))
    assert (here[..., 3] == theirs[..., 3]).all()
    assert (degrees > 0.1).mean() < 0.005  # where a chart meets itself in a point, groups differ
    assert shape == "sphere" or len(np.unique(ours[:, 3])) == 2  # mirrored charts are among them
