"""blender_parts.py FILE OUT.json: what Blender makes of a file of several meshes on one skeleton.

OUT.json gets the number of `armatures` and by name of `meshes` their triangles, materials and images, and
whether the armature bends them.
"""

import json
import sys
from pathlib import Path

import bpy
from blender_scene import import_file


def images_of(mesh: bpy.types.Object) -> list[str]:
    """Names of the pictures that a mesh's materials show."""
    nodes = [node for material in mesh.data.materials for node in material.node_tree.nodes]
    return sorted({node.image.name for node in nodes if getattr(node, "image", None)})


def main(path: str, out: Path) -> None:
    import_file(path)
    armatures = [one for one in bpy.data.objects if one.type == "ARMATURE"]
    shapes = {bone.custom_shape for armature in armatures for bone in armature.pose.bones}
    meshes = {}
    for mesh in bpy.data.objects:
        if mesh.type == "MESH" and mesh not in shapes:
            mesh.data.calc_loop_triangles()
            meshes[mesh.name] = {
                "triangles": len(mesh.data.loop_triangles),
                "materials": [material.name for material in mesh.data.materials],
                "images": images_of(mesh),
                "bent": any(m.type == "ARMATURE" and m.object in armatures for m in mesh.modifiers),
            }
    out.write_text(json.dumps({"armatures": len(armatures), "meshes": meshes}))


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
