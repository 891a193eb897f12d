"""What measures people found in photographs: errors that are known beforehand come out, pictures show what
stands before the camera, and a call that was cut off goes on. One person is photographed and found for real
where the networks are."""

import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

import avatargen
from avatargen.commands import main
from avatargen.commands.learn.photo_plot import PANELS
from avatargen.commands.learn.photo_plot import draw as plot
from avatargen.commands.learn.photo_trial import Trial
from avatargen.errors import InputError
from avatargen.metrics.photo_error import (
    PhotoError,
    from_json,
    joints_mm,
    overlap,
    pelvis_on_pelvis,
    procrustes,
    right_words,
    summary,
    surface_mm,
    table,
    to_json,
)
from avatargen.metrics.photo_studio import (
    HEIGHT,
    SPAN,
    WIDTH,
    Figure,
    before_wall,
    draw,
    lamp_on,
    put_camera,
    stand,
    turned,
)
from avatargen.photo.seeing.see import Eyes, open_eyes
from tests.shapes import icosphere

BLIND = Eyes(detector=lambda picture: [], landmarks=lambda picture: [], face=lambda picture: [])


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(8)


def person(seed: int, joints: float = 40.0, *, shirt: bool = True) -> PhotoError:
    return PhotoError(
        seed=seed,
        stages={
            "fit": {"seconds": 1.0, "joints_mm": 2 * joints},
            "paint": {"seconds": 3.0, "joints_mm": joints},
        },
        right={"top": shirt, "hair": True},
        seconds={"see": 1.0},
    )


REFUSED = PhotoError(seed=9, refused="found nobody", stages={}, right={}, seconds={})


# errors


def test_procrustes_undoes_a_similarity_and_no_mirroring(rng: np.random.Generator) -> None:
    wanted = rng.normal(0, 0.5, (22, 3))
    turn = Rotation.from_rotvec(rng.normal(0, 1.0, 3)).as_matrix()
    found = 1.3 * wanted @ turn.T + [0.4, -1.0, 3.0]
    assert joints_mm(procrustes(found, wanted)(found), wanted) < 1e-9
    mirrored = wanted * [-1, 1, 1]
    way = procrustes(mirrored, wanted)
    assert np.linalg.det(way.rotation) == pytest.approx(1)
    assert joints_mm(way(mirrored), wanted) > 50
    off = wanted + rng.normal(0, 0.03, wanted.shape)
    best = np.square(procrustes(off, wanted)(off) - wanted).sum()
    for _ in range(20):  # no similarity nearby is better
        nudged = replace(
            procrustes(off, wanted),
            rotation=Rotation.from_rotvec(rng.normal(0, 0.01, 3)).as_matrix()
            @ procrustes(off, wanted).rotation,
        )
        assert np.square(nudged(off) - wanted).sum() >= best


def test_a_person_elsewhere_is_off_by_the_pose_alone(rng: np.random.Generator) -> None:
    wanted = rng.normal(0, 0.5, (22, 3))
    found = wanted + np.array([1.0, 2.0, 3.0])
    assert joints_mm(pelvis_on_pelvis(found, wanted)(found), wanted) < 1e-9
    found[5, 0] += 0.022
    assert joints_mm(pelvis_on_pelvis(found, wanted)(found), wanted) == pytest.approx(1.0)


def test_the_surface_s_error_is_that_of_its_points() -> None:
    ball = icosphere(0.5)
    assert surface_mm(ball.vertices, ball.faces, 1.02 * ball.vertices) == pytest.approx(10.0, abs=0.01)


def test_silhouettes_overlap_by_their_share() -> None:
    one, other = np.zeros((10, 10), bool), np.zeros((10, 10), bool)
    one[:, :6], other[:, 4:] = True, True
    assert overlap(one, other) == pytest.approx(0.2) and overlap(one & other & ~one, one & ~one) == 0


def test_words_that_say_nothing_are_not_counted() -> None:
    wanted = {"gender": "man", "hat": "none", "top": "shirt", "top_color": "red", "outer": "none"}
    found = {"gender": "man", "hat": "none", "top": "shirt", "top_color": "blue", "outer": "coat"}
    found["outer_color"] = "black"
    assert right_words(found, wanted) == {"gender": True, "top": True, "outer": False, "top_color": False}


