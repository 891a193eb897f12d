"""What is worn from the neck down: tops, trousers, skirts, coats, shoes.

A garment is the body (or its closing, where cloth bridges hollows) thickened and cut along the edges of its
pattern pieces; wide sleeves and legs are cones, skirts a flared rounded prism around both legs.
"""

import torch
from torch import Tensor

from avatargen.wardrobe.attributes import People
from avatargen.wardrobe.chart import SOLE, Places, tailor
from avatargen.wardrobe.layers import Layer, Number, bump, cloth, folds, mix, ramp, smooth_min

ARM_Y, ARM_Z = 0.468, 0.012
WAIST_Y = 0.155
FLOOR = 0.952  # m below the hip, along the leg
SKIRT = ("woman", "bottom_a")  # the choices that make a skirt
PERIOD = 0.07  # m, of stripes and checks
KNEE, ANKLE = 0.436, 0.871
LINING = 0.30  # brightness of undersides and insides


def loosened(places: Places, ease: Tensor) -> Tensor:
    """Body for tight cloth, its closing for loose, m."""
    return places.body + (places.closed - places.body) * (0.35 + 0.65 * ease)


def neck_opening(x: Tensor, y: Tensor, z: Tensor, deep: Tensor, vee: Tensor, turtle: Tensor) -> Tensor:
    """Metres covered below a neckline: round or V, `deep` metres below the collar; a turtleneck
    climbs the neck.
    """
    round_cut = torch.sqrt(
        (x / 0.085) ** 2 + ((y - 0.560) / (0.055 + deep)) ** 2 + ((z - 0.045) / 0.105) ** 2 + 1e-10
    )
    bowl = (round_cut - 1) * 0.075
    wedge = (x.abs() - 0.55 * (y - (0.44 - 1.3 * deep))) * 0.8
    front = ramp(z, 0.0, 0.03)
    bowl = torch.where(vee > 0.5, torch.minimum(bowl, wedge * front + 0.1 * (1 - front)), bowl)
    low = 0.552 - y
    high = 0.590 + 0.25 * (0.02 - z) - y
    return torch.where(turtle > 0.5, high, torch.minimum(low, bowl))


def sleeve_cone(x: Tensor, y: Tensor, z: Tensor, radius: Tensor) -> Tensor:
    """Distance to a cone about the arm, from the shoulder outward, m."""
    rho = torch.sqrt((y - ARM_Y) ** 2 + (z - ARM_Z) ** 2 + 1e-10)
    return torch.maximum(rho - radius, 0.16 - x.abs())


def creases(places: Places, people: People) -> Tensor:
    """Fold pattern of tops within -1.5..1.5: rings near the elbows, drapes elsewhere."""
    x, y, z = tailor(places.p)
    arm = ramp(x.abs(), 0.17, 0.24)
    rings = folds(x.abs(), y + z, 0.2) * (0.5 + 0.5 * bump(x.abs(), 0.45, 0.1))
    drapes = folds(0.55 * x + 0.8 * y, x, 0.6, 0.11) * (0.35 + 0.65 * bump(y, 0.16, 0.12))
    return people.between("creased", 0.5, 1.5) * (arm * rings + (1 - arm) * drapes)


def pattern(color: Tensor, other: Tensor, places: Places, people: People) -> Tensor:
    """Prints by three choices: plain (half of them), stripes across, stripes down, checks, a chest
    print, two blocks.
    """
    x, y, z = tailor(places.p)
    kind = people.kind("pattern_a", "pattern_b", "pattern_c")
    arm = ramp(x.abs(), 0.19, 0.21) * ramp(y, 0.25, 0.30)  # a wide dress has no arms at its sides
    along_limb = y * (1 - arm) + x.abs() * arm
    across = torch.sigmoid(torch.sin(6.2832 * along_limb / PERIOD) * PERIOD / 0.006)
    down = torch.sigmoid(torch.sin(6.2832 * (x * (1 - arm) + y * arm) / PERIOD) * PERIOD / 0.006)
    chest = torch.sqrt(x**2 + (y - 0.335) ** 2 + 1e-10)
    emblem = torch.sigmoid(
        (0.052 - (chest - 0.012 * torch.cos(5 * torch.atan2(x, y - 0.335 + 1e-6)))) / 0.0012
    ) * ramp(z, 0.04, 0.05)
    block = torch.sigmoid((along_limb * (1 - arm) - 0.30 + 10 * arm) / 0.0012)
    weight = (
        across * (kind == 4) + 0.8 * down * (kind == 5) + emblem * (kind == 6) + block * (kind == 7)
        + 0.5 * (across + down) * (kind == 3)
    )  # fmt: skip
    return mix(color, other, weight * people.between("boldness", 0.6, 1.0))


