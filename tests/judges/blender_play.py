"""blender_play.py FILE OUT.npz SECONDS...: a file's own animation as Blender plays it, and its sliders.

OUT.npz holds `played` [T W 3], the vertices at each of the moments; the names of the `morphs`, "Basis" first,
and under each name but that the vertices at rest with its slider at 1.
"""

import sys

import bpy
import numpy as np
from blender_scene import GLTF_FROM_BLENDER, deformed_vertices, import_rigged


def main(path: str, out: str, moments: list[float]) -> None:
    imported = import_rigged(path)
    scene = bpy.context.scene
    rate = scene.render.fps / scene.render.fps_base
    played = []
    for moment in moments:
        frame, part = divmod(moment * rate, 1)
        scene.frame_set(int(frame), subframe=part)
        played.append(deformed_vertices(imported))
    found = {"played": np.array(played)}
    keys = imported.mesh.data.shape_keys
    blocks = list(keys.key_blocks) if keys else []
    found["morphs"] = np.array([block.name for block in blocks])
    world = GLTF_FROM_BLENDER @ np.array(imported.mesh.matrix_world)
    for block in blocks[1:]:
        flat = np.empty(3 * len(block.data), dtype=np.float32)
        block.data.foreach_get("co", flat)
        found[block.name] = flat.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3]
    np.savez(out, **found)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], [float(moment) for moment in sys.argv[3:]])
