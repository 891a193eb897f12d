"""An asset as binary glTF 2.0: one mesh and what else the asset has: a skeleton with a skin, one PNG inside.
Same asset, same bytes.

Conventions are glTF's and ours alike: metres, y up, facing +z, right-handed, faces counter-clockwise from
outside, uv origin at the texture's top left. Letters: W vertices (seams split), F faces, J joints.
`T_world_joint` reads world <- joint. Node i < J is joint i; node J is the mesh, at the scene's root and
without a transform of its own.
"""

import numpy as np
import pygltflib as gltf
from jaxtyping import Float32, Shaped

from assets.asset import Asset, AssetInfo, PlainAsset, Skeleton, TexturedAsset
from exporters.binary import Binary
from exporters.glb_levels import add_levels
from exporters.glb_motion import animations, morph_targets, rest_quaternions
from exporters.png import encode_png

ROUGHNESS = 0.8  # cloth and skin scatter light; nothing on the asset is metal
IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])  # quaternion x y z w


def encode(asset: PlainAsset) -> bytes:
    """The asset as the bytes of a .glb file, with as much in it as the asset has."""
    return pack(*describe(asset))


def pack(document: gltf.GLTF2, data: bytes) -> bytes:
    """A document and its buffer in one file."""
    document.set_binary_blob(data)
    return b"".join(document.save_to_bytes())


def describe(asset: PlainAsset, picture_uri: str | None = None) -> tuple[gltf.GLTF2, bytes]:
    """The document and its one buffer, which holds the picture unless that has a place of its own."""
    binary = Binary()
    document = gltf.GLTF2(
        asset=file_info(asset.info),
        scene=0,
        scenes=[gltf.Scene(name="avatar", nodes=[0])],
        nodes=[gltf.Node(name="avatar", mesh=0)],
        meshes=[gltf.Mesh(name="avatar", primitives=[mesh_primitive(asset, binary)])],
        materials=[material(textured=isinstance(asset, TexturedAsset))],
    )
    if isinstance(asset, Asset):
        add_skeleton(document, asset.skeleton, binary)
        add_morphs(document.meshes[0], asset, binary)
        document.animations = animations(asset, binary)
    add_levels(document, asset, binary)
    if isinstance(asset, TexturedAsset):
        add_texture(document)
        if picture_uri is None:
            document.images = [embedded(encode_png(asset.texture), binary)]
        else:
            document.images = [gltf.Image(name="base_color", uri=picture_uri)]
    document.accessors, document.bufferViews = binary.accessors, binary.views
    document.buffers = [gltf.Buffer(byteLength=len(binary.data))]
    return document, bytes(binary.data)


def add_skeleton(document: gltf.GLTF2, skeleton: Skeleton, binary: Binary) -> None:
    """Put the joints before the mesh's node, and a skin on it."""
    joint_count = len(skeleton.parents)
    document.skins = [joint_skin(skeleton, binary)]
    document.nodes = [*joint_nodes(skeleton), gltf.Node(name="avatar", mesh=0, skin=0)]
    document.scenes[0].nodes = [*np.flatnonzero(skeleton.parents < 0).tolist(), joint_count]


def add_morphs(mesh: gltf.Mesh, asset: Asset, binary: Binary) -> None:
    """Put the sliders at weight 0 and their names where importers look for them.

    No morph target moves a joint: how far the joints ought to move is told beside the names, in metres, for
    programs that move them.
    """
    if asset.morphs:
        mesh.primitives[0].targets = morph_targets(asset, binary)
        mesh.weights = [0.0] * len(asset.morphs)
        mesh.extras = {
            "targetNames": [morph.name for morph in asset.morphs],
            "targetJointOffsets": [morph.joints.round(6).tolist() for morph in asset.morphs],
        }


def embedded(png: bytes, binary: Binary) -> gltf.Image:
    return gltf.Image(name="base_color", mimeType=gltf.IMAGEPNG, bufferView=binary.add_bytes(png))


def add_texture(document: gltf.GLTF2) -> None:
    """Let the material's texture read the document's only picture."""
    document.samplers = [texture_sampler()]
    document.textures = [gltf.Texture(sampler=0, source=0)]


def mesh_primitive(asset: PlainAsset, binary: Binary) -> gltf.Primitive:
    attributes = gltf.Attributes(
        POSITION=binary.add_array(asset.vertices.astype(np.float32), gltf.ARRAY_BUFFER, bounds=True),
        NORMAL=binary.add_array(unit(asset.normals), gltf.ARRAY_BUFFER),
    )
    if isinstance(asset, TexturedAsset):
        attributes.TEXCOORD_0 = binary.add_array(asset.uv.astype(np.float32), gltf.ARRAY_BUFFER)
    if isinstance(asset, Asset):
        joint_type = np.uint8 if len(asset.skeleton.parents) <= 256 else np.uint16
        joints = np.where(asset.weights > 0, asset.joints, 0).astype(joint_type)
        attributes.JOINTS_0 = binary.add_array(joints, gltf.ARRAY_BUFFER)
        attributes.WEIGHTS_0 = binary.add_array(exact_weights(asset.weights), gltf.ARRAY_BUFFER)
    indices = binary.add_indices(asset.faces, len(asset.vertices))
    return gltf.Primitive(attributes=attributes, indices=indices, material=0, mode=gltf.TRIANGLES)


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


def material(textured: bool) -> gltf.Material:
    surface = gltf.PbrMetallicRoughness(metallicFactor=0.0, roughnessFactor=ROUGHNESS)
    if textured:
        surface.baseColorTexture = gltf.TextureInfo(index=0)
    return gltf.Material(name="avatar", pbrMetallicRoughness=surface, doubleSided=False)


def texture_sampler() -> gltf.Sampler:
    return gltf.Sampler(
        magFilter=gltf.LINEAR,
        minFilter=gltf.LINEAR_MIPMAP_LINEAR,
        wrapS=gltf.CLAMP_TO_EDGE,
        wrapT=gltf.CLAMP_TO_EDGE,
    )


def file_info(info: AssetInfo) -> gltf.Asset:
    """Where the file comes from, under the keys that scripts read: asset.generator and asset.extras."""
    extras = {
        "seed": info.seed,
        "weights_hash": info.weights_hash,
        "version": info.version,
        "licence": info.licence,
        "betas": [round(float(beta), 6) for beta in info.betas],
    }
    return gltf.Asset(
        version="2.0", generator=f"avatargen {info.version}", copyright=info.licence, extras=extras
    )
