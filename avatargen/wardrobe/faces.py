"""Shapes of faces: what each of the body's directions beyond build and stature does, and who has how much.

The default body's first ten directions are builds, found by their variance: faces hardly vary there. The
directions after them, in the order of `FACE_SHAPES`, are those of faces alone; -2..2 is their range. They
move no vertex at the crown up or down, so statures do not depend on them.

Letters: B people, f directions of faces.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from avatargen.wardrobe.attributes import People

BUILDS = 10  # directions of the default body that come before those of faces
FACE_SHAPES = (
    "woman",  # -1 man, 1 woman
    "old",  # -1 young, 1 old
    "fat",  # -1 thin, 1 fat
    "african",
    "asian",
    "nose",  # size
    "bridge",  # of the nose, concave to convex
    "nose_width",
    "jaw",  # width
    "chin",  # height
    "cheek",  # bones
    "mouth",  # width
    "lip",  # fullness
    "eye_size",
    "eye_distance",
    "head",  # width
    "ear",  # size
    "smile",  # corners of the mouth
    "brows",  # how high, and higher at the nose
)
SPREAD, MOST = 0.6, 2.0  # standard deviation and most of a feature's share
SPREADS = {"smile": 0.35, "brows": 0.35, "eye_size": 0.4, "chin": 0.5}  # of some
# what people have more of than the body's template: it looks stern, and its chin recedes
OF_ALL = {
    "chin": 0.7,
    "eye_size": 1.4,
    "eye_distance": 0.3,
    "head": -0.55,
    "jaw": -0.25,
    "cheek": 0.2,
    "nose": -0.35,
    "nose_width": -0.4,
    "smile": 1.15,
    "brows": 0.6,
    "mouth": 0.7,
    "lip": -0.25,
}
# what women have more of than that and men less
OF_WOMEN = {
    "jaw": -0.95,
    "chin": -0.3,
    "head": -0.25,
    "nose": -0.5,
    "nose_width": -0.45,
    "cheek": 0.6,
    "lip": 0.4,
    "eye_size": 0.55,
    "smile": 0.25,
    "brows": 0.2,
}
OTHER_NAMES = {
    "bridge": "brow",
    "mouth": "eye_light",
    "eye_distance": "eye_hue",
    "ear": "hairline",
    "smile": "boldness",
    "brows": "creased",
}


def face_betas(people: People) -> Float[Tensor, "B f"]:
    """How much of each face shape people have: sex, age, build and skin decide some, the others are their
    own coordinates."""

    def centred(name: str) -> Float[Tensor, "B 1"]:
        return 2 * people.measure(name) - 1

    dark = ((people.measure("skin_light") - 0.5) / 0.3).clamp(0, 1)
    asian = people.measure("asian") * (1 - dark)
    woman = 2 * people.choice("woman") - 1
    drawn = {
        "woman": 0.9 * woman - 0.2 * centred("muscle"),
        "old": centred("age"),
        "fat": 0.8 * centred("weight"),
        "african": 1.2 * dark - 0.3,
        "asian": 0.9 * asian**2 - 0.2,
    }
    for name in FACE_SHAPES:
        if name not in drawn:
            own = SPREADS.get(name, SPREAD) * people.normal(OTHER_NAMES.get(name, name))
            usual = OF_ALL.get(name, 0.0) + OF_WOMEN.get(name, 0.0) * woman
            drawn[name] = (own + usual).clamp(-MOST, MOST)
    return torch.cat([drawn[name] for name in FACE_SHAPES], dim=1)
