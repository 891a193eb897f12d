"""The geometry half: from functions of points to a rigged, textured asset. Nothing here knows a network.

Importing the package is light; a name's module is loaded when the name is first asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from assets.asset.animate import animate, figure_of
    from assets.asset.asset import Asset, PlainAsset, TexturedAsset
    from assets.asset.levels import with_levels
    from assets.build_config import BuildConfig
    from assets.choose import choose_settings
    from assets.errors import GeometryError
    from assets.isosurface.extract import ExtractConfig, extract
    from assets.mesh.surface import Surface
    from assets.pipeline import build, build_content
    from assets.scenes import SCENES

MODULE_OF = {
    "Asset": "asset.asset",
    "BuildConfig": "build_config",
    "ExtractConfig": "isosurface.extract",
    "GeometryError": "errors",
    "PlainAsset": "asset.asset",
    "SCENES": "scenes",
    "Surface": "mesh.surface",
    "TexturedAsset": "asset.asset",
    "animate": "asset.animate",
    "build": "pipeline",
    "build_content": "pipeline",
    "choose_settings": "choose",
    "extract": "isosurface.extract",
    "figure_of": "asset.animate",
    "with_levels": "asset.levels",
}
__all__ = [
    "SCENES",
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
    "choose_settings",
    "extract",
    "figure_of",
    "with_levels",
]


def __getattr__(name: str) -> object:
    if name in MODULE_OF:
        return getattr(import_module(f"assets.{MODULE_OF[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
