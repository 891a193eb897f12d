"""A rigged asset as USD: UsdSkel skeleton and skinned mesh, UsdPreviewSurface. Same asset, same bytes.

    /avatar            SkelRoot, the default prim (Xform for an asset without a skeleton)
    /avatar/skeleton   Skeleton: joints are paths, binds in world space, rests relative to the parent
    /avatar/mesh       Mesh: one normal, uv and four influences a point
    /avatar/material   the material, beside them: programs make an object of a scope around it

An asset of parts has a mesh and a material for each: /avatar/top, /avatar/top_material.

Metres, y up, facing +z, faces counter-clockwise from outside, as ours; the uv origin alone is at the bottom
left there. USD's matrices act on row vectors, so ours are transposed. Letters: W vertices, J joints.
"""

# USD's modules fill themselves when they load, so their names are unknown before.
# pyright: reportAttributeAccessIssue=false

import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from jaxtyping import Float
from pxr import Gf, Kind, Sdf, Tf, Usd, UsdGeom, UsdShade, UsdSkel, Vt

from assets.asset.asset import Asset, AssetInfo, PlainAsset, TexturedAsset, meshes_of
from assets.asset.rig import Skeleton
from avatargen.errors import InputError
from exporters.encoding import SUFFIXES, Encoding
from exporters.file import File
from exporters.glb import PICTURES, ROUGHNESS, exact_weights, picture_files, unit
from exporters.package import pack
from exporters.usd_motion import add_animations, add_extents, add_morphs

ROOT = "/avatar"


def encode(asset: PlainAsset, names: tuple[str, ...], encoding: Encoding) -> tuple[File, ...]:
    """NAME.usda or NAME.usdc and its pictures, or NAME.usdz, which holds all."""
    name, suffix = names[0], Path(names[0]).suffix.lower()
    picture_names = names[1:]
    if suffix == ".usdz":
        picture_names = tuple(f"{picture}{SUFFIXES[encoding.pictures]}" for picture in PICTURES)
    stage, files = make_stage(asset), ()
    folder = "" if suffix == ".usdz" else "./"
    for part, mesh in meshes_of(asset, "mesh").items():
        if isinstance(mesh, TexturedAsset):
            prefix = "" if mesh is asset else f"{part}_"
            named = picture_files(mesh, [prefix + picture for picture in picture_names], encoding)
            paths = {picture: f"{folder}{file.name}" for picture, file in named.items()}
            add_material(stage, f"{ROOT}/{part}", f"{ROOT}/{prefix}material", paths)
            files = (*files, *named.values())
    if suffix == ".usdz":
        return (File(name, pack((File("avatar.usdc", stage_bytes(stage, ".usdc")), *files))),)
    return (File(name, stage_bytes(stage, suffix)), *files)


def stage_bytes(stage: Usd.Stage, suffix: str) -> bytes:
    """The stage as text (.usda) or in USD's binary form (.usdc), which its library writes to files alone.

    Raises:
        InputError: there is no room for that file in the system's folder for such files.
    """
    layer = stage.GetRootLayer()
    if suffix == ".usda":
        return layer.ExportToString().encode()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "avatar.usdc"
        try:
            layer.Export(str(path))
            return path.read_bytes()
        except (Tf.ErrorException, OSError) as error:
            reason = str(error).strip().splitlines()[-1].strip()
            place = tempfile.gettempdir()
            raise InputError(
                f"cannot write {suffix} by way of {place} ({reason}); make room there, or set TMPDIR"
            ) from error


