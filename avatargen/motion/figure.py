"""What clips need to know of a person: where the joints are in the T-pose, and how high the ground is."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from avatargen.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Figure:
    """Joints in the T-pose and the height of the soles there, metres."""

    joint_names: tuple[str, ...]
    joints: Float64[np.ndarray, "J 3"]
    ground: float

    def __getitem__(self, name: str) -> Float64[np.ndarray, "3"]:
        """A joint's place. Raises InputError where the skeleton has no such joint."""
        if name not in self.joint_names:
            raise InputError(f"clip: the body has no joint {name}; give a body with SMPL's joint names")
        return self.joints[self.joint_names.index(name)]
