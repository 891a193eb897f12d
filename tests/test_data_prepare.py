"""Photographs to a data set: every convention ends at the same pixels, mirrors mirror, and what is broken is
named and left out.
"""

import hashlib
import json
import pickle
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

from avatargen.body.joints import mirrored_name
from avatargen.body.model import pose, shape
from avatargen.commands.main import main
from avatargen.data.crop import square_around
from avatargen.data.dataset import open_pictures
from avatargen.data.joints import projected_joints
from avatargen.data.keypoints import keypoints_of, read_keypoints
from avatargen.data.labels import read_labels
from avatargen.data.mask import mask_of
from avatargen.data.names import given_to, without_suffix
from avatargen.data.photograph import Settings
from avatargen.data.prepare import Sources, prepare
from avatargen.data.raycast import Light, shoot
from avatargen.eight_bits import eight_bits
from avatargen.errors import InputError
from avatargen.generator.camera import camera_of_vector
from tests.photographs import BODY, CONVENTIONS, FOCAL, HEIGHT, WIDTH, Scene, make_scene

SQUARE = 64


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return make_scene(tmp_path_factory.mktemp("photographs"))


def sources(scene: Scene, convention: str, **change: Path | None) -> Sources:
    return replace(
        Sources(
            images=scene.folder / "photos",
            labels=scene.labels(convention),
            masks=scene.folder / "masks",
            keypoints=scene.folder / "coco.json",
        ),
        **change,
    )


def settings(convention: str, **change: object) -> Settings:
    focal = FOCAL if convention in ("getavatar", "eva3d") else None
    return replace(Settings(convention=convention, size=SQUARE, focal=focal), **change)  # pyright: ignore


def silent(done: int, of: int) -> None:
    pass


def digest(folder: Path) -> dict[str, str]:
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest() for p in files}


def joints_in(labels, name: str) -> np.ndarray:
    i = labels.names.index(f"images/{name}.png")
    return projected_joints(BODY, labels.camera[i], labels.pose[i], labels.betas[i]) * SQUARE


def cropped(scene: Scene, i: int) -> np.ndarray:
    """Where the joints of a photograph come to lie in its square, by the square alone."""
    mask = np.asarray(Image.open(scene.folder / "masks" / f"{scene.names[i]}.png"))
    points = keypoints_of(read_keypoints(scene.folder / "coco.json")[scene.names[i]])
    square = square_around(points, mask, 0.63)
    return (scene.joints[i] - [square.x, square.y]) * SQUARE / square.side


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_every_convention_puts_joints_on_the_same_pixels(scene: Scene, convention: str, tmp_path: Path):
    summary = prepare(sources(scene, convention), tmp_path / "out", settings(convention), 1, silent)
    assert summary.skipped == () and len(summary.labels) == 2 * len(scene.names)
    content = json.loads((tmp_path / "out" / "dataset.json").read_bytes())
    assert content["convention"] == "avatargen-1" and content["prepared_from"] == convention
    labels = read_labels(tmp_path / "out" / "dataset.json")
    assert (labels.pose[:, 0] == 0).all()
    other = [BODY.joint_names.index(mirrored_name(name)) for name in BODY.joint_names]
    for i, name in enumerate(scene.names):
        expected = cropped(scene, i)
        assert np.abs(joints_in(labels, name) - expected).max() < 0.01  # pixels
        mirrored = joints_in(labels, f"{name}_mirrored")
        assert (
            np.abs(mirrored[other] - [SQUARE, 0] - expected * [-1, 1]).max() < 0.15
        )  # bodies are not quite even