def make_stage(asset: PlainAsset) -> Usd.Stage:
    """The mesh, and what else the asset has but its texture."""
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    kind = UsdSkel.Root if isinstance(asset, Asset) else UsdGeom.Xform
    root = kind.Define(stage, ROOT)
    stage.SetDefaultPrim(root.GetPrim())
    Usd.ModelAPI(root).SetKind(Kind.Tokens.component)
    describe_source(stage.GetRootLayer(), asset.info)
    meshes = meshes_of(asset, "mesh")
    made = [(add_mesh(stage, f"{ROOT}/{name}", mesh), mesh) for name, mesh in meshes.items()]
    if isinstance(asset, Asset):
        root.CreateExtentAttr(extent(asset))
        skeleton = add_skeleton(stage, asset.skeleton)
        rigged = [(prim, mesh) for prim, mesh in made if isinstance(mesh, Asset)]
        for prim, mesh in rigged:
            bind_mesh(prim, mesh, skeleton)
        add_animations(stage, asset, skeleton)
        add_extents(root, rigged)
        for prim, mesh in rigged:
            add_morphs(stage, mesh, prim)
    return stage


def describe_source(layer: Sdf.Layer, info: AssetInfo) -> None:
    """Where the file comes from, in the layer's own data."""
    layer.documentation = f"avatargen {info.version}, seed {info.seed}; {info.licence}"
    layer.customLayerData = {
        "creator": f"avatargen {info.version}",
        "avatargen": {
            "seed": str(info.seed),  # USD's integers end before the largest seed
            "weights_hash": info.weights_hash,
            "version": info.version,
            "licence": info.licence,
            "betas": Vt.DoubleArray([round(float(beta), 6) for beta in info.betas]),
            **({} if info.height_m is None else {"height_m": round(info.height_m, 4)}),
            **({"attributes": dict(info.facts)} if info.facts else {}),
        },
    }


def joint_paths(skeleton: Skeleton) -> list[str]:
    """A path for each joint, root first: pelvis/spine1. Characters that no path may hold become _."""
    used: set[str] = set()
    paths: list[str] = []
    for name, parent in zip(skeleton.joint_names, skeleton.parents, strict=True):
        path = Tf.MakeValidIdentifier(name)
        if parent >= 0:
            path = f"{paths[parent]}/{path}"
        while path in used:
            path += "_"
        used.add(path)
        paths.append(path)
    return paths


def row_matrices(transforms: Float[np.ndarray, "J 4 4"]) -> Vt.Matrix4dArray:
    return Vt.Matrix4dArray.FromNumpy(np.ascontiguousarray(transforms.transpose(0, 2, 1), dtype=np.float64))


def add_skeleton(stage: Usd.Stage, skeleton: Skeleton) -> UsdSkel.Skeleton:
    prim = UsdSkel.Skeleton.Define(stage, f"{ROOT}/skeleton")
    prim.CreateJointsAttr(joint_paths(skeleton))
    prim.CreateJointNamesAttr(list(skeleton.joint_names))
    prim.CreateBindTransformsAttr(row_matrices(skeleton.T_world_joint))
    prim.CreateRestTransformsAttr(row_matrices(skeleton.T_parent_joint))
    return prim


def add_mesh(stage: Usd.Stage, path: str, asset: PlainAsset) -> UsdGeom.Mesh:
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(asset.vertices))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(asset.faces), 3))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(asset.faces.astype(np.int32).ravel()))
    mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(unit(asset.normals)))
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    mesh.CreateExtentAttr(extent(asset))
    mesh.CreateDoubleSidedAttr(False)
    if isinstance(asset, TexturedAsset):
        st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
            "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex
        )
        st.Set(Vt.Vec2fArray.FromNumpy(np.stack([asset.uv[:, 0], 1 - asset.uv[:, 1]], axis=1)))
    return mesh


def extent(asset: PlainAsset) -> Vt.Vec3fArray:
    return Vt.Vec3fArray.FromNumpy(np.stack([asset.vertices.min(axis=0), asset.vertices.max(axis=0)]))


