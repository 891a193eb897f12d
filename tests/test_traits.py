"""Traits, and the mapping network that learns to say them."""

import torch

from avatargen.generator.config import MappingConfig
from avatargen.generator.mapping import Mapping
from avatargen.training.learn_traits import draw, learn_traits
from avatargen.wardrobe.attributes import LATENT_SIZE, People
from avatargen.wardrobe.hair import style
from avatargen.wardrobe.skin import full_beard
from avatargen.wardrobe.traits import hair_traits, traits


def many_people() -> People:
    return People(torch.randn(3000, LATENT_SIZE, generator=torch.Generator().manual_seed(0)))


def test_traits_are_of_one_size_and_every_one_varies():
    values = traits(many_people())
    assert values.abs().max() <= 2
    assert values.std(dim=0).min() > 0.1
    assert values.shape[1] <= MappingConfig().w_size


def test_what_takes_several_coordinates_is_one_trait():
    people = many_people()
    hair, _, side, _, _, _, beard = hair_traits(people)
    assert torch.equal(beard[:, 3:], full_beard(people))
    assert torch.equal(hair.sum(dim=1), torch.ones(3000))
    assert torch.allclose(side / 30, style(people)[0])
    assert all(len(side[hair[:, kind] > 0].unique()) == 1 for kind in range(16))  # a style is one thickness


def test_the_mapping_learns_traits_of_people_it_has_not_seen():
    torch.manual_seed(0)
    mapping = Mapping(MappingConfig(width=96, layers=2, w_size=64))
    unseen, cameras = draw(500, seed=1, step=0)
    wanted = traits(unseen)[:, :64]

    def unexplained() -> float:
        with torch.no_grad():
            error = mapping(unseen.z, cameras) - wanted
        return float((error.square().mean(dim=0) / wanted.var(dim=0)).mean())

    lines: list[str] = []
    before = unexplained()
    learn_traits(mapping, steps=100, seed=0, report=lines.append)
    assert unexplained() < 0.6 < before
    assert len(lines) == 1
