"""Cameras, and the vector of 25 numbers in which EG3D's labels carry them.

A camera looks along its own +z with x right and y down (OpenCV); `cam2world` takes camera points to world
points, metres. Intrinsics are normalised by the picture's size: a picture is 1 wide and 1 high, whatever its
pixels.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

FRONT_DISTANCE = 3.2  # metres
FRONT_FOCAL = 1.4  # of the picture's height: 39 degrees


@dataclass(frozen=True, kw_only=True)
class Camera:
    """A batch of cameras. The last row of intrinsics is 0 0 1, as is the first number of the second one."""

    cam2world: Float[Tensor, "B 4 4"]
    intrinsics: Float[Tensor, "B 3 3"]

    @property
    def vector(self) -> Float[Tensor, "B 25"]:
        """EG3D's label: cam2world, then intrinsics, both row by row."""
        return torch.cat([self.cam2world.flatten(1), self.intrinsics.flatten(1)], dim=1)


def camera_of_vector(vector: Float[Tensor, "B 25"]) -> Camera:
    """The cameras of EG3D's labels."""
    cam2world, intrinsics = vector.split([16, 9], dim=1)
    return Camera(cam2world=cam2world.unflatten(1, (4, 4)), intrinsics=intrinsics.unflatten(1, (3, 3)))


def front_camera(batch: int = 1) -> Camera:
    """The camera straight before the person's pelvis: the one that avatars are sampled with.

    The person stands at the origin and faces +z; the camera stands on +z and looks back.
    """
    cam2world = torch.diag(torch.tensor([1.0, -1.0, -1.0, 1.0]))
    cam2world[2, 3] = FRONT_DISTANCE
    intrinsics = torch.tensor([[FRONT_FOCAL, 0.0, 0.5], [0.0, FRONT_FOCAL, 0.5], [0.0, 0.0, 1.0]])
    return Camera(cam2world=cam2world.expand(batch, 4, 4), intrinsics=intrinsics.expand(batch, 3, 3))


def rays(camera: Camera, size: int) -> tuple[Float[Tensor, "B P 3"], Float[Tensor, "B P 3"]]:
    """Origins and unit directions, in world space, through the centres of size x size pixels, row by row."""
    centers = (torch.arange(size, device=camera.cam2world.device) + 0.5) / size
    v, u = torch.meshgrid(centers, centers, indexing="ij")
    focal_x, skew, middle_x = (camera.intrinsics[:, 0, i, None] for i in range(3))
    focal_y, middle_y = camera.intrinsics[:, 1, 1, None], camera.intrinsics[:, 1, 2, None]
    y = (v.flatten() - middle_y) / focal_y
    x = (u.flatten() - middle_x - skew * y) / focal_x
    local = torch.stack([x, y, torch.ones_like(x)], dim=2)
    # summed number by number: products of matrices may be rounded to ten bits on a GPU
    direction = (camera.cam2world[:, None, :3, :3] * local[:, :, None]).sum(dim=3)
    direction = direction / direction.norm(dim=-1, keepdim=True)
    return camera.cam2world[:, None, :3, 3].expand_as(direction), direction
