"""Photographs made in code: people of the synthetic data set before noise, labelled as other projects do.

A label here starts from ours and goes the other way round than `avatargen.data.conventions`: the person is
turned, scaled and moved, and the camera follows so that the picture stays.
"""

import json
import pickle
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

from avatargen.avatar import training_body
from avatargen.body.model import shape
from avatargen.data.dataset import Pictures, open_pictures
from avatargen.data.joints import projected_joints
from avatargen.data.keypoints import COCO_17, OPENPOSE_25
from avatargen.data.synth import SynthConfig, synthesize

BODY = training_body()
SIZE, WIDTH, HEIGHT = 64, 110, 96
CORNER = np.array([(WIDTH - SIZE) // 2, (HEIGHT - SIZE) // 2])
FOCAL = 1.4 * SIZE / HEIGHT  # of the synthetic cameras, as a share of the photograph's height
PEOPLE, VIEWS = 2, 3
CONVENTIONS = ("eg3d", "getavatar", "ag3d", "eva3d")


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A folder with `photos`, `masks`, `coco.json` and `openpose`; and everybody's joints, in pixels."""

    folder: Path
    truth: Pictures
    names: tuple[str, ...]
    joints: np.ndarray  # N J 2

    def labels(self, convention: str) -> Path:
        """Labels in a convention, written where they are asked for."""
        return write_labels(self, convention)


def make_scene(folder: Path) -> Scene:
    synthesize(folder / "synth", PEOPLE, SynthConfig(size=SIZE, views=VIEWS, cell=0.03), 1, lambda *_: None)
    truth = open_pictures(folder / "synth", SIZE)
    labels, rng = truth.labels, np.random.default_rng(3)
    names, joints = [], []
    for kind in ("photos", "masks", "openpose"):
        (folder / kind / "more").mkdir(parents=True)
    for i in range(len(truth)):
        name = f"more/person{i}" if i % 2 else f"person{i}"
        photo, mask = photograph(truth, i, rng)
        Image.fromarray(photo).save(folder / "photos" / f"{name}.png")
        Image.fromarray(mask).save(folder / "masks" / f"{name}.png")
        places = projected_joints(BODY, labels.camera[i], labels.pose[i], labels.betas[i]) * SIZE + CORNER
        names.append(name)
        joints.append(places)
    scene = Scene(folder=folder, truth=truth, names=tuple(names), joints=np.stack(joints))
    write_keypoints(scene)
    return scene


def photograph(truth: Pictures, i: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A person in the middle of noise, and the mask."""
    photo = rng.integers(0, 255, (HEIGHT, WIDTH, 3)).astype(np.float64)
    mask = np.zeros((HEIGHT, WIDTH), dtype=np.uint8)
    rows, columns = slice(CORNER[1], CORNER[1] + SIZE), slice(CORNER[0], CORNER[0] + SIZE)
    cover = truth.mask(i).numpy()[..., None]
    person = truth.image(i).permute(1, 2, 0).numpy() - (1 - cover)  # the white behind is taken away
    photo[rows, columns] = 255 * person + (1 - cover) * photo[rows, columns]
    mask[rows, columns] = np.rint(255 * cover[..., 0])
    return np.rint(photo.clip(0, 255)).astype(np.uint8), mask


def write_keypoints(scene: Scene) -> None:
    """COCO's and OpenPose's: the limbs and, at the head joint, the nose; in COCO a second, fainter person."""
    images, annotations = [], []
    for i, (name, joints) in enumerate(zip(scene.names, scene.joints, strict=True)):
        points = {**dict(zip(BODY.joint_names, joints, strict=True)), "nose": joints[15]}
        for wanted, write in ((COCO_17, annotations.append), (OPENPOSE_25, None)):
            rows = [[*points[n], 0.9] if n in points else [0.0, 0.0, 0.0] for n in wanted]
            flat = [float(value) for row in rows for value in row]
            if write is None:
                people = {"people": [{"pose_keypoints_2d": flat}]}
                path = scene.folder / "openpose" / f"{name}_keypoints.json"
                path.write_text(json.dumps(people))
            else:
                write({"image_id": i, "keypoints": flat})
                write({"image_id": i, "keypoints": [0.35 if k % 3 == 2 else 5.0 for k in range(51)]})
        images.append({"id": i, "file_name": f"{name}.jpg"})
    (scene.folder / "coco.json").write_text(json.dumps({"images": images, "annotations": annotations}))


def write_labels(scene: Scene, convention: str) -> Path:
    labels, rng = scene.truth.labels, np.random.default_rng(5)
    path = scene.folder / f"{convention}.json"
    rows = {}
    for i, name in enumerate(scene.names):
        turn = Rotation.from_rotvec(rng.normal(0, 1.5, 3))
        world2cam = np.linalg.inv(labels.camera[i, :16].reshape(4, 4).astype(np.float64))
        pelvis = shape(BODY, labels.betas[i]).joints[0]
        back = np.eye(4)  # from where the turned person is to where the upright one was
        back[:3, :3] = turn.as_matrix().T
        back[:3, 3] = pelvis - turn.as_matrix().T @ pelvis
        camera = world2cam @ back
        person = [turn.as_rotvec(), labels.pose[i, 1:].ravel(), labels.betas[i]]
        rows[name] = row_of(convention, camera, person, labels.camera[i, 16:], rng)
    if convention == "eva3d":
        return write_pickles(scene.folder / "eva3d", rows)
    listed = {f"{name}.png": list(map(float, row)) for name, row in rows.items()}
    as_pairs = [[f"photos/{name}", row] for name, row in listed.items()]
    path.write_text(json.dumps({"labels": listed if convention == "getavatar" else as_pairs}))
    if convention == "ag3d":  # in two pieces, as that project writes them
        path.write_text(json.dumps({"labels": [[name, [row[:25], row[25:]]] for name, row in as_pairs]}))
    return path


def row_of(convention: str, world2cam: np.ndarray, person: list, intrinsics: np.ndarray, rng) -> np.ndarray:
    """The numbers of one label."""
    share = np.array(
        [[SIZE / WIDTH, 0, CORNER[0] / WIDTH], [0, SIZE / HEIGHT, CORNER[1] / HEIGHT], [0, 0, 1]]
    )
    K = (share @ intrinsics.reshape(3, 3)).ravel()
    if convention == "eg3d":
        return np.concatenate([np.linalg.inv(world2cam).ravel(), K, *person])
    if convention == "getavatar":
        return np.concatenate([(np.diag([1.0, -1, -1, 1]) @ world2cam).ravel(), *person])
    if convention == "ag3d":
        scale, moved = rng.uniform(0.5, 2), rng.normal(0, 1, 3)
        world2cam = world2cam.copy()  # a point X is scale * (body + moved)
        world2cam[:3, 3] = scale * (world2cam[:3, 3] - world2cam[:3, :3] @ moved)
        return np.concatenate([np.linalg.inv(world2cam).ravel(), K, [scale], moved, *person])
    return np.concatenate([world2cam[:3, :3].ravel(), world2cam[:3, 3], *person])


def write_pickles(folder: Path, rows: dict[str, np.ndarray]) -> Path:
    sizes = {"camera_rotation": (1, 3, 3), "camera_translation": (1, 3), "global_orient": (1, 3)}
    sizes |= {"body_pose": (1, 69), "betas": (1, 10)}
    for name, row in rows.items():
        ends = np.cumsum([int(np.prod(size)) for size in sizes.values()])[:-1]
        parts = zip(sizes.items(), np.split(row.astype(np.float32), ends), strict=True)
        path = folder / name / "000.pkl"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(pickle.dumps({key: part.reshape(size) for (key, size), part in parts}))
    return folder
