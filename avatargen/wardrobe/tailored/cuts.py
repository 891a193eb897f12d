"""How each tailored garment is cut: its measures, metres, and the colour of its cloth, sRGB."""

from avatargen.wardrobe.tailored.bottoms import Bottom
from avatargen.wardrobe.tailored.coats import Coat
from avatargen.wardrobe.tailored.collars import Collar
from avatargen.wardrobe.tailored.dresses import Dress
from avatargen.wardrobe.tailored.hanging import Fall
from avatargen.wardrobe.tailored.tops import Top

TEE = Top(neck=(0.08, 0.1, 0.035, 2.0), sleeve=0.275, hem=0.03, base=(0.86, 0.85, 0.83))
TANK = Top(neck=(0.08, 0.16, 0.09, 2.2), sleeve=None, hem=0.03, ease=0.0045, base=(0.82, 0.82, 0.82))
BLOUSE = Top(
    neck=(0.075, 0.16, 0.035, 1.25),
    sleeve=0.66,
    hem=0.0,
    ease=0.009,
    waist=0.007,
    cuff=0.004,
    folded=0.0035,
    base=(0.88, 0.86, 0.84),
)
SWEATER = Top(
    neck=(0.078, 0.085, 0.04, 2.0),
    sleeve=0.69,
    hem=0.0,
    ease=0.012,
    waist=0.008,
    cuff=0.002,
    rib=0.02,
    folded=0.0044,
    base=(0.72, 0.66, 0.58),
)
HOODIE = Top(
    neck=(0.08, 0.095, 0.04, 2.0),
    sleeve=0.69,
    hem=-0.01,
    ease=0.014,
    waist=0.01,
    cuff=0.003,
    folded=0.0055,
    base=(0.45, 0.47, 0.5),
)
POLO = Top(
    neck=(0.075, 0.09, 0.035, 2.0),
    sleeve=0.33,
    hem=0.0,
    ease=0.01,
    waist=0.009,
    cuff=0.01,
    folded=0.0031,
    base=(0.2, 0.28, 0.42),
)
SHIRT = Top(
    neck=(0.075, 0.11, 0.035, 1.5),
    sleeve=0.685,
    hem=-0.04,
    ease=0.011,
    waist=0.01,
    cuff=0.004,
    folded=0.004,
    base=(0.8, 0.82, 0.86),
)
CREW = Top(
    neck=(0.078, 0.075, 0.035, 2.0),
    sleeve=0.31,
    hem=-0.01,
    ease=0.009,
    waist=0.008,
    cuff=0.012,
    folded=0.0031,
    base=(0.84, 0.84, 0.84),
)
PULLOVER = Top(
    neck=(0.075, 0.07, 0.035, 2.0),
    sleeve=0.69,
    hem=-0.02,
    ease=0.013,
    waist=0.01,
    cuff=0.002,
    rib=0.022,
    folded=0.0044,
    base=(0.36, 0.4, 0.46),
)
DRESS = Dress(
    top=Top(neck=(0.09, 0.12, 0.05, 2.0), sleeve=0.27, hem=0.2, base=(0.27, 0.4, 0.55)),
    fall=Fall(top=0.2, hem=-0.46, ease=0.008, flare=0.2, flares=0.1, folds=11, deep=0.012),
)
DOTTED = Dress(
    top=Top(neck=(0.08, 0.14, 0.07, 3.0), sleeve=None, hem=0.2, base=(0.6, 0.14, 0.17)),
    fall=Fall(top=0.2, hem=-0.4, ease=0.008, flare=0.42, flares=0.19, folds=14, deep=0.018),
)
MIDI = Dress(
    top=Top(neck=(0.078, 0.17, 0.06, 1.2), sleeve=None, hem=0.22, base=(0.3, 0.42, 0.36)),
    fall=Fall(top=0.22, hem=-0.58, ease=0.008, flare=0.32, flares=0.14, folds=13, deep=0.016),
)
COAT = Coat(
    dress=Dress(
        top=Top(
            neck=(0.082, 0.12, 0.04, 2.0),
            sleeve=0.7,
            hem=0.18,
            ease=0.019,
            waist=0.004,
            cuff=0.006,
            folded=0.0044,
            base=(0.66, 0.54, 0.4),
        ),
        fall=Fall(top=0.18, hem=-0.42, ease=0.026, flare=0.1, flares=0.1, folds=9, deep=0.006),
    ),
    collar=Collar(stand=0.02, fall=0.055, gap=0.03, points=0.02, thick=0.009, off=0.01),
    open=0.042,
    lapel=0.075,
)
PEACOAT = Coat(
    dress=Dress(
        top=Top(
            neck=(0.08, 0.14, 0.04, 1.8),
            sleeve=0.7,
            hem=0.16,
            ease=0.02,
            waist=0.006,
            cuff=0.006,
            folded=0.0044,
            base=(0.25, 0.26, 0.3),
        ),
        fall=Fall(top=0.16, hem=-0.11, ease=0.026, flare=0.04, flares=0.03, folds=7, deep=0.003),
    ),
    collar=Collar(stand=0.022, fall=0.055, gap=0.03, points=0.02, thick=0.009, off=0.01),
    open=0.045,
    lapel=0.08,
)


BLOUSE_COLLAR = Collar(stand=0.018, fall=0.035, gap=0.02, points=0.015)
SHIRT_COLLAR = Collar(stand=0.022, fall=0.04, gap=0.018, points=0.022)
POLO_COLLAR = Collar(stand=0.022, fall=0.038, gap=0.016, points=0.015)
HOOD = Collar(stand=0.02, fall=0.06, thick=0.022, off=0.02, points=-0.02)  # thrown back
LEGGINGS = Bottom(waist=0.15, dip=0.01, hem=-0.86, ease=0.003, base=(0.17, 0.17, 0.19))
JEANS = Bottom(
    waist=0.135,
    dip=0.015,
    hem=-0.87,
    ease=0.005,
    wide=0.003,
    folded=0.0031,
    fly=True,
    base=(0.24, 0.33, 0.47),
)
SHORTS = Bottom(
    waist=0.135,
    dip=0.012,
    hem=-0.23,
    ease=0.006,
    wide=0.013,
    folded=0.0022,
    fly=True,
    base=(0.36, 0.45, 0.58),
)
CHINOS = Bottom(
    waist=0.11, dip=0.012, hem=-0.42, ease=0.009, wide=0.016, folded=0.0026, fly=True, base=(0.6, 0.53, 0.42)
)
SKIRT = Fall(top=0.165, hem=-0.43, ease=0.006, flare=0.24, flares=0.04, folds=11, deep=0.012)
PLEATED = Fall(top=0.165, hem=-0.27, ease=0.006, flare=0.36, flares=0.0, folds=26, deep=0.009, sharp=True)
