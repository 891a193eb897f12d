"""blender_check.py FILE.glb POSES.npz OUT_FOLDER: what Blender makes of a GLB, for a test to compare.

POSES.npz holds `names` [J] and `T_posed_rest` [P J 4 4]. OUT_FOLDER gets `found.json` (what was imported),
`deformed.npz` (`rest` [W 3], `posed` [P W 3], `uv`) and `posed.png` (the first pose).
"""

import json
import sys
from pathlib import Path

import bpy
import numpy as np
from blender_scene import (
    Imported,
    deformed_vertices,
    import_rigged,
    look_at,
    pose_bones,
    prepare_render,
    render,
)


def describe(imported: Imported) -> dict[str, object]:
    """Names, hierarchy and picture as Blender holds them."""
    bones = imported.armature.data.bones
    grouped = {
        imported.mesh.vertex_groups[g.group].name for v in imported.mesh.data.vertices for g in v.groups
    }
    return {
        "bones": {bone.name: bone.parent.name if bone.parent else None for bone in bones},
        "heads": {bone.name: list(imported.armature.matrix_world @ bone.head_local) for bone in bones},
        "tails": {bone.name: list(imported.armature.matrix_world @ bone.tail_local) for bone in bones},
        "vertex_groups": [group.name for group in imported.mesh.vertex_groups],
        "groups_with_vertices": sorted(grouped),
        "triangles": len(imported.mesh.data.loop_triangles),
        "materials": [material.name for material in imported.mesh.data.materials],
        "images": [
            {"name": image.name, "size": list(image.size), "packed": image.packed_file is not None}
            for image in bpy.data.images
            if image.source == "FILE"
        ],
        "dimensions": list(imported.mesh.dimensions),
        "objects": {one.name: one.type for one in bpy.data.objects},
    }


def main(glb: str, poses: str, out: Path) -> None:
    imported = import_rigged(glb)
    imported.mesh.data.calc_loop_triangles()
    (out / "found.json").write_text(json.dumps(describe(imported)))
    rest = deformed_vertices(imported)
    given = np.load(poses)
    posed = []
    for transforms in given["T_posed_rest"]:
        pose_bones(imported, dict(zip(given["names"].tolist(), transforms, strict=True)))
        posed.append(deformed_vertices(imported))
    np.savez(out / "deformed.npz", rest=rest, posed=np.array(posed))
    pose_bones(imported, dict(zip(given["names"].tolist(), given["T_posed_rest"][0], strict=True)))
    prepare_render(size=256, samples=8)
    low, high = posed[0].min(axis=0), posed[0].max(axis=0)
    look_at((low + high) / 2, height=1.15 * float((high - low).max()), degrees=20)
    render(str(out / "posed.png"))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], Path(sys.argv[3]))
