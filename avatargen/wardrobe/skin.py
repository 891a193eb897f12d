"""Skin, face and beard. Positions are those of the default body's face, metres in the canonical frame."""

import torch
from jaxtyping import Float
from torch import Tensor

from avatargen.wardrobe.attributes import People
from avatargen.wardrobe.chart import Places, tailor
from avatargen.wardrobe.layers import Layer, bump, mix, ramp

EYE_X, EYE_Y = 0.0325, 0.7114
MOUTH_Y = 0.6405
MOUTH_HALF = 0.0255
IRIS, PUPIL = 0.0058, 0.0024

# display RGB from the palest to the darkest skin, evenly spaced in measure
SKIN_TONES = torch.tensor(
    [
        [0.96, 0.84, 0.76],
        [0.91, 0.75, 0.64],
        [0.82, 0.63, 0.50],
        [0.68, 0.48, 0.36],
        [0.48, 0.32, 0.23],
        [0.30, 0.19, 0.14],
    ]
)
EYE_HUES = torch.tensor([[0.20, 0.12, 0.07], [0.36, 0.22, 0.11], [0.38, 0.40, 0.22], [0.32, 0.46, 0.56]])
HAIR_TONES = torch.tensor(
    [
        [0.06, 0.05, 0.05],
        [0.16, 0.10, 0.07],
        [0.32, 0.19, 0.11],
        [0.50, 0.33, 0.17],
        [0.76, 0.60, 0.36],
        [0.52, 0.20, 0.09],
    ]
)


def along(table: Float[Tensor, "K 3"], t: Float[Tensor, "B 1"]) -> Float[Tensor, "B 1 3"]:
    """Piecewise-linear colour of a table at t in 0..1."""
    table = table.to(t)
    x = t[:, 0].clamp(0, 1) * (len(table) - 1)
    i = x.floor().clamp(max=len(table) - 2).long()
    return (table[i] + (table[i + 1] - table[i]) * (x - i)[:, None])[:, None]


def skin_tone(people: People) -> Float[Tensor, "B 1 3"]:
    """Base skin colour."""
    warm = (people.measure("skin_warm") - 0.5)[:, None] * torch.tensor([0.03, 0.0, -0.05]).to(people.z)
    return (along(SKIN_TONES, people.measure("skin_light")) + warm).clamp(0.05, 0.98)


def hair_tone(people: People) -> Float[Tensor, "B 1 3"]:
    """Hair colour: natural tones, greyer with age."""
    tone = along(HAIR_TONES, people.measure("hair"))
    grey = ramp(people.measure("age"), 0.75, 1.0)[..., None]
    return tone + (0.62 - tone) * grey * 0.8


def eye_colour(people: People) -> Float[Tensor, "B 1 3"]:
    """Colour of the iris."""
    return along(EYE_HUES, people.measure("eye_hue")) * (0.8 + 0.7 * people.measure("eye_light")[..., None])


def skin(places: Places, people: People) -> Layer:
    """The bare body with a painted face."""
    x, y, z = tailor(places.p)
    tone = skin_tone(people)
    color = tone.expand(*x.shape, 3)
    front = ramp(z, 0.085, 0.11) * ramp(y, 0.57, 0.60)
    flush = bump(x.abs(), 0.045, 0.022) * bump(y, 0.668, 0.022) + 0.8 * bump(x, 0, 0.014) * bump(
        y, 0.673, 0.014
    )
    red = tone * torch.tensor([1.0, 0.80, 0.78]).to(x)
    color = mix(color, red, 0.55 * front * flush)
    hands = ramp(x.abs(), 0.72, 0.80) + ramp(-places.leg[..., 1], 0.88, 0.95)
    color = mix(color, red, 0.25 * hands)
    color = mix(
        color, tone * 0.80, front * 0.5 * bump(x.abs(), EYE_X, 0.018) * bump(y, 0.699, 0.006)
    )  # under the eyes
    color = mix(
        color, tone * 0.45, front * bump(x.abs(), 0.0085, 0.0042) * bump(y, 0.6615, 0.0032)
    )  # nostrils
    color = mix(
        color, tone * 0.90, ramp(-y, -0.60, -0.575) * ramp(y, 0.52, 0.56) * ramp(z, 0.02, 0.06)
    )  # under the chin
    color = lips(color, tone, x, y, front, people)
    color = eyes(color, tone, places, people, front)
    color = brows(color, x, y, front, people)
    bristle = beard(places, people) * (1 - lip_area(x, y, people) * front)
    color = mix(color, hair_tone(people) * 0.9 + tone * 0.08, bristle)
    thick = 0.0015 * brow_area(x, y, people) * front + 0.007 * bristle * full_beard(people)
    thick = thick + features_of_face(x, y, z, people)
    return Layer(sdf=places.body - thick, color=color)


