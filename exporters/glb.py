"""An asset as binary glTF 2.0: one mesh, or one for each part, and what else the asset has: a skeleton, a
skin, pictures. Same asset, same bytes.

Conventions are glTF's and ours alike: metres, y up, facing +z, right-handed, faces counter-clockwise from
outside, uv origin at the texture's top left. Letters: W vertices (seams split), F faces, J joints.
`T_world_joint` reads world <- joint. Node i < J is joint i; nodes from J on are the meshes, at the scene's
root and without a transform of their own. A part has a mesh, a material and pictures by its name.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pygltflib as gltf
from jaxtyping import Float32, Shaped, UInt8

from assets.asset.asset import Asset, AssetInfo, PlainAsset, Skeleton, TexturedAsset, meshes_of, part_names
from exporters.binary import Binary
from exporters.encoding import PLAIN, Encoding
from exporters.file import File
from exporters.glb_levels import add_levels
from exporters.glb_motion import animations, morph_targets, rest_quaternions
from exporters.quantize import EXTENSION, cube_around, directions, shares, whole_weights

WEBP = "EXT_texture_webp"
PICTURES = ("base_color", "normal", "occlusion")  # that an asset can have, in order
ROUGHNESS = 0.8  # cloth and skin scatter light; nothing on the asset is metal
ARMATURE = "Armature"  # the node above joints and meshes where there is a root bone
IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])  # quaternion x y z w


def encode(asset: PlainAsset, encoding: Encoding = PLAIN) -> bytes:
    """The asset as the bytes of a .glb file, with as much in it as the asset has."""
    return pack(*describe(asset, encoding))


def pack(document: gltf.GLTF2, data: bytes) -> bytes:
    """A document and its buffer in one file."""
    document.set_binary_blob(data)
    return b"".join(document.save_to_bytes())


def describe(
    asset: PlainAsset, encoding: Encoding, picture_uris: Sequence[str] = ()
) -> tuple[gltf.GLTF2, bytes]:
    """The document and its one buffer, which holds the pictures unless these have places of their own."""
    binary, meshes = Binary(), meshes_of(asset, "avatar")
    document = gltf.GLTF2(
        asset=file_info(asset.info, part_names(asset)),
        scene=0,
        scenes=[gltf.Scene(name="avatar", nodes=list(range(len(meshes))))],
        nodes=[gltf.Node(name=name, mesh=number) for number, name in enumerate(meshes)],
        meshes=[
            gltf.Mesh(name=name, primitives=[mesh_primitive(mesh, number, binary, encoding)])
            for number, (name, mesh) in enumerate(meshes.items())
        ],
    )
    if encoding.quantize:
        require_extension(document, EXTENSION)
    if encoding.quantize and not isinstance(asset, Asset):
        cube = cube_around(asset.vertices)
        document.nodes[0].translation, document.nodes[0].scale = cube.centre.tolist(), [cube.half] * 3
    if isinstance(asset, Asset):
        add_skeleton(document, asset.skeleton, binary)
        for made, mesh in zip(document.meshes, meshes.values(), strict=True):
            add_morphs(made, mesh, binary)
    add_levels(document, asset, binary)
    if isinstance(asset, Asset):
        faces = [number for number, node in enumerate(document.nodes) if node.mesh is not None]
        document.animations = animations(asset, binary, faces)
        if asset.skeleton.armature:
            add_armature(document)
    for name, mesh in meshes.items():
        document.materials.append(material(mesh, name, len(document.textures)))
        if isinstance(mesh, TexturedAsset):
            prefix = "" if mesh is asset else f"{name}_"
            add_textures(document, mesh, prefix, encoding, picture_uris, binary)
    document.accessors, document.bufferViews = binary.accessors, binary.views
    document.buffers = [gltf.Buffer(byteLength=len(binary.data))]
    return document, bytes(binary.data)


def add_skeleton(document: gltf.GLTF2, skeleton: Skeleton, binary: Binary) -> None:
    """Put the joints before the meshes' nodes, and a skin on these."""
    joint_count = len(skeleton.parents)
    document.skins = [joint_skin(skeleton, binary)]
    skinned = [replace(node, skin=0) for node in document.nodes]
    document.nodes = [*joint_nodes(skeleton), *skinned]
    places = range(joint_count, len(document.nodes))
    document.scenes[0].nodes = [*np.flatnonzero(skeleton.parents < 0).tolist(), *places]


def add_armature(document: gltf.GLTF2) -> None:
    """One node above all that the scene has, as modellers and pages made for their files look for."""
    scene = document.scenes[0]
    document.nodes.append(gltf.Node(name=ARMATURE, children=scene.nodes))
    scene.nodes = [len(document.nodes) - 1]