def top(places: Places, people: People) -> Layer:
    """T-shirt, shirt, vest or sweater; women's dresses share it."""
    x, y, z = tailor(places.p)
    kind = people.kind("collar_a", "collar_b")  # 0 round, 1 V, 2 shirt, 3 turtleneck
    knit = (kind == 3) | (people.measure("thickness") > 0.75)
    sleeve = people.between("sleeve", 0.135, 0.84).clamp(max=0.69)
    sleeve = torch.where(knit, sleeve.clamp(min=0.60), sleeve)
    layered = people.choice("outer_a")  # under a jacket: close-fitting, and not longer than it
    hem = people.between("hem", -0.09, 0.06) + 0.05 * layered
    ease = people.measure("ease") * (1 - 0.9 * layered)
    crease = creases(places, people)
    tucked_in = people.choice("tucked") * ramp(WAIST_Y + 0.03 - y, 0.0, 0.04)
    thick = (
        0.0045 + 0.006 * people.measure("thickness") + 0.005 * knit + 0.012 * ease * ramp(-y, -0.34, -0.05)
    )
    thick = (thick + (0.0012 + 0.0022 * ease) * crease) * (1 - 0.35 * layered)
    below = torch.where(has_skirt(people) > 0.5, 0.012, 0.005 + 0.0105 * people.measure("leg_width"))
    over_it = (below + 0.003) * ramp(
        WAIST_Y + 0.035 - y, 0.0, 0.05
    )  # what is worn below the waist stays under
    thick = torch.maximum(thick, over_it)
    thick = thick + (0.003 - thick) * tucked_in
    body = loosened(places, ease * (1 - tucked_in))
    width = people.between("sleeve_width", 0.052, 0.078) - 0.03 * ramp(x.abs(), 0.3, 0.7) * (1 - 0.3 * ease)
    body = torch.where(
        (sleeve > 0.2) & (layered < 0.5), smooth_min(body, sleeve_cone(x, y, z, width) + thick, 0.02), body
    )
    deep = people.between("neckline", 0.0, 0.055)
    neck = neck_opening(x, y, z, deep, ((kind == 1) | (kind == 2)).to(x), (kind == 3).to(x))
    covered = torch.minimum(torch.minimum(sleeve - x.abs(), y - hem), neck)
    color, other = people.colour("top"), people.colour("second", chroma=0.2)
    painted = pattern(color.expand(*x.shape, 3), other, places, people)
    rib = ramp(0.016 - torch.minimum(sleeve - x.abs(), y - hem), -0.001, 0.001) * knit + ramp(
        0.014 - neck, -0.001, 0.001
    ) * (kind != 2)
    painted = mix(painted, color * 0.78, 0.8 * rib.clamp(0, 1))
    placket = torch.sigmoid((0.013 - x.abs()) / 0.0008) * ramp(z, 0.03, 0.05) * (kind == 2)
    painted = mix(painted, color * 0.88 + 0.03, placket)
    button = torch.sqrt(x**2 + ((y + 0.01).remainder(0.075) - 0.0375) ** 2 + 1e-10)
    painted = mix(painted, 0.9 - 0.75 * color.round(), placket * torch.sigmoid((0.005 - button) / 0.0006))
    collar = ramp(0.030 - neck, -0.0008, 0.0008) * (kind == 2)
    painted = mix(painted, color * 0.92 + 0.04, collar)
    thick = thick + 0.004 * collar + 0.002 * rib.clamp(0, 1)
    painted = painted * (1 + 0.07 * crease[..., None])
    return Layer(sdf=cloth(body, thick, covered), color=painted.clamp(0, 1))


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