def features_of_face(x: Tensor, y: Tensor, z: Tensor, people: People) -> Tensor:
    """Metres by which nose, jaw, chin and cheeks stand out of the body's own face, or lie behind it; between
    the lips, what closes the gap.
    """
    side, front = x.abs(), ramp(z, 0.085, 0.11)
    nose = bump(x, 0, 0.011) * bump(y, 0.679, 0.017) * front
    wings = bump(side, 0.015, 0.008) * bump(y, 0.668, 0.010) * front
    jaw = bump(side, 0.060, 0.020) * bump(y, 0.633, 0.024) * ramp(z, 0.02, 0.05) * ramp(0.11 - z, 0, 0.03)
    chin = bump(x, 0, 0.022) * bump(y, 0.613, 0.014) * ramp(z, 0.07, 0.10)
    cheeks = bump(side, 0.048, 0.019) * bump(y, 0.676, 0.018) * ramp(z, 0.05, 0.08)
    gap = bump(y, MOUTH_Y, 0.0045) * ramp(MOUTH_HALF - side, 0, 0.01) * front
    return (
        0.0022 * gap
        + people.between("nose", -0.003, 0.003) * nose
        + people.between("nose_width", -0.0012, 0.0025) * wings
        + people.between("jaw", -0.003, 0.006) * jaw
        + people.between("chin", -0.003, 0.005) * chin
        + people.between("cheek", -0.003, 0.004) * cheeks
    )


def lip_area(x: Tensor, y: Tensor, people: People) -> Tensor:
    """1 on the lips, 0 off them, in the frontal projection."""
    full = 0.75 + 0.5 * people.measure("lip")
    across = (1 - (x / MOUTH_HALF) ** 2).clamp(min=0)
    bow = 1 - 0.22 * bump(x, 0, 0.005)
    upper = MOUTH_Y + 0.0085 * full * across**0.8 * bow
    lower = MOUTH_Y - 0.0098 * full * across**0.65
    inside = torch.minimum(torch.minimum(upper - y, y - lower), 0.4 * (MOUTH_HALF - x.abs()))
    return torch.sigmoid(inside / 0.0006)


def lips(color: Tensor, tone: Tensor, x: Tensor, y: Tensor, front: Tensor, people: People) -> Tensor:
    """Lips and the dark line between them; lipstick for some women."""
    makeup = (people.choice("makeup") * people.choice("woman"))[..., None]
    natural = tone * torch.tensor([0.86, 0.60, 0.58]).to(x)
    painted = torch.tensor([0.66, 0.12, 0.18]).to(x) * (0.6 + 0.5 * people.measure("lip")[..., None])
    color = mix(color, natural + (painted - natural) * makeup * 0.8, lip_area(x, y, people) * front)
    line = bump(y, MOUTH_Y + 0.0004, 0.0011) * ramp(MOUTH_HALF - x.abs(), -0.001, 0.003)
    return mix(color, tone * 0.30, 0.85 * line * front)