def test_a_summary_counts_people_and_leaves_the_refused_out() -> None:
    told = summary([person(1, 30.0), person(2, 50.0, shirt=False), person(3, 70.0), REFUSED])
    joints = told["numbers"]["joints_mm"]
    assert (told["people"], told["refused"]) == (4, 1)
    assert (joints["value"], joints["median"], joints["count"]) == (50.0, 50.0, 3)
    assert 30 <= joints["low"] < 50 < joints["high"] <= 70
    assert told["right"]["top"]["value"] == pytest.approx(2 / 3) and told["right"]["hair"]["value"] == 1
    assert told["stages"]["fit"]["joints_mm"]["value"] == 100.0
    assert told["stages"]["paint"]["joints_mm"] == joints and told["stages"]["paint"]["seconds"]["value"] == 3
    rows = table(told).splitlines()
    assert rows[-4:] == [
        "| after | seconds | joints mm |",
        "| --- | --- | --- |",
        "| fit | 1 | 100 |",
        "| paint | 3 | 50 |",
    ]
    assert rows[2].startswith("| joints mm | 50 | ") and "| top: right | 0.667 |" in table(told)
    assert summary([REFUSED])["numbers"] == {}


def test_a_table_comes_back_as_it_was_and_another_is_refused() -> None:
    people, settings = [person(1), REFUSED], {"weights_hash": "a", "first_seed": 1}
    data = to_json(settings, people)
    assert from_json(data, settings, "f.json") == people
    with pytest.raises(InputError, match=r"f\.json was made with another weights_hash"):
        from_json(data, settings | {"weights_hash": "b"}, "f.json")
    damaged = json.loads(data)
    damaged["each"][0]["right"] = {"wings": True}
    timeless = json.loads(data)
    del timeless["each"][0]["stages"]["fit"]["seconds"]
    damages = (json.dumps(each).encode() for each in (damaged, timeless))
    for bad in (b"", b"[]", data[:-20], *damages, b'{"each": 3}'):
        with pytest.raises(InputError, match=r"f\.json is no table of this command; name another file$"):
            from_json(bad, settings, "f.json")


def test_stages_are_drawn_as_a_picture() -> None:
    """All numbers of all stages, those without an interval as well."""
    names = [name for panel in PANELS.values() for name in panel]
    rows = [
        PhotoError(
            seed=seed,
            stages={
                stage: {"seconds": at} | dict.fromkeys(names, at + seed)
                for stage, at in (("fit", 1.0), ("paint", 4.0))
            },
            right={},
            seconds={},
        )
        for seed in (1, 2)
    ]
    picture = Image.open(io.BytesIO(plot(summary(rows)["stages"])))
    assert picture.size == (1000, 700) and np.asarray(picture.convert("L")).std() > 5


# the studio


def ball_figure(texture: np.ndarray) -> Figure:
    ball = icosphere(0.8)
    uv = 0.5 + ball.vertices[:, :2] / 2
    return Figure(vertices=ball.vertices.astype(np.float64), faces=ball.faces, uv=uv, texture=texture)


def test_somebody_stands_before_the_camera_in_their_own_colours(rng: np.random.Generator) -> None:
    texture = np.zeros((8, 8, 3), np.uint8)
    texture[:] = (200, 100, 50)
    figure = ball_figure(texture)
    camera, move = put_camera(figure.vertices, rng)
    figure = replace(figure, vertices=figure.vertices + move)
    picture = draw(figure, camera)
    assert picture.shape == (HEIGHT, WIDTH, 4)
    whole = picture[..., 3] == 255
    rows = np.flatnonzero(whole.any(axis=1))
    assert len(rows) == pytest.approx(SPAN * HEIGHT, rel=0.15) and rows[0] > 0 and rows[-1] < HEIGHT - 1
    assert (np.abs(picture[whole][:, :3].astype(int) - (200, 100, 50)) <= 1).all()
    dark = draw(figure, camera, np.full(len(figure.vertices), 0.5))
    assert (dark[whole][:, :3] < picture[whole][:, :3]).all()
    before = before_wall(picture, rng)
    assert np.array_equal(before[whole], picture[whole][:, :3])
    assert before[picture[..., 3] == 0].std() > 5