def trouser_colour(people: People) -> Tensor:
    """Blue for jeans, any for others, [B 1 3]."""
    shade = 0.5 + 1.0 * people.measure("bottom")[..., None]
    blue = torch.tensor([0.20, 0.28, 0.42]).to(people.z) * shade
    return torch.where(has_jeans(people)[..., None] > 0.5, blue, people.colour("bottom", 0.05, 0.75, 0.10))


def trousers(places: Places, people: People) -> Layer:
    """Trousers, jeans, shorts or leggings."""
    x, y, z = tailor(places.p)
    lateral, down, depth = places.leg[..., 0], -places.leg[..., 1], places.leg[..., 2]
    short = has_shorts(people)
    end = torch.where(
        short > 0.5,
        people.between("leg_length", 0.22, 0.47),
        people.between("leg_length", 0.70, 1.02).clamp(max=0.895),
    )
    jeans = has_jeans(people)
    wide = people.measure("leg_width")
    knee = bump(down, KNEE, 0.09) + 0.8 * bump(down, 0.05, 0.08) + 0.9 * bump(down, 0.84, 0.06)
    crease = (
        people.between("creased", 0.5, 1.5)
        * folds(down, lateral + depth, 0.4)
        * (0.25 + 0.75 * knee.clamp(0, 1))
        * ramp(down, -0.06, 0.02)
    )
    thick = 0.004 + 0.008 * wide + (0.0008 + 0.0025 * wide) * crease
    centre_z = 0.018 - 0.055 * ramp(down, 0.15, 0.62)
    rho = torch.sqrt((lateral - 0.02 * ramp(down, 0, 0.87)) ** 2 + (depth - centre_z) ** 2 + 1e-10)
    radius = (
        0.062
        + 0.034 * wide
        + 0.028 * bump(down, 0.05, 0.25)
        + 0.035 * (people.measure("flare") - 0.6).clamp(min=0) * ramp(down, 0.45, 0.9)
    )
    cone = rho - radius + 0.12 * ramp(0.26 - down, 0.0, 0.24)  # melts into the hip
    body = smooth_min(loosened(places, wide), cone + thick, 0.03)
    covered = torch.minimum(WAIST_Y + 0.02 * people.normal("wear").clamp(-1, 1) - y, end - down)
    color = trouser_colour(people).expand(*x.shape, 3)
    worn = (
        jeans
        * (bump(down, 0.22, 0.13) + 0.7 * bump(down, KNEE, 0.07))
        * ramp(depth, 0.0, 0.06)
        * people.measure("wear")
    )
    color = mix(color, color + 0.16, worn)
    seam = bump(depth - centre_z, 0, 0.0035) * ramp(lateral, 0.02, 0.04) * ramp(down, -0.12, -0.05)
    color = mix(color, color * 0.72, 0.7 * seam)
    color = mix(
        color,
        color * 0.75,
        bump(x, 0, 0.0035) * ramp(depth, 0.06, 0.08) * ramp(-y, -0.15, -0.13) * ramp(y, -0.06, -0.04),
    )  # fly
    pocket = (
        bump(y + 0.9 * (x.abs() - 0.12), 0.06, 0.004)
        * ramp(x.abs(), 0.085, 0.095)
        * ramp(0.155 - x.abs(), 0, 0.01)
        * ramp(z, 0.03, 0.05)
    )
    color = mix(color, color * 0.65, pocket)
    cuff = ramp(0.018 - (end - down), -0.001, 0.001)
    color = mix(color, color * 0.85, cuff) * (1 + 0.08 * crease[..., None])
    under = ramp(down - end, -0.002, 0.0005)
    color = mix(color, color * LINING, under)
    return Layer(sdf=cloth(body, thick + 0.0015 * cuff, covered), color=color.clamp(0, 1))


