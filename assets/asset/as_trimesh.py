"""An asset as trimesh's mesh, for those who go on with that library."""

import trimesh
from PIL import Image
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from assets.asset.asset import PlainAsset, TexturedAsset


def as_trimesh(asset: PlainAsset) -> trimesh.Trimesh:
    """See `PlainAsset.to_trimesh`."""
    return trimesh.Trimesh(
        vertices=asset.vertices,
        faces=asset.faces,
        vertex_normals=asset.normals,
        visual=texture_of(asset) if isinstance(asset, TexturedAsset) else None,
        process=False,
    )


def texture_of(asset: TexturedAsset) -> TextureVisuals:
    """uv and pictures; trimesh's uv start at the texture's bottom left."""
    normal_map, occlusion = asset.normal_map, asset.occlusion
    material = PBRMaterial(
        baseColorTexture=Image.fromarray(asset.texture),
        normalTexture=None if normal_map is None else Image.fromarray(normal_map.texels),
        occlusionTexture=None if occlusion is None else Image.fromarray(occlusion),
        metallicFactor=0.0,
        roughnessFactor=1.0,
    )
    return TextureVisuals(uv=asset.uv * [1, -1] + [0, 1], material=material)
