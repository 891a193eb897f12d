"""blender_render.py FILE.glb OUT_FOLDER [--size 384] [--poses rest walk ...]: pictures for people to look at.

Renders the file at rest and in named poses, each from the front, the back, three quarters and close to the
face, and joins them into OUT_FOLDER/sheet.png, a row for each pose. Poses say where limbs point, so they fit
any rest pose.
"""

import argparse
from pathlib import Path

import bpy
import numpy as np
from blender_scene import (
    GLTF_FROM_BLENDER,
    Imported,
    deformed_vertices,
    import_rigged,
    look_at,
    pose_bones,
    prepare_render,
    render,
    rest_transforms,
)

# joint -> (the child it aims at, the direction from joint to child: x to the person's left, y up, z forward)
Aims = dict[str, tuple[str, tuple[float, float, float]]]
POSES: dict[str, Aims] = {
    "rest": {},
    "walk": {
        "left_hip": ("left_knee", (0.05, -0.9, 0.42)),
        "left_knee": ("left_ankle", (0.0, -1.0, -0.05)),
        "right_hip": ("right_knee", (-0.05, -0.95, -0.25)),
        "right_knee": ("right_ankle", (0.0, -0.75, -0.65)),
        "left_shoulder": ("left_elbow", (0.3, -0.9, -0.35)),
        "left_elbow": ("left_wrist", (0.15, -0.95, 0.1)),
        "right_shoulder": ("right_elbow", (-0.3, -0.9, 0.3)),
        "right_elbow": ("right_wrist", (-0.05, -0.6, 0.75)),
    },
    "arms_up": {
        "left_shoulder": ("left_elbow", (0.35, 0.95, 0.0)),
        "left_elbow": ("left_wrist", (0.1, 1.0, 0.0)),
        "right_shoulder": ("right_elbow", (-0.35, 0.95, 0.0)),
        "right_elbow": ("right_wrist", (-0.1, 1.0, 0.0)),
    },
    "sit": {
        "left_hip": ("left_knee", (0.15, -0.12, 1.0)),
        "left_knee": ("left_ankle", (0.0, -1.0, 0.05)),
        "right_hip": ("right_knee", (-0.15, -0.12, 1.0)),
        "right_knee": ("right_ankle", (0.0, -1.0, 0.05)),
        "left_shoulder": ("left_elbow", (0.25, -0.9, 0.3)),
        "left_elbow": ("left_wrist", (-0.1, -0.25, 0.95)),
        "right_shoulder": ("right_elbow", (-0.25, -0.9, 0.3)),
        "right_elbow": ("right_wrist", (0.1, -0.25, 0.95)),
    },
}
VIEWS = {"front": 0.0, "back": 180.0, "three_quarter": 40.0, "face": 15.0}  # degrees around the person


def rotation_between(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """The smallest rotation that turns one direction into another (not opposite) one."""
    a, b = start / np.linalg.norm(start), end / np.linalg.norm(end)
    x, y, z = np.cross(a, b)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + cross + cross @ cross / (1 + a @ b)


def aim(imported: Imported, aims: Aims) -> dict[str, np.ndarray]:
    """Posed <- rest transforms (glTF's axes) of all bones after the aims, parents first."""
    heads = {name: (GLTF_FROM_BLENDER @ T)[:3, 3] for name, T in rest_transforms(imported).items()}
    T_posed_rest: dict[str, np.ndarray] = {}
    for bone in imported.armature.data.bones:
        T = T_posed_rest[bone.parent.name] if bone.parent else np.eye(4)
        if bone.name in aims:
            child, direction = aims[bone.name]
            turn = rotation_between(T[:3, :3] @ (heads[child] - heads[bone.name]), np.array(direction))
            pivot = T[:3, :3] @ heads[bone.name] + T[:3, 3]
            about = np.eye(4)
            about[:3, :3], about[:3, 3] = turn, pivot - turn @ pivot
            T = about @ T
        T_posed_rest[bone.name] = T
    return T_posed_rest


def frame_of(imported: Imported, view: str) -> tuple[np.ndarray, float]:
    """Centre and height, in metres, of what a view shows."""
    vertices = deformed_vertices(imported)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    if view != "face" or "head" not in imported.armature.pose.bones:
        return (low + high) / 2, 1.12 * float((high - low).max())
    head = (GLTF_FROM_BLENDER @ np.array([*imported.armature.pose.bones["head"].head, 1]))[:3]
    near = vertices[np.linalg.norm(vertices - head, axis=1) < 0.3]
    top = near[:, 1].max()
    return np.array([head[0], top - 0.14, head[2]]), 0.36


def pixels_of(image: bpy.types.Image) -> np.ndarray:
    """Rows from the bottom, [H W 4]."""
    flat = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(flat)
    width, height = image.size
    return flat.reshape(height, width, 4)


def join(pictures: list[list[Path]], path: Path) -> None:
    """Put pictures of one size side by side, a row for each list."""
    rows = []
    for row in pictures:
        images = [bpy.data.images.load(str(picture)) for picture in row]
        rows.append(np.hstack([pixels_of(image) for image in images]))
    sheet = np.vstack(rows[::-1])  # Blender counts rows from the bottom
    image = bpy.data.images.new("sheet", sheet.shape[1], sheet.shape[0])
    image.pixels.foreach_set(sheet.ravel())
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("glb")
    parser.add_argument("out", type=Path)
    parser.add_argument("--size", type=int, default=384)
    parser.add_argument("--samples", type=int, default=8)
    parser.add_argument("--poses", nargs="+", default=list(POSES), choices=list(POSES))
    parser.add_argument("--views", nargs="+", default=list(VIEWS), choices=list(VIEWS))
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    imported = import_rigged(given.glb)
    prepare_render(given.size, given.samples)
    pictures: list[list[Path]] = []
    for pose in given.poses:
        pose_bones(imported, aim(imported, POSES[pose]))
        pictures.append([])
        for view in given.views:
            look_at(*frame_of(imported, view), degrees=VIEWS[view])
            pictures[-1].append(given.out / f"{pose}_{view}.png")
            render(str(pictures[-1][-1].resolve()))
    join(pictures, given.out / "sheet.png")
    print(given.out / "sheet.png")


if __name__ == "__main__":
    main()