def add_morphs(mesh: gltf.Mesh, asset: PlainAsset, binary: Binary) -> None:
    """Put the sliders at weight 0 and their names where importers look for them.

    No morph target moves a joint: how far the joints ought to move is told beside the names, in metres, for
    programs that move them.
    """
    if isinstance(asset, Asset) and asset.morphs:
        mesh.primitives[0].targets = morph_targets(asset, binary)
        mesh.weights = [0.0] * len(asset.morphs)
        mesh.extras = {"targetNames": [morph.name for morph in asset.morphs]}
        if any(morph.normals is None for morph in asset.morphs):  # a face's shapes move no joint
            mesh.extras["targetJointOffsets"] = [morph.joints.round(6).tolist() for morph in asset.morphs]


def add_textures(
    document: gltf.GLTF2,
    asset: TexturedAsset,
    prefix: str,
    encoding: Encoding,
    picture_uris: Sequence[str],
    binary: Binary,
) -> None:
    """The pictures that a material reads: the base colour and what there is beside it."""
    document.samplers = [texture_sampler()]
    for name, pixels in pictures(asset).items():
        image = gltf.Image(name=prefix + name)
        if picture_uris:
            image.uri = picture_uris[PICTURES.index(name)]
        else:
            image.bufferView = binary.add_picture(encoding.picture(name, pixels))
            image.mimeType = encoding.mime_type
        document.textures.append(picture_texture(document, len(document.images), encoding))
        document.images.append(image)


def picture_texture(document: gltf.GLTF2, index: int, encoding: Encoding) -> gltf.Texture:
    """A texture that shows an image. WebP is an extension, and without a second picture one that readers
    must have."""
    if encoding.pictures != "webp":
        return gltf.Texture(sampler=0, source=index)
    require_extension(document, WEBP)
    return gltf.Texture(sampler=0, extensions={WEBP: {"source": index}})


def require_extension(document: gltf.GLTF2, name: str) -> None:
    """Note that the file cannot be read without an extension."""
    document.extensionsUsed = sorted({*(document.extensionsUsed or []), name})
    document.extensionsRequired = sorted({*(document.extensionsRequired or []), name})


def pictures(asset: TexturedAsset) -> dict[str, UInt8[np.ndarray, "S S *C"]]:
    """What an asset has to be looked at, in the order of `PICTURES`; occlusion is grey."""
    found = {"base_color": asset.texture}
    if asset.normal_map is not None:
        found["normal"] = asset.normal_map.texels
    if asset.occlusion is not None:
        found["occlusion"] = asset.occlusion
    return found


def picture_files(asset: TexturedAsset, names: Sequence[str], encoding: Encoding) -> dict[str, File]:
    """The asset's pictures as files; `names` are those for the first of `PICTURES`, and others are left
    out."""
    found, files = pictures(asset), zip(PICTURES, names, strict=False)
    return {name: File(file, encoding.picture(name, found[name])) for name, file in files if name in found}


def mesh_primitive(asset: PlainAsset, material: int, binary: Binary, encoding: Encoding) -> gltf.Primitive:
    attributes = gltf.Attributes()
    for name, values in (whole_numbers if encoding.quantize else real_numbers)(asset).items():
        fractions = values.dtype.kind != "f" and name != "JOINTS_0"
        accessor = binary.add_array(values, gltf.ARRAY_BUFFER, name == "POSITION", normalized=fractions)
        setattr(attributes, name, accessor)
    indices = binary.add_indices(asset.faces, len(asset.vertices))
    return gltf.Primitive(attributes=attributes, indices=indices, material=material, mode=gltf.TRIANGLES)


def real_numbers(asset: PlainAsset) -> dict[str, Shaped[np.ndarray, "W C"]]:
    """What each vertex has, by glTF's names."""
    found = {"POSITION": asset.vertices.astype(np.float32), "NORMAL": unit(asset.normals)}
    if isinstance(asset, TexturedAsset):
        if asset.normal_map is not None:
            found["TANGENT"] = asset.normal_map.tangents
        found["TEXCOORD_0"] = asset.uv.astype(np.float32)
    if isinstance(asset, Asset):
        joint_type = np.uint8 if len(asset.skeleton.parents) <= 256 else np.uint16
        found["JOINTS_0"] = np.where(asset.weights > 0, asset.joints, 0).astype(joint_type)
        found["WEIGHTS_0"] = exact_weights(asset.weights)
    return found