def bind_mesh(mesh: UsdGeom.Mesh, asset: Asset, skeleton: UsdSkel.Skeleton) -> None:
    """Four influences a point; the mesh stands in the skeleton's space."""
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    joints = np.where(asset.weights > 0, asset.joints, 0).astype(np.int32)
    binding.CreateJointIndicesPrimvar(False, 4).Set(Vt.IntArray.FromNumpy(joints.ravel()))
    binding.CreateJointWeightsPrimvar(False, 4).Set(
        Vt.FloatArray.FromNumpy(exact_weights(asset.weights).ravel())
    )
    binding.CreateGeomBindTransformAttr(Gf.Matrix4d(1.0))


def add_material(stage: Usd.Stage, mesh: str, path: str, pictures: Mapping[str, str]) -> None:
    """UsdPreviewSurface with the base colour and perhaps a normal map and occlusion, on the mesh; cloth and
    skin scatter light. `pictures` are the files, by name."""
    material = UsdShade.Material.Define(stage, path)
    reader = add_shader(
        stage, f"{path}/st", "UsdPrimvarReader_float2", varname=(Sdf.ValueTypeNames.String, "st")
    )
    surface = add_shader(
        stage,
        f"{path}/surface",
        "UsdPreviewSurface",
        roughness=(Sdf.ValueTypeNames.Float, ROUGHNESS),
        metallic=(Sdf.ValueTypeNames.Float, 0.0),
    )
    texture = add_picture(stage, f"{path}/base_color", pictures["base_color"], reader, "sRGB")
    connect(surface, "diffuseColor", Sdf.ValueTypeNames.Color3f, texture, "rgb", Sdf.ValueTypeNames.Float3)
    if "normal" in pictures:
        texture = add_picture(stage, f"{path}/normal", pictures["normal"], reader, "raw")
        texture.CreateInput("scale", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(2, 2, 2, 1))
        texture.CreateInput("bias", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(-1, -1, -1, 0))
        connect(surface, "normal", Sdf.ValueTypeNames.Normal3f, texture, "rgb", Sdf.ValueTypeNames.Float3)
    if "occlusion" in pictures:
        texture = add_picture(stage, f"{path}/occlusion", pictures["occlusion"], reader, "raw")
        connect(surface, "occlusion", Sdf.ValueTypeNames.Float, texture, "r", Sdf.ValueTypeNames.Float)
    output = surface.CreateOutput("surface", Sdf.ValueTypeNames.Token)
    material.CreateSurfaceOutput().ConnectToSource(output)
    UsdShade.MaterialBindingAPI.Apply(stage.GetPrimAtPath(mesh)).Bind(material)


def add_picture(
    stage: Usd.Stage, path: str, file: str, reader: UsdShade.Shader, color_space: str
) -> UsdShade.Shader:
    """A texture at the mesh's uv."""
    texture = add_shader(
        stage,
        path,
        "UsdUVTexture",
        file=(Sdf.ValueTypeNames.Asset, file),
        sourceColorSpace=(Sdf.ValueTypeNames.Token, color_space),
        wrapS=(Sdf.ValueTypeNames.Token, "clamp"),
        wrapT=(Sdf.ValueTypeNames.Token, "clamp"),
    )
    connect(texture, "st", Sdf.ValueTypeNames.Float2, reader, "result", Sdf.ValueTypeNames.Float2)
    return texture


def add_shader(
    stage: Usd.Stage, path: str, shader_id: str, **inputs: tuple[Sdf.ValueTypeName, object]
) -> UsdShade.Shader:
    shader = UsdShade.Shader.Define(stage, path)
    shader.CreateIdAttr(shader_id)
    for input_name, (value_type, value) in inputs.items():
        shader.CreateInput(input_name, value_type).Set(value)
    return shader


def connect(
    reader: UsdShade.Shader,
    input_name: str,
    input_type: Sdf.ValueTypeName,
    source: UsdShade.Shader,
    output_name: str,
    output_type: Sdf.ValueTypeName,
) -> None:
    """Let an input read another shader's output."""
    output = source.CreateOutput(output_name, output_type)
    reader.CreateInput(input_name, input_type).ConnectToSource(output)
