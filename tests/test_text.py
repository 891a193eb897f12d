"""A line of text to a person: what is understood, who comes of it, what is said of the rest.

`text_descriptions.tsv` holds 200 descriptions with the facts that they name, 70 written by hand and 130 by a
program with words and orders of its own; where several values are right they stand with | between them.
"""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

import pytest

from avatargen import load_generator
from avatargen.dressed_avatar import DressedSampler
from avatargen.errors import InputError
from avatargen.text.colours import plain, toned
from avatargen.text.items import items_of
from avatargen.text.near import near, vectors
from avatargen.text.person import Told, drawn, offered_by, understand
from avatargen.text.phrases import read
from avatargen.text.vocabulary import vocabulary
from avatargen.wardrobe.choosing import SHOWN, VALUES
from avatargen.wardrobe.colour_names import NAMES
from avatargen.wardrobe.makehuman.choose import draw_latent
from avatargen.wardrobe.makehuman.condition import condition

TABLE = Path(__file__).with_name("text_descriptions.tsv")
HEAD_AND_CLOTHES = ("hair", "hat", "top", "bottom", "overall", "outer", "shoes", "pattern")


@pytest.fixture(scope="module")
def people() -> DressedSampler:
    found = load_generator()
    assert isinstance(found, DressedSampler)
    return found


def descriptions() -> list[tuple[str, dict[str, list[str]]]]:
    """Texts, and the values that each fact may have."""
    rows = [line.split("\t") for line in TABLE.read_text().splitlines()]
    pairs = [(text, (each.split("=") for each in facts.split())) for text, facts in rows]
    return [(text, {name: values.split("|") for name, values in facts}) for text, facts in pairs]


def traits(
    people: DressedSampler, text: str, own: Mapping[str, str | float] | None = None
) -> dict[str, str | float]:
    return understand(text, offered_by(people), own).traits.given()


def facts(people: DressedSampler, told: Told, seed: int) -> dict[str, str | int | float]:
    return condition(draw_latent(seed), told.traits, people)[1].facts()


def test_people_are_as_200_descriptions_say(people):
    right, asked = Counter[str](), Counter[str]()
    for seed, (text, wanted) in enumerate(descriptions()):
        found = facts(people, understand(text, offered_by(people)), seed)
        for name, values in wanted.items():
            kind = "colour" if "color" in name else "worn" if name in HEAD_AND_CLOTHES else "body"
            asked[kind] += 1
            right[kind] += found.get(name, "none") in values
    assert len(descriptions()) == 200 and min(asked.values()) > 300
    assert right["worn"] >= 0.97 * asked["worn"]
    assert right["colour"] >= 0.95 * asked["colour"]
    assert right["body"] >= 0.97 * asked["body"]


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("a man", {"gender": "man"}),
        ("a shirt in red and brown trousers", {"top_color": "red", "bottom_color": "brown"}),
        ("a lady in red trousers", {"gender": "woman", "bottom": "trousers", "bottom_color": "red"}),
        ("a woman in red", {"top_color": "red", "bottom_color": "red"}),
        ("her hair is long and grey", {"gender": "woman", "hair": "long", "hair_color": "grey"}),
        (
            "a blue and white striped shirt",
            {"top_color": "blue", "pattern": "across", "pattern_color": "white"},
        ),
        ("a grey suit with black trousers", {"top_color": "grey", "bottom_color": "black"}),
        (
            "a grey suit",
            {"top_color": "grey", "bottom_color": "grey", "bottom": "trousers", "shoes": "leather"},
        ),
        (
            "a short man in a short skirt with short hair",
            {"stature": "short", "bottom": "skirt", "hair": "short"},
        ),
        ("a black man in a black shirt", {"skin": "dark", "top_color": "black"}),
        ("a brown ponytail, pink shorts", {"hair_color": "brown", "bottom_color": "pink"}),
        ("no hat or jacket, brown boots", {"hat": "none", "outer": "none", "shoes_color": "brown"}),
        ("a man without hair", {"hair": "bald"}),
        ("barefoot, 1.80 m tall", {"shoes": "none", "height": 1.8}),
        ("six words: a 6'2\" tall guy of 34 years", {"height": 1.88, "age": "young"}),
        (
            "an eighty-year-old in a Navy-Blue blouse",
            {"age": "old", "top": "shirt", "top_color": "navy blue"},
        ),
        ("an old man in an old jacket", {"age": "old", "outer": "jacket"}),
        ("a man in heavy boots", {"gender": "man", "shoes": "boots"}),
        ("Trousers: gray. Hair: red.", {"bottom_color": "grey", "hair_color": "red"}),
    ],
)
def test_words_belong_to_their_nouns(people, text, wanted):
    found = traits(people, text)
    assert {name: found.get(name) for name in wanted} == wanted
    assert not {"figure", "age"} & set(found) - set(wanted)


def test_words_in_no_table_land_near_what_they_mean(people):
    for word, name, value in (
        ("kimono", "bottom", "dress"),
        ("poncho", "outer", "coat"),
        ("sweats", "bottom", "trousers"),
        ("duchess", "gender", "woman"),
    ):
        assert word not in vocabulary() and word in vectors()
        assert traits(people, f"a {word}").get(name) == value
    told = understand("a woman in a kimono with a laptop and a splonk", offered_by(people))
    assert any(line.startswith("kimono: taken for bottom dress") for line in told.left_out)
    assert any(line.startswith("laptop: nobody carries") for line in told.left_out)
    assert any(line.startswith("not understood: splonk") for line in told.left_out)
    assert near("splonk") is None and near("quickly") is None