def belt(places: Places, people: People) -> Layer:
    """A belt at the waist with a buckle."""
    x, y, z = tailor(places.p)
    middle = WAIST_Y - 0.022 + 0.02 * people.normal("wear").clamp(-1, 1)
    covered = 0.016 - (y - middle).abs()
    leather = torch.tensor([0.16, 0.09, 0.05]).to(x) * (0.4 + 1.8 * people.measure("wear")[..., None])
    buckle = torch.sigmoid((0.022 - x.abs()) / 0.0008) * ramp(z, 0.04, 0.05)
    color = mix(leather.expand(*x.shape, 3), torch.tensor([0.75, 0.68, 0.50]).to(x), buckle)
    wide = people.measure("leg_width")
    return Layer(
        sdf=cloth(loosened(places, wide), 0.009 + 0.008 * wide + 0.002 * buckle, covered), color=color
    )


def skirt_sdf(p: Tensor, flare: Tensor, end: Tensor, ease: Number, creased: Tensor) -> tuple[Tensor, Tensor]:
    """A flared rounded prism around both legs from the waist down to height `end`, its underside
    hollow; and its fold pattern.
    """
    x, y, z = tailor(p)
    below = (WAIST_Y - y).clamp(min=0)
    half = (
        0.150
        + 0.062 * ramp(below, 0.0, 0.28)
        + (0.42 * (below - 0.2).clamp(min=0))
        + flare * 0.28 * below
        + ease
    )
    deep = 0.112 + 0.020 * ramp(below, 0.02, 0.2) + flare * 0.30 * below + ease
    centre = 0.030 - 0.028 * ramp(below, 0.0, 0.30)
    angle = torch.atan2((z - centre) / 0.12, x / (half + 1e-3))
    wave = torch.sin(angle * 7 + 0.8) + 0.4 * torch.sin(angle * 11 + 2.1)
    amplitude = (0.4 + flare) * 0.016 * below * creased
    qx, qz = x.abs() - (half - deep), (z - centre).abs()
    outline = torch.where(qx > 0, torch.sqrt(qx.clamp(min=0) ** 2 + qz**2 + 1e-10), qz) - deep
    wall = (outline - amplitude * wave) * 0.88
    hollow = 0.07 * ramp(-wall, 0.010, 0.055)
    return torch.maximum(torch.maximum(wall, y - WAIST_Y - 0.01), end + hollow - y), wave


def skirt_end(people: People) -> Tensor:
    """Height at which a skirt ends, m."""
    return WAIST_Y - people.between("skirt_length", 0.36, 0.95)


def skirt_cone(p: Tensor, people: People) -> tuple[Tensor, Tensor]:
    """The free-hanging part of a person's skirt, and its folds."""
    flare, creased = people.between("flare", 0.05, 0.75), people.between("creased", 0.5, 1.5)
    return skirt_sdf(p, flare, skirt_end(people), 0.004, creased)


def skirt_colour(people: People) -> Tensor:
    """A dress has the colour of the top, [B 1 3]."""
    own = people.colour("bottom", 0.08, 0.85, 0.16)
    return torch.where(has_dress(people)[..., None] > 0.5, people.colour("top"), own)


