"""Choosing people by traits: what moves in the latent, what stays, what is refused, and what files tell."""

import itertools
import json
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
import torch

import avatargen
from assets.assemble import asset_info
from avatargen.avatar import AvatarSampler, load_single, shipped
from avatargen.errors import InputError
from avatargen.generator.checkpoint import save_checkpoint
from avatargen.wardrobe import garments
from avatargen.wardrobe.attributes import LATENT_SIZE, People, coordinate
from avatargen.wardrobe.choosing import HEIGHT, SHOWN, VALUES, Traits, read_traits, traits_of, values_of
from avatargen.wardrobe.colour_names import KNOWN, colour_name, lab
from avatargen.wardrobe.condition import condition
from avatargen.wardrobe.describe import Attributes, describe, people_of
from avatargen.wardrobe.palettes import PALETTES
from avatargen.wardrobe.stature import MEN, SPREAD, WOMEN
from avatargen.wardrobe.together import WORN_BY, check_together
from exporters.read_glb import read_glb
from tests.generators import random_generator
from tests.tube import tube

OTHERS = {("beard", "goatee")}  # that the procedural coding does not have
EVERY = [(name, value) for name, values in VALUES.items() for value in values if (name, value) not in OTHERS]
PEOPLE = 40


@pytest.fixture(scope="module")
def sampler() -> AvatarSampler:
    return load_single(shipped("generator.safetensors"))


def drawn(seed: int) -> torch.Tensor:
    return torch.randn(1, LATENT_SIZE, generator=torch.Generator().manual_seed(seed))


@pytest.mark.parametrize(("name", "value"), EVERY)
def test_a_chosen_trait_is_what_the_coding_then_says(name: str, value: str):
    for seed in range(PEOPLE):
        z = condition(drawn(seed), traits_of({name: value}))
        found = describe(People(z), 1.7).facts()
        said = found["age_years"] if name == "age" else found.get(name)
        if name == "age":
            low, high = {"young": (18, 40), "old": (65, 90)}[value]
            assert isinstance(said, int) and low <= said <= high
        else:
            assert said == value, f"seed {seed}"
        assert z.abs().max() < 4.5  # as likely a person as others


@pytest.mark.parametrize(("name", "value"), EVERY)
def test_only_what_decides_moves_and_a_second_time_nothing(name: str, value: str):
    deciding = {
        "gender": {"woman"},
        "age": {"age"},
        "skin": {"skin_light"},
        "hair": {"woman", "hair_a", "hair_b", "hair_c", "hat_a", "hat_b", "hat_c"},
        "hair_color": {"hair", "age", "hair_a", "hair_b", "hair_c", "hat_a", "hat_b", "hat_c"},
        "beard": {"woman", "beard_a", "beard_b"},
        "hat": {"hat_a", "hat_b", "hat_c"},
        "top": {"collar_a", "collar_b", "outer_a"},
        "sleeves": {"sleeve", "thickness", "collar_a", "collar_b", "outer_a"},
        "top_color": {"top", "outer_a", "pattern_a", "pattern_b", "pattern_c"},
        "bottom": {"woman", "bottom_a", "bottom_b"},
        "bottom_color": {"bottom", "bottom_a", "bottom_b"},
        "outer": {"outer_a", "outer_b"},
        "outer_color": {"outer", "outer_a", "outer_b"},
        "shoes": {"shoe_a", "shoe_b"},
    }[name]
    may_move = {coordinate(each) for each in deciding}
    if name.endswith("_color") and name != "hair_color":
        may_move |= {coordinate(name.removesuffix("_color")) + i for i in (1, 2)}
    for seed in range(PEOPLE):
        z = drawn(seed)
        once = condition(z, traits_of({name: value}))
        moved = set(torch.nonzero(once[0] != z[0])[:, 0].tolist())
        assert moved <= may_move, f"seed {seed}"
        assert torch.equal(condition(once, traits_of({name: value})), once)
        if describe(People(z), 1.7).facts().get(name) == value and name in ("gender", "beard", "shoes"):
            assert torch.equal(once, z)  # who has it already stays the same


def test_a_beard_that_the_coding_does_not_have_is_refused():
    with pytest.raises(InputError, match="beard goatee: these weights do not say"):
        condition(drawn(5), Traits(beard="goatee"))


def test_a_person_who_is_as_wanted_stays_the_same():
    wanted = Traits(gender="woman", skin="dark", hair="long", bottom="dress", top_color="green")
    z = condition(drawn(5), wanted)
    assert torch.equal(condition(z, wanted), z)
    assert torch.equal(condition(z, Traits(gender="woman", bottom="dress")), z)


def test_ranks_keep_their_order_within_the_interval():
    """Nobody piles up at its ends: moved people differ as much as those who were there."""
    z = torch.cat([drawn(seed) for seed in range(400)])
    moved = torch.cat([condition(row[None], Traits(skin="dark")) for row in z])
    low = People(z).measure("skin_light")[:, 0] < 0.86
    rank = People(moved).measure("skin_light")[low, 0].double()
    assert rank.min() >= 0.86
    quartiles = (rank.quantile(torch.tensor([0.25, 0.5, 0.75], dtype=torch.float64)) - 0.86) / 0.14
    assert quartiles.tolist() == pytest.approx([0.25, 0.5, 0.75], abs=0.08)


