"""verdicts_of_trimesh.py FILE: what trimesh says of an .obj, .ply or .stl, as JSON on standard output.

A program of its own, because readers may fail in any way on a damaged file.
"""

import json
import sys
from typing import Any

import trimesh


def main(path: str) -> None:
    mesh: Any = trimesh.load_mesh(path, process=False)
    joined = mesh.copy()
    joined.merge_vertices(merge_tex=True, merge_norm=True)
    # vertices may be split at seams, which are no holes, or meet at one place and yet be apart
    json.dump(verdicts(mesh if mesh.is_watertight else joined), sys.stdout)


def verdicts(mesh: Any) -> dict[str, Any]:
    return {
        "faces": len(mesh.faces),
        "is_watertight": bool(mesh.is_watertight),
        "is_winding_consistent": bool(mesh.is_winding_consistent),
        "is_volume": bool(mesh.is_volume),
        "euler_number": int(mesh.euler_number),
    }


if __name__ == "__main__":
    main(sys.argv[1])