def skirt(places: Places, people: People) -> Layer:
    """Skirts, and the lower half of dresses."""
    x, y, _z = tailor(places.p)
    end = skirt_end(people)
    sdf, wave = skirt_cone(places.p, people)
    dress = has_dress(people)
    tight = torch.maximum(
        loosened(places, people.measure("ease")) - 0.011, torch.maximum(y - WAIST_Y - 0.02, end - y)
    )
    color = skirt_colour(people).expand(*x.shape, 3)
    color = torch.where(
        dress[..., None] > 0.5, pattern(color, people.colour("second", chroma=0.2), places, people), color
    )
    trim = ramp(0.02 - (y - end), -0.001, 0.001) * (people.measure("wear") > 0.6)
    color = mix(color, people.colour("second", chroma=0.2).expand_as(color), 0.8 * trim)
    color = color * (1 + 0.10 * wave * ramp(WAIST_Y - y, 0.05, 0.4))[..., None]
    under = ramp(end - y, -0.0055, -0.002) + ramp(-(sdf - (end - y)).abs(), -0.002, 0) * ramp(
        y - end, 0.001, 0.01
    )
    color = mix(color, color * LINING, under.clamp(0, 1))
    return Layer(sdf=smooth_min(sdf, tight, 0.015), color=color.clamp(0, 1))


def has_coat(people: People) -> Tensor:
    """1 for those whose outer garment reaches below the hips."""
    return people.choice("outer_a") * people.choice("outer_b")


def coat_tail(p: Tensor, people: People) -> Tensor:
    """The free-hanging part of a coat, m."""
    hem = people.between("outer_length", -0.42, -0.12)
    return skirt_sdf(p, 0.12 * torch.ones_like(hem), hem, 0.020, people.between("creased", 0.5, 1.5))[0]


def free_cloth(p: Tensor, people: People) -> Tensor:
    """Signed distance to what hangs free of the legs, 1 for those who wear nothing of the kind, m."""
    skirt = torch.where(has_skirt(people) > 0.5, skirt_cone(p, people)[0], 1.0)
    return torch.minimum(skirt, torch.where(has_coat(people) > 0.5, coat_tail(p, people), 1.0))


def outer_colour(people: People) -> Tensor:
    """Of a jacket or coat, [B 1 3]."""
    return people.colour("outer", 0.06, 0.80, 0.12)


def outer(places: Places, people: People) -> Layer:
    """Jacket, cardigan or coat, open in front or closed; coats reach to the thighs or knees."""
    x, y, z = tailor(places.p)
    coat = people.choice("outer_b")
    openness = people.choice("collar_b")
    hem = torch.where(
        coat > 0.5, people.between("outer_length", -0.42, -0.12), people.between("outer_length", -0.04, 0.06)
    )
    crease = creases(places, people)
    thick = 0.019 + 0.006 * people.measure("thickness") + 0.004 * crease * (0.4 + people.measure("ease"))
    body = smooth_min(
        places.closed, sleeve_cone(x, y, z, 0.068 - 0.016 * ramp(x.abs(), 0.3, 0.7)) + thick, 0.02
    )
    tail = coat_tail(places.p, people)
    width = 0.02 + 0.055 * people.measure("collar_height") + 0.05 * ramp(-y, -0.45, 0.1)
    vee = 0.60 * (y - 0.30 + 0.08 * people.measure("collar_height")).clamp(min=0)
    front = torch.maximum(x.abs() - torch.where(openness > 0.5, width, vee), 0.7 * (0.02 - z))
    collar = 0.575 + 0.25 * (0.0 - z) - y
    covered = torch.minimum(torch.minimum(0.692 - x.abs(), y - hem), torch.minimum(collar, front))
    shape = torch.where(
        coat > 0.5, torch.maximum(smooth_min(body - thick, tail, 0.02), -covered), cloth(body, thick, covered)
    )
    base = outer_colour(people)
    color = base.expand(*x.shape, 3)
    lapel = ramp(0.030 - front, -0.001, 0.001) * ramp(y, 0.15, 0.25) * ramp(z, -0.01, 0.02)
    color = mix(color, base * 0.78 + 0.02, lapel)
    closed_line = bump(x, 0.0, 0.003) * (1 - openness) * ramp(z, 0.02, 0.04)
    color = mix(color, base * 0.45, closed_line)
    button = torch.sqrt((x - 0.02) ** 2 + (y.remainder(0.11) - 0.055) ** 2 + 1e-10)
    color = mix(
        color,
        0.15 * torch.ones_like(base),
        torch.sigmoid((0.008 - button) / 0.0008) * (1 - openness) * ramp(z, 0.02, 0.04) * (y < 0.3),
    )
    cuff = ramp(0.030 - (0.692 - x.abs()), -0.001, 0.001)
    color = mix(color, base * 0.8, cuff)
    pocket = (
        bump(y, 0.06, 0.004)
        * ramp(x.abs(), 0.075, 0.08)
        * ramp(0.135 - x.abs(), 0, 0.005)
        * ramp(z, 0.02, 0.04)
    )
    color = mix(color, base * 0.5, pocket)
    inside = torch.maximum(ramp(0.0022 - covered, 0, 0.002), ramp(hem - y, -0.004, -0.001))
    color = mix(color * (1 + 0.07 * crease[..., None]), base * 0.55, inside)
    return Layer(sdf=shape, color=color.clamp(0, 1))


