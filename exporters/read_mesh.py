"""read_mesh.py FILE: the vertices [V 3] and faces [F 3] of an .obj, .ply or .stl, as .npz on standard output.

A program of its own, because PyMeshLab's readers bring their whole process down on some damaged files.
"""

import io
import sys

import numpy as np
import pymeshlab


def main(path: str) -> None:
    meshes = pymeshlab.MeshSet()  # pyright: ignore
    meshes.load_new_mesh(path)
    mesh = meshes.current_mesh()
    stream = io.BytesIO()
    np.savez(stream, vertices=mesh.vertex_matrix(), faces=mesh.face_matrix().astype(np.int64))
    sys.stdout.buffer.write(stream.getvalue())


if __name__ == "__main__":
    main(sys.argv[1])
