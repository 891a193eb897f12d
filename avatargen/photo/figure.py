"""The body as torch sees it: joints, landmarks and vertices as differentiable functions of shape and pose.

Rotations are kept as six numbers, the first two columns of a matrix before they are made orthonormal, which
are continuous everywhere (Zhou et al., arXiv 1812.07035, section 4.2). Letters: J joints, K landmarks, V
vertices, b betas.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from avatargen.body.model import Body
from avatargen.photo.anchors import ANCHORS


def matrices(six: Float[Tensor, "J 6"]) -> Float[Tensor, "J 3 3"]:
    """Rotations by Gram and Schmidt."""
    first = torch.nn.functional.normalize(six[:, :3], dim=1, eps=1e-6)
    second = six[:, 3:] - (first * six[:, 3:]).sum(dim=1, keepdim=True) * first
    second = torch.nn.functional.normalize(second, dim=1, eps=1e-6)
    return torch.stack([first, second, torch.linalg.cross(first, second)], dim=2)


def six_of(rotations: Float[Tensor, "J 3 3"]) -> Float[Tensor, "J 6"]:
    """The six numbers of rotations."""
    return torch.cat([rotations[:, :, 0], rotations[:, :, 1]], dim=1)


def turns(rotations: Float[Tensor, "J 3 3"]) -> Float[Tensor, "J 3"]:
    """Axis times angle, radians; smooth at angle zero, and short of half a turn."""
    axis = torch.stack(
        [
            rotations[:, 2, 1] - rotations[:, 1, 2],
            rotations[:, 0, 2] - rotations[:, 2, 0],
            rotations[:, 1, 0] - rotations[:, 0, 1],
        ],
        dim=1,
    )
    cosine = ((rotations.diagonal(dim1=1, dim2=2).sum(dim=1) - 1) / 2).clamp(-0.9999, 0.999999)
    angle = torch.arccos(cosine)[:, None]
    return axis * (angle / (2 * torch.sin(angle)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Posed:
    """A posed figure in the camera's space, metres."""

    joints: Float[Tensor, "J 3"]
    landmarks: Float[Tensor, "K 3"]
    rotations: Float[Tensor, "J 3 3"]  # world <- joint
    T_joints: Float[Tensor, "J 3"]  # where joints rest


@dataclass(frozen=True, kw_only=True, eq=False)
class Cloud:
    """Points that move with a body: where they rest, how they grow with its shape, and their weights."""

    points: Float[Tensor, "V 3"]
    directions: Float[Tensor, "V 3 b"]
    weights: Float[Tensor, "V J"]


class Figure:
    """One body's skeleton and landmarks. Joints and directions are those of `body`."""

    def __init__(self, body: Body, betas: int) -> None:
        self.body, self.names = body, body.joint_names
        self.parents = body.parents
        directions = body.shapedirs[:, :, :betas].astype(np.float64)
        regressor = body.J_regressor.astype(np.float64)
        self.betas = directions.shape[2]
        self.joints = tensor(regressor @ body.v_template)
        self.joint_directions = tensor(np.einsum("jv,vab->jab", regressor, directions))
        self.levels = levels_of(body.parents)
        place = {name: number for number, name in enumerate(self.names)}
        self.at = torch.tensor([place[anchor.joint] for anchor in ANCHORS])
        self.turned_by = torch.tensor([place[anchor.frame] for anchor in ANCHORS])
        self.offsets = tensor(np.array([anchor.offset for anchor in ANCHORS]))

    def pose(
        self, betas: Float[Tensor, " b"], rotations: Float[Tensor, "J 3 3"], move: Float[Tensor, "3"]
    ) -> Posed:
        """Joints and landmarks; rotations are those against each joint's parent."""
        rest = self.joints + self.joint_directions @ betas
        world: list[Tensor] = [rotations[0]] * len(self.names)
        place: list[Tensor] = [rest[0] + move] * len(self.names)
        for joints, parents in self.levels:
            above = torch.stack([world[parent] for parent in parents])
            turned = above @ rotations[joints]
            reach = (above @ (rest[joints] - rest[parents])[:, :, None])[:, :, 0]
            for number, joint in enumerate(joints):
                world[joint] = turned[number]
                place[joint] = place[parents[number]] + reach[number]
        every, places = torch.stack(world), torch.stack(place)
        landmarks = places[self.at] + (every[self.turned_by] @ self.offsets[:, :, None])[:, :, 0]
        return Posed(joints=places, landmarks=landmarks, rotations=every, T_joints=rest)

    def skin(self, posed: Posed, betas: Float[Tensor, " b"], cloud: Cloud) -> Float[Tensor, "V 3"]:
        """Points by linear blend skinning."""
        shaped = cloud.points + cloud.directions @ betas
        moves = posed.joints - (posed.rotations @ posed.T_joints[:, :, None])[:, :, 0]
        blended = (cloud.weights @ posed.rotations.reshape(len(self.names), 9)).reshape(-1, 3, 3)
        return (blended @ shaped[:, :, None])[:, :, 0] + cloud.weights @ moves


def tensor(values: np.ndarray) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(values, dtype=np.float32))


def levels_of(parents: np.ndarray) -> list[tuple[list[int], list[int]]]:
    """Joints as far from the root as one another, and their parents, the nearest first."""
    depth = [0] * len(parents)
    for joint in range(1, len(parents)):
        depth[joint] = depth[parents[joint]] + 1
    found = []
    for level in range(1, max(depth) + 1):
        joints = [joint for joint in range(len(parents)) if depth[joint] == level]
        found.append((joints, [int(parents[joint]) for joint in joints]))
    return found