def test_what_cannot_be_made_is_said_and_the_rest_is_made(people):
    for text, why in (
        ("a woman with wings in a red shirt", "wings: no such thing"),
        ("a child in a red shirt", "child: children are none"),
        ("a boy, aged 6, in a red shirt", "children are none"),
        ("a bald man with long hair and a red shirt", "long hair: bald was said before"),
        ("a red shirt and a floral skirt", "floral: prints are stripes and checks"),
        ("a man in a red shirt with sunglasses", "sunglasses: nobody carries or wears"),
    ):
        told = understand(text, offered_by(people))
        assert any(why in line for line in told.left_out), told.left_out
        assert told.traits.top_color == "red"
    for text in ("a dragon", "qwrtz", "12", "the and of"):
        with pytest.raises(InputError, match="can be made"):
            understand(text, offered_by(people))
    with pytest.raises(InputError, match="at most 200"):
        understand("red " * 300, offered_by(people))


def test_what_these_people_lack_has_its_nearest_in_its_place(people):
    had = offered_by(people)
    had["top"] = had["top"] - {"dress"}
    told = understand("a woman in a green dress", {**had, "bottom": {"trousers", "skirt"}})
    assert (told.traits.bottom, told.traits.bottom_color, told.traits.top_color) == (
        "skirt",
        "green",
        "green",
    )
    assert told.left_out == ("dress: there is none; bottom skirt in its place",)
    told = understand("a woman in a green dress", {**had, "bottom": {"trousers", "dress"}})
    assert (told.traits.bottom, told.left_out) == ("dress", ())
    with pytest.raises(InputError, match="these people have no beard full"):
        understand("a full beard", {name: values for name, values in had.items() if name != "beard"})


def test_what_no_coat_goes_over_is_left_out_and_the_coat_is_worn(people):
    person = drawn(people, 0, "an old man in a grey coat, a striped shirt and brown shoes")
    facts = dict(person.info.facts)
    assert facts["outer"] == "coat" and facts["outer_color"] == "grey" and facts["shoes_color"] == "brown"
    assert "shirt: it does not go under a coat" in str(facts["left_out"])
    close = dict(drawn(people, 0, "a woman in a red coat, a white t-shirt and jeans").info.facts)
    assert (close["outer"], close["top"], close["bottom"]) == ("coat", "t-shirt", "jeans")
    assert "left_out" not in close


def test_the_paper_s_people_take_words_too():
    had = {name: set(values) for name, values in VALUES.items()}
    told = understand("a bearded man in a navy turtleneck and jeans", had)
    wanted = {"gender": "man", "beard": "full", "top": "turtleneck", "top_color": "blue", "bottom": "jeans"}
    assert told.traits.given() == wanted and not told.left_out
    told = understand("scarlet shirt", had)
    assert told.traits.given() == {"top": "shirt"} and "of top-color these people have" in told.left_out[0]


def test_every_meaning_is_of_a_trait(people):
    for words, meaning in vocabulary().items():
        if meaning.kind in ("garment", "say"):
            assert read(items_of(words, near)).mentions, words
    named = {
        part.split(":")[0] for each in vocabulary().values() for part in each.value.split() if ":" in part
    }
    assert named - {"length", "tone", "made"} <= {*SHOWN, "beard"}


def test_a_person_is_changed_and_stays_otherwise(people):
    own = dict(people.sample(8).info.facts)
    for text, moved in (
        ("in a red shirt", {"top", "top_color", "pattern", "pattern_color", "outer", "outer_color"}),
        ("make her hair red", {"hair_color"}),
        ("give him a hat", {"hat", "hat_color"}),
        ("taller", {"stature"}),
        ("barefoot", {"shoes", "shoes_color"}),
        ("not so tall and in a skirt", {"bottom", "bottom_color", "stature"}),
    ):
        avatar = drawn(people, 8, text, change=True)
        found = dict(avatar.info.facts)
        changed = {name for name in own if found.get(name, "none") != own[name]} - {"garments"}
        assert changed and changed <= moved, text
    assert drawn(people, 8, "taller", change=True).height == pytest.approx(
        people.sample(8).height + 0.08, abs=1e-3
    )
    assert drawn(people, 8, "older", change=True).info.facts != people.sample(8).info.facts


def test_the_same_line_and_seed_are_the_same_person_and_the_seed_varies_who(people):
    text = "a woman in a green shirt with curly hair"
    first, again, other = (drawn(people, seed, text).info for seed in (1, 1, 2))
    assert first == again and first.facts != other.facts
    said = dict(first.facts)
    assert said["text"] == text and "top-color green" in str(said["understood"])
    assert str(said["left_out"]) == "curly: hair has no such curl"


def test_tones_make_colours_dark_and_light():
    assert plain(toned("teal", "dark")) in ("teal", "black") and toned("teal", None) == "teal"
    assert toned("red", "light") != toned("red", "dark")
    assert {plain(name) for name in NAMES} == set(NAMES)
