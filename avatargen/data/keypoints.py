"""2D keypoints of people as detectors write them: COCO's 17 or OpenPose's 25, to places by joint name.

Read are a folder with OpenPose's files (`NAME_keypoints.json` or `NAME.json`, one a picture), a COCO data set
(`images` and `annotations`), or a list of results with `image_id` (a file's name) and `keypoints`. Each point
is x and y in pixels from the top left corner, and a confidence: a detector's 0..1, or COCO's 0 (not there),
1 (hidden), 2 (seen).
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from avatargen.data.names import without_suffix
from avatargen.errors import InputError


def of(side: str, *parts: str) -> tuple[str, ...]:
    """Names of parts on one side, or of each part on the left and right where the side is `both`."""
    sides = ("left", "right") if side == "both" else (side,)
    return tuple(f"{one}_{part}" for part in parts for one in sides)


ARM, LEG, TOES = ("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle"), ("big_toe", "small_toe", "heel")
COCO_17 = ("nose", *of("both", "eye", "ear", *ARM, *LEG))
OPENPOSE_25 = (
    *(
        "nose",
        "neck",
        *of("right", *ARM),
        *of("left", *ARM),
        "mid_hip",
        *of("right", *LEG),
        *of("left", *LEG),
    ),
    *("right_eye", "left_eye", "right_ear", "left_ear", *of("left", *TOES), *of("right", *TOES)),
)
NAMES = {3 * len(names): names for names in (COCO_17, OPENPOSE_25)}
SEEN = 0.3  # confidence from which a point counts
HEAD = ("nose", "left_eye", "right_eye", "left_ear", "right_ear", "head")
ANKLES = ("left_ankle", "right_ankle")
LIMBS = of("both", *ARM, *LEG)


@dataclass(frozen=True, kw_only=True)
class Keypoints:
    """Points of one person that were seen, by name, in pixels."""

    places: dict[str, Float64[np.ndarray, "2"]]

    def box(self) -> Float64[np.ndarray, "2 2"]:
        """Lowest and highest x and y."""
        places = np.stack(list(self.places.values()))
        return np.stack([places.min(axis=0), places.max(axis=0)])

    def check_whole(self) -> None:
        """Raises InputError unless the head and both ankles were seen."""
        missing = [name for name in ANKLES if name not in self.places]
        if not any(name in self.places for name in HEAD):
            missing.append("head")
        if missing:
            raise InputError(f"partial body: no {' and no '.join(missing)} in the picture")


def keypoints_of(people: list[Any]) -> Keypoints:
    """The surest of the people found in a picture, each a flat list of x, y, confidence.

    Raises:
        InputError: nobody was found, or a list has an unknown length or is no numbers.
    """
    found = [points for points in map(numbers, people) if points[:, 2].max() > 0]
    if not found:
        raise InputError("keypoints: nobody was found in the picture")
    best = max(found, key=lambda points: float(points[:, 2].sum()))
    names = NAMES[best.size]
    return Keypoints(places={name: best[i, :2] for i, name in enumerate(names) if best[i, 2] >= SEEN})


def numbers(values: Any) -> Float64[np.ndarray, "K 3"]:
    """Raises InputError unless these are as many finite numbers as one of the formats has."""
    try:
        points = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError("keypoints: they are no numbers; run the detector again") from error
    if points.ndim != 1 or points.size not in NAMES or not np.isfinite(points).all():
        raise InputError(
            f"keypoints: {points.size} numbers, or NaN; {' or '.join(map(str, NAMES))} are read "
            "(COCO, OpenPose)"
        )
    return points.reshape(-1, 3)


def read_keypoints(path: Path) -> dict[str, list[Any]]:
    """People found in each picture, by the picture's name without suffix; not yet checked. Annotations
    without keypoints, or of a picture that is not listed, are passed over.

    Raises:
        InputError: no such file or folder, or of another form.
    """
    if path.is_dir():
        return {
            str(file.relative_to(path).with_suffix("")).removesuffix("_keypoints"): openpose_people(file)
            for file in sorted(path.rglob("*.json"))
        }
    content = read_json(path)
    try:
        if isinstance(content, dict):
            names = {image["id"]: image["file_name"] for image in content["images"]}
            found: dict[str, list[Any]] = {without_suffix(name): [] for name in names.values()}
            rows = [(names.get(row["image_id"]), row) for row in content["annotations"]]
        else:
            found = {}
            rows = [(row["image_id"], row) for row in content]
        rows = [(name, row["keypoints"]) for name, row in rows if name is not None and "keypoints" in row]
    except (KeyError, TypeError) as error:
        raise InputError(f"keypoints: {path} is no COCO data set or list of results ({error!r})") from error
    if not rows:
        raise InputError(f"keypoints: {path} holds no keypoints; give COCO's person_keypoints or results")
    for name, points in rows:
        found.setdefault(without_suffix(name), []).append(points)
    return found


def openpose_people(file: Path) -> list[Any]:
    """The people of one of OpenPose's files; of a damaged one a list that no picture is made from."""
    try:
        return [person["pose_keypoints_2d"] for person in read_json(file)["people"]]
    except (InputError, KeyError, TypeError):
        return ["damaged"]


def read_json(path: Path) -> Any:
    """Raises InputError where there is none."""
    try:
        return json.loads(path.read_bytes())
    except OSError as error:
        raise InputError(f"cannot read {path} ({error.strerror}); check the path") from error
    except ValueError as error:
        raise InputError(f"{path} is no JSON ({error}); make it anew") from error
