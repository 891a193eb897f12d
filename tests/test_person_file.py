"""A person in a file: the same bytes come out of it as without it, also of somebody found in a photograph,
and what is no such file, or of other weights, is one line."""

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load, save

from assets import BuildConfig, build
from assets.asset.asset import TexturedAsset
from avatargen.commands.export import avatar_export
from avatargen.commands.look.render import load as load_drawn
from avatargen.commands.look.render import parse as parse_drawn
from avatargen.commands.look.render import read_seed
from avatargen.commands.viewer.people import People, Photo, Wish
from avatargen.errors import InputError
from avatargen.export.one import export_avatar
from avatargen.export.person_file import FORMAT, encode_person, read_person
from avatargen.export.photo_pixels import look_of, painted
from avatargen.export.photographs import FoundPerson
from avatargen.export.request import ExportRequest
from avatargen.export.saved_people import SavedPhotographed, open_saved, saved
from avatargen.photo.resembling.person import attributes_of, avatar_of
from avatargen.photo.resembling.resemble import Resemblance
from avatargen.wardrobe.choosing import traits_of
from avatargen.wardrobe.colour_names import lab
from tests.test_photo_person import DYES, HAIR, OUTFIT, SKIN, posing, sampler

COARSE = BuildConfig(resolution=96, faces=2000, texture=128)


@pytest.fixture(scope="module")
def found() -> FoundPerson:
    """The man of `posing`, as if the fit and the clothes were found without error."""
    posed = posing()
    colors = {name: lab(np.array([DYES[name]]))[0] for name in DYES} | {"short04": lab(np.array([HAIR]))[0]}
    resemblance = Resemblance(
        sex="man", outfit=OUTFIT, colors=colors, skin=lab(np.array([SKIN]))[0], miss=0.4
    )
    return FoundPerson(
        sightings=(replace(posed.sighting, face=np.ones((5, 2))),),
        fits=(posed.fit,),
        resemblance=resemblance,
        avatar=avatar_of(sampler(), attributes_of(sampler(), resemblance, "young"), posed.fit),
        gender_told=True,
        seconds={"see": 1.0},
    )


@pytest.fixture
def kept(tmp_path: Path) -> Path:
    """Seed 3 in a file."""
    path = tmp_path / "a.safetensors"
    path.write_bytes(encode_person(saved(sampler().sample(3), None, pixels=True)))
    return path


def request(path: Path, **more: Any) -> ExportRequest:
    return ExportRequest(seeds=0, person=path, **more)


def test_a_person_of_a_file_is_the_same_bytes_again(tmp_path: Path) -> None:
    """Of a seed under traits; and once more of the file that is kept on the way."""
    first = ExportRequest(
        seeds=8,
        traits=traits_of({"top_color": "red", "height": 1.7}),
        build=COARSE,
        out=tmp_path / "a.glb",
        save_person=tmp_path / "a.safetensors",
    )
    export_avatar(first)
    export_avatar(
        request(
            tmp_path / "a.safetensors",
            build=COARSE,
            out=tmp_path / "b.glb",
            save_person=tmp_path / "b.safetensors",
        )
    )
    for kind in ("glb", "safetensors"):
        one, other = ((tmp_path / f"{name}.{kind}").read_bytes() for name in "ab")
        assert one == other
    assert len(one) < 20_000


