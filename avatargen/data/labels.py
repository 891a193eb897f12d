"""dataset.json: what a data set says about each picture, under an explicit convention tag.

    {"convention": "avatargen-1", "layout": {"camera": 25, "pose": 72, "betas": 10},
     "labels": [["images/00000/00.png", [107 numbers]], ...]}

`avatargen-1`: the camera is EG3D's vector (16 of cam2world row by row, OpenCV axes, metres; 9 of the
intrinsics normalised by the picture's size); the pose is axis-angle in radians for every joint of the body,
the root first, as in `avatargen.body.pose`; betas are the body's own. The person's root joint is not
translated. The first 25 numbers of a row are what EG3D reads.

A prepared data set also holds "weights", how often each picture is shown (`avatargen.data.balance`), "body",
the hash of the body that poses and betas are of, and "prepared_from", the convention its labels came in.

Letters: N pictures, J joints, b directions of shape.
"""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float32

from avatargen.errors import InputError

CONVENTION = "avatargen-1"
CAMERA_SIZE = 25
FILE_NAME = "dataset.json"


@dataclass(frozen=True, kw_only=True)
class Labels:
    """Pictures by name, with camera, pose and shape each."""

    names: tuple[str, ...]
    camera: Float32[np.ndarray, "N 25"]
    pose: Float32[np.ndarray, "N J 3"]
    betas: Float32[np.ndarray, "N b"]
    weights: Float32[np.ndarray, " N"] | None = None  # how often each is shown; none: all alike
    body: str = ""  # `body_hash` of the canonical body they are of; empty: not said

    def __len__(self) -> int:
        return len(self.names)

    def may_be_of(self, body_hash: str) -> bool:
        """Whether they are of this canonical body, or do not say."""
        return self.body in ("", body_hash)

    def rows(self) -> Float32[np.ndarray, "N k"]:
        """One vector a picture, in the layout of the file."""
        return np.concatenate([self.camera, self.pose.reshape(len(self), -1), self.betas], axis=1)


def joined(parts: list[Labels]) -> Labels:
    """The labels of several lists without weights, one after another."""
    return Labels(
        names=tuple(name for part in parts for name in part.names),
        camera=np.concatenate([part.camera for part in parts]),
        pose=np.concatenate([part.pose for part in parts]),
        betas=np.concatenate([part.betas for part in parts]),
    )


def encode_labels(labels: Labels, **more: object) -> bytes:
    """The text of the file; numbers as short as they come back to the same float32. `more` stands beside."""
    layout = {"camera": CAMERA_SIZE, "pose": labels.pose[0].size, "betas": labels.betas.shape[1]}
    rows = [
        [name, [float(str(value)) for value in row]]
        for name, row in zip(labels.names, labels.rows(), strict=True)
    ]
    if labels.body:
        more = {"body": labels.body, **more}
    if labels.weights is not None:
        more = {"weights": [float(str(value)) for value in labels.weights], **more}
    return json.dumps({"convention": CONVENTION, "layout": layout, **more, "labels": rows}).encode()


def read_labels(path: Path) -> Labels:
    """Read and check a data set's labels.

    Raises:
        InputError: no such file, damaged, of another convention, or rows of the wrong length or not finite.
    """
    try:
        content = json.loads(path.read_bytes())
        convention = content["convention"]
        layout, labels = content["layout"], content["labels"]
        names = tuple(str(name) for name, _ in labels)
        widths = [int(layout[part]) for part in ("camera", "pose", "betas")]
        rows = np.array([row for _, row in labels], dtype=np.float32)
        weights = read_weights(content.get("weights"), len(names))
        body = str(content.get("body", ""))
    except OSError as error:
        raise InputError(
            f"data: cannot read {path} ({error.strerror}); name a folder that holds it"
        ) from error
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
        raise InputError(f"data: {path} is damaged ({str(error)[:200]!r}); make the data set anew") from error
    if convention != CONVENTION:
        raise InputError(f"data: {path} has convention {convention!r}; {CONVENTION!r} is read")
    fitting = rows.ndim == 2 and rows.shape[1] == sum(widths) and min(widths) >= 0
    if not fitting or widths[0] != CAMERA_SIZE or widths[1] % 3:
        raise InputError(f"data: rows of {path} are {rows.shape[1:]} numbers; its layout says {layout}")
    if outside := [name for name in names if "\0" in name or ".." in name.split("/") or name.startswith("/")]:
        raise InputError(
            f"data: {path} names {outside[0]!r}, which is not in its folder; make the data set anew"
        )
    if not np.isfinite(rows).all():
        raise InputError(f"data: {path} holds NaN or infinity; make the data set anew")
    camera, pose, betas = np.split(rows, np.cumsum(widths)[:2], axis=1)
    pose = pose.reshape(len(rows), -1, 3)
    return Labels(names=names, camera=camera, pose=pose, betas=betas, weights=weights, body=body)


def read_weights(found: list[float] | None, count: int) -> Float32[np.ndarray, " N"] | None:
    """Raises ValueError unless there are none, or as many finite positive numbers as pictures."""
    if found is None:
        return None
    weights = np.array(found, dtype=np.float32)
    if weights.shape != (count,) or not (np.isfinite(weights) & (weights > 0)).all():
        raise ValueError(f"weights of {count} pictures are {weights.shape}, or not positive")
    return weights
