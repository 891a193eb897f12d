"""blender_levels.py FILE.glb: the last line on standard output says which meshes Blender holds, as JSON."""

import json
import sys

import bpy

bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=sys.argv[1])
shown = set(bpy.context.view_layer.objects)
found = {
    thing.name: {
        "triangles": len(thing.data.polygons),
        "in_scene": thing in shown,
        "groups": len(thing.vertex_groups),
    }
    for thing in bpy.data.objects
    if thing.type == "MESH" and thing.name.startswith("avatar")
}
print(json.dumps(found))