def test_a_person_of_a_photograph_keeps_what_is_on_the_texture(tmp_path: Path, found: FoundPerson) -> None:
    path = tmp_path / "a.safetensors"
    path.write_bytes(encode_person(saved(found.avatar, found, pixels=True)))
    again = read_person(path)
    (look,), (whole,) = found.looks, again.looks
    assert np.array_equal(look.pixels, whole.pixels) and np.array_equal(look.mask, whole.mask)
    person = open_saved(request(path, texture_from="field"), path)
    assert isinstance(person, SavedPhotographed) and again.stuffs is not None
    avatar = person.sample(0)
    assert avatar.attributes == found.avatar.attributes and avatar.info == found.avatar.info
    assert np.array_equal(person.pose(avatar.body.joint_names), found.fits[0].rotations)
    assert person.facts() == json.loads(json.dumps(found.facts() | {"seconds": {}}))
    first, second = build(found.avatar, COARSE), build(avatar, COARSE)
    assert isinstance(first, TexturedAsset) and isinstance(second, TexturedAsset)
    one = painted(first, avatar.body, found.looks, found.stuffs)
    other = person.painted(second)
    assert isinstance(other, TexturedAsset) and np.array_equal(one.texture, other.texture)
    assert not np.array_equal(one.texture, first.texture)
    assert encode_person(saved(avatar, person, pixels=True)) == path.read_bytes()  # kept once more
    less = saved(found.avatar, found, pixels=False)
    assert encode_person(saved(avatar, person, pixels=False)) == encode_person(less)


def test_without_pixels_the_pose_alone_is_kept(tmp_path: Path, found: FoundPerson) -> None:
    path = tmp_path / "a.safetensors"
    path.write_bytes(encode_person(saved(found.avatar, found, pixels=False)))
    assert path.stat().st_size < 20_000
    person = open_saved(request(path, photo_pose=True), path)  # which needs no network
    asset = build(person.sample(0), COARSE)
    assert isinstance(person, SavedPhotographed) and person.painted(asset) is asset


def test_the_viewer_shows_the_person_of_a_file(kept: Path, found: FoundPerson) -> None:
    """One who was drawn, and one of a photograph, in its pose's file without pixels: no network is needed."""
    people = People(sampler(), lambda faces: replace(COARSE, faces=faces))
    less = encode_person(saved(found.avatar, found, pixels=False))
    for data, avatar in ((kept.read_bytes(), sampler().sample(3)), (less, found.avatar)):
        wish = Wish(seed=0, faces=2000, photo=Photo("me.SAFETENSORS", data))
        shown = people.get(wish, lambda stage, share: None).asset
        assert isinstance(shown, TexturedAsset)
        wanted = build(avatar, COARSE)
        assert isinstance(wanted, TexturedAsset)
        assert np.array_equal(shown.vertices, wanted.vertices)
        assert np.array_equal(shown.texture, wanted.texture)


def test_what_is_not_the_person_is_not_kept(found: FoundPerson) -> None:
    sighting = found.sightings[0]
    far = np.ones(sighting.mask.shape, bool)
    rows, columns = np.nonzero(sighting.mask > 0)
    far[rows.min() - 12 : rows.max() + 12, columns.min() - 12 : columns.max() + 12] = False
    look = look_of(sighting, found.fits[0])
    assert far.any() and (look.pixels[far] == 128).all()
    inside = sighting.mask > 0
    assert np.array_equal(look.pixels[inside], sighting.picture.pixels[inside])


def test_a_damaged_picture_is_one_line(tmp_path: Path, found: FoundPerson) -> None:
    good = encode_person(saved(found.avatar, found, pixels=True))
    path = tmp_path / "a.safetensors"
    picture = load(good)["looks.0.picture"]
    for bad in (picture[:300], torch.zeros(80, dtype=torch.uint8), picture[:0]):
        path.write_bytes(good)
        changed(path, path, {}, **{"looks.0.picture": bad.clone()})
        with pytest.raises(InputError, match=r"a\.safetensors is damaged .*; save the person anew$"):
            read_person(path)


def changed(path: Path, to: Path, told: dict[str, Any], **tensors: torch.Tensor) -> None:
    """The file with other words, and other tensors."""
    with safe_open(path, framework="pt") as file:
        metadata = file.metadata()
    words = json.loads(metadata["person"])
    words["attributes"] |= told.pop("attributes", {})
    metadata["person"] = json.dumps(words | told)
    to.write_bytes(save(load(path.read_bytes()) | tensors, metadata))