@pytest.mark.parametrize(
    ("chosen", "why"),
    [
        ({"gender": "man", "bottom": "dress"}, "bottom dress is for women alone"),
        ({"beard": "full", "hair": "bun"}, "for women alone|for men alone"),
        ({"hair": "bald", "hair_color": "black"}, "no hair to colour"),
        ({"hat": "beanie", "hair": "afro"}, "the hat hides the hair"),
        ({"bottom": "dress", "bottom_color": "black"}, "a dress has top_color"),
        ({"outer": "none", "outer_color": "black"}, "nothing to colour"),
        ({"age": "young", "hair_color": "grey"}, "hair goes grey with age"),
        ({"age": "old", "hair_color": "blond"}, "hair goes grey with age"),
        ({"top": "turtleneck", "sleeves": "short"}, "long sleeves"),
        ({"outer": "coat", "sleeves": "short"}, "hides the sleeves"),
        ({"hair": "lang"}, "found 'lang', wanted one of .*long"),
        ({"hiar": "long"}, "did you mean hair"),
        ({"height": 2.5}, "wanted 1.40 to 2.10 m"),
        ({"height": float("nan")}, "wanted 1.40 to 2.10 m"),
        ({"height": "tall"}, "wanted metres"),
        ({"top_color": "bleu"}, "wanted one of black, .* or another colour's name or #rrggbb"),
        ({"hat": "none", "hat_color": "red"}, "nothing to colour"),
        ({"height": 1.8, "stature": "tall"}, "both say how tall"),
        ({"top_color": "navy"}, "these weights do not say"),
        ({"hair": 3}, "wanted one of"),
        ({"hair": ["long"]}, "wanted one of"),
        ({"hat": True}, "wanted one of"),
    ],
)
def test_what_cannot_be_is_refused_in_one_sentence(chosen: dict[str, object], why: str):
    with pytest.raises(InputError, match=why) as refused:
        condition(drawn(0), traits_of(chosen))
    assert "\n" not in str(refused.value) and len(str(refused.value)) < 200


def test_pairs_that_are_accepted_are_had_at_once():
    """No pair of traits is accepted and then not given, and none ends in a failure; every fifth pair."""
    accepted = 0
    pairs = [pair for pair in itertools.combinations(EVERY, 2) if pair[0][0] != pair[1][0]]
    for first, second in pairs[::5]:
        try:
            wanted = traits_of(dict([first, second]))
            check_together(wanted)
        except InputError:
            continue
        accepted += 1
        found = describe(People(condition(drawn(accepted), wanted)), 1.7).facts()
        for name, value in (first, second):
            assert name == "age" or found.get(name) == value, (first, second)
    assert accepted > 200


def test_names_are_those_of_the_dataclass():
    names = {field.name for field in fields(Traits)} - {HEIGHT}
    assert names == {*VALUES, *SHOWN} and all(map(values_of, names))
    assert all(value in VALUES[name] for name, value in WORN_BY)


def test_colours_have_the_names_of_the_nearest_known_ones():
    for name, colors in KNOWN.items():
        assert {colour_name(np.array(color)) for color in colors} == {name}
    reference = {(1, 1, 1): (100, 0, 0), (0, 0, 0): (0, 0, 0), (1, 0, 0): (53.24, 80.09, 67.20)}
    for rgb, expected in reference.items():
        np.testing.assert_allclose(lab(np.array([rgb], dtype=float))[0], expected, atol=0.02)


def test_palettes_are_the_garments_own():
    people = People(torch.cat([drawn(seed) for seed in range(50)]))
    for name, colors in (
        ("top", people.colour("top")),
        ("outer", garments.outer_colour(people)),
    ):
        normal = people.z[:, PALETTES[name].coordinates].double().numpy()
        np.testing.assert_allclose(PALETTES[name].colours(normal), colors[:, 0], atol=1e-5)
    skirts = People(people.z.clone())
    for each, sign in (("woman", 1), ("bottom_a", 1), ("bottom_b", -1)):
        skirts.z[:, coordinate(each)] = sign
    own = PALETTES["skirt"].colours(skirts.z[:, PALETTES["skirt"].coordinates].double().numpy())
    np.testing.assert_allclose(own, garments.skirt_colour(skirts)[:, 0], atol=1e-5)
    skirts.z[:, coordinate("bottom_a")] = -1
    own = PALETTES["trousers"].colours(skirts.z[:, PALETTES["trousers"].coordinates].double().numpy())
    np.testing.assert_allclose(own, garments.trouser_colour(skirts)[:, 0], atol=1e-5)


def test_latents_of_fewer_coordinates_are_read():
    z = drawn(1)
    assert torch.equal(people_of(z[:, :-5]).z[:, :-5], z[:, :-5])
    with pytest.raises(InputError, match="reads"):
        people_of(torch.zeros(1, LATENT_SIZE + 1))


