"""Many bodies posed at once, as tensors on any device; and the way back from each to the canonical space.

The numbers are those of `avatargen.body.model` and `avatargen.generator.canonical`: float64 inside, which
costs next to nothing for bodies, and float32 outside.

Letters: B people, V vertices, J joints, b directions of shape, P numbers of pose. Metres, radians.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from jaxtyping import Float, Float64, Int
from scipy.spatial import KDTree
from torch import Tensor

from avatargen.body.model import Body, pose_canonically
from avatargen.body.skinning import MINIMUM_DETERMINANT, blend
from avatargen.errors import InputError
from avatargen.generator.layers import may_branch, without_autocast
from avatargen.generator.nearest import by_trees, nearest_vertices

AT_VERTEX = 1e-9  # metres; keeps inverse distances finite


@dataclass(frozen=True, kw_only=True, eq=False)
class PosedBodies:
    """Posed vertices, and each vertex's affine map to the canonical space."""

    vertices: Float[Tensor, "B V 3"]
    T_canonical_posed: Float[Tensor, "B V 3 4"]

    @cached_property
    def trees(self) -> list[KDTree]:
        """One a person; asked on the CPU alone."""
        return [KDTree(own.double().numpy()) for own in self.vertices]

    def nearest(
        self, points: Float[Tensor, "B N 3"], count: int = 1
    ) -> tuple[Float[Tensor, "B N K"], Int[Tensor, "B N K"]]:
        """Distances to the nearest vertices and which these are, the nearest first; without gradients."""
        points = points.detach()
        if may_branch(points):
            return by_trees(self.trees, points, count)
        return nearest_vertices(points, self.vertices, count)

    def to_canonical(
        self, points: Float[Tensor, "B N 3"], count: int = 1
    ) -> tuple[Float[Tensor, "B N 3"], Float[Tensor, "B N"], Int[Tensor, "B N"]]:
        """Canonical points by the maps of the nearest vertices, blended by inverse distance; the distance to
        the nearest one, and its number.

        Differentiable in the points, with the choice and the blend of vertices held fixed.

        Raises:
            InputError: `count` is not 1 to 4.
        """
        if not 1 <= count <= 4:
            raise InputError(f"canonical map: nearest = {count}; choose 1 to 4 body vertices")
        away, index = self.nearest(points, count)
        weights = 1 / (away + AT_VERTEX)
        weights = weights / weights.sum(dim=2, keepdim=True)
        first = torch.arange(len(index), device=index.device)[:, None] * self.vertices.shape[1]
        table = self.T_canonical_posed.flatten(2).flatten(0, 1)
        maps = torch.zeros((), dtype=points.dtype, device=points.device)
        for k in range(count):
            rows = table.index_select(0, (first + index[..., k]).flatten()).unflatten(0, points.shape[:2])
            maps = rows if count == 1 else maps + rows * weights[..., k, None]
        maps = maps.to(points.dtype).unflatten(2, (3, 4))
        canonical = (maps[..., :3] * points[:, :, None]).sum(dim=3) + maps[..., 3]
        return canonical, away[..., 0], index[..., 0]


@dataclass(frozen=True, kw_only=True, eq=False)
class Posing:
    """What posing takes of a body, on a device."""

    template: Float64[Tensor, "V 3"]
    shapedirs: Float64[Tensor, "V 3 b"]
    posedirs: Float64[Tensor, "V 3 P"] | None
    regressor: Float64[Tensor, "J V"]
    weights: Float64[Tensor, "V J"]
    heaviest: Int[Tensor, " V"]  # joint of each vertex
    levels: Sequence[tuple[Tensor, Tensor]]  # by depth: numbers of joints, places of their parents
    order: Int[Tensor, " J"]  # place of each joint in the levels, one after the other
    parents: Int[Tensor, " J"]
    canonical_rest: Float64[Tensor, "V 3"]  # shaped as the canonical body, its pose's blend shapes added
    T_canonical_rest: Float64[Tensor, "V 3 4"]

    def __call__(self, betas: Float[Tensor, "B b"], poses: Float[Tensor, "B J 3"]) -> PosedBodies:
        """Shape and pose bodies, without gradients. Fewer betas than directions: the rest are zero."""
        with torch.no_grad(), without_autocast(betas.device):
            return self.posed(betas.double(), poses.double())

    def posed(self, betas: Float64[Tensor, "B b"], poses: Float64[Tensor, "B J 3"]) -> PosedBodies:
        shaped = self.template + (self.shapedirs[..., : betas.shape[1]] @ betas.T).permute(2, 0, 1)
        joints = self.regressor @ shaped
        rotations = rotation_matrices(poses)
        rest = shaped
        if self.posedirs is not None:
            turn = rotations[:, 1:] - torch.eye(3, dtype=rotations.dtype, device=rotations.device)
            rest = shaped + (self.posedirs @ turn.flatten(1).T).permute(2, 0, 1)
        T_posed_rest = self.transforms(joints, rotations)  # B J 3 4
        blended = (self.weights @ T_posed_rest.flatten(2)).unflatten(2, (3, 4))
        vertices = product(blended[..., :3], rest[..., None])[..., 0] + blended[..., 3]
        back = self.way_back(blended, T_posed_rest, self.canonical_rest - rest)
        return PosedBodies(vertices=vertices.float(), T_canonical_posed=back.float())

    def transforms(
        self, joints: Float64[Tensor, "B J 3"], rotations: Float64[Tensor, "B J 3 3"]
    ) -> Float64[Tensor, "B J 3 4"]:
        """Posed <- rest of every joint: forward kinematics, level by level of the skeleton."""
        local = joints - joints[:, self.parents]
        turns, places = [rotations[:, :1]], [joints[:, :1]]
        for index, parent in self.levels:
            turns.append(product(turns[-1][:, parent], rotations[:, index]))
            step = product(turns[-2][:, parent], local[:, index, :, None])[..., 0]
            places.append(places[-1][:, parent] + step)
        turn, place = (torch.cat(part, dim=1)[:, self.order] for part in (turns, places))
        moved = place - product(turn, joints[..., None])[..., 0]
        return torch.cat([turn, moved[..., None]], dim=-1)

    def way_back(
        self,
        blended: Float64[Tensor, "B V 3 4"],
        T_posed_rest: Float64[Tensor, "B J 3 4"],
        shift: Float64[Tensor, "B V 3"],
    ) -> Float64[Tensor, "B V 3 4"]:
        """Canonical <- posed of every vertex: its skinning undone, blend shapes exchanged, the canonical
        skinning. Where a blend has no inverse the vertex follows its heaviest joint, as in `invert_blend`.
        """
        across, determinant = adjugate(blended[..., :3])
        regular = determinant > MINIMUM_DETERMINANT
        alone = T_posed_rest[:, self.heaviest]
        rigid = alone[..., :3].mT
        inverse = across / torch.where(regular, determinant, 1.0)[..., None, None]
        inverse = torch.where(regular[..., None, None], inverse, rigid)
        moved = torch.where(regular[..., None], blended[..., 3], alone[..., 3])
        total = torch.where(regular, self.weights.sum(dim=1), 1.0)[..., None]  # one, but for rounding
        rest = shift - product(inverse, moved[..., None])[..., 0] / total
        turn = self.T_canonical_rest[..., :3]
        end = (
            product(turn.expand_as(inverse), rest[..., None])[..., 0] + self.T_canonical_rest[..., 3] / total
        )
        return torch.cat([product(turn.expand_as(inverse), inverse), end[..., None]], dim=-1)