def whole_numbers(asset: PlainAsset) -> dict[str, Shaped[np.ndarray, "W C"]]:
    """The same, rounded; a weight that becomes nothing names joint 0.

    Places of a skinned mesh stay as they are: the matrix that turns steps into metres would belong into the
    joints' binds, where Blender takes it for the bones' own size.
    """
    ways = {"NORMAL": directions, "TANGENT": directions, "TEXCOORD_0": shares}
    if not isinstance(asset, Asset):
        ways["POSITION"] = cube_around(asset.vertices).places
    found = real_numbers(asset)
    found |= {name: ways[name](values) for name, values in found.items() if name in ways}
    if "WEIGHTS_0" in found:
        found["WEIGHTS_0"] = whole_weights(found["WEIGHTS_0"])
        found["JOINTS_0"] = np.where(found["WEIGHTS_0"] > 0, found["JOINTS_0"], 0).astype(
            found["JOINTS_0"].dtype
        )
    return found


def unit(normals: Shaped[np.ndarray, "W 3"]) -> Float32[np.ndarray, "W 3"]:
    """Normals of length 1; one without a direction points up."""
    wide = normals.astype(np.float64)
    length = np.linalg.norm(wide, axis=1, keepdims=True)
    return np.where(length > 1e-12, wide / np.maximum(length, 1e-12), [0.0, 1.0, 0.0]).astype(np.float32)


def exact_weights(weights: Shaped[np.ndarray, "W 4"]) -> Float32[np.ndarray, "W 4"]:
    """Rows that sum to 1 to one rounding of float32: the heaviest takes what the others' rounding left."""
    wide = weights.astype(np.float64)
    rounded = (wide / wide.sum(axis=1, keepdims=True)).astype(np.float32)
    heaviest = rounded.argmax(axis=1)
    rows = np.arange(len(rounded))
    rest = rounded.sum(axis=1, dtype=np.float64) - rounded[rows, heaviest]
    rounded[rows, heaviest] = (1 - rest).astype(np.float32)
    return rounded


def joint_skin(skeleton: Skeleton, binary: Binary) -> gltf.Skin:
    """The skin over all joints; glTF stores matrices by columns."""
    inverse_binds = np.linalg.inv(skeleton.T_world_joint).astype(np.float32)
    inverse_binds[:, 3] = [0, 0, 0, 1]
    columns = np.ascontiguousarray(inverse_binds.transpose(0, 2, 1))
    joints = list(range(len(skeleton.parents)))
    return gltf.Skin(name="skeleton", joints=joints, inverseBindMatrices=binary.add_array(columns))


def joint_nodes(skeleton: Skeleton) -> list[gltf.Node]:
    """A node for each joint, named as the body names it, with its rest transform relative to its parent."""
    T_parent_joint = skeleton.T_parent_joint
    rotations = rest_quaternions(T_parent_joint)
    nodes = []
    for joint, name in enumerate(skeleton.joint_names):
        node = gltf.Node(name=name, translation=T_parent_joint[joint, :3, 3].tolist())
        if np.abs(rotations[joint] - IDENTITY).max() > 1e-9:
            node.rotation = rotations[joint].tolist()
        children = np.flatnonzero(skeleton.parents == joint).tolist()
        node.children = children or None
        nodes.append(node)
    return nodes


def material(asset: PlainAsset, name: str, textures: int) -> gltf.Material:
    """How a mesh looks, whose textures come after so many others."""
    surface = gltf.PbrMetallicRoughness(metallicFactor=0.0, roughnessFactor=ROUGHNESS)
    made = gltf.Material(name=name, pbrMetallicRoughness=surface, doubleSided=False)
    if isinstance(asset, TexturedAsset):
        surface.baseColorTexture = gltf.TextureInfo(index=textures)
        index = {picture: textures + i for i, picture in enumerate(pictures(asset))}
        if "normal" in index:
            made.normalTexture = gltf.NormalMaterialTexture(index=index["normal"])
        if "occlusion" in index:
            made.occlusionTexture = gltf.OcclusionTextureInfo(index=index["occlusion"])
    return made


def texture_sampler() -> gltf.Sampler:
    return gltf.Sampler(
        magFilter=gltf.LINEAR,
        minFilter=gltf.LINEAR_MIPMAP_LINEAR,
        wrapS=gltf.CLAMP_TO_EDGE,
        wrapT=gltf.CLAMP_TO_EDGE,
    )


def file_info(info: AssetInfo, parts: Sequence[str] = ()) -> gltf.Asset:
    """Where the file comes from and its parts, under the keys that scripts read: asset.generator and
    asset.extras."""
    extras = {
        "seed": info.seed,
        "weights_hash": info.weights_hash,
        "version": info.version,
        "licence": info.licence,
        "betas": [round(float(beta), 6) for beta in info.betas],
    }
    if info.height_m is not None:
        extras["height_m"] = round(info.height_m, 4)
    if info.facts:
        extras["attributes"] = dict(info.facts)
    if parts:
        extras["parts"] = list(parts)
    return gltf.Asset(
        version="2.0", generator=f"avatargen {info.version}", copyright=info.licence, extras=extras
    )