def test_pictures_show_the_labelled_body_on_white_and_mirrors_are_mirrored(scene: Scene, tmp_path: Path):
    """The bare body, drawn at the label, lies within the mask; clothes and hair cover more."""
    out = tmp_path / "out"
    prepare(sources(scene, "ag3d"), out, settings("ag3d"), 1, silent)
    pictures = open_pictures(out, SQUARE)
    light = Light(ambient=1.0, direction=np.array([0.0, 1.0, 0.0]), strength=0.0)
    for i in range(len(pictures)):
        labels = pictures.labels
        camera = camera_of_vector(torch.from_numpy(labels.camera[i : i + 1]))
        posed = pose(BODY, shape(BODY, labels.betas[i]), labels.pose[i])
        colors = np.zeros_like(posed.vertices, dtype=np.float32)
        bare = shoot(posed.vertices, BODY.faces, colors, camera, light, SQUARE).mask > 127
        mask = pictures.mask(i).numpy()
        assert (bare & (mask > 0.5)).sum() / bare.sum() > 0.9
        assert (bare & (mask > 0.5)).sum() / (bare | (mask > 0.5)).sum() > 0.55
        assert (pictures.image(i).permute(1, 2, 0).numpy()[mask == 0] > 0.9).all()
        edges = np.concatenate([mask[0], mask[-1], mask[:, 0], mask[:, -1]])
        assert edges.max() < 0.5 and 0.05 < mask.mean() < 0.5
    for i in range(0, len(pictures), 2):
        assert pictures.labels.names[i + 1] == pictures.labels.names[i].replace(".png", "_mirrored.png")
        assert torch.equal(pictures.image(i).flip(2), pictures.image(i + 1))
        assert torch.equal(pictures.mask(i).flip(1), pictures.mask(i + 1))


def test_processes_and_resuming_make_the_same_files_and_runs_do_not_mix(
    scene: Scene, tmp_path: Path, monkeypatch
):
    monkeypatch.setattr("avatargen.data.prepare.PART", 2)
    given = sources(scene, "eva3d")
    prepare(given, tmp_path / "one", settings("eva3d"), 1, silent)
    prepare(given, tmp_path / "two", settings("eva3d"), 2, silent)
    assert digest(tmp_path / "one") == digest(tmp_path / "two")

    (tmp_path / "two" / "parts" / "00001.json").unlink()  # as if killed in the second part
    (tmp_path / "two" / "images" / "person0.png").write_bytes(b"torn")
    (tmp_path / "two" / "dataset.json").unlink()
    told = []
    prepare(given, tmp_path / "two", settings("eva3d"), 1, lambda done, of: told.append((done, of)))
    assert told == [(4, 6), (6, 6)] and digest(tmp_path / "one") == digest(tmp_path / "two")

    with pytest.raises(InputError, match="another folder"):
        prepare(given, tmp_path / "one", settings("eva3d", size=32), 1, silent)
    masks = {"masks": None}
    with pytest.raises(InputError, match="another folder"):
        prepare(replace(given, **masks), tmp_path / "one", settings("eva3d"), 1, silent, white_is_none)
    shutil.copytree(given.images, tmp_path / "photos")
    (tmp_path / "photos" / "new.png").write_bytes(b"")
    with pytest.raises(InputError, match="another folder"):
        prepare(replace(given, images=tmp_path / "photos"), tmp_path / "one", settings("eva3d"), 1, silent)


def test_sources_whose_contents_change_are_refused_by_name(scene: Scene, tmp_path: Path):
    """Same names and sizes; masks, pickles, OpenPose's files and pictures that are others than they were."""
    shutil.copytree(scene.folder, tmp_path / "scene")
    scene.labels("eva3d")
    shutil.copytree(scene.folder / "eva3d", tmp_path / "scene" / "eva3d", dirs_exist_ok=True)
    here = replace(scene, folder=tmp_path / "scene")
    given = sources(here, "ag3d", labels=here.folder / "eva3d", keypoints=here.folder / "openpose")

    def again() -> None:
        prepare(given, tmp_path / "out", settings("eva3d"), 1, silent)

    again()
    made = digest(tmp_path / "out")
    for name, file in (
        ("images", "photos/person0.png"),
        ("masks", "masks/person0.png"),
        ("labels", "eva3d/person0/000.pkl"),
        ("keypoints", "openpose/person0_keypoints.json"),
    ):
        whole = (here.folder / file).read_bytes()
        (here.folder / file).write_bytes(bytes([whole[0] ^ 1]) + whole[1:])
        with pytest.raises(InputError, match=f"other settings: {name} has other contents; name another"):
            again()
        (here.folder / file).write_bytes(whole)
    here.folder.rename(tmp_path / "moved")
    moved = {n: tmp_path / "moved" / p.relative_to(here.folder) for n, p in vars(given).items() if p}
    prepare(replace(given, **moved), tmp_path / "out", settings("eva3d"), 1, silent)
    assert digest(tmp_path / "out") == made


