"""Every reader takes 2,000 damaged or forged files: our errors or something sound, within 5 s and 1 GB."""

import io
import itertools
import json
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

from assets.choose import load_curves
from avatargen.body.joints import JOINT_NAMES
from avatargen.body.load import load_body, save_body
from avatargen.body.pose import load_pose
from avatargen.data import synth
from avatargen.data.dataset import open_pictures
from avatargen.data.labels import FILE_NAME, Labels, encode_labels
from avatargen.export.manifest import NAME, Row, open_manifest
from avatargen.export.person_file import Saved, Words, encode_person, read_person
from avatargen.export.photo_pixels import Look
from avatargen.generator.checkpoint import load_checkpoint, save_checkpoint
from avatargen.motion.amass import load_motion
from avatargen.photo.camera import Pinhole
from avatargen.photo.problem import Fit
from avatargen.run_folder import claim
from avatargen.training import adversarial_state
from avatargen.wardrobe.makehuman.choose import Draw, choose, draw_latent
from exporters import glb
from exporters.encoding import Encoding
from exporters.read_glb import read_glb
from tests.bodies import capsule_body
from tests.generators import random_generator
from tests.mutate import (
    COUNT,
    assault,
    bomb,
    bytes_changed,
    fast_folder,
    json_changed,
    mutations,
    npz_changed,
)
from tests.test_avatar_export import outside
from tests.tube import tube

REFUSED = 0.3  # at least this share of the files is no good in a way that can be told


@pytest.fixture
def folder() -> Iterator[Path]:
    with fast_folder() as found:
        yield found


