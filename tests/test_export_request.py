"""The request of an export: made from the options, checked when made, and no field of it is forgotten."""

import json
from argparse import Action
from dataclasses import fields, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from assets import BuildConfig
from assets.content import MOVING_FACE
from avatargen.commands.export import avatar_export
from avatargen.commands.export.options import make_parser, parse, read
from avatargen.errors import InputError
from avatargen.export.fingerprint import facts, fingerprint, plain, settings
from avatargen.export.manifest import open_manifest
from avatargen.export.on_ray import with_whole_paths
from avatargen.export.request import NO_BYTE, ExportRequest
from exporters.encoding import Encoding
from tests import cli_page

WALKING = ("--seed", "3", "--clip", "walk")
MOVING = ("--seed", "3", "--face", MOVING_FACE)
APART = ("--seed", "3", "--parts", "separate")
PHOTO = ("--photo", "a.jpg")
ONE, MANY = ("--seed", "3"), ("--seeds", "0:2", "--out", "crowd")
# option: words before it is changed, and after
CHANGES: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "SEED": (("3",), ("4",)),
    "--seed": (ONE, ("--seed", "4")),
    "--seeds": (MANY, ("--seeds", "0:3", "--out", "crowd")),
    "--from": (ONE, (*ONE, "--from", "wardrobe")),
    "--wardrobe": (
        (*ONE, "--from", "wardrobe"),
        (*ONE, "--from", "wardrobe", "--wardrobe", "folder"),
    ),
    "--parts": (ONE, (*ONE, "--parts", "separate")),
    "--hidden": (APART, (*APART, "--hidden", "keep")),
    "--part-names": (APART, (*APART, "--part-names", "rpm")),
    "--mesher": (ONE, (*ONE, "--mesher", "marching-cubes")),
    "--simplifier": (ONE, (*ONE, "--simplifier", "pymeshlab")),
    "--wear": (ONE, (*ONE, "--wear", "8:top,outer")),
    "--photo": (PHOTO, (*PHOTO, "--photo", "b.jpg")),
    "--mask": (PHOTO, (*PHOTO, "--mask", "a.png")),
    "--texture-from": (PHOTO, (*PHOTO, "--texture-from", "field")),
    "--person": (ONE, ("--person", "a.safetensors")),
    "--save-person": (ONE, (*ONE, "--save-person", "c.safetensors")),
    "--weights": (ONE, (*ONE, "--weights", "a.safetensors")),
    "--body": (ONE, (*ONE, "--body", "a.npz")),
    "--gender": (ONE, (*ONE, "--gender", "man")),
    "--age": (ONE, (*ONE, "--age", "old")),
    "--text": (ONE, (*ONE, "--text", "a tall man in a red shirt")),
    "--figure": (ONE, (*ONE, "--figure", "slim")),
    "--stature": (ONE, (*ONE, "--stature", "tall")),
    "--eyes": (ONE, (*ONE, "--eyes", "blue")),
    "--skin": (ONE, (*ONE, "--skin", "dark")),
    "--hair": (ONE, (*ONE, "--hair", "long")),
    "--hair-color": (ONE, (*ONE, "--hair-color", "grey")),
    "--beard": (ONE, (*ONE, "--beard", "full")),
    "--hat": (ONE, (*ONE, "--hat", "beanie")),
    "--hat-color": (ONE, (*ONE, "--hat-color", "navy")),
    "--top": (ONE, (*ONE, "--top", "shirt")),
    "--top-color": (ONE, (*ONE, "--top-color", "blue")),
    "--pattern": (ONE, (*ONE, "--pattern", "checks")),
    "--pattern-color": (ONE, (*ONE, "--pattern-color", "white")),
    "--sleeves": (ONE, (*ONE, "--sleeves", "short")),
    "--bottom": (ONE, (*ONE, "--bottom", "skirt")),
    "--bottom-color": (ONE, (*ONE, "--bottom-color", "black")),
    "--overall": (ONE, (*ONE, "--overall", "overall")),
    "--overall-color": (ONE, (*ONE, "--overall-color", "blue")),
    "--outer": (ONE, (*ONE, "--outer", "coat")),
    "--outer-color": (ONE, (*ONE, "--outer-color", "black")),
    "--shoes": (ONE, (*ONE, "--shoes", "boots")),
    "--shoes-color": (ONE, (*ONE, "--shoes-color", "#7a1f2b")),
    "--height": (ONE, (*ONE, "--height", "1.75m")),
    "--traits": (ONE, (*ONE, "--traits", "a.json")),
    "--out": (ONE, (*ONE, "--out", "a.glb")),
    "--format": (ONE, (*ONE, "--format", "gltf")),
    "--compress": (ONE, (*ONE, "--compress", "quantize")),
    "--report": (ONE, (*ONE, "--report", "a.json")),
    "--preview": (ONE, (*ONE, "--preview", "a.png")),
    "--sheet": (MANY, (*MANY, "--sheet", "a.png")),
    "--scene": (ONE, (*ONE, "--scene", "hero")),
    "--content": (ONE, (*ONE, "--content", "mesh")),
    "--resolution": (ONE, (*ONE, "--resolution", "64")),
    "--faces": (ONE, (*ONE, "--faces", "900")),
    "--lods": (("--seed", "3", "--faces", "900"), (*ONE, "--lods", "900,500")),
    "--tolerance": (ONE, (*ONE, "--tolerance", "1mm")),
    "--budget": (ONE, (*ONE, "--budget", "9s")),
    "--texture": (ONE, (*ONE, "--texture", "64")),
    "--normal-map": (ONE, (*ONE, "--normal-map", "64")),
    "--ambient-occlusion": (ONE, (*ONE, "--ambient-occlusion", "64")),
    "--texture-format": (ONE, (*ONE, "--texture-format", "jpeg")),
    "--pose": (ONE, (*ONE, "--pose", "a.npz")),
    "--joints": (ONE, (*ONE, "--joints", "24")),
    "--names": (ONE, (*ONE, "--names", "unity")),
    "--bones": (ONE, (*ONE, "--bones", "world")),
    "--ends": (ONE, (*ONE, "--ends")),
    "--root": (ONE, (*ONE, "--root")),
    "--twist": (ONE, (*ONE, "--twist")),
    "--springs": (ONE, (*ONE, "--springs")),
    "--morphs": (ONE, (*ONE, "--morphs")),
    "--face": (ONE, (*ONE, "--face", "shapes")),
    "--clip": (ONE, (*ONE, "--clip", "walk")),
    "--say": (MOVING, (*MOVING, "--say", "hello")),
    "--phonemes": (MOVING, (*MOVING, "--phonemes", "a.json")),
    "--motion": (ONE, (*ONE, "--motion", "a.npz")),
    "--motion-up": ((*ONE, "--motion", "a.npz"), (*ONE, "--motion", "a.npz", "--motion-up", "y")),
    "--fps": (WALKING, (*WALKING, "--fps", "24")),
    "--speed": (WALKING, (*WALKING, "--speed", "2")),
    "--mirror": (WALKING, (*WALKING, "--mirror")),
    "--in-place": (WALKING, (*WALKING, "--in-place")),
    "--device": (ONE, (*ONE, "--device", "cuda")),
    "--jobs": (MANY, (*MANY, "--jobs", "2")),
    "--ray": (MANY, (*MANY, "--ray", "auto")),
    "--dry-run": (ONE, (*ONE, "--dry-run")),
}
# these change no byte of a seed's files; their fields say why
UNCHANGING = {
    *(
        "SEED",
        "--save-person",
        "--seed",
        "--seeds",
        "--out",
        "--report",
        "--preview",
        "--sheet",
        "--jobs",
        "--ray",
        "--dry-run",
    )
}
# these are no part of a request
ASIDE = {"--quiet": "what is said, not what is made", "--help": "ends before", "--version": "ends before"}