def test_whoever_is_turned_once_around_is_as_before(rng: np.random.Generator) -> None:
    figure = ball_figure(np.zeros((8, 8, 3), np.uint8))
    middle = np.array([0.1, 0.2, -3.0])
    back = turned(turned(figure, middle, 2.0), middle, 2 * np.pi - 2.0)
    assert np.allclose(back.vertices, figure.vertices)
    side = turned(figure, np.zeros(3), np.pi / 2).vertices
    assert np.allclose(side[:, 0], figure.vertices[:, 2]) and np.allclose(side[:, 2], -figure.vertices[:, 0])


def test_poses_and_light_are_those_of_their_seed() -> None:
    names = ("pelvis", "left_hip", "left_elbow")
    one, again, other = (stand(names, np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert np.array_equal(one, again) and not np.array_equal(one, other)
    light = lamp_on(np.eye(3), np.random.default_rng(1))
    assert (light >= 0.45).all() and (light <= 1.2).all()


# the command


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--out", "a.txt"], "give a name that ends in .json"),
        (["--out", "a.json", "--sheet", "a.jpg"], "give a name that ends in .png"),
        (["--out", "a.json", "--plot", "a.pdf"], "give a name that ends in .png"),
        (["--out", "a.json", "--people", "0"], "found people 0"),
        (["--out", "none/a.json"], "cannot write none/a.json"),
        (["--out", "a.json"], "run `avatargen photo-models` once"),
    ],
)
def test_what_is_wrong_is_one_line_and_no_file(
    words: list[str],
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("AVATARGEN_PHOTO_MODELS", str(tmp_path / "models"))
    assert main.main(["eval", "photo", *words]) == 2
    err = capsys.readouterr().err
    assert said in err and err.count("\n") == 1 and list(tmp_path.iterdir()) == []


def test_a_call_that_was_cut_off_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """People who were measured are not measured again, and the table is that of one call."""
    measured: list[int] = []

    def of(self: Trial, seed: int) -> tuple[PhotoError, np.ndarray | None]:
        if seed == 12 and 12 not in measured:
            measured.append(seed)
            raise InputError("the power went")
        measured.append(seed)
        return (REFUSED, None) if seed == 9 else (person(seed), np.full((4, 6, 3), seed, np.uint8))

    monkeypatch.setattr(Trial, "of", of)
    monkeypatch.setattr("avatargen.photo.seeing.see.open_eyes", lambda: BLIND)
    out, sheet = tmp_path / "a.json", tmp_path / "a.png"
    words = ["eval", "photo", "--people", "5", "--first-seed", "8", "--out", str(out), "--sheet", str(sheet)]
    assert main.main(words) == 2 and main.main(words) == 0
    assert measured == [8, 9, 10, 11, 12, 12]
    told = json.loads(out.read_bytes())
    assert [row["seed"] for row in told["each"]] == [8, 9, 10, 11, 12]
    assert told["summary"]["people"] == 5 and told["summary"]["refused"] == 1
    assert "| joints mm | 40 |" in capsys.readouterr().out
    assert np.unique(np.asarray(Image.open(sheet))).tolist() == [8, 10, 11, 12]


def test_a_rendered_person_is_found_again() -> None:
    try:
        eyes = open_eyes()
    except InputError as error:
        pytest.skip(str(error))
    found, strip = Trial(avatargen.load_generator(), eyes).of(31)
    assert found.refused is None and strip is not None and strip.ndim == 3
    assert found.numbers["joints_aligned_mm"] < 90 and found.numbers["surface_aligned_mm"] < 30
    assert found.numbers["silhouette_iou"] > 0.88
    assert found.numbers["psnr_seen_db"] > found.numbers["psnr_unseen_db"] > 8
    assert sum(found.right.values()) >= len(found.right) / 2
    assert list(found.stages) == ["landmarks", "fit", "resemble", "refine", "again", "paint"]
    until = [stage["seconds"] for stage in found.stages.values()]
    assert until == sorted(until) and until[0] > 0
    joints = [stage["joints_aligned_mm"] for stage in found.stages.values()]
    assert joints[-1] < joints[0]
    assert found.stages["paint"]["psnr_seen_db"] > found.stages["fit"]["psnr_seen_db"]
    assert set(found.seconds) == {"see", "fit", "resemble", "refine", "build", "paint"}
