"""Who wears what: choices that several garments ask for."""

from torch import Tensor

from avatargen.wardrobe.attributes import People

SKIRT = ("woman", "bottom_a")  # the choices that make a skirt


def has_skirt(people: People) -> Tensor:
    """1 for women in a skirt or a dress."""
    return people.choice(SKIRT[0]) * people.choice(SKIRT[1])


def has_dress(people: People) -> Tensor:
    """1 for women in a dress: a skirt in the colour of the top."""
    return has_skirt(people) * people.choice("bottom_b")


def has_shorts(people: People) -> Tensor:
    """1 for men in shorts."""
    return people.choice("bottom_a") * people.choice("bottom_b") * (1 - people.choice("woman"))


def has_jeans(people: People) -> Tensor:
    """1 for trousers of denim."""
    return people.choice("bottom_b") * (1 - has_shorts(people)) * (1 - has_skirt(people))


def has_coat(people: People) -> Tensor:
    """1 for those whose outer garment reaches below the hips."""
    return people.choice("outer_a") * people.choice("outer_b")
