"""The synthetic data set: the same by any route, and labelled in the generator's conventions."""

import hashlib
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from avatargen.avatar import training_body
from avatargen.body.model import canonical_body
from avatargen.commands.main import main
from avatargen.data.dataset import Pictures, open_pictures
from avatargen.data.labels import encode_labels, read_labels
from avatargen.data.synth import SynthConfig, synthesize
from avatargen.errors import InputError
from avatargen.generator.camera import camera_of_vector
from avatargen.generator.config import DEBUG, for_body
from avatargen.generator.generator import AvatarGenerator
from avatargen.generator.picture import CanonicalSurface, take_picture

CONFIG = SynthConfig(size=32, views=3, cell=0.03)


def silent(done: int, of: int) -> None:
    pass


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("synth") / "data"
    synthesize(out, 2, CONFIG, workers=1, report=silent)
    return out


def digest(folder: Path) -> dict[str, str]:
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest() for p in files}


def test_processes_resuming_and_extending_make_the_same_files(folder: Path, tmp_path: Path):
    out = tmp_path / "data"
    synthesize(out, 2, CONFIG, workers=2, report=silent)
    assert digest(out) == digest(folder)

    (out / "people" / "00001.json").unlink()  # as if killed while person 1 was made
    (out / "images" / "00001" / "01.png").write_bytes(b"torn")
    (out / "dataset.json").unlink()
    told = []
    synthesize(out, 2, CONFIG, workers=1, report=lambda done, of: told.append((done, of)))
    assert digest(out) == digest(folder)
    assert told == [(1, 2), (2, 2)]  # only the unfinished person was made again


def test_a_packed_set_is_the_same_set_and_grows(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    out = tmp_path / "data"
    words = ["data", "synth", "--size", "32", "--views", "3", "--cell", "30", "--workers", "1"]
    for people in ("1", "2", "2"):
        assert main([*words, "--people", people, "--packed", "--out", str(out)]) == 0
        assert capsys.readouterr().out == f"{out / 'dataset.json'}\n"
        found = sorted(path.name for path in out.iterdir())
        assert found == ["dataset.json", "people", "pictures.safetensors", "synth.json"]
    files, packed = open_pictures(folder, 32), open_pictures(out, 32)
    assert (out / "dataset.json").read_bytes() == (folder / "dataset.json").read_bytes()
    assert torch.equal(files.pixels(torch.arange(6)), packed.pixels(torch.arange(6)))
    for i in range(6):
        assert torch.equal(files.mask(i), packed.mask(i)) and torch.equal(files.depth(i), packed.depth(i))


def test_labels_describe_the_pictures(folder: Path):
    """The bare body of an untrained generator, at the labels, covers what the masks cover."""
    body = training_body()
    config = for_body(DEBUG, canonical_body(body))
    render = replace(config.render, raw_size=32, image_size=32, samples=32, initial_alpha=2e-3, shell=0.1)
    generator = AvatarGenerator(replace(config, render=render))
    pictures = open_pictures(folder, 32)
    camera, pose, betas = pictures.row(torch.arange(len(pictures)))
    with torch.no_grad():
        seen = take_picture(
            generator,
            CanonicalSurface(body),
            torch.zeros(len(pictures), 16),
            camera_of_vector(camera),
            pose,
            betas,
        )
    for i in range(len(pictures)):
        true, bare = pictures.mask(i) > 0.5, seen.mask[i] > 0.5
        assert (true & bare).sum() / bare.sum() > 0.9  # clothes and hair cover the body, and more
        assert (true & bare).sum() / (true | bare).sum() > 0.55
        both = true & (seen.mask[i] > 0.99)
        nearer = (seen.depth[i] - pictures.depth(i))[both]  # clothes are before the body
        assert -0.01 < nearer.median() < 0.06  # metres


def test_pictures_are_white_beside_the_person_and_varied(folder: Path):
    pictures = open_pictures(folder, 16)
    images = torch.stack([pictures.image(i) for i in range(len(pictures))])
    masks = torch.stack([pictures.mask(i) for i in range(len(pictures))])
    assert images.shape == (6, 3, 16, 16)
    assert (images.permute(0, 2, 3, 1)[masks == 0] == 1).all()
    assert all(0.03 < mask.mean() < 0.5 for mask in masks)
    assert (pictures.labels.pose[0] != pictures.labels.pose[1]).any()
    assert np.array_equal(pictures.labels.betas[0], pictures.labels.betas[1])  # one person, one shape
    assert not np.array_equal(pictures.labels.betas[0], pictures.labels.betas[3])


def test_a_folder_of_anything_else_is_refused(folder: Path, tmp_path: Path):
    with pytest.raises(InputError, match="another folder"):
        synthesize(folder, 2, replace(CONFIG, seed=1), workers=1, report=silent)
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="holds other files"):
        synthesize(tmp_path, 1, CONFIG, workers=1, report=silent)
    assert [p.name for p in tmp_path.iterdir()] == ["notes.txt"]


def test_labels_round_trip_exactly_and_bad_ones_are_named(folder: Path, tmp_path: Path):
    labels = read_labels(folder / "dataset.json")
    again = tmp_path / "again.json"
    again.write_bytes(encode_labels(labels))
    assert (
        np.array_equal(read_labels(again).rows(), labels.rows()) and read_labels(again).names == labels.names
    )
    content = json.loads(again.read_bytes())
    damages = [
        b"{",
        json.dumps(content | {"convention": "eg3d"}).encode(),
        json.dumps(content | {"labels": [["a.png", [1.0, 2.0]]]}).encode(),
        json.dumps(content | {"labels": [["a.png", [float("nan")] * 107]]}).encode(),
        json.dumps({"labels": content["labels"]}).encode(),
    ]
    for damage in damages:
        again.write_bytes(damage)
        with pytest.raises(InputError, match=r"again\.json"):
            read_labels(again)
    with pytest.raises(InputError, match="cannot read"):
        read_labels(tmp_path / "none.json")


def test_a_broken_picture_is_named(folder: Path, tmp_path: Path):
    labels = read_labels(folder / "dataset.json")
    broken = Pictures(folder=tmp_path, labels=labels, size=32)
    with pytest.raises(InputError, match=r"00\.png"):
        broken.image(0)
    target = tmp_path / labels.names[0]
    target.parent.mkdir(parents=True)
    target.write_bytes((folder / labels.names[0]).read_bytes()[:200])
    with pytest.raises(InputError, match=r"00\.png"):
        broken.image(0)
    with pytest.raises(InputError, match="multiple of 24"):
        Pictures(folder=folder, labels=labels, size=24).image(0)


def test_the_command_says_what_is_wrong_in_one_line(capsys: pytest.CaptureFixture[str]):
    assert main(["data", "synth", "--people", "none", "--out", "/nowhere"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "whole number" in error
