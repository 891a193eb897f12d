"""A whole clothed person: the layers in the order they are put on. This is the training target of the
warm start.
"""

from jaxtyping import Float
from torch import Tensor

from avatargen.wardrobe import garments
from avatargen.wardrobe.attributes import People
from avatargen.wardrobe.chart import Places
from avatargen.wardrobe.hair import beanie, hair, style
from avatargen.wardrobe.layers import Layer, over, over_those
from avatargen.wardrobe.skin import skin


def wears_hat(people: People) -> Float[Tensor, "B 1"]:
    """One in eight wears a beanie."""
    return people.choice("hat_a") * people.choice("hat_b") * people.choice("hat_c")


def dress_up(places: Places, people: People) -> Layer:
    """Signed distance and colour of every person at every place, both [B N ...], in canonical space.

    `places` has leading shape [B N] or [1 N]. Tucked tops go under the trousers, others over them.
    """
    places = places.for_people(len(people.z))
    skirted, hat = garments.has_skirt(people), wears_hat(people)
    tucked = people.choice("tucked") * (1 - garments.has_dress(people))
    untucked, legged = 1 - tucked, 1 - skirted
    upper = garments.top(places, people)
    person = skin(places, people)
    person = over_those(person, people.choice("fringe"), lambda: garments.socks(places, people))
    person = over(person, garments.shoes(places, people))
    person = over_those(person, tucked, lambda: upper)
    person = over_those(person, legged, lambda: garments.trousers(places, people))
    person = over_those(person, skirted, lambda: garments.skirt(places, people))
    belted = people.choice("belt") * tucked * legged
    person = over_those(person, belted, lambda: garments.belt(places, people))
    person = over_those(person, untucked, lambda: upper)
    person = over_those(person, people.choice("outer_a"), lambda: garments.outer(places, people))
    _, _, curtain, _ = style(people)
    covered = hat * (curtain < 0.5).to(hat)
    person = over_those(person, 1 - covered, lambda: hair(places, people))
    return over_those(person, hat, lambda: beanie(places, people))