def shoe_colour(people: People) -> Tensor:
    """Of a shoe's upper, [B 1 3]."""
    return people.colour("shoe", 0.05, 0.85, 0.14)


def shoes(places: Places, people: People) -> Layer:
    """Sneakers, boots, flats or leather shoes: the closed foot with a sole."""
    lateral, down, depth = places.leg[..., 0], -places.leg[..., 1], places.leg[..., 2]
    kind = people.kind("shoe_a", "shoe_b")  # 0 sneakers, 1 boots, 2 flats, 3 leather shoes
    tall = 0.14 + 0.22 * people.measure("leg_length") * has_skirt(people)
    shaft = torch.where(kind == 1, tall, 0.055 + 0.03 * (kind == 0))
    ground = FLOOR + SOLE
    opening = torch.where(kind == 2, 0.020 + 0.035 * ramp(0.05 - depth, 0, 0.1), shaft)
    covered = torch.minimum(down - (FLOOR - opening), ground - down)
    upper = places.closed - (0.006 + 0.004 * (kind == 1) + 0.003 * (kind == 0))
    sole = torch.maximum(places.shod - 0.0075, FLOOR - 0.006 - down)
    sdf = torch.maximum(smooth_min(upper, sole, 0.003), -covered)
    leather = shoe_colour(people)
    color = leather.expand(*down.shape, 3)
    pale = torch.where(
        ((kind == 0) | (people.measure("wear") > 0.7))[..., None],
        0.9 * torch.ones_like(leather),
        0.10 * torch.ones_like(leather),
    )
    color = mix(color, pale.expand_as(color), torch.sigmoid((down - FLOOR + 0.006) / 0.0007))
    lace = (
        torch.sin(down * 260).clamp(min=0)
        * bump(lateral - 0.015, 0, 0.020)
        * ramp(depth, 0.04, 0.06)
        * ramp(0.12 - depth, 0, 0.02)
    )
    color = mix(color, pale.expand_as(color), 0.8 * lace * ((kind == 0) | (kind == 1)))
    toe = ramp(depth, 0.135, 0.138) * (kind == 0)
    color = mix(color, pale * 0.9 + 0.05 * leather, 0.8 * toe)
    stripe = (
        torch.sigmoid((0.012 - (depth - 0.02 + 0.5 * (down - 0.9)).abs()) / 0.001)
        * (kind == 0)
        * (down > 0.89)
    )
    color = mix(color, people.colour("second", chroma=0.2), stripe)
    near_foot = torch.where(down > 0.55, sdf, torch.ones_like(sdf))
    return Layer(sdf=near_foot, color=color.clamp(0, 1))


def socks(places: Places, people: People) -> Layer:
    """Short socks, seen below shorts and skirts."""
    down = -places.leg[..., 1]
    covered = down - (ANKLE - people.between("leg_length", 0.02, 0.14))
    color = people.colour("second", 0.3, 0.95, 0.05).expand(*down.shape, 3)
    sdf = torch.where(down > 0.55, cloth(places.closed, 0.0025, covered), torch.ones_like(down))
    return Layer(sdf=sdf, color=color)