def name_of(action: Action) -> str:
    return (action.option_strings or [str(action.metavar)])[-1]


OPTIONS = [action for action in make_parser()._actions if name_of(action) not in ASIDE]


@pytest.fixture(autouse=True)
def in_a_folder_with_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("a.npz", "b.npz", "a.safetensors", "a.jpg", "b.jpg", "a.png"):
        Path(name).write_bytes(b"as it was")
    Path("a.json").write_text('{"hair": "bob"}')
    Path("folder").mkdir()


def changed_fields(before: ExportRequest, after: ExportRequest) -> set[str]:
    return {name for name, value in facts(before).items() if facts(after)[name] != value}


def test_every_option_has_a_row_here() -> None:
    """An option more must say, in this table, what it changes."""
    assert {name_of(action) for action in OPTIONS} == set(CHANGES)
    assert {name_of(action) for action in make_parser()._actions} == set(CHANGES) | set(ASIDE)


@pytest.mark.parametrize("option", CHANGES)
def test_a_changed_option_changes_the_fingerprint_or_says_why_not(option: str) -> None:
    before, after = (parse(words) for words in CHANGES[option])
    changed = changed_fields(before, after)
    kept = {each.name: each.metadata[NO_BYTE] for each, _ in settings(after) if NO_BYTE in each.metadata}

    assert changed
    assert (fingerprint(before) == fingerprint(after)) == (option in UNCHANGING)
    if option in UNCHANGING:
        assert all(kept[name] for name in changed)
    else:
        assert changed - set(kept)


