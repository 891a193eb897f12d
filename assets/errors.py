"""The geometry half's own error."""

from avatargen.errors import AvatarGenError


class GeometryError(AvatarGenError):
    """A mesh or field has no usable surface, or a stage cannot keep its promise about the mesh."""