def test_a_sampled_person_has_the_traits_and_is_the_same_again(sampler: AvatarSampler):
    wanted = {"gender": "woman", "hair": "long", "bottom": "dress", "height": 1.7}
    points = torch.from_numpy(sampler.body.vertices[::50])
    first, again = (sampler.sample(3, traits=wanted) for _ in range(2))
    assert torch.equal(first.color(points), again.color(points))
    assert np.array_equal(first.betas, again.betas)
    said = first.attributes
    assert isinstance(said, Attributes)
    assert (said.gender, said.hair, said.bottom) == ("woman", "long", "dress")
    assert first.height == pytest.approx(1.7, abs=1e-5) and said.height_m == 1.7
    plain = sampler.sample(3)
    assert isinstance(plain.attributes, Attributes) and plain.attributes.skin == said.skin
    assert said.shoe_color == plain.attributes.shoe_color


def test_height_changes_the_body_alone_and_sex_the_stature(sampler: AvatarSampler):
    points = torch.from_numpy(sampler.body.vertices[::50])
    own, tall = sampler.sample(4), sampler.sample(4, traits=Traits(height=2.0))
    assert torch.equal(own.sdf(points), tall.sdf(points)) and torch.equal(
        own.color(points), tall.color(points)
    )
    assert tall.height == pytest.approx(2.0, abs=1e-5)
    woman, man = (sampler.sample(4, traits=Traits(gender=each)).height for each in ("woman", "man"))
    assert man - woman == pytest.approx(MEN - WOMEN, abs=1e-4)
    assert abs(man - MEN) < 3 * SPREAD


def test_weights_of_another_coding_say_nothing_and_refuse(sampler: AvatarSampler, tmp_path: Path):
    save_checkpoint(random_generator(), tmp_path / "g.safetensors", {"licence": "CC0-1.0"})
    from tests.bodies import capsule_body

    other = avatargen.load_generator(tmp_path / "g.safetensors", capsule_body(0.04))
    assert other.sample(1).attributes is None and other.sample(1).height > 0
    with pytest.raises(InputError, match="do not say what their latents mean"):
        other.sample(1, traits={"hair": "long"})
    assert other.sample(1, traits={}).attributes is None
    with pytest.raises(InputError, match="truncation"):
        sampler.sample(1, truncation=0.5, traits={"hair": "long"})
    assert sampler.sample(1, truncation=0.5).attributes is None
    without = replace(sampler, sizing=None)
    with pytest.raises(InputError, match="height"):
        without.sample(1, traits={"height": 1.7})


def test_files_tell_the_attributes(sampler: AvatarSampler, tmp_path: Path):
    avatar = sampler.sample(13)
    info = asset_info(avatar)
    assert avatar.attributes is not None
    assert dict(info.facts) == avatar.attributes.facts() and info.height_m == avatar.height
    from exporters.glb import encode

    (tmp_path / "a.glb").write_bytes(encode(replace(tube(), info=info)))
    back = read_glb(tmp_path / "a.glb").info
    assert back.facts == info.facts
    assert back.height_m == pytest.approx(avatar.height, abs=1e-4)


def test_a_layer_of_usd_tells_them_too(sampler: AvatarSampler):
    from pxr import Sdf

    from exporters.usd import describe_source

    info = asset_info(sampler.sample(13))
    layer = Sdf.Layer.CreateAnonymous()  # pyright: ignore[reportAttributeAccessIssue]
    describe_source(layer, info)
    told = layer.customLayerData["avatargen"]
    assert told["attributes"] == dict(info.facts)
    assert told["height_m"] == pytest.approx(info.height_m, abs=1e-4)


def test_traits_come_from_a_file(tmp_path: Path):
    path = tmp_path / "t.json"
    path.write_text(json.dumps({"hair-color": "blond", "height": 1.6, "bottom": "jeans"}))
    assert read_traits(path) == Traits(hair_color="blond", height=1.6, bottom="jeans")
    for text, why in (("[1]", "no object"), ("{", "cannot be read"), ('{"hair": null}', "wanted one of")):
        path.write_text(text)
        with pytest.raises(InputError, match=why):
            read_traits(path)
    with pytest.raises(InputError, match="cannot be read"):
        read_traits(tmp_path / "none.json")


def test_the_shipped_weights_show_the_colour_that_was_named(sampler: AvatarSampler):
    """On the clothed chest, found by steps of the signed distance; bare skin under a deep neck aside."""
    x, y, z = sampler.body.vertices.T
    chest = torch.from_numpy(sampler.body.vertices[(abs(x) < 0.12) & (y > 0.18) & (y < 0.36) & (z > 0.05)])
    names = VALUES["top_color"]
    seen = []
    for seed in range(4):
        for name in names:
            avatar, points = sampler.sample(seed, traits={"top_color": name}), chest.clone()
            for _ in range(6):
                points[:, 2] -= avatar.sdf(points)
            seen.append(colour_name(avatar.color(points).double().median(dim=0).values.numpy()) == name)
    assert np.mean(seen) >= 0.9