@pytest.mark.parametrize("action", [each for each in OPTIONS if each.choices], ids=name_of)
def test_every_choice_of_an_option_is_a_fingerprint_of_its_own(action) -> None:
    words = CHANGES[action.option_strings[-1]][0]
    seen = [fingerprint(parse([*words, action.option_strings[-1], choice])) for choice in action.choices]
    assert all(one != other for i, one in enumerate(seen) for other in seen[:i])


def test_every_field_of_a_request_is_reached_by_an_option() -> None:
    reached = {
        name for before, after in CHANGES.values() for name in changed_fields(parse(before), parse(after))
    }
    reached |= changed_fields(parse(ONE), parse([*ONE, "--pose", "t"]))
    reached |= changed_fields(parse(ONE), parse([*ONE, "--scene", "print"]))
    reached |= changed_fields(parse(PHOTO), parse([*PHOTO, "--pose", "photo"]))
    names = [each.name for each, _ in settings(parse(ONE))]
    assert len(names) == len(set(names)), "two fields of one name hide each other"
    # what `avatargen edit` says, and of BuildConfig what has no option
    assert set(names) - reached == {"change", "head_detail", "on_ground"}


@pytest.mark.parametrize(
    "option", ["--weights", "--body", "--pose", "--motion", "--mask", "--person", "--phonemes"]
)
def test_files_enter_by_their_contents(option: str) -> None:
    name = CHANGES[option][1][-1]
    words = () if option == "--person" else CHANGES[option][0]
    before = fingerprint(parse([*words, option, name]))
    Path("elsewhere").mkdir()
    moved = Path("elsewhere") / name
    moved.write_bytes(Path(name).read_bytes())
    assert fingerprint(parse([*words, option, str(moved)])) == before
    Path(name).write_bytes(b"as it is now")
    assert fingerprint(parse([*words, option, name])) != before


def test_a_motion_s_name_is_in_the_file_and_so_is_its_order() -> None:
    one, other, both, turned = (
        fingerprint(parse([*ONE, *(word for name in names for word in ("--motion", name))]))
        for names in (["a.npz"], ["b.npz"], ["a.npz", "b.npz"], ["b.npz", "a.npz"])
    )
    assert len({json.dumps(each) for each in (one, other, both, turned)}) == 4


def test_rotations_enter_by_their_numbers_and_what_has_no_rule_is_refused() -> None:
    poses = [np.zeros((24, 3), np.float32), np.zeros((24, 3)), np.full((24, 3), 0.1, np.float32), "t"]
    found = [fingerprint(ExportRequest(seeds=0, build=BuildConfig(pose=pose))) for pose in poses]
    assert all(one["pose"] != other["pose"] for one, other in pairwise(found))
    assert json.loads(json.dumps(found[0])) == found[0]
    with pytest.raises(TypeError, match="no rule"):
        plain({"a": 1}, str)


