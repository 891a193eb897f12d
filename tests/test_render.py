"""The command that draws: from a file and from a seed, posed, turning; bad input is one line and no file."""

import itertools
import os
import signal
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

import assets
import avatargen
from avatargen.body.joints import SMPL_JOINT_NAMES
from avatargen.commands.look.render import main
from exporters import export
from tests.tube import tube

SMALL = ["--height", "48"]


@pytest.fixture(autouse=True)
def in_a_folder_with_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    export(tube(joint_count=3), "a.glb")
    handler = signal.getsignal(signal.SIGTERM)
    yield
    signal.signal(signal.SIGTERM, handler)


def named_tube(joint_names: tuple[str, ...]) -> assets.Asset:
    asset = tube(joint_count=len(joint_names))
    return replace(asset, skeleton=replace(asset.skeleton, joint_names=joint_names))


def test_a_file_becomes_a_picture_and_a_film(capsys: pytest.CaptureFixture[str]) -> None:
    views = ["--views", "front,left", "--transparent"]
    assert main(["a.glb", "--out", "a.png", "--turntable", "a.gif", "--frames", "3", *views, *SMALL]) == 0
    assert capsys.readouterr().out.split() == ["a.png", "a.gif"]
    assert Image.open("a.png").mode == "RGBA"
    assert Image.open("a.png").height == Image.open("a.gif").height == 48
    assert Image.open("a.gif").n_frames == 3  # pyright: ignore[reportAttributeAccessIssue]


def test_a_pose_bends_the_figure() -> None:
    export(named_tube(("pelvis", "spine1", "head")), "named.glb")
    np.savez("bow.npz", pose=np.array([[0, 0, 0], [0, 0, 1.2], [0, 0, 0]]))
    for number, pose in enumerate(([], ["--pose", "walk"], ["--pose", "bow.npz"])):
        arguments = ["named.glb", "--views", "front", "--out", f"{number}.png", "--rest", "t", *pose]
        assert main([*arguments, *SMALL]) == 0
    straight, walking, bowed = (Image.open(f"{number}.png").width for number in range(3))
    assert straight == walking  # a figure without legs and arms walks on the spot
    assert bowed > 1.5 * straight


def test_a_clip_becomes_a_film_on_the_spot(capsys: pytest.CaptureFixture[str]) -> None:
    from tests.figure import figure

    export(replace(figure(), animations=()), "b.glb")
    assert main(["b.glb", "--clip", "walk", "--fps", "5", "--views", "left", *SMALL]) == 0
    assert capsys.readouterr().out.split() == ["b_walk.webp"]
    film = Image.open("b_walk.webp")
    assert film.n_frames == 5  # pyright: ignore[reportAttributeAccessIssue]
    seen = []
    for frame in range(5):
        film.seek(frame)
        seen.append(np.asarray(film.convert("RGB")).astype(int))
    assert all(np.abs(one - other).max() > 40 for one, other in itertools.pairwise(seen))


def test_a_face_speaks_in_a_film(capsys: pytest.CaptureFixture[str]) -> None:
    """Of a file with shapes; the film has the clip's name."""
    from tests.figure import figure
    from tests.test_face_files import with_shapes

    export(with_shapes(figure()), "c.glb")
    assert main(["c.glb", "--say", "ma", "--fps", "5", "--views", "front", *SMALL]) == 0
    assert capsys.readouterr().out.split() == ["c_say.webp"]
    film = Image.open("c_say.webp")
    assert 3 <= film.n_frames <= 5  # pyright: ignore[reportAttributeAccessIssue]
    seen = []
    for frame in (0, 1):  # before it speaks, and with lips closed
        film.seek(frame)
        seen.append(np.asarray(film.convert("RGB")).astype(int))
    assert np.abs(seen[0] - seen[1]).max() > 40


def test_a_seed_is_built_in_the_rest_pose(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked: list[Any] = []

    def build(avatar: Any, config: assets.BuildConfig) -> assets.Asset:
        asked.extend([avatar, config.pose])
        return named_tube(SMPL_JOINT_NAMES)

    monkeypatch.setattr(assets, "build", build)
    monkeypatch.setattr(
        avatargen, "load_generator", lambda weights, body: SimpleNamespace(sample=lambda seed: seed)
    )
    assert main(["7", "--views", "front", "--pose", "wave", *SMALL]) == 0
    assert asked == [7, "a"]
    assert Image.open("avatar_7.png").height == 48
    capsys.readouterr()
    assert main(["random", "--views", "front", *SMALL]) == 0
    assert capsys.readouterr() == (f"avatar_{asked[2]}.png\n", f"seed {asked[2]} was drawn\n")


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ([], "required: SEED|FILE"),
        (["-1"], "found '-1', which is no seed"),
        (["none.glb"], "found 'none.glb', which is no seed and no .glb file"),
        (["99999999999999999999"], "no seed"),
        (["a.glb", "--out", "a.jpg"], "give a name that ends in .png"),
        (["a.glb", "--turntable", "a.avi"], "give a name that ends in .gif or .mp4 or .webp"),
        (["a.glb", "--clip", "walk", "--out", "a.png"], "give a name that ends in .gif or .mp4 or .webp"),
        (["a.glb", "--clip", "walk", "--pose", "sit"], "found --clip and --pose"),
        (["a.glb", "--clip", "walk"], "the body has no joint"),
        (["a.glb", "--clip", "fly"], "found clip 'fly'"),
        (["a.glb", "--clip", "say"], "without a word to say"),
        (["a.glb", "--say", "hello", "--out", "a.png"], "give a name that ends in .gif or .mp4 or .webp"),
        (["a.glb", "--say", "hello"], "the face has no shape viseme_"),
        (["a.glb", "--turntable", "none/a.gif"], "cannot write none/a.gif"),
        (["a.glb", "--views", "top"], "no view is named top"),
        (["a.glb", "--pose", "moonwalk"], "no pose is named 'moonwalk'"),
        (["a.glb", "--pose", "none.npz"], "cannot read none.npz"),
        (["a.glb", "--frames", "1"], "--frames: found '1'"),
    ],
)
def test_bad_input_is_one_line_and_no_file(
    arguments: list[str], line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    before = sorted(os.listdir())
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n"), sorted(os.listdir())) == ("", 1, before)
    assert err.startswith("avatargen render: ")
    assert line in err