def white_is_none(photo: np.ndarray) -> np.ndarray:
    """A segmentation for pictures on white."""
    return (photo.min(axis=2) < 250).astype(np.float32)


def test_what_is_broken_is_named_and_skipped(scene: Scene, tmp_path: Path):
    """One photograph for each way to be broken, and one that is whole."""
    photos, masks = tmp_path / "photos", tmp_path / "masks"
    rows, people = {}, {}
    whole = json.loads(scene.labels("eg3d").read_bytes())["labels"][0][1]
    points = read_keypoints(scene.folder / "coco.json")[scene.names[0]]

    def add(name: str) -> None:
        for folder, kind in ((photos, "photos"), (masks, "masks")):
            folder.mkdir(exist_ok=True)
            (folder / f"{name}.png").write_bytes((scene.folder / kind / f"{scene.names[0]}.png").read_bytes())
        rows[name], people[name] = whole, points

    broken = {
        "torn": "picture: ",
        "nothing": "picture: ",
        "torn_mask": "mask: ",
        "small_mask": "mask: it has shape",
        "empty_mask": "mask: a person on 0.00 %",
        "no_mask": "mask: ",
        "border": "partial body: the mask touches the bottom",
        "no_label": "label: there is none",
        "short": "label: 106 numbers; eg3d has 107",
        "text": "label: it holds something else",
        "nan": "label: NaN",
        "skewed": "label: the camera's matrix is no rotation",
        "nobody": "keypoints: nobody",
        "unnamed": "keypoints: there are none by this name",
        "wrong_points": "keypoints: 50 numbers",
        "no_feet": "partial body: no left_ankle and no right_ankle",
        "no_head": "partial body: no head",
        "elsewhere": "disagreement: the label's joints lie",
    }
    for name in ("good", *broken):
        add(name)
    (photos / "torn.png").write_bytes((photos / "torn.png").read_bytes()[:900])
    (photos / "nothing.png").write_bytes(b"")
    (masks / "torn_mask.png").write_bytes((masks / "torn_mask.png").read_bytes()[:90])
    Image.new("L", (30, 30), 255).save(masks / "small_mask.png")
    Image.new("L", (WIDTH, HEIGHT)).save(masks / "empty_mask.png")
    (masks / "no_mask.png").unlink()
    cut_off = np.array(Image.open(masks / "border.png"))
    cut_off[60:, 50:60] = 255
    Image.fromarray(cut_off).save(masks / "border.png")
    del rows["no_label"]
    rows["short"] = whole[:-1]
    rows["text"] = [*whole[:-1], "tall"]
    rows["nan"] = [*whole[:-1], float("nan")]
    rows["skewed"] = [2 * whole[0], *whole[1:]]
    rows["elsewhere"] = [*whole[:25], 0.0, 3.0, 0.0, *whole[28:]]
    people["nobody"] = [[0.0] * 51]
    people["unnamed"] = []
    people["wrong_points"] = [points[0][:50]]
    hidden = np.array(points[0]).reshape(17, 3)
    for name, lost in (("no_feet", [15, 16]), ("no_head", [0])):
        changed = hidden.copy()
        changed[lost, 2] = 0.1
        people[name] = [changed.ravel().tolist()]
    (tmp_path / "labels.json").write_text(json.dumps({"labels": rows}))
    results = [{"image_id": f"{name}.png", "keypoints": p} for name, found in people.items() for p in found]
    (tmp_path / "results.json").write_text(json.dumps(results))

    given = Sources(
        images=photos,
        labels=tmp_path / "labels.json",
        masks=masks,
        keypoints=tmp_path / "results.json",
    )
    summary = prepare(given, tmp_path / "out", settings("eg3d", mirror=False), 1, silent)
    assert summary.labels.names == ("images/good.png",)
    assert [p.name for p in (tmp_path / "out" / "images").iterdir()] == ["good.png"]
    found = dict(summary.skipped)
    for name, words in broken.items():
        assert found.pop(name).startswith(words), name
    assert not found
    lines = (tmp_path / "out" / "skipped.jsonl").read_text().splitlines()
    assert tuple((row["name"], row["reason"]) for row in map(json.loads, lines)) == summary.skipped
    assert summary.reasons() == {
        "mask": 4,
        "label": 5,
        "partial body": 3,
        "picture": 2,
        "keypoints": 3,
        "disagreement": 1,
    }