def posing_of(body: Body, device: torch.device | str = "cpu") -> Posing:
    """A body's arrays on a device."""

    def exact(array: np.ndarray) -> Float64[Tensor, "..."]:
        return torch.from_numpy(np.array(array, dtype=np.float64)).to(device)

    canonical = pose_canonically(body)
    levels, order = levels_of(body.parents)
    pairs = [tuple(torch.from_numpy(part).to(device) for part in level) for level in levels]
    return Posing(
        template=exact(body.v_template),
        shapedirs=exact(body.shapedirs),
        posedirs=None if body.posedirs is None else exact(body.posedirs),
        regressor=exact(body.J_regressor),
        weights=exact(body.weights),
        heaviest=torch.from_numpy(body.weights.argmax(axis=1)).to(device),
        levels=[(index, parent) for index, parent in pairs],
        order=torch.from_numpy(order).to(device),
        parents=torch.from_numpy(body.parents.clip(0)).to(device),
        canonical_rest=exact(canonical.shaped.vertices + canonical.offsets),
        T_canonical_rest=exact(blend(body.weights, canonical.T_posed_rest)[:, :3]),
    )


def levels_of(parents: np.ndarray) -> tuple[list[tuple[np.ndarray, np.ndarray]], np.ndarray]:
    """Joints by their depth below the root, each level with the places of its parents in the level above;
    and the place of each joint in all levels, the root first.
    """
    depth = np.zeros(len(parents), dtype=np.int64)
    for joint in range(1, len(parents)):
        depth[joint] = depth[parents[joint]] + 1
    rows = [np.flatnonzero(depth == level) for level in range(depth.max() + 1)]
    pairs = [(row, np.searchsorted(above, parents[row])) for above, row in itertools.pairwise(rows)]
    return pairs, np.argsort(np.concatenate(rows))


def product(a: Float[Tensor, "*batch i j"], b: Float[Tensor, "*batch j k"]) -> Float[Tensor, "*batch i k"]:
    """Products of small matrices, multiplied and summed number by number: no precision is traded away."""
    return (a[..., None] * b[..., None, :, :]).sum(dim=-2)


def rotation_matrices(axis_angle: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 3 3"]:
    """Rodrigues' formula, exact and smooth at angle zero."""
    angle = axis_angle.square().sum(dim=-1).sqrt()[..., None, None]
    x, y, z = axis_angle.unbind(-1)
    zero = torch.zeros_like(x)
    cross = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], dim=-1).unflatten(-1, (3, 3))
    sine_over_angle = torch.sinc(angle / torch.pi)
    versine_over_square = 0.5 * torch.sinc(angle / (2 * torch.pi)).square()
    one = torch.eye(3, dtype=axis_angle.dtype, device=axis_angle.device)
    return one + sine_over_angle * cross + versine_over_square * product(cross, cross)


def adjugate(
    matrices: Float[Tensor, "*batch 3 3"],
) -> tuple[Float[Tensor, "*batch 3 3"], Float[Tensor, "*batch"]]:
    """What over the determinant is the inverse, and the determinant."""
    a, b, c = matrices.unbind(-2)
    rows = [torch.linalg.cross(b, c), torch.linalg.cross(c, a), torch.linalg.cross(a, b)]
    return torch.stack(rows, dim=-1), (a * rows[0]).sum(dim=-1)
