"""Import a rigged file into an empty Blender scene, pose its skeleton, read its deformed vertices.

Runs only where `bpy` is installed. Transforms and points go in and out in glTF's axes (metres, y up, facing
+z); inside, Blender's z is up and the person faces -y.
"""

from dataclasses import dataclass

import bpy
import numpy as np

BLENDER_FROM_GLTF = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]], dtype=np.float64)
GLTF_FROM_BLENDER = BLENDER_FROM_GLTF.T
FPS = 30  # frames of a scene to a second of a clip


@dataclass(frozen=True)
class Imported:
    """What the importer made of the file."""

    armature: bpy.types.Object
    mesh: bpy.types.Object


def import_rigged(path: str) -> Imported:
    """Empty the scene and import the file. Raises ValueError unless it gives one armature and one skin."""
    import_file(path)
    shown = set(bpy.context.view_layer.objects)  # coarser levels of detail lie outside the scene
    armatures = [o for o in bpy.data.objects if o.type == "ARMATURE"]
    meshes = [o for o in shown if o.type == "MESH" and any(m.type == "ARMATURE" for m in o.modifiers)]
    for stray in [o for o in bpy.data.objects if o.type == "MESH" and o not in meshes]:
        bpy.data.objects.remove(stray)  # the importer's own bone shape, an icosphere
    if len(armatures) != 1 or len(meshes) != 1:
        raise ValueError(
            f"{path}: {len(armatures)} armatures and {len(meshes)} skinned meshes; one of each is wanted"
        )
    return Imported(armature=armatures[0], mesh=meshes[0])


def import_file(path: str) -> None:
    """Empty the scene and import the file with Blender's importer for its suffix."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    suffix = path.rsplit(".", 1)[1].lower()
    # Blender takes USD's time codes for frames, whatever they say they are
    bpy.context.scene.render.fps = 24 if suffix.startswith("usd") else FPS
    if suffix.startswith("usd"):
        bpy.ops.wm.usd_import(filepath=path)
    elif suffix in ("obj", "ply", "stl"):
        getattr(bpy.ops.wm, f"{suffix}_import")(filepath=path)
    else:
        bpy.ops.import_scene.gltf(filepath=path)


def rest_transforms(imported: Imported) -> dict[str, np.ndarray]:
    """World <- bone in Blender's axes, at rest, by bone name, parents first."""
    world = np.array(imported.armature.matrix_world)
    return {bone.name: world @ np.array(bone.matrix_local) for bone in imported.armature.data.bones}


def pose_bones(imported: Imported, T_posed_rest: dict[str, np.ndarray]) -> None:
    """Move each bone by its posed <- rest transform, in glTF's world axes; parents are set first."""
    from mathutils import Matrix

    rest = rest_transforms(imported)
    to_armature = np.linalg.inv(np.array(imported.armature.matrix_world))
    for name in rest:
        moved = BLENDER_FROM_GLTF @ T_posed_rest[name] @ GLTF_FROM_BLENDER @ rest[name]
        imported.armature.pose.bones[name].matrix = Matrix((to_armature @ moved).tolist())
        bpy.context.view_layer.update()


def play(imported: Imported, clip: str, seconds: float) -> None:
    """Put the scene at a moment of an imported animation, bones and shape keys; what it does not move is at
    rest."""
    action, keys = bpy.data.actions[clip], imported.mesh.data.shape_keys
    for bone in imported.armature.pose.bones:
        bone.matrix_basis.identity()
    for key in keys.key_blocks if keys else ():
        key.value = 0
    for moved, kind in ((imported.armature, "OBJECT"), (keys, "KEY")):
        if moved is not None and moved.animation_data is not None:
            slot = next((slot for slot in action.slots if slot.target_id_type == kind), None)
            moved.animation_data.action = action if slot else None
            if slot:
                moved.animation_data.action_slot = slot
    frame = seconds * FPS
    bpy.context.scene.frame_set(int(frame), subframe=frame - int(frame))


def set_shape_keys(imported: Imported, weights: dict[str, float]) -> None:
    """Move the sliders of a morphed mesh."""
    for name, weight in weights.items():
        key = imported.mesh.data.shape_keys.key_blocks[name]
        key.slider_min, key.slider_max = min(key.slider_min, weight), max(key.slider_max, weight)
        key.value = weight
    bpy.context.view_layer.update()


def deformed_vertices(imported: Imported) -> np.ndarray:
    """The evaluated mesh's vertices [W 3] in glTF's axes, in the file's order."""
    evaluated = imported.mesh.evaluated_get(bpy.context.evaluated_depsgraph_get())
    flat = np.empty(3 * len(evaluated.data.vertices), dtype=np.float32)
    evaluated.data.vertices.foreach_get("co", flat)
    world = GLTF_FROM_BLENDER @ np.array(evaluated.matrix_world)
    return flat.reshape(-1, 3).astype(np.float64) @ world[:3, :3].T + world[:3, 3]


def prepare_render(size: int, samples: int) -> None:
    """Cycles on the CPU, few samples and denoised, colours as the texture has them."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = samples
    scene.cycles.use_denoising = True
    scene.cycles.denoising_quality = "FAST"
    scene.cycles.denoising_prefilter = "FAST"
    scene.cycles.max_bounces = 3
    scene.render.resolution_x = scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format = "PNG"
    scene.render.threads_mode = "FIXED"
    scene.render.threads = 2
    scene.render.use_persistent_data = True  # a new camera does not rebuild the scene
    scene.view_settings.view_transform = "Standard"
    light_scene(scene)


def light_scene(scene: bpy.types.Scene) -> None:
    """A grey room: an even sky, a key light from the upper left, a weaker one from behind."""
    scene.world = bpy.data.worlds.new("grey")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.42, 0.42, 0.42, 1)
    for name, angles, strength in (("key", (0.85, 0.1, 0.6), 2.2), ("back", (0.9, 0.0, 3.6), 1.2)):
        light = bpy.data.lights.new(name, "SUN")
        light.energy, light.angle = strength, 0.3
        lamp = bpy.data.objects.new(name, light)
        lamp.rotation_euler = angles
        scene.collection.objects.link(lamp)


def look_at(centre: np.ndarray, height: float, degrees: float) -> None:
    """Aim the camera so that `height` metres about `centre` (glTF's axes) fill the picture; 0: front."""
    from mathutils import Vector

    scene = bpy.context.scene
    if scene.camera is None:
        scene.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
        scene.collection.objects.link(scene.camera)
    scene.camera.data.lens = 85
    distance = height * 85 / scene.camera.data.sensor_width
    angle = np.radians(degrees)
    place = centre + distance * np.array([np.sin(angle), 0.08, np.cos(angle)])
    target, eye = ((BLENDER_FROM_GLTF[:3, :3] @ point).tolist() for point in (centre, place))
    scene.camera.location = eye
    scene.camera.rotation_euler = (Vector(target) - Vector(eye)).to_track_quat("-Z", "Y").to_euler()


def render(path: str) -> None:
    bpy.context.scene.render.filepath = path
    bpy.ops.render.render(write_still=True)