def test_a_wrong_convention_is_found_out_and_leaves_no_data_set(scene: Scene, tmp_path: Path):
    """Cameras with OpenGL's axes, where OpenCV's are read: everybody would stand behind them."""
    content = json.loads(scene.labels("eg3d").read_bytes())
    for _, row in content["labels"]:
        row[:16] = (np.array(row[:16]).reshape(4, 4) @ np.diag([1, -1, -1, 1])).ravel().tolist()
    (tmp_path / "opengl.json").write_text(json.dumps(content))
    given = sources(scene, "eg3d", labels=tmp_path / "opengl.json")
    with pytest.raises(InputError, match=r"none of 6 photographs.*check the convention"):
        prepare(given, tmp_path / "out", settings("eg3d"), 1, silent)
    assert not (tmp_path / "out" / "dataset.json").exists()


def test_keypoints_of_openpose_or_of_the_labels_make_the_same_pictures(scene: Scene, tmp_path: Path):
    for name, keypoints in (("a", scene.folder / "openpose"), ("b", None), ("c", scene.folder / "coco.json")):
        prepare(sources(scene, "eg3d", keypoints=keypoints), tmp_path / name, settings("eg3d"), 1, silent)
    images = [digest(tmp_path / name / "images") for name in "abc"]
    assert images[0] == images[2]
    assert (
        images[1].keys() == images[0].keys()
    )  # hands and feet among the joints make squares a little larger


def test_alpha_and_segmentation_stand_in_for_masks(scene: Scene, tmp_path: Path):
    photos, plain = tmp_path / "photos", tmp_path / "plain" / "photos"
    for name in scene.names:
        photo, mask = (Image.open(scene.folder / kind / f"{name}.png") for kind in ("photos", "masks"))
        for folder in (photos, plain):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
        photo.putalpha(mask)
        photo.save(photos / f"{name}.png")
        white = Image.new("RGB", photo.size, "white")
        white.paste(photo, mask=mask)
        white.save(plain / f"{name}.png")
    given = sources(scene, "ag3d", masks=None)
    prepare(sources(scene, "ag3d"), tmp_path / "mask", settings("ag3d"), 1, silent)
    prepare(replace(given, images=photos), tmp_path / "alpha", settings("ag3d"), 1, silent)
    assert digest(tmp_path / "alpha" / "images") == digest(tmp_path / "mask" / "images")
    taken = prepare(
        replace(given, images=plain), tmp_path / "cut", settings("ag3d"), 2, silent, white_is_none
    )
    assert len(taken.labels) == 2 * len(scene.names)
    masks = [open_pictures(tmp_path / name, SQUARE).mask(0) > 0.5 for name in ("mask", "cut")]
    assert (masks[0] & masks[1]).sum() / (masks[0] | masks[1]).sum() > 0.85
    with pytest.raises(InputError, match="give masks, an alpha channel or a segmentation"):
        prepare(replace(given, images=plain), tmp_path / "none", settings("ag3d"), 1, silent)
    with pytest.raises(InputError, match="the segmentation gave"):
        prepare(replace(given, images=plain), tmp_path / "bad", settings("ag3d"), 1, silent, np.asarray)


