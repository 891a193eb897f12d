"""AvatarGen: a generative model of clothed, animatable people, and the fields it gives.

generator = avatargen.load_generator()
avatar = generator.sample(seed=3)
avatar.sdf(points), avatar.color(points)
avatargen.export_avatar(avatargen.ExportRequest(seeds=3, out=Path("person.glb")))

Importing the package is light; torch is loaded with the first name that needs it.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from avatargen.avatar import Avatar
    from avatargen.export.many import export_many
    from avatargen.export.one import export_avatar
    from avatargen.export.request import ExportRequest
    from avatargen.loading import load_generator
    from avatargen.wardrobe.choosing import Traits

__version__ = "0.1.0"
MODULE_OF = {
    "Avatar": "avatar",
    "ExportRequest": "export.request",
    "Traits": "wardrobe.choosing",
    "export_avatar": "export.one",
    "export_many": "export.many",
    "load_generator": "loading",
}
__all__ = [
    "Avatar",
    "ExportRequest",
    "Traits",
    "__version__",
    "export_avatar",
    "export_many",
    "load_generator",
]


def __getattr__(name: str) -> object:
    if name in MODULE_OF:
        return getattr(import_module(f"avatargen.{MODULE_OF[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
