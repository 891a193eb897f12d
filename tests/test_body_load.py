"""Body files: what is written is read back, SMPL's form loads, damaged or forged files are refused."""

import io
import struct
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest

from avatargen.body.conventions import volume
from avatargen.body.joints import SMPL_JOINT_NAMES
from avatargen.body.load import load_body, save_body
from avatargen.body.model import Body
from avatargen.errors import InputError
from tests.bodies import capsule_body, smpl_like_arrays

ARRAYS = ("v_template", "faces", "weights", "parents", "J_regressor", "shapedirs", "posedirs")


@pytest.mark.parametrize("pose_blend", [False, True])
def test_what_is_saved_is_read_back(tmp_path: Path, pose_blend: bool):
    body = capsule_body(pose_blend=pose_blend)
    save_body(body, tmp_path / "body.npz")
    again = load_body(tmp_path / "body.npz")

    assert again.joint_names == body.joint_names
    for name in ARRAYS:
        assert np.array_equal(getattr(again, name), getattr(body, name)), name


def test_an_smpl_like_file_of_6890_vertices_loads(tmp_path: Path):
    arrays = smpl_like_arrays()
    np.savez(tmp_path / "smpl.npz", **arrays)  # pyright: ignore[reportArgumentType]
    body = load_body(tmp_path / "smpl.npz")

    assert isinstance(body, Body)
    assert body.v_template.shape == (6890, 3)
    assert body.joint_names == SMPL_JOINT_NAMES
    assert body.parents[0] == -1
    assert (body.parents[1:] < np.arange(1, 24)).all()
    assert np.allclose(body.v_template, arrays["v_template"])


def test_other_joint_counts_load(tmp_path: Path):
    body = capsule_body()
    arrays = {
        "v_template": body.v_template,
        "f": body.faces,
        "weights": np.repeat([[0.5, 0.5, 0.0]], len(body.v_template), axis=0),
        "kintree_table": np.array([[2**32 - 1, 7, 7], [7, 8, 9]], dtype=np.int64),
        "J_regressor": body.J_regressor[:3],
        "shapedirs": body.shapedirs,
    }
    np.savez(tmp_path / "three.npz", **arrays)
    loaded = load_body(tmp_path / "three.npz")

    assert loaded.joint_names == ("joint_00", "joint_01", "joint_02")
    assert loaded.parents.tolist() == [-1, 0, 0]  # parents are given by id, and stored by place


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("v_template", None),
        ("f", None),
        ("weights", np.ones((6890, 24))),
        ("weights", np.full((6890, 24), np.nan)),
        ("v_template", np.zeros((6890, 2))),
        ("v_template", np.full((6890, 3), np.inf)),
        ("f", np.full((10, 3), 0.5)),
        ("f", np.full((10, 3), 6890)),
        ("f", np.zeros((10, 4), dtype=int)),
        ("kintree_table", np.zeros((2, 24), dtype=int)),
        ("J_regressor", np.zeros((23, 6890))),
        ("shapedirs", np.zeros((6890, 3))),
        ("shapedirs", np.array(["x"] * 4)),
        ("posedirs", np.zeros((6890, 3, 206))),
        ("joint_names", np.array(["a"] * 24)),
        ("v_template", np.array([{}], dtype=object)),
    ],
)
def test_files_that_hold_no_body_are_refused(tmp_path: Path, key: str, value: np.ndarray | None):
    arrays = smpl_like_arrays() | {key: value}
    kept = {k: v for k, v in arrays.items() if v is not None}
    np.savez(tmp_path / "bad.npz", **kept)  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match="body"):
        load_body(tmp_path / "bad.npz")


def test_missing_cut_and_foreign_files_are_refused(tmp_path: Path):
    save_body(capsule_body(), tmp_path / "body.npz")
    whole = (tmp_path / "body.npz").read_bytes()
    for name, content in {"cut": whole[:-5000], "empty": b"", "text": b"hello" * 100}.items():
        (tmp_path / f"{name}.npz").write_bytes(content)
        with pytest.raises(InputError, match=r"no whole \.npz"):
            load_body(tmp_path / f"{name}.npz")
    with pytest.raises(InputError, match="cannot read"):
        load_body(tmp_path / "none.npz")
    with pytest.raises(InputError, match="suffix"):
        load_body(tmp_path / "body.obj")


def test_random_damage_never_gives_anything_but_a_body_or_an_input_error(tmp_path: Path):
    save_body(capsule_body(0.06), tmp_path / "body.npz")
    whole = bytearray((tmp_path / "body.npz").read_bytes())
    rng = np.random.default_rng(0)
    refused = 0
    for _ in range(150):
        damaged = bytearray(whole)
        for place in rng.integers(len(whole), size=4):
            damaged[place] = rng.integers(256)
        (tmp_path / "damaged.npz").write_bytes(damaged)
        try:
            load_body(tmp_path / "damaged.npz")
        except InputError:
            refused += 1
    assert refused > 100


def forged(header: bytes, data: bytes = b"") -> bytes:
    """An .npz whose v_template has this header."""
    stream = io.BytesIO()
    others = ("f", "weights", "kintree_table", "J_regressor", "shapedirs")
    np.savez(stream, **{key: np.zeros(3) for key in others})  # pyright: ignore[reportArgumentType]
    with zipfile.ZipFile(stream, "a", zipfile.ZIP_DEFLATED) as archive:
        member = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + data
        archive.writestr("v_template.npy", member)
    return stream.getvalue()


