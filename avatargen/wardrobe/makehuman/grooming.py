"""A person's hair and beard as layers and skin have them: cuts by the names of MakeHuman's styles."""

import numpy as np

from avatargen.wardrobe.hair_paint import HairPaint
from avatargen.wardrobe.makehuman.choose import Attributes
from avatargen.wardrobe.strand_pattern import CURLED, TIED, Flow
from avatargen.wardrobe.worn_hair import CROPPED, HANGING, TAILED, Cut, Hairdo

LOWEST = -1.0  # m: hair that is not cut off
SCALP, SHADOW = 0.94, 0.30  # how much hair hides of the skin that it grows on, and a shaved head's
DARKER = 0.75  # a beard beside the hair
NO_FLOW = Flow(kind=CURLED)
CROWN = Flow(x=0.008, back=-0.005, front=-0.005)
CUTS = {
    "afro01": Cut(kind=CROPPED, flow=Flow(kind=CURLED), rise=2.2, least=0.006, ridges=0.0),
    "bob01": Cut(kind=HANGING, flow=Flow(x=0.045, back=-0.01, front=0.13), bulk=0.108, ends=(0.595, 0.635)),
    "bob02": Cut(kind=HANGING, flow=Flow(x=0.035, back=-0.01, front=0.13), ends=(0.590, 0.635)),
    "braid01": Cut(kind=HANGING, flow=Flow(x=0.045, back=0.02, front=0.13)),
    "long01": Cut(kind=HANGING, flow=Flow(x=0.0, back=-0.03, front=0.13), ends=(0.10, 0.50)),
    "ponytail01": Cut(kind=TAILED, flow=Flow(kind=TIED), rise=0.8),
    "short01": Cut(kind=CROPPED, flow=CROWN, rise=0.9),
    "short02": Cut(kind=CROPPED, flow=CROWN, rise=0.9),
    "short03": Cut(kind=CROPPED, flow=Flow(x=0.040, back=-0.01, front=0.13), rise=0.9),
    "short04": Cut(kind=CROPPED, flow=CROWN, rise=0.8),
}


def cut_of(style: str) -> Cut:
    """The cut of a style; one that is not known is combed from the crown and hangs."""
    return CUTS.get(style, Cut(kind=HANGING, flow=CROWN))


def hairdo_of(person: Attributes) -> Hairdo:
    """How somebody wears the hair. Nobody bald may be asked for."""
    assert person.hair is not None
    cut, worn = cut_of(person.hair), person.hair_worn
    low, high = cut.ends or (LOWEST, LOWEST)
    return Hairdo(
        cut=cut,
        mirrored=worn.mirrored,
        end=low + (high - low) * worn.length,
        line=worn.line,
        colour=person.hair_colour,
    )


def paint_of(person: Attributes) -> HairPaint:
    """What of hair and beard is drawn on the skin."""
    r, g, b = (DARKER * np.array(person.hair_colour) + 0.01).tolist()
    bald = SHADOW if person.hair_worn.shaved else 0.0
    return HairPaint(
        line=person.hair_worn.line,
        density=bald if person.hair is None else SCALP,
        flow=NO_FLOW if person.hair is None else cut_of(person.hair).flow,
        mirrored=person.hair_worn.mirrored,
        colour=person.hair_colour,
        beard=person.beard,
        beard_colour=(r, g, b),
    )
