"""blender_tangents.py ASKED.npz FOUND.npz: the tangents that Blender's MikkTSpace gives at each corner.

ASKED holds vertices [W 3], faces [F 3], unit normals [W 3] and uv [W 2] with the origin at the top left;
FOUND gets tangents [F 3 4], the last number the bitangent's sign.
"""

import sys

import bpy
import numpy as np

with np.load(sys.argv[-2]) as asked:
    vertices, faces, normals, uv = (asked[name] for name in ("vertices", "faces", "normals", "uv"))
mesh = bpy.data.meshes.new("asked")
mesh.from_pydata(vertices.tolist(), [], faces.tolist())
layer = mesh.uv_layers.new(name="uv")
corner_uv = uv[faces.reshape(-1)] * [1, -1] + [0, 1]
layer.data.foreach_set("uv", corner_uv.astype(np.float32).reshape(-1))
mesh.shade_smooth()
mesh.normals_split_custom_set_from_vertices(normals.tolist())
mesh.calc_tangents(uvmap="uv")
found = [[*loop.tangent, loop.bitangent_sign] for loop in mesh.loops]
np.savez(sys.argv[-1], tangents=np.array(found).reshape(-1, 3, 4))
