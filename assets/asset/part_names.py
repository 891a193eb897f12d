"""Names of parts that pages look for which were made for Ready Player Me's avatars.

There the head is a mesh of its own. So the body is cut in two between faces: both have the vertices along the
cut, with the same places, normals and weights, so nothing shows and nothing gapes; one picture serves both.
Parts that those avatars do not have keep their names. Letters: W vertices, J joints.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Int64

from assets.asset.asset import Asset, Part
from assets.asset.parts import bounds, shifted
from avatargen.errors import InputError

BODY, HEAD, TOP = "body", "head", "top"
NECK = "neck"
PART_NAMES = {
    HEAD: "Wolf3D_Head",
    BODY: "Wolf3D_Body",
    "hair": "Wolf3D_Hair",
    TOP: "Wolf3D_Outfit_Top",
    "bottom": "Wolf3D_Outfit_Bottom",
    "shoes": "Wolf3D_Outfit_Footwear",
    "hat": "Wolf3D_Headwear",
    "glasses": "Wolf3D_Glasses",
}


def rename_parts(asset: Asset) -> Asset:
    """The asset in parts of those names, its joints still named as SMPL's.

    Raises:
        InputError: it is one mesh.
    """
    if not asset.parts:
        raise InputError("part names: found one mesh, wanted parts; give --parts separate")
    cut = head_apart(asset)
    worn = {part.name for part in cut.parts}
    names = PART_NAMES if TOP in worn else PART_NAMES | {"dress": PART_NAMES[TOP]}
    return replace(cut, parts=tuple(replace(p, name=names.get(p.name, p.name)) for p in cut.parts))


def head_apart(asset: Asset) -> Asset:
    """The asset with its body cut into a head, which comes first, and the rest; as it is without a neck's
    joint."""
    names = asset.skeleton.joint_names
    if NECK not in names or BODY not in (part.name for part in asset.parts):
        return asset
    own = below(asset.skeleton.parents, names.index(NECK))
    of_head = np.where(own[asset.joints], asset.weights, 0).sum(axis=1)
    head = of_head[asset.faces].mean(axis=1) > 0.5
    pieces: list[tuple[Part, Int64[np.ndarray, "_ 3"]]] = []
    for part in asset.parts:
        faces, upper = asset.faces[slice(*part.faces)], head[slice(*part.faces)]
        if part.name == BODY:
            pieces += [(replace(part, name=HEAD), faces[upper]), (part, faces[~upper])]
        else:
            pieces.append((part, faces))
    return of_pieces(asset, [(part, faces) for part, faces in pieces if len(faces)])


def below(parents: Int64[np.ndarray, " J"], joint: int) -> Bool[np.ndarray, " J"]:
    """The joint and all that hang on it."""
    own = np.zeros(len(parents), dtype=bool)
    own[joint] = True
    for each in range(joint + 1, len(parents)):
        own[each] = own[parents[each]]
    return own


def of_pieces(asset: Asset, pieces: list[tuple[Part, Int64[np.ndarray, "_ 3"]]]) -> Asset:
    """The asset of these parts with these faces, each with the vertices that its faces have."""
    used = [np.unique(faces, return_inverse=True) for _, faces in pieces]
    rows = np.concatenate([each for each, _ in used])
    vertices = bounds(len(each) for each, _ in used)
    counts = bounds(len(faces) for _, faces in pieces)
    normal_map, welded = asset.normal_map, asset.welded
    return replace(
        asset,
        vertices=asset.vertices[rows],
        normals=asset.normals[rows],
        faces=shifted([corner.reshape(-1, 3) for _, corner in used], vertices).astype(np.int64),
        welded=None if welded is None else np.unique(welded[rows], return_inverse=True)[1].reshape(-1),
        canonical=None if asset.canonical is None else asset.canonical[rows],
        uv=asset.uv[rows],
        normal_map=normal_map and replace(normal_map, tangents=normal_map.tangents[rows]),
        joints=asset.joints[rows],
        weights=asset.weights[rows],
        morphs=tuple(morph.of(rows) for morph in asset.morphs),
        parts=tuple(
            replace(part, vertices=v, faces=f)
            for (part, _), v, f in zip(pieces, vertices, counts, strict=True)
        ),
    )