@pytest.mark.parametrize(
    "words", [["--lods", "20000,5000"], ["--bones", "world"], ["--ends"], ["--device", "cuda"]]
)
def test_a_folder_refuses_a_command_that_would_make_other_files(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with open_manifest(Path("crowd"), fingerprint(parse(MANY))):
        pass
    assert avatar_export.main([*MANY, *words]) == 2
    err = capsys.readouterr().err
    assert "batch: " in err and "was made with other settings: " in err and "name another folder" in err


def test_a_folder_refuses_a_pose_file_that_has_changed(capsys: pytest.CaptureFixture[str]) -> None:
    words = [*MANY, "--pose", "a.npz"]
    with open_manifest(Path("crowd"), fingerprint(parse(words))):
        pass
    with open_manifest(Path("crowd"), fingerprint(parse(words))):  # the same command goes on
        pass
    Path("a.npz").write_bytes(b"as it is now")
    assert avatar_export.main(words) == 2
    assert "other settings" in capsys.readouterr().err


def test_a_request_without_options_is_the_command_without_options() -> None:
    assert fingerprint(parse(ONE)) == fingerprint(ExportRequest(seeds=3))
    wanted = ExportRequest(
        seeds=range(2),
        build=replace(BuildConfig.for_scene("crowd"), ends=True),
        encoding=Encoding(quantize=True),
        clips=("walk",),
        out=Path("crowd"),
    )
    words = ["--scene", "crowd", "--ends", "--compress", "quantize", "--clip", "walk"]
    assert parse([*MANY, *words]) == replace(wanted, scene="crowd")


def test_one_seed_and_many_in_all_their_forms() -> None:
    one = [["3"], ["--seed", "3"], ["--ends", "3"], ["3", "--ends"], ["--out", "a.glb", "3"]]
    assert {parse(words).seeds for words in one} == {3}
    for text, seeds in (
        ("3,5,8", (3, 5, 8)),
        ("8, 3,5:7", (8, 3, 5, 6)),
        ("5:8,6,7:9", (5, 6, 7, 8)),
        ("0:1000", range(1000)),
        ("7", range(7, 8)),
    ):
        request = parse(["--seeds", text, "--out", "crowd"])
        assert (request.seeds, request.many) == (seeds, True)
        assert json.loads(json.dumps(facts(request)))["seeds"]
    assert ExportRequest(seeds=[3, 5], out=Path("crowd")).seeds == (3, 5)


def test_a_drawn_seed_is_another_each_time_and_one_of_ours() -> None:
    drawn = [read(["--seed", "random"]) for _ in range(4)] + [read(["random"])]
    assert all(options.drawn and 0 <= options.seed < 10**9 for options in drawn)
    assert len({options.seed for options in drawn}) > 1
    assert not read(["3"]).drawn


def test_the_format_comes_from_the_name_and_the_path_from_both() -> None:
    assert ExportRequest(seeds=3).path_of(3) == Path("avatar_3.glb")
    assert ExportRequest(seeds=3, out=Path("a.GLTF")).format == "gltf"
    folder = ExportRequest(seeds=range(9), out=Path("crowd.v2"), format="usdz")
    assert folder.path_of(8) == Path("crowd.v2/avatar_8.usdz")


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"seeds": -1}, "seeds: found -1"),
        ({"seeds": range(0)}, "seeds: found range"),
        ({"seeds": range(3, 2**63 + 1)}, "wanted whole numbers"),
        ({"seeds": range(3)}, "--seeds without --out"),
        ({"seeds": range(3), "out": Path("a"), "budget_s": 5.0}, "both are for one seed"),
        ({"seeds": ()}, r"seeds: found \(\), wanted whole numbers"),
        ({"seeds": (3, 5, -1)}, "seeds: found -1"),
        ({"seeds": (3, 5, 3), "out": Path("a")}, "seeds: found 3 twice"),
        ({"seeds": (3,)}, "--seeds without --out"),
        ({"sheet": Path("a.png")}, "found --sheet with one seed"),
        ({"seeds": range(3), "out": Path("a"), "sheet": Path("a.gif")}, "ends in .png or .jpg"),
        ({"seeds": range(1001), "out": Path("a"), "sheet": Path("a.png")}, "found --sheet with 1001 seeds"),
        ({"jobs": 2}, "found --jobs with one seed"),
        ({"format": "fbx"}, "no known suffix"),
        ({"format": "vrm", "out": Path("a.glb")}, "ends in .vrm"),
        ({"format": "stl"}, "at most mesh"),
        ({"format": "vrm"}, "rests in pose t"),
        ({"format": "usdz", "levels": (500,)}, "one level of detail"),
        ({"format": "usdz", "encoding": Encoding(quantize=True)}, "rounded numbers"),
        ({"format": "obj", "build": BuildConfig(content="textured", ambient_occlusion=64)}, "holds none"),
        ({"build": BuildConfig(content="mesh"), "clips": ("walk",)}, "holds no skeleton"),
        ({"clips": ("fly",)}, "found clip 'fly', wanted one of idle, walk"),
        ({"clips": ("walk,idle",)}, "found clip walk,idle; one of the body"),
        ({"clips": ("talk,talk",)}, "found clip talk,talk"),
        ({"clips": ("walk,talk",)}, "found --clip walk,talk on a face that does not move"),
        ({"say": "hello"}, "found --say or --phonemes on a face that does not move"),
        ({"say": "..."}, "wanted words"),
        ({"say": "a", "phonemes": Path("a.json")}, "give one"),
        ({"clips": ("say",)}, "without a word to say"),
        ({"tolerance_mm": 1.0, "budget_s": 5.0}, "give one of them alone"),
        ({"tolerance_mm": 1.0, "levels": (500,)}, "--tolerance and --lods"),
        ({"preview": Path("a.jpg")}, "ends in .png"),
    ],
)
def test_what_does_not_go_together_is_told_when_a_request_is_made(values: dict, words: str) -> None:
    with pytest.raises(InputError, match=words):
        ExportRequest(**({"seeds": 3} | values))  # pyright: ignore[reportArgumentType]


