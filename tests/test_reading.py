"""Readers of pictures: right where pictures tell, at chance where they do not, and never of people they have
seen."""

from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor

from avatargen.commands.learn.reading import pictured
from avatargen.errors import InputError
from avatargen.metrics.reading import (
    REGIONS,
    SIDE,
    Pictured,
    Region,
    colours_off_skin,
    cut,
    read_all,
    read_by_others,
)

HEIGHT, FIGURE, FACE = 100, 70, 80  # pixels: of the picture, and the lengths of its panels


def test_what_features_tell_is_read() -> None:
    rng = np.random.default_rng(0)
    place = rng.integers(3, size=90)
    features = rng.normal(size=(90, 40)) + 4 * rng.normal(size=(3, 40))[place]
    words = [("red", "green", "blue")[i] for i in place]
    assert read_by_others(features, words) == words


def test_what_features_do_not_tell_is_guessed() -> None:
    """With far more features than people: a reader that had seen whom it reads would be always right."""
    rng = np.random.default_rng(1)
    words = [("a", "b")[i] for i in rng.integers(2, size=100)]
    read = read_by_others(rng.normal(size=(100, 400)), words)
    assert 0.3 < np.mean([x == y for x, y in zip(read, words, strict=True)]) < 0.7


def test_a_rare_word_does_not_win_by_being_rare() -> None:
    """Features that say nothing: everybody is what most are."""
    words = ["usual"] * 45 + ["rare"] * 5
    assert set(read_by_others(np.ones((50, 4)), words)) == {"usual"}


@pytest.mark.parametrize(("panel", "start", "width"), [("front", 0, 70), ("back", 70, 70), ("face", 140, 80)])
def test_a_region_is_cut_out_of_its_panel(panel: str, start: int, width: int) -> None:
    picture = np.zeros((HEIGHT, 2 * FIGURE + FACE, 3), np.uint8)
    left = start + (width - 30) // 2
    picture[20:50, left : left + 30] = (255, 0, 51)
    square = cut(picture, Region(panel=panel, top=0.2, side=0.3))
    assert square.shape == (3, SIDE, SIDE)
    assert torch.allclose(square, torch.tensor([1.0, 0.0, 0.2])[:, None, None].expand_as(square))


def test_a_region_wider_than_a_narrow_figure_stays_in_its_panel() -> None:
    picture = np.zeros((HEIGHT, 2 * 20 + FACE, 3), np.uint8)
    picture[:, 20:40] = 255
    assert (cut(picture, Region(panel="back", top=0.1, side=0.5)) == 1).all()
    assert (cut(picture, Region(panel="front", top=0.1, side=0.5)) == 0).all()


def test_eyes_are_told_by_colours_that_skin_has_not() -> None:
    """However light the skin is, and wherever in the crop they are."""
    crops = torch.full((4, 3, 40, 40), 0.6)
    crops[1::2] += 0.15
    for i, (row, colour) in enumerate(
        [(5, (0.1, 0.3, 0.7)), (20, (0.1, 0.3, 0.7)), (5, (0.4, 0.2, 0.1)), (30, (0.4, 0.2, 0.1))]
    ):
        crops[i, :, row : row + 4, 10:20] = torch.tensor(colour)[:, None, None]
    blue, light_blue, brown, light_brown = colours_off_skin(crops)
    assert np.allclose(blue, light_blue)
    assert np.allclose(brown, light_brown)
    assert np.abs(blue - brown).max() > 0.1
    assert (colours_off_skin(torch.full((1, 3, 8, 8), 0.5)) == 0).all()


def mean_colours(images: Tensor) -> Tensor:
    """A network that sees colours alone."""
    return images.mean(dim=(2, 3))


def people_in(colours: dict[str, int], count: int = 30) -> list[Pictured]:
    """People who are grey of a shade all over but for their eyes, each of a word of its own."""
    rng = np.random.default_rng(2)
    found = []
    for i in range(count):
        word = list(colours)[i % len(colours)]
        shade = colours[word] + rng.integers(-4, 5)
        picture = np.full((HEIGHT, 2 * FIGURE + FACE, 3), shade, np.uint8)
        picture[50:56, 170:190] = (60, 60, 160) if i % len(colours) else (160, 60, 40)
        words = dict.fromkeys(REGIONS, word) | {"outer": "none"}
        found.append(Pictured(picture=picture, words=words))
    return found


def test_traits_that_show_are_right_and_words_too_few_wear_are_left_out() -> None:
    people = people_in({"dark": 20, "light": 220})
    people.append(Pictured(picture=people[0].picture, words=dict.fromkeys(REGIONS, "odd")))
    found = read_all(people, mean_colours)
    assert set(found) == set(REGIONS) - {"outer"}  # nobody wears any
    for trait in found.values():
        assert trait.right.value == 1
        assert trait.words == {"dark": 15, "light": 15}
        assert trait.taken == ()


def test_what_a_coat_hides_is_not_asked() -> None:
    people = people_in({"dark": 20, "light": 220}, count=40)
    for person in people[:20]:
        person.words["outer"] = "coat"
    found = read_all(people, mean_colours)
    assert found["top"].right.count == found["pattern"].right.count == 20
    assert found["bottom"].right.count == found["outer"].right.count == 40


def test_what_is_taken_for_what_is_told() -> None:
    people = people_in({"dark": 20, "light": 220})
    people[0] = Pictured(picture=people[1].picture, words=people[0].words)  # a dark one drawn light
    found = read_all(people, mean_colours)["top"]
    assert found.taken == (("light", "dark"),)
    assert found.right.value == pytest.approx(29 / 30)


def test_people_who_are_all_alike_are_refused() -> None:
    with pytest.raises(InputError, match="20 people, too few to tell two words"):
        read_all(people_in({"dark": 20}, count=20), mean_colours)


def test_a_folder_without_pictures_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no picture beside a file"):
        pictured(tmp_path)