@pytest.mark.parametrize(
    "header",
    [
        b"{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999, 3), }\n",
        b"{'descr': '<f8', 'fortran_order': False, 'shape': (4294967296, 4294967296), }\n",
        b"{'descr': '|O', 'fortran_order': False, 'shape': (6890, 3), }\n",
        b"{'descr': '<f8', 'fortran_order': False, 'shape': (-1, 3), }\n",
        b"{'descr': '|V1000000000', 'fortran_order': False, 'shape': (6890, 3), }\n",
        b"{'descr': '<f8', 'fortran_order': False, }\n",
        b"(" * 3000,
        b"__import__('os').system('true')\n",
    ],
)
def test_forged_headers_are_refused_before_memory_is_taken(tmp_path: Path, header: bytes):
    (tmp_path / "forged.npz").write_bytes(forged(header, b"\0" * 64))
    tracemalloc.start()
    with pytest.raises(InputError):
        load_body(tmp_path / "forged.npz")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1e6


def test_a_zip_bomb_is_refused(tmp_path: Path):
    path = tmp_path / "bomb.npz"
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
        archive.open("v_template.npy", "w") as member,
    ):
        for _ in range(65):
            member.write(bytes(2**24))
    assert path.stat().st_size < 10e6
    with pytest.raises(InputError, match="at most"):
        load_body(path)


def arrays_of(body: Body) -> dict[str, np.ndarray]:
    return {
        "v_template": body.v_template,
        "f": body.faces,
        "weights": body.weights,
        "kintree_table": np.stack([body.parents, np.arange(body.joint_count)]),
        "J_regressor": body.J_regressor,
        "shapedirs": body.shapedirs,
    }


def loaded(folder: Path, **changes: np.ndarray) -> Body:
    np.savez(folder / "body.npz", **arrays_of(capsule_body()) | changes)  # pyright: ignore[reportArgumentType]
    return load_body(folder / "body.npz")


Z_UP = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])


@pytest.mark.parametrize("convention", ["reversed", "z up", "centimetres", "millimetres", "all of them"])
def test_another_convention_becomes_ours(tmp_path: Path, convention: str) -> None:
    """The same person, whatever way the file has it."""
    body, every = capsule_body(), convention == "all of them"
    changes, scale = (
        {},
        {"centimetres": 100.0, "millimetres": 1000.0, "all of them": 100.0}.get(convention, 1),
    )
    turn = Z_UP if every or convention == "z up" else np.eye(3)
    if every or convention == "reversed":
        changes["f"] = body.faces[:, ::-1]
    changes["v_template"] = scale * body.v_template @ turn.T
    changes["shapedirs"] = scale * np.einsum("ij,vjb->vib", turn, body.shapedirs)
    found = loaded(tmp_path, **changes)
    np.testing.assert_allclose(found.v_template, body.v_template, atol=1e-6)
    np.testing.assert_allclose(found.shapedirs, body.shapedirs, atol=1e-6)
    np.testing.assert_array_equal(np.sort(found.faces), np.sort(body.faces))
    assert volume(found.v_template, found.faces) == pytest.approx(
        volume(body.v_template, body.faces), rel=1e-4
    )


def test_what_is_in_our_convention_stays_as_it_is(tmp_path: Path) -> None:
    found, body = loaded(tmp_path), capsule_body()
    for name in ("v_template", "faces", "weights", "shapedirs"):
        np.testing.assert_array_equal(getattr(found, name), getattr(body, name))


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"v_template": -capsule_body().v_template}, "its head is above its ankles along -y, wanted y"),
        ({"v_template": capsule_body().v_template[:, [1, 0, 2]]}, "along x, wanted y"),
        ({"v_template": 17 * capsule_body().v_template}, "no person's size in metres, centimetres or"),
        (
            {
                "v_template": capsule_body().v_template @ Z_UP.T,
                "posedirs": np.zeros((len(capsule_body().v_template), 3, 207)),
            },
            "along z, wanted y",
        ),
    ],
)
def test_what_makes_no_person_is_refused(tmp_path: Path, changes: dict, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        loaded(tmp_path, **changes)


def test_weights_that_were_rounded_below_zero_are_zero(tmp_path: Path) -> None:
    weights = capsule_body().weights.astype(np.float64)
    weights[weights == 0] = -1e-9
    np.testing.assert_allclose(loaded(tmp_path, weights=weights).weights, capsule_body().weights, atol=1e-7)
    weights[0, :2] = 1.1, -0.1
    weights[0, 2:] = 0
    with pytest.raises(InputError, match=r"weights must be 0 or more; the least is -1.0e-01"):
        loaded(tmp_path, weights=weights)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.uint32, np.uint64, np.int64, np.float64])
def test_no_parent_in_every_type(tmp_path: Path, kind: type) -> None:
    table = np.stack([capsule_body().parents, np.arange(24)])
    table = table.astype(kind) if kind is np.float64 else table.astype(np.int64).astype(kind)
    assert loaded(tmp_path, kintree_table=table).parents.tolist() == capsule_body().parents.tolist()