def test_paths_for_a_cluster_mean_the_same_anywhere() -> None:
    words = [*MANY, "--weights", "a.safetensors", "--motion", "a.npz", "--pose", "b.npz", "--ray", "auto"]
    request = parse(words)
    there = with_whole_paths(request)
    assert there.out == Path.cwd() / "crowd"
    assert (there.pose_file, there.motions) == (Path.cwd() / "b.npz", (Path.cwd() / "a.npz",))
    assert fingerprint(there) == fingerprint(request)
    for each in fields(there):
        value = getattr(there, each.name)
        assert not isinstance(value, Path) or value.is_absolute()


def test_help_and_the_page_of_options_tell_the_defaults() -> None:
    """docs/cli.md is what `python -m tests.cli_page` writes."""
    assert cli_page.PAGE.read_text() == cli_page.page()
    words = {"content", "format", "out", "normal_map", "jobs", "wardrobe"}  # whose default is no value
    usual = {each.name: value for each, value in settings(parse(ONE))}
    usual |= {"texture_format": usual["pictures"], "compress": "none", "ambient_occlusion": "0"}
    usual["mask"] = "found by the networks"
    told = {each.dest: cli_page.default_of(each) for each in OPTIONS if cli_page.default_of(each)}
    assert words <= set(told)
    for dest in set(told) - words:
        value = usual[dest]
        assert told[dest].split(",")[0] == (f"{value:g}" if isinstance(value, float) else str(value)), dest


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--hidden", "keep"), "without --parts separate"),
        (("--parts", "separate", "--format", "obj"), "choose glb, vrm or usdz"),
        (("--parts", "separate", "--format", "gltf"), "choose glb, vrm or usdz"),
        (("--parts", "separate", "--scene", "print"), "choose glb, vrm or usdz"),
        (("--parts", "separate", "--lods", "900,500"), "of one mesh"),
        (("--parts", "separate", "--tolerance", "1mm"), "of one mesh"),
        (("--wear", "8:top", "--wear", "9:top"), "twice"),
        (("--wear", "8:scarf"), "garments of top"),
        (("--wear", "top"), "SEED:GARMENT"),
        (("--wear", "8:hat", "--from", "wardrobe"), "procedural wardrobe"),
    ],
)
def test_parts_and_borrowing_that_cannot_be_are_refused(words: tuple[str, ...], said: str) -> None:
    with pytest.raises(InputError, match=said):
        parse([*ONE, *words])


def test_what_is_borrowed_is_one_value_whatever_the_order() -> None:
    one = parse([*ONE, "--wear", "8:top,outer", "--wear", "5:shoes"])
    assert one.wear == (("outer", 8), ("shoes", 5), ("top", 8))
    assert one == parse([*ONE, "--wear", "5:shoes", "--wear", "8:outer,top"])