def eyes(color: Tensor, tone: Tensor, places: Places, people: People, front: Tensor) -> Tensor:
    """Sclera, iris, pupil, a glint and the lash line; `places.eye` knows the lids exactly."""
    x, y, _ = tailor(places.p)
    ball = ramp(places.eye, 0.35, 0.75)
    r = torch.sqrt((x.abs() - EYE_X) ** 2 + (y - EYE_Y) ** 2 + 1e-12)
    iris = eye_colour(people)
    inner = (torch.tensor([0.93, 0.92, 0.90]).to(x)).expand_as(color)
    inner = mix(inner, iris * 0.45, torch.sigmoid((IRIS - r) / 0.0003))
    inner = mix(inner, iris, torch.sigmoid((IRIS * 0.86 - r) / 0.0004))
    inner = mix(inner, 0.02 * torch.ones_like(iris), torch.sigmoid((PUPIL - r) / 0.0003))
    glint = torch.sqrt((x - torch.sign(x) * EYE_X - 0.0018) ** 2 + (y - EYE_Y - 0.0020) ** 2 + 1e-12)
    inner = mix(inner, torch.ones_like(iris), 0.9 * torch.sigmoid((0.0010 - glint) / 0.0002))
    inner = inner * (1 - 0.45 * ramp(y, EYE_Y + 0.0015, EYE_Y + 0.0045))[..., None]  # shade of the upper lid
    shadow = people.choice("makeup") * people.choice("woman")
    almond = torch.sqrt(((x.abs() - EYE_X) / 0.0150) ** 2 + ((y - EYE_Y - 0.0055) / 0.0058) ** 2)
    color = mix(color, tone * 0.55, 0.5 * shadow * front * ramp(1.3 - almond, 0, 0.6))
    lash = front * ramp(1.0 - ((x.abs() - EYE_X) / 0.0145).abs(), 0, 0.12)
    lid = EYE_Y + 0.0050 - 0.0062 * ((x.abs() - EYE_X) / 0.0125) ** 2
    color = mix(color, 0.10 * torch.ones_like(tone), (0.75 + 0.2 * shadow) * lash * bump(y, lid, 0.0013))
    return mix(color, inner, ball)


def brow_area(x: Tensor, y: Tensor, people: People) -> Tensor:
    """1 on the eyebrows, in the frontal projection."""
    t = (x.abs() - 0.013) / 0.036  # 0 at the inner end, 1 at the outer
    height = 0.7285 + 0.0065 * torch.sin(3.1416 * (0.12 + 0.75 * t).clamp(0, 1)) - 0.002 * t
    half = (0.0019 + 0.0022 * people.measure("brow") - 0.0008 * people.choice("woman")) * (
        1.25 - 0.75 * t.clamp(0, 1)
    )
    inside = torch.minimum(half - (y - height).abs(), 0.012 * torch.minimum(t, 1 - t) + 0.0004)
    return torch.sigmoid(inside / 0.0007)


def brows(color: Tensor, x: Tensor, y: Tensor, front: Tensor, people: People) -> Tensor:
    """Eyebrows, darker than the hair."""
    return mix(color, hair_tone(people) * 0.6 + 0.02, 0.9 * brow_area(x, y, people) * front)


def full_beard(people: People) -> Tensor:
    """1 for a full beard: men only."""
    return (people.kind("beard_a", "beard_b") == 3).to(people.z) * (1 - people.choice("woman"))


def beard(places: Places, people: People) -> Tensor:
    """Cover of stubble (faint), moustache or full beard, 0..1."""
    x, y, z = tailor(places.p)
    kind = people.kind("beard_a", "beard_b")
    man = 1 - people.choice("woman")
    cheek = 0.651 + 0.055 * ramp(0.090 - z, 0, 0.035)  # rises into the sideburns
    throat = 0.588 + 0.35 * (0.11 - z).clamp(min=0)  # follows the jaw
    jaw = ramp(cheek - y, -0.007, 0.008) * ramp(y - throat, -0.006, 0.006) * ramp(z, 0.040, 0.055)
    upper = (
        ramp(0.0115 - (y - 0.6525).abs() - 0.12 * x.abs(), 0.0035, 0.0065)
        * ramp(0.03 - x.abs(), 0, 0.004)
        * ramp(z, 0.1, 0.11)
    )
    cover = torch.maximum(jaw, upper)
    stubble = 0.22 * (kind == 1).to(x) * cover
    moustache = 0.9 * (kind == 2).to(x) * upper
    return man * (stubble + moustache + 0.93 * (kind == 3).to(x) * cover)