def saved(**arrays: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.savez(stream, **arrays)  # pyright: ignore[reportArgumentType]
    return stream.getvalue()


def check(refused: int, seen: int, least: float = REFUSED) -> None:
    assert seen >= COUNT
    assert refused >= least * seen


def test_bodies(folder: Path) -> None:
    save_body(capsule_body(0.12), folder / "whole.npz")
    whole = (folder / "whole.npz").read_bytes()
    bombs = [bomb("v_template", (13_000_000, 3), "|u1"), bomb("shapedirs", (4_000_000, 3, 1), "<f8")]
    files = itertools.chain(mutations(whole, bytes_changed, npz_changed), bombs)
    check(*assault(load_body, folder / "body.npz", files))


def test_poses(folder: Path) -> None:
    rng = np.random.default_rng(0)
    whole = saved(poses=rng.normal(size=(4, 72)), global_orient=np.zeros(3), body_pose=np.zeros((1, 69)))
    files = itertools.chain(
        mutations(whole, bytes_changed, npz_changed), [bomb("poses", (13_000_000, 3), "|u1")]
    )
    check(*assault(lambda path: load_pose(path, JOINT_NAMES[24]), folder / "pose.npz", files))


def test_motions(folder: Path) -> None:
    rng = np.random.default_rng(0)
    whole = saved(poses=rng.normal(size=(4, 72)), trans=np.zeros((4, 3)), mocap_framerate=np.array(60.0))

    def read(path: Path) -> None:
        assert np.isfinite(load_motion(path).rotations).all()

    files = itertools.chain(
        mutations(whole, bytes_changed, npz_changed), [bomb("poses", (600_000, 72), "|u1")]
    )
    check(*assault(read, folder / "take.npz", files))


def test_people(folder: Path) -> None:
    """Words, arrays and the picture of a person found in a photograph."""
    rng = np.random.default_rng(0)
    camera = Pinhole(width=24, height=32, focal=30.0)
    fit = Fit(
        betas=rng.normal(size=10),
        rotations=rng.normal(size=(24, 3)),
        move=rng.normal(size=3),
        camera=camera,
        height=1.7,
        height_known=True,
        uncertain=(),
    )
    look = Look(
        pixels=rng.integers(0, 256, (32, 24, 3), np.uint8),
        mask=rng.integers(0, 2, (32, 24)).astype(np.float32),
        landmarks=rng.normal(size=(33, 2)),
        face=None,
        fit=fit,
    )
    who = choose(Draw(draw_latent(3)), {}, ["young_lightskinned_male_diffuse"], ["brown"])
    words = Words(
        attributes=who,
        seed=3,
        height=1.7,
        said=(("text", "a man"),),
        weights_hash="0" * 64,
        body_hash="1" * 64,
        looks=((30.0, 1.7),),
        photo='{"photos": ["me.jpg"]}',
    )
    person = Saved(
        words=words,
        betas=np.zeros(10, np.float32),
        turns=fit.rotations,
        looks=(look,),
        stuffs=np.zeros((1, 3)),
    )
    files = mutations(encode_person(person), bytes_changed)
    check(*assault(read_person, folder / "person.safetensors", files))


PICKLES = """
import sys
from pathlib import Path
from avatargen.body.pickle import limit_resources, read_pickle
limit_resources()
import numpy, time
refused = 0
for path in sorted(Path(sys.argv[1]).iterdir()):
    started = time.process_time()
    try:
        for array in read_pickle(path).values():
            assert isinstance(array, numpy.ndarray) and array.dtype.kind in "fiu"
    except AssertionError:
        raise
    except Exception:
        refused += 1
    assert time.process_time() - started < 5, path
print(refused)
"""


def test_pickled_bodies(folder: Path) -> None:
    """As the converter's process reads them, under its own limits; some through the front door too."""
    import pickle

    from scipy.sparse import csc_matrix

    body = capsule_body(0.2)
    content = {
        "v_template": body.v_template,
        "weights": body.weights,
        "f": body.faces,
        "kintree_table": np.stack([body.parents, np.arange(24)]),
        "shapedirs": body.shapedirs,
        "J_regressor": csc_matrix(body.J_regressor),
    }
    whole = [pickle.dumps(content, protocol=protocol) for protocol in (2, 4)]
    files = folder / "files"
    files.mkdir()
    each = [mutations(data, bytes_changed, count=COUNT // 2) for data in whole]
    for number, data in enumerate(itertools.chain(*each)):
        (files / f"{number:04d}").write_bytes(data)
    command = [sys.executable, "-c", PICKLES, str(files)]
    run = subprocess.run(command, env=outside(), capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, run.stderr
    assert int(run.stdout) > REFUSED * COUNT

    chosen = [(files / f"{number:04d}").read_bytes() for number in range(0, COUNT, COUNT // 8)]
    refused, _ = assault(load_body, folder / "body.pkl", iter(chosen))
    assert refused > 0


def safetensors_changed(whole: bytes, rng: np.random.Generator) -> bytes:
    """Another description of the same numbers, or another configuration."""
    length = struct.unpack_from("<Q", whole)[0]
    header = json.loads(whole[8 : 8 + length])
    if rng.integers(2):
        metadata = header["__metadata__"]
        metadata["config"] = json_changed(metadata["config"].encode(), rng).decode()
        text = json.dumps(header).encode()
    else:
        text = json_changed(json.dumps(header).encode(), rng)
    return struct.pack("<Q", len(text)) + text + whole[8 + length :]


def test_weights(folder: Path) -> None:
    save_checkpoint(random_generator(), folder / "whole.safetensors")
    whole = (folder / "whole.safetensors").read_bytes()

    def read(path: Path) -> None:
        state = load_checkpoint(path).generator.state_dict().values()
        assert all(torch.isfinite(tensor).all() for tensor in state if tensor.is_floating_point())

    files = mutations(whole, bytes_changed, safetensors_changed, safetensors_changed)
    check(*assault(read, folder / "g.safetensors", files))


def small_labels() -> Labels:
    rng = np.random.default_rng(0)
    return Labels(
        names=("images/00000/00.png", "images/00000/01.png"),
        camera=rng.normal(size=(2, 25)).astype(np.float32),
        pose=rng.normal(size=(2, 24, 3)).astype(np.float32),
        betas=rng.normal(size=(2, 10)).astype(np.float32),
    )


def test_labels(folder: Path) -> None:
    def read(path: Path) -> None:
        pictures = open_pictures(path.parent, 8)
        assert all(torch.isfinite(rows).all() for rows in pictures.row(torch.arange(len(pictures))))

    whole = encode_labels(small_labels())
    files = mutations(whole, bytes_changed, json_changed, json_changed)
    check(*assault(read, folder / FILE_NAME, files), least=0.2)  # of most numbers any value will do


@pytest.mark.parametrize("kind", ["PNG", "JPEG"])
def test_pictures(folder: Path, kind: str) -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (16, 16, 3), dtype=np.uint8)
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, kind)
    (folder / FILE_NAME).write_bytes(encode_labels(small_labels()))
    (folder / "images" / "00000").mkdir(parents=True)
    pictures = open_pictures(folder, 8)

    def read(path: Path) -> None:
        assert pictures.image(0).shape == (3, 8, 8)

    def huge() -> Iterator[bytes]:
        """Pictures of a few kilobytes that say they are large."""
        for side in (5000, 9000, 20_000, 100_000):
            stream = io.BytesIO()
            Image.new("1", (min(side, 20_000), min(side, 20_000))).save(stream, "PNG")
            data = bytearray(stream.getvalue())
            data[16:24] = struct.pack(">II", side, side)
            yield bytes(data)

    path = folder / "images" / "00000" / "00.png"
    files = itertools.chain(mutations(stream.getvalue(), bytes_changed), huge())
    check(*assault(read, path, files), least=0.1)  # a JPEG takes a lot


def test_configurations(folder: Path) -> None:
    """The settings that a run's or a data set's folder keeps: another run asks whether they are its own."""
    settings = {
        "training": {"images": 8, "rates": [0.1, 0.2]},
        "data": "x",
        "start": "random",
        "generator": {},
    }

    def of_a_run(path: Path) -> None:
        claim(
            path.parent,
            "config.json",
            settings,
            "train",
            made=["state.pt"],
            free=adversarial_state.MAY_CHANGE,
        )

    def of_a_data_set(path: Path) -> None:
        claim(path.parent, synth.SETTINGS_FILE, {"people": 3}, "data synth", made=["*"])

    for name, read in (("config.json", of_a_run), (synth.SETTINGS_FILE, of_a_data_set)):
        place = folder / read.__name__ / name
        place.parent.mkdir()
        read(place)
        whole = place.read_bytes()
        check(*assault(read, place, mutations(whole, bytes_changed, json_changed)))


def glb_changed(whole: bytes, rng: np.random.Generator) -> bytes:
    """Another description of the same buffer."""
    size = struct.unpack_from("<I", whole, 12)[0]
    text = json_changed(whole[20 : 20 + size], rng)
    rest = whole[20 + size :]
    return struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A) + text + rest


@pytest.mark.parametrize("rounded", [False, True])
def test_glb(folder: Path, rounded: bool) -> None:
    whole = glb.encode(tube(rings=4, joint_count=3), Encoding(quantize=rounded))

    def read(path: Path) -> None:
        asset = read_glb(path)
        assert np.isfinite(asset.vertices).all() and asset.faces.max() < len(asset.vertices)

    check(*assault(read, folder / "a.glb", mutations(whole, bytes_changed, glb_changed, glb_changed)))


def test_manifests(folder: Path) -> None:
    settings: dict[str, object] = {"faces": 2000}

    def read(path: Path) -> None:
        with open_manifest(path.parent, settings) as manifest:
            for seed, row in manifest.rows.items():
                assert type(seed) is int and not manifest.holds(seed)
                manifest.add(row)

    with open_manifest(folder, settings) as manifest:
        for seed in range(3):
            manifest.add(Row(seed=seed, file=f"avatar_{seed}.glb", sha256="0" * 64, error_mm={"mean": 0.1}))
    whole = (folder / NAME).read_bytes()

    def line_changed(whole: bytes, rng: np.random.Generator) -> bytes:
        lines = whole.splitlines()
        lines[1] = json_changed(lines[1], rng)
        return b"\n".join(lines) + b"\n"

    check(*assault(read, folder / NAME, mutations(whole, bytes_changed, line_changed, line_changed)))
    (folder / NAME).write_bytes(whole)
    kept = (folder / "settings.json").read_bytes()
    damaged = mutations(kept, bytes_changed, json_changed, count=200)
    refused, seen = assault(read, folder / "settings.json", damaged)
    assert refused > 0.9 * seen


def test_curves(folder: Path) -> None:
    row = {"resolution": 256, "faces": 5000, "seconds": {"extract": 1.0, "atlas": 0.5}, "p99_mm": 0.8}
    texture = {"size": 512, "seconds": {"bake": 0.4, "encode": 0.1}, "bytes": 100_000}
    whole = json.dumps({"field_us": 2.0, "surfaces": [row] * 2, "textures": [texture] * 2}).encode()

    def read(path: Path) -> None:
        curves = load_curves(path, None)
        for choice in [*curves.choices(512), *curves.choices(None)]:
            assert np.isfinite([choice.seconds, choice.p99_mm]).all()
        assert np.isfinite(curves.texture_bytes(512)) and curves.most_faces > 0
        assert np.isfinite(curves.stage_seconds("extract", 256, 5000, 512))

    check(*assault(read, folder / "curves.json", mutations(whole, bytes_changed, json_changed)))