@pytest.mark.parametrize("form", ["16 bits", "fractions"])
def test_deep_grey_photographs_are_scaled_and_not_clipped(scene: Scene, tmp_path: Path, form: str):
    deep, plain = tmp_path / "deep", tmp_path / "plain"
    for name in scene.names:
        grey = Image.open(scene.folder / "photos" / f"{name}.png").convert("L")
        values = np.asarray(grey).astype(np.uint16) * 257
        for folder in (deep, plain):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
        grey.save(plain / f"{name}.png")
        if form == "16 bits":
            Image.fromarray(values).save(deep / f"{name}.png")
        else:
            Image.fromarray((values / 65535).astype(np.float32)).save(deep / f"{name}.tiff")
    for folder in (deep, plain):
        prepare(
            sources(scene, "eg3d", images=folder), tmp_path / "out" / folder.name, settings("eg3d"), 1, silent
        )
    assert digest(tmp_path / "out" / "deep" / "images") == digest(tmp_path / "out" / "plain" / "images")
    picture = np.asarray(Image.open(tmp_path / "out" / "deep" / "images" / "person0.png"))
    assert picture.std() > 20  # somebody is seen


def test_pictures_beyond_their_range_are_refused():
    assert np.asarray(eight_bits(Image.fromarray(np.array([[0, 257 * 9]], dtype=np.int32)))).tolist() == [
        [0, 9]
    ]
    for values in (np.array([[0, 70_000]], dtype=np.int32), np.array([[0.5, np.nan]], dtype=np.float32)):
        with pytest.raises(InputError, match="save it in 8 or 16 bits"):
            eight_bits(Image.fromarray(values))


def test_masks_of_every_form_are_the_same_person():
    """A figure of three parts on a ground, as segmentations and human parsers write it."""
    parts = np.zeros((12, 12), dtype=np.uint8)
    parts[2:5, 4:8], parts[5:8, 3:9], parts[8:11, 4:8] = 1, 2, 15
    person = np.where(parts > 0, 255, 0).astype(np.uint8)
    indexed = Image.fromarray(parts).convert("P")
    indexed.putpalette([0, 0, 0, 128, 0, 0, 0, 128, 0] + [0, 0, 0] * 12 + [192, 128, 128])
    grey_indexed = Image.fromarray(np.where(parts > 0, 0, 1).astype(np.uint8)).convert("P")
    grey_indexed.putpalette([255, 255, 255, 0, 0, 0])  # of few colours, white first
    photo = np.random.default_rng(0).integers(0, 255, (12, 12, 3), dtype=np.uint8)
    undecided = parts.copy()
    undecided[2, 4] = 255
    for form in (
        Image.fromarray(person),
        Image.fromarray(person > 0),
        Image.fromarray((person > 0).astype(np.uint8)),
        Image.fromarray(parts),
        Image.fromarray(parts.astype(np.uint16)),
        Image.fromarray(person.astype(np.uint16) * 257),
        Image.fromarray(undecided),
        indexed,
        indexed.convert("RGB"),
        grey_indexed,
        Image.fromarray(np.dstack([photo, person])),  # the photograph cut out
        Image.fromarray(np.dstack([person] * 3 + [np.full_like(person, 255)])),
    ):
        assert np.array_equal(mask_of(form), person), form
    soft = np.linspace(0, 255, 144).reshape(12, 12).astype(np.uint8)
    assert np.array_equal(mask_of(Image.fromarray(soft)), soft)
    assert (mask_of(Image.new("L", (12, 12))) == 0).all()


def test_an_opaque_alpha_channel_is_no_mask(scene: Scene, tmp_path: Path):
    for name in scene.names:
        (tmp_path / "photos" / name).parent.mkdir(parents=True, exist_ok=True)
        Image.open(scene.folder / "photos" / f"{name}.png").convert("RGBA").save(
            tmp_path / "photos" / f"{name}.png"
        )
    with pytest.raises(InputError, match="the alpha channel is opaque all over; give masks"):
        prepare(
            sources(scene, "eg3d", images=tmp_path / "photos", masks=None),
            tmp_path / "o",
            settings("eg3d"),
            1,
            silent,
        )


