"""The names of a face's shapes and what each is made of: ARKit's 52 and the 15 visemes. Standard library
alone.

A recipe is a sum of terms: a unit's or a made motion's name, how much of it, and where: "left" or "right" for
that half of the face alone, "up" or "down" for what lies above or below the lips, "" for all of it.
"""

Term = tuple[str, float, str]
Recipe = tuple[Term, ...]


def both(name: str, recipe: dict[str, tuple[float, str]]) -> dict[str, Recipe]:
    """A shape for each side of the face, of whole units or of units with a side in their names."""
    found = {}
    for side in ("left", "right"):
        terms = []
        for unit, (share, where) in recipe.items():
            own = unit.replace("?", side)
            terms.append((own, share, where if "?" in unit else f"{side}{where}"))
        found[name + side.capitalize()] = tuple(terms)
    return found


JAW_OPEN = 0.7  # of the unit: what a mouth opens to without being torn

ARKIT: dict[str, Recipe] = {
    **both("browDown", {"eyebrows-?-down": (1.0, "")}),
    "browInnerUp": (("eyebrows-left-inner-up", 1.3, ""), ("eyebrows-right-inner-up", 1.3, "")),
    **both("browOuterUp", {"eyebrows-?-extern-up": (0.9, ""), "eyebrows-?-up": (0.3, "")}),
    "cheekPuff": (("puff", 1.0, ""),),
    **both("cheekSquint", {"eye-?-slit": (0.35, ""), "cheek": (1.0, "")}),
    **both("eyeBlink", {"blink-?": (1.0, "")}),
    **both("eyeLookDown", {"look-?-down": (1.0, ""), "blink-?": (0.3, "")}),
    **both("eyeLookIn", {"look-?-in": (1.0, "")}),
    **both("eyeLookOut", {"look-?-out": (1.0, "")}),
    **both("eyeLookUp", {"look-?-up": (1.0, ""), "eye-?-opened-up": (0.5, "")}),
    **both("eyeSquint", {"eye-?-slit": (0.8, "")}),
    **both("eyeWide", {"eye-?-opened-up": (1.0, "")}),
    "jawForward": (("jaw-forward", 1.0, ""),),
    "jawLeft": (("jaw-left", 1.0, ""),),
    "jawOpen": (("mouth-open", JAW_OPEN, ""),),
    "jawRight": (("jaw-left", -1.0, ""),),
    "mouthClose": (("close", 1.0, ""),),
    **both("mouthDimple", {"mouth-retraction": (0.8, "")}),
    **both("mouthFrown", {"mouth-depression": (0.8, "")}),
    "mouthFunnel": (("mouth-protusion", 0.7, ""),),
    "mouthLeft": (("mouth-left", 1.0, ""),),
    **both("mouthLowerDown", {"mouth-part-later": (0.7, "down")}),
    **both("mouthPress", {"mouth-compression": (0.7, "")}),
    "mouthPucker": (("mouth-pursing", 0.9, ""),),
    "mouthRight": (("mouth-left", -1.0, ""),),
    "mouthRollLower": (("roll", 1.0, "down"),),
    "mouthRollUpper": (("roll", 1.0, "up"),),
    "mouthShrugLower": (("shrug-lower", 1.0, ""),),
    "mouthShrugUpper": (("shrug-upper", 1.0, ""),),
    **both("mouthSmile", {"mouth-corner-puller": (0.9, "")}),
    **both("mouthStretch", {"neck-platysma": (0.6, "")}),
    **both("mouthUpperUp", {"mouth-elevation": (0.6, "up")}),
    **both("noseSneer", {"nose-?-elevation": (1.0, "")}),
    "tongueOut": (("mouth-open", 0.35, ""), ("tongue-out", 1.0, "")),
}

VISEMES: dict[str, Recipe] = {
    "viseme_sil": (),
    "viseme_PP": (("press", 1.0, ""),),
    "viseme_FF": (("mouth-open", 0.06, ""), ("roll", 0.9, "down"), ("mouth-elevation", 0.25, "up")),
    "viseme_TH": (("mouth-open", 0.14, ""), ("tongue-up", 0.5, ""), ("tongue-out", 0.35, "")),
    "viseme_DD": (("mouth-open", 0.12, ""), ("mouth-parling", 0.4, ""), ("tongue-up", 1.0, "")),
    "viseme_kk": (("mouth-open", 0.16, ""), ("mouth-parling", 0.3, "")),
    "viseme_CH": (("mouth-open", 0.08, ""), ("mouth-protusion", 0.55, "")),
    "viseme_SS": (("mouth-open", 0.05, ""), ("mouth-retraction", 0.35, ""), ("mouth-part-later", 0.25, "")),
    "viseme_nn": (("mouth-open", 0.1, ""), ("mouth-parling", 0.3, ""), ("tongue-up", 1.0, "")),
    "viseme_RR": (("mouth-open", 0.1, ""), ("mouth-protusion", 0.35, "")),
    "viseme_aa": (("mouth-open", 0.5, ""),),
    "viseme_E": (("mouth-open", 0.22, ""), ("mouth-retraction", 0.45, "")),
    "viseme_I": (("mouth-open", 0.14, ""), ("mouth-upward-retraction", 0.3, "")),
    "viseme_O": (("mouth-open", 0.34, ""), ("mouth-pursing", 0.4, ""), ("mouth-protusion", 0.2, "")),
    "viseme_U": (("mouth-open", 0.14, ""), ("mouth-pursing", 0.75, "")),
}

# of VRM 1.0, as sums of the shapes above; those of the gaze are in its table, too
EXPRESSIONS: dict[str, dict[str, float]] = {
    "happy": {
        "mouthSmileLeft": 0.9,
        "mouthSmileRight": 0.9,
        "cheekSquintLeft": 0.6,
        "cheekSquintRight": 0.6,
    },
    "angry": {
        "browDownLeft": 1.0,
        "browDownRight": 1.0,
        "noseSneerLeft": 0.5,
        "noseSneerRight": 0.5,
        "mouthPressLeft": 0.6,
        "mouthPressRight": 0.6,
    },
    "sad": {"browInnerUp": 1.0, "mouthFrownLeft": 0.8, "mouthFrownRight": 0.8},
    "relaxed": {
        "mouthSmileLeft": 0.4,
        "mouthSmileRight": 0.4,
        "eyeBlinkLeft": 0.25,
        "eyeBlinkRight": 0.25,
    },
    "surprised": {
        "browInnerUp": 0.8,
        "browOuterUpLeft": 1.0,
        "browOuterUpRight": 1.0,
        "eyeWideLeft": 1.0,
        "eyeWideRight": 1.0,
        "jawOpen": 0.35,
    },
    "neutral": {},
    "aa": {"viseme_aa": 1.0},
    "ih": {"viseme_I": 1.0},
    "ou": {"viseme_U": 1.0},
    "ee": {"viseme_E": 1.0},
    "oh": {"viseme_O": 1.0},
    "blink": {"eyeBlinkLeft": 1.0, "eyeBlinkRight": 1.0},
    "blinkLeft": {"eyeBlinkLeft": 1.0},
    "blinkRight": {"eyeBlinkRight": 1.0},
    "lookUp": {"eyeLookUpLeft": 1.0, "eyeLookUpRight": 1.0},
    "lookDown": {"eyeLookDownLeft": 1.0, "eyeLookDownRight": 1.0},
    "lookLeft": {"eyeLookOutLeft": 1.0, "eyeLookInRight": 1.0},
    "lookRight": {"eyeLookInLeft": 1.0, "eyeLookOutRight": 1.0},
}
