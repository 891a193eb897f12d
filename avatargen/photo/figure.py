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


class Figure:
    """One body's skeleton and some of its vertices. Joints and directions are those of `body`."""

    def __init__(self, body: Body, vertices: int = 1500, betas: int = 10) -> None:
        self.body, self.names = body, body.joint_names
        self.parents = body.parents
        directions = body.shapedirs[:, :, :betas].astype(np.float64)
        regressor = body.J_regressor.astype(np.float64)
        self.betas = directions.shape[2]
        chosen = spread_out(body.v_template, vertices)
        self.joints = tensor(regressor @ body.v_template)
        self.joint_directions = tensor(np.einsum("jv,vab->jab", regressor, directions))
        self.vertices = tensor(body.v_template[chosen])
        self.directions = tensor(directions[chosen])
        self.weights = tensor(body.weights[chosen])
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

    def skin(self, posed: Posed, betas: Float[Tensor, " b"]) -> Float[Tensor, "V 3"]:
        """The chosen vertices by linear blend skinning."""
        shaped = self.vertices + self.directions @ betas
        moves = posed.joints - (posed.rotations @ posed.T_joints[:, :, None])[:, :, 0]
        blended = (self.weights @ posed.rotations.reshape(len(self.names), 9)).reshape(-1, 3, 3)
        return (blended @ shaped[:, :, None])[:, :, 0] + self.weights @ moves


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


def spread_out(points: Float[np.ndarray, "V 3"], count: int) -> np.ndarray:
    """Some of the points, about evenly over space: one of each cell of a grid."""
    cell = 0.2
    while True:
        _, first = np.unique(np.floor(points / cell).astype(np.int64), axis=0, return_index=True)
        if len(first) >= min(count, len(points) // 2):
            return np.sort(first)
        cell *= 0.9
