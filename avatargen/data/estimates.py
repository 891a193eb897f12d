"""The files in which other projects keep labels, to a row of numbers for each picture.

JSON (`eg3d`, `getavatar`, `ag3d`): {"labels": [[file, row], ...]} or {"labels": {file: row}}, where a row may
come in pieces; a `dataset.json` of ours is read as `eg3d`. Pickles (`eva3d`): a folder that holds `NAME.pkl`
or `NAME/000.pkl` for each picture. Cameras alone (`eg3d` rows of 25 numbers) go with poses from an .npz file:
`names`, `poses` [N 72], `betas` [N 10] and, if there are, `trans` [N 3].
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from avatargen.body.arrays import read_npz
from avatargen.data.conventions import BETAS, CAMERA_NUMBERS, POSE
from avatargen.data.keypoints import read_json
from avatargen.data.names import without_suffix
from avatargen.data.pickles import Row, read_rows
from avatargen.errors import InputError


def rows_in_json(path: Path) -> dict[str, Row]:
    """The row of each picture by its name without suffix; text where it is none.

    Raises:
        InputError: no such file, or no labels in it.
    """
    content = read_json(path)
    try:
        labels = content["labels"]
        pairs = list(labels.items()) if isinstance(labels, dict) else list(labels)
        return {without_suffix(name): numbers(row) for name, row in pairs}
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f'label: {path} holds no list "labels" of files and numbers ({error!r})') from error


def numbers(row: Any) -> Row:
    """The row's numbers, of its pieces one after another."""
    pieces = row if isinstance(row, list) and any(isinstance(part, list) for part in row) else [row]
    try:
        return np.concatenate([np.array(piece, dtype=np.float64).reshape(-1) for piece in pieces])
    except (TypeError, ValueError):
        return "label: it holds something else than numbers; estimate it anew"


def rows_in_pickles(folder: Path, names: Sequence[str]) -> list[Row]:
    """The rows of pictures by those names."""
    places = [pickle_of(folder, name) for name in names]
    there = [place for place in places if place.exists()]
    found = dict(zip(there, read_rows(there) if there else [], strict=True))
    return [found.get(place, "label: there is none") for place in places]


def pickle_of(folder: Path, name: str) -> Path:
    """Where a picture's label lies, or would."""
    alone = folder / f"{name}.pkl"
    return alone if alone.exists() else folder / name / "000.pkl"


def with_poses(cameras: dict[str, Row], path: Path) -> dict[str, Row]:
    """`ag3d` rows of `eg3d` cameras and the poses of a file.

    Raises:
        InputError: the file is missing, damaged or incomplete.
    """
    arrays = read_npz(path, ("names", "poses", "betas", "trans"), what="label")
    if not {"names", "poses", "betas"} <= set(arrays) or arrays["names"].dtype.kind != "U":
        raise InputError(f"label: {path} lacks names, poses or betas; save them by these names")
    count = len(arrays["names"])
    trans = arrays.get("trans", np.zeros((count, 3)))
    parts = [arrays["poses"].reshape(count, -1), arrays["betas"].reshape(count, -1), trans]
    if [part.shape for part in parts] != [(count, POSE), (count, BETAS), (count, 3)]:
        raise InputError(
            f"label: {path} holds {[part.shape for part in parts]}; {count} rows of 72, 10 and 3 are wanted"
        )
    row_of = {without_suffix(name): i for i, name in enumerate(arrays["names"])}
    return {name: joined(camera, parts, row_of.get(name)) for name, camera in cameras.items()}


def joined(camera: Row, parts: list[Float64[np.ndarray, "N _"]], row: int | None) -> Row:
    """One `ag3d` row, or what is missing of it."""
    if isinstance(camera, str):
        return camera
    if row is None:
        return "label: there is a camera and no pose"
    pose, betas, trans = (part[row] for part in parts)
    return np.concatenate([camera[: CAMERA_NUMBERS["eg3d"]], [1.0], trans, pose, betas])