def test_names_in_other_folders_and_numbers_find_their_photograph():
    def given(photographs: list[str], found: list[str]) -> dict[str, str]:
        return given_to(photographs, {name: name for name in found}, "keypoints")

    assert given(["a/1", "b/1"], ["p/a/1", "p/b/1"]) == {"a/1": "p/a/1", "b/1": "p/b/1"}
    assert given(["000000397133", "x"], ["397133", "other"]) == {"000000397133": "397133"}
    assert given(["one", "two"], ["train/one", "train/two"]) == {"one": "train/one", "two": "train/two"}
    assert given(["more/one", "one"], ["one"]) == {"one": "one"}
    assert given(["more/one", "other/one", "two"], ["one", "two"]) == {"two": "two"}  # whose is it?
    assert given(["one", "two"], ["a/one", "b/one", "two"]) == {"two": "two"}
    assert given(["one"], []) == {}
    with pytest.raises(
        InputError, match="keypoints name pictures such as 'x', and the photographs are called 'one'"
    ):
        given(["one"], ["x"])
    names = ("a.b.jpg", "a.b", 397133, "in\\one.JPG", "x.5")
    assert [without_suffix(name) for name in names] == ["a.b", "a.b", "397133", "in/one", "x.5"]


def test_one_annotation_without_keypoints_costs_nothing(scene: Scene, tmp_path: Path):
    content = json.loads((scene.folder / "coco.json").read_bytes())
    content["annotations"] += [{"image_id": 0, "bbox": [0, 0, 1, 1]}, {"image_id": 99, "keypoints": []}]
    for image in content["images"]:
        image["file_name"] = f"train2017/{image['file_name']}"
    path = tmp_path / "coco.json"
    path.write_text(json.dumps(content))
    made = prepare(sources(scene, "eg3d", keypoints=path), tmp_path / "out", settings("eg3d"), 1, silent)
    assert made.skipped == ()
    content["annotations"] = [{"image_id": 0, "bbox": [0, 0, 1, 1]}]
    path.write_text(json.dumps(content))
    with pytest.raises(InputError, match="holds no keypoints"):
        read_keypoints(path)


def test_cameras_alone_take_their_poses_from_a_file(scene: Scene, tmp_path: Path):
    content = json.loads(scene.labels("ag3d").read_bytes())
    rows = {name.removeprefix("photos/"): np.concatenate(row) for name, row in content["labels"]}
    table = np.stack(list(rows.values()))
    scale = table[:, 25:26]
    for row, s in zip(table, scale[:, 0], strict=True):  # an EG3D camera knows no scale
        row[3:12:4] /= s
    (tmp_path / "cameras.json").write_text(
        json.dumps({"labels": dict(zip(rows, table[:, :25].tolist(), strict=True))})
    )
    np.savez(
        tmp_path / "poses.npz",
        names=list(rows),
        poses=table[:, 29:101],
        betas=table[:, 101:],
        trans=table[:, 26:29],
    )
    given = sources(scene, "ag3d", labels=tmp_path / "cameras.json", smpl=tmp_path / "poses.npz")
    both = prepare(given, tmp_path / "out", settings("eg3d"), 1, silent).labels
    whole = prepare(sources(scene, "ag3d"), tmp_path / "whole", settings("ag3d"), 1, silent).labels
    assert both.names == whole.names and np.abs(both.rows() - whole.rows()).max() < 1e-5


class Payload:
    def __reduce__(self):
        return (Path.touch, (Path("/tmp/avatargen-was-here"),))


