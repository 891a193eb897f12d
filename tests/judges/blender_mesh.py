"""blender_mesh.py FILE OUT.npz: the one mesh that Blender makes of a file, for a test to compare.

OUT.npz holds `vertices` [V 3] in Blender's world, `faces` [F 3], `uv` [3F 2], `colours` [V 4] in 0..1 sRGB,
the sizes of `images` and the number of `materials`; what the file does not have is empty.
"""

import sys

import bpy
import numpy as np
from blender_scene import import_file


def values(collection: bpy.types.bpy_prop_collection, name: str, width: int, kind: type) -> np.ndarray:
    flat = np.empty(width * len(collection), dtype=kind)
    collection.foreach_get(name, flat)
    return flat.reshape(-1, width)


def main(path: str, out: str) -> None:
    import_file(path)
    (made,) = (o for o in bpy.data.objects if o.type == "MESH")
    mesh, world = made.data, np.array(made.matrix_world)
    assert all(len(polygon.vertices) == 3 for polygon in mesh.polygons), "a face is no triangle"
    vertices = values(mesh.vertices, "co", 3, np.float32) @ world[:3, :3].T + world[:3, 3]
    colours = mesh.color_attributes[0].data if mesh.color_attributes else ()
    images = [list(image.size) for image in bpy.data.images if image.source == "FILE"]
    np.savez(
        out,
        vertices=vertices,
        faces=values(mesh.loops, "vertex_index", 1, np.int32).reshape(-1, 3),
        uv=values(mesh.uv_layers[0].uv, "vector", 2, np.float32) if mesh.uv_layers else np.zeros((0, 2)),
        colours=values(colours, "color_srgb", 4, np.float32) if len(colours) else np.zeros((0, 4)),
        images=np.array(images),
        materials=len(mesh.materials),
    )


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
