"""The geometry half: from functions of points to a rigged, textured asset. Nothing here knows a network."""

from assets.asset.animate import animate, figure_of
from assets.asset.asset import Asset, PlainAsset, TexturedAsset
from assets.asset.levels import with_levels
from assets.build_config import BuildConfig
from assets.errors import GeometryError
from assets.isosurface.extract import ExtractConfig, extract
from assets.mesh.surface import Surface
from assets.pipeline import build, build_content

__all__ = [
    "Asset",
    "BuildConfig",
    "ExtractConfig",
    "GeometryError",
    "PlainAsset",
    "Surface",
    "TexturedAsset",
    "animate",
    "build",
    "build_content",
    "extract",
    "figure_of",
    "with_levels",
]