@pytest.mark.parametrize(
    ("told", "tensors", "said"),
    [
        ({"weights_hash": "0"}, {}, "was saved with other weights"),
        ({"body_hash": "0"}, {}, "was saved with another body"),
        ({"wings": 2}, {}, "is damaged (unknown settings ['wings'])"),
        ({"height": "tall"}, {}, "is damaged"),
        ({"looks": [[700.0, 1.7]]}, {}, "is damaged"),
        ({"attributes": {"hair": "wings"}}, {}, "nobody is or wears that"),
        ({"attributes": {"skin_mix": float("nan")}}, {}, "nobody is or wears that"),
        ({"attributes": {"prints": ["plain"]}}, {}, "nobody is or wears that"),
        ({}, {"betas": torch.full((10,), torch.nan)}, "betas of"),
        ({}, {"betas": torch.zeros(3)}, "nobody is or wears that"),
        ({}, {"betas": torch.zeros(3, 2)}, "betas is torch.float32 (3, 2)"),
        ({}, {"more": torch.zeros(3)}, "unknown more"),
    ],
)
def test_a_file_that_does_not_fit_is_one_line(
    told: dict[str, Any], tensors: dict[str, torch.Tensor], said: str, kept: Path, tmp_path: Path
) -> None:
    path = tmp_path / "b.safetensors"
    changed(kept, path, dict(told), **tensors)
    with pytest.raises(InputError) as raised:
        open_saved(request(path), path)
    assert said in str(raised.value) and "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--person", "none.safetensors"], "found no file none.safetensors"),
        (["--person", "foreign.safetensors"], "holds None, wanted 'avatargen-person-1'"),
        (["--person", "cut.safetensors"], "is no whole safetensors file"),
        (["--person", "a.safetensors", "--seed", "3"], "leave the seed out"),
        (["--person", "a.safetensors", "--seeds", "0:2", "--out", "x"], "leave the seed out"),
        (["--person", "a.safetensors", "--text", "a man"], "found --person with --text"),
        (["--person", "a.safetensors", "--hair-color", "red"], "found --person with --hair-color"),
        (["--person", "a.safetensors", "--pose", "photo"], "holds no photograph's pose"),
        (["--person", "a.safetensors", "--save-person", "a.safetensors"], "it is read as well"),
        (["--seed", "3", "--save-person", "a.npz"], "give a name that ends in .safetensors"),
        (["--seeds", "0:2", "--out", "x", "--save-person", "b.safetensors"], "leave those out"),
        (["--seed", "3", "--from", "wardrobe", "--save-person", "b.safetensors"], "leave those out"),
    ],
)
def test_what_does_not_go_with_a_person_is_one_line_and_no_file(
    words: list[str],
    said: str,
    kept: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    folder = kept.parent
    monkeypatch.chdir(folder)
    Path("foreign.safetensors").write_bytes(save({"a": torch.zeros(2)}))
    Path("cut.safetensors").write_bytes(kept.read_bytes()[:-9])
    before = sorted(folder.iterdir())
    assert avatar_export.main([*words, "--quiet"]) == 2
    err = capsys.readouterr().err
    assert said in err and err.count("\n") == 1, err
    assert sorted(folder.iterdir()) == before


def test_a_person_of_a_file_is_drawn(kept: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("assets.BuildConfig", lambda pose, face: replace(COARSE, pose=pose, face=face))
    one = load_drawn(parse_drawn([str(kept)]), read_seed(str(kept)))
    other = load_drawn(parse_drawn(["3"]), 3)
    assert isinstance(one, TexturedAsset) and isinstance(other, TexturedAsset)
    assert np.array_equal(one.vertices, other.vertices) and np.array_equal(one.texture, other.texture)


def test_a_file_says_what_it_is(kept: Path) -> None:
    with safe_open(kept, framework="pt") as file:
        assert file.metadata()["format"] == FORMAT
    again = read_person(kept)
    assert encode_person(again) == kept.read_bytes()
    assert asdict(again.words)["seed"] == 3
