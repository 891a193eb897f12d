"""What MakeHuman's own garments and hair, and the tailored ones, are in plain words; what is not known is
called by its kind."""

import numpy as np

from avatargen.wardrobe.colour_names import colour_name, lab

GARMENTS = {
    "female_casualsuit01-top": "t-shirt",
    "female_casualsuit01-bottom": "jeans",
    "female_casualsuit02-top": "t-shirt",
    "female_casualsuit02-bottom": "shorts",
    "female_elegantsuit01-top": "shirt",
    "female_sportsuit01-top": "t-shirt",
    "female_sportsuit01-bottom": "trousers",
    "male_casualsuit02-top": "t-shirt",
    "male_casualsuit02-bottom": "jeans",
    "male_casualsuit03-bottom": "jeans",
    "male_casualsuit04-top": "t-shirt",
    "male_casualsuit04-bottom": "jeans",
    "male_casualsuit05-outer": "jacket",
    "male_casualsuit05-top": "shirt",
    "male_casualsuit05-bottom": "jeans",
    "male_casualsuit06-top": "t-shirt",
    "male_casualsuit06-bottom": "jeans",
    "male_elegantsuit01-top": "suit",
    "male_elegantsuit01-bottom": "trousers",
    "male_worksuit01-overall": "overall",
    "male_worksuit01-top": "t-shirt",
    "tailored-tshirt": "t-shirt",
    "tailored-tank": "tank top",
    "tailored-blouse": "blouse",
    "tailored-sweater": "sweater",
    "tailored-hoodie": "hoodie",
    "tailored-polo": "polo shirt",
    "tailored-shirt": "shirt",
    "tailored-crew": "t-shirt",
    "tailored-pullover": "sweater",
    "tailored-leggings": "leggings",
    "tailored-jeans": "jeans",
    "tailored-shorts": "shorts",
    "tailored-chinos": "shorts",
    "tailored-skirt": "skirt",
    "tailored-pleated": "skirt",
    "tailored-dress": "dress",
    "tailored-dotted": "dress",
    "tailored-midi": "dress",
    "tailored-coat": "coat",
    "tailored-peacoat": "coat",
    "shoes01-shoes": "leather",
    "shoes02-shoes": "boots",
    "shoes03-shoes": "leather",
    "shoes04-shoes": "leather",
    "shoes05-shoes": "sneakers",
}
HAIR = {
    "afro01": "afro",
    "bob01": "bob",
    "bob02": "bob",
    "braid01": "long",
    "long01": "long",
    "ponytail01": "ponytail",
    "short01": "short",
    "short02": "short",
    "short03": "short",
    "short04": "short",
}
DYED = 15.0  # CIELAB chroma of hair from which it is no natural colour, unless it is reddish or yellowish
IRISES = {  # of MakeHuman's that are not called by their colour
    "brownlight": "brown",
    "lightblue": "blue",
    "deepblue": "blue",
    "bluegreen": "green",
    "ice": "grey",
}


def eye_word(iris: str) -> str:
    """What a colour of eyes is called."""
    return IRISES.get(iris, iris)


def garment_word(name: str, kind: str) -> str:
    """What a garment is called."""
    return GARMENTS.get(name, kind)


def hair_word(name: str | None) -> str:
    """What hair is called."""
    return "bald" if name is None else HAIR.get(name, name)


def hair_color_word(rgb: tuple[float, float, float]) -> str:
    """What a colour of hair is called: by its lightness, chroma and hue in CIELAB."""
    lightness, a, b = lab(np.array(rgb)[None])[0]
    if lightness > 78 and np.hypot(a, b) < 10:
        return "white"
    if np.hypot(a, b) > DYED and not (a > 0 and b > 0):
        return colour_name(np.array(rgb))
    if lightness > 30 and np.hypot(a, b) < 10:
        return "grey"
    if lightness < 13:
        return "black"
    if lightness > 40 and b > 1.3 * a:
        return "blond"
    return "red" if a > 14 and lightness > 25 else "brown"
