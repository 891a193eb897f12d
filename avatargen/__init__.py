"""AvatarGen: a generative model of clothed, animatable people, and the fields it gives.

generator = avatargen.load_generator()
avatar = generator.sample(seed=3)
avatar.sdf(points), avatar.color(points)

Importing the package is light; torch is loaded with the first name that needs it.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from avatargen.avatar import Avatar, load_generator

__version__ = "0.1.0"
__all__ = ["Avatar", "__version__", "load_generator"]


def __getattr__(name: str) -> object:
    if name in ("Avatar", "load_generator"):
        from avatargen import avatar

        return getattr(avatar, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
