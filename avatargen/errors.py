"""The error tree: everything this project raises on purpose.

    AvatarGenError
    ├── InputError      a bad argument, option or file from the user (also a ValueError)
    ├── FieldError      a field gave NaN or infinity
    ├── TrainingError   training diverged, or its state is damaged or of other networks
    └── assets.errors.GeometryError   a mesh or field has no usable surface

Messages are one sentence each: what was found, what was wanted, what to do. Only the command line turns
an error into one printed line; everything else lets it pass.
"""


class AvatarGenError(Exception):
    """Base of every error raised on purpose."""


class InputError(AvatarGenError, ValueError):
    """A bad argument, option or file from the user."""


class FieldError(AvatarGenError):
    """A signed distance or colour field gave NaN or infinity."""


class TrainingError(AvatarGenError):
    """Training diverged, or what it continues from is damaged or of other networks."""
