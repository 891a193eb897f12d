"""The geometry half: from functions of points to a rigged, textured asset. Nothing here knows a network."""

from assets.animate import animate, figure_of
from assets.asset import Asset, PlainAsset, TexturedAsset
from assets.build_config import BuildConfig
from assets.errors import GeometryError
from assets.extract import ExtractConfig, extract
from assets.levels import with_levels
from assets.pipeline import build, build_content
from assets.surface import Surface

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
