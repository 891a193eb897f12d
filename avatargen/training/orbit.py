"""Cameras around a person, as the mapping network takes them."""

import math

import torch
from jaxtyping import Float
from torch import Tensor

from avatargen.generator.camera import Camera, front_camera


def orbit_cameras(people: int, random: torch.Generator) -> Float[Tensor, "B 25"]:
    """Camera vectors all around the person. The fields must not depend on them, so every step draws
    new ones.
    """
    angle = torch.rand(people, generator=random) * 2 * math.pi
    turn = torch.eye(4).repeat(people, 1, 1)
    turn[:, 0, 0] = turn[:, 2, 2] = angle.cos()
    turn[:, 0, 2], turn[:, 2, 0] = angle.sin(), -angle.sin()
    front = front_camera(people)
    return Camera(cam2world=turn @ front.cam2world, intrinsics=front.intrinsics).vector