def test_hostile_pickles_run_nothing_and_cost_their_picture_alone(scene: Scene, tmp_path: Path):
    shutil.copytree(scene.labels("eva3d"), tmp_path / "labels")
    (tmp_path / "labels" / "person0" / "000.pkl").write_bytes(pickle.dumps(Payload()))
    (tmp_path / "labels" / "more" / "person1" / "000.pkl").write_bytes(b"\x80\x04\x96" + b"\xff" * 8)
    (tmp_path / "labels" / "person2" / "000.pkl").unlink()
    given = sources(scene, "eva3d", labels=tmp_path / "labels")
    summary = prepare(given, tmp_path / "out", settings("eva3d"), 1, silent)
    assert {name for name, _ in summary.skipped} == {"person0", "more/person1", "person2"}
    assert "not on the list of harmless names" in dict(summary.skipped)["person0"]
    assert not Path("/tmp/avatargen-was-here").exists()


def test_mean_shape_leaves_the_betas_out(scene: Scene, tmp_path: Path):
    labels = prepare(
        sources(scene, "eg3d"), tmp_path / "out", settings("eg3d", keep_betas=False), 1, silent
    ).labels
    assert (labels.betas == 0).all() and len(labels) == 2 * len(scene.names)


def test_two_pictures_of_one_name_and_none_at_all_are_refused(scene: Scene, tmp_path: Path):
    given = sources(scene, "eg3d", images=tmp_path)
    with pytest.raises(InputError, match="no pictures"):
        prepare(given, tmp_path / "out", settings("eg3d"), 1, silent)
    for name in ("a.png", "a_mirrored.jpg"):
        (tmp_path / name).write_bytes(b"")
    with pytest.raises(InputError, match="two pictures would be named a_mirrored"):
        prepare(given, tmp_path / "out", settings("eg3d"), 1, silent)


def test_the_command(scene: Scene, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "matting_of_mine.py").write_text(
        "def person(photo):\n    return (photo.min(axis=2) < 250)\n\nanswer = 3\n"
    )
    arguments = ["data", "prepare", "--images", str(scene.folder / "photos"), "--size", "32"]
    arguments += ["--labels", str(scene.labels("getavatar")), "--convention", "getavatar", "--shape", "given"]
    arguments += ["--focal", str(FOCAL), "--workers", "1"]
    masks = ["--masks", str(scene.folder / "masks"), "--keypoints", str(scene.folder / "coco.json")]
    assert main([*arguments, *masks, "--out", "made"]) == 0
    said = capsys.readouterr()
    assert said.out == "made/dataset.json\n" and "6 of 6 photographs, 12 pictures" in said.err
    for _ in range(2):  # the second time all is there
        assert main([*arguments, *masks, "--out", "packed", "--packed"]) == 0
        files, packed = (open_pictures(tmp_path / name, 32) for name in ("made", "packed"))
        assert torch.equal(files.pixels(torch.arange(12)), packed.pixels(torch.arange(12)))
        assert np.array_equal(files.read("masks", range(12)), packed.read("masks", range(12)))
        assert not (tmp_path / "packed/images").exists()
    capsys.readouterr()
    for text, words in (("matting_of_mine", "MODULE:FUNCTION"), ("matting_of_mine:answer", "no function")):
        assert main([*arguments, "--segment", text, "--out", "none"]) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1 and words in error
    assert (
        main([*arguments, "--segment", "matting_of_mine:person", "--out", "none"]) == 2
    )  # noise is no person
    assert "none of 6 photographs" in capsys.readouterr().err
    assert (
        main(["data", "prepare", "--images", "x", "--labels", "y", "--convention", "mine", "--out", "z"]) == 2
    )
    assert "eg3d" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["images", "masks", "keypoints", "labels", "smpl", "body"])
def test_what_is_missing_is_named_before_any_work(
    scene: Scene,
    name: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    found = vars(sources(scene, "eg3d")) | {name: Path("none")}
    words = [word for key, path in found.items() if path is not None for word in (f"--{key}", str(path))]
    assert main(["data", "prepare", *words, "--convention", "eg3d", "--out", "out"]) == 2
    out, err = capsys.readouterr()
    kind = {"images": "folder", "masks": "folder", "keypoints": "file or folder", "labels": "file or folder"}
    line = f"data prepare: found no {kind.get(name, 'file')} none; check --{name}"
    assert (out, err) == ("", f"avatargen data prepare: {line}\n")
    assert list(tmp_path.iterdir()) == []
