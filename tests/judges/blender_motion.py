"""blender_motion.py FILE.glb MOMENTS.npz OUT.npz: a GLB's animations and shape keys as Blender plays them.

MOMENTS.npz holds `clips` [N] names, `seconds` [N], `keys` [K] names of shape keys and `weights` [N K].
OUT.npz gets `vertices` [N W 3] in glTF's axes, `lengths` [N] of the clips in seconds, and `bones` [J 6]: head
and tail of every bone at rest, in glTF's axes, by `names`.
"""

import sys

import bpy
import numpy as np
from blender_scene import (
    FPS,
    GLTF_FROM_BLENDER,
    deformed_vertices,
    import_rigged,
    play,
    set_shape_keys,
)


def main(glb: str, moments: str, out: str) -> None:
    imported = import_rigged(glb)
    given = np.load(moments)
    vertices, lengths = [], []
    rows = zip(given["clips"].tolist(), given["seconds"].tolist(), given["weights"], strict=True)
    for clip, seconds, weights in rows:
        play(imported, clip, seconds)
        set_shape_keys(imported, dict(zip(given["keys"].tolist(), weights.tolist(), strict=True)))
        vertices.append(deformed_vertices(imported))
        lengths.append(bpy.data.actions[clip].frame_range[1] / FPS)
    bones = imported.armature.data.bones
    ends = np.array([[*bone.head_local, 1, *bone.tail_local, 1] for bone in bones]).reshape(-1, 2, 4)
    world = GLTF_FROM_BLENDER @ np.array(imported.armature.matrix_world)
    np.savez(
        out,
        vertices=np.array(vertices),
        lengths=np.array(lengths),
        bones=(ends @ world.T)[:, :, :3].reshape(-1, 6),
        names=np.array([bone.name for bone in bones]),
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
