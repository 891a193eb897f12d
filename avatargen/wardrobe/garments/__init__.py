"""What is worn from the neck down, one file a garment.

A garment is the body (or its closing, where cloth bridges hollows) thickened and cut along the edges of its
pattern pieces; wide sleeves and legs are cones, skirts a flared rounded prism around both legs.
"""

from avatargen.wardrobe.garments.belt import belt
from avatargen.wardrobe.garments.outer import free_cloth, outer, outer_colour
from avatargen.wardrobe.garments.shoes import shoe_colour, shoes
from avatargen.wardrobe.garments.skirt import skirt, skirt_colour
from avatargen.wardrobe.garments.socks import socks
from avatargen.wardrobe.garments.top import top
from avatargen.wardrobe.garments.trousers import trouser_colour, trousers
from avatargen.wardrobe.garments.worn import SKIRT, has_coat, has_dress, has_jeans, has_shorts, has_skirt

__all__ = [
    "SKIRT",
    "belt",
    "free_cloth",
    "has_coat",
    "has_dress",
    "has_jeans",
    "has_shorts",
    "has_skirt",
    "outer",
    "outer_colour",
    "shoe_colour",
    "shoes",
    "skirt",
    "skirt_colour",
    "socks",
    "top",
    "trouser_colour",
    "trousers",
]
