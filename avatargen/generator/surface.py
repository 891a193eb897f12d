"""Bodies' surfaces as the field needs them, on the device that asks.

Letters: B people, N points, V vertices. Metres.
"""

from functools import cached_property

import numpy as np
import torch
from jaxtyping import Float, Int64
from torch import Tensor

from avatargen.body.distance import BodyDistance
from avatargen.body.model import Body, pose_canonically
from avatargen.generator.closest import Surfaces, Topology, closest_on, surfaces_of, topology_of
from avatargen.generator.decoder import BodyPoints, attach_gradient, body_points
from avatargen.generator.layers import may_branch
from avatargen.generator.posing import Posing, posing_of


class BodySurface:
    """Surfaces of bodies as the field needs them: distances, faces and vertices; one, or one a person."""

    def __init__(self, vertices: Float[Tensor, "B V 3"], topology: Topology) -> None:
        self.vertices, self.topology = vertices, topology

    @cached_property
    def trees(self) -> list[BodyDistance]:
        """One a body, for the CPU."""
        return [BodyDistance(own.numpy(), self.topology.faces.numpy()) for own in self.vertices]

    @cached_property
    def surfaces(self) -> Surfaces:
        """For other devices."""
        return surfaces_of(self.vertices, self.topology)

    def at(self, points: Float[Tensor, "B N 3"], near: Int64[Tensor, "B N"]) -> BodyPoints:
        """The bodies at points of their space, of which vertices are known that are not far; the distance
        passes gradients on to the points.
        """
        shape, count = points.shape[:2], len(self.vertices)
        if may_branch(points):
            parts = points.detach().reshape(count, -1, 3).numpy()
            hits = [tree.query(part) for tree, part in zip(self.trees, parts, strict=True)]
            found = [body_points(hit, self.topology.faces) for hit in hits]
            distance, vertices, barycentric = (
                torch.cat([getattr(one, name) for one in found]).reshape(*shape, *rest)
                for name, rest in (("distance", ()), ("vertices", (3,)), ("barycentric", (3,)))
            )
        else:
            closest = closest_on(self.surfaces, points.reshape(count, -1, 3), near.reshape(count, -1))
            distance, barycentric = closest.distance.view(shape), closest.barycentric.view(*shape, 3)
            vertices = self.topology.faces.index_select(0, closest.face.flatten()).view(*shape, 3)
        body = BodyPoints(distance=distance, vertices=vertices, barycentric=barycentric)
        return attach_gradient(body, points, self.vertices)


class CanonicalSurface:
    """A body, its surface in the canonical pose, and what posing takes, on every device that asks. Built once
    a body.
    """

    def __init__(self, body: Body) -> None:
        self.body, self.canonical = body, pose_canonically(body)
        self.posings: dict[torch.device, Posing] = {}
        self.surfaces: dict[torch.device, BodySurface] = {}

    def posing(self, device: torch.device) -> Posing:
        if device not in self.posings:
            self.posings[device] = posing_of(self.body, device)
        return self.posings[device]

    def on(self, device: torch.device) -> BodySurface:
        """The surface of the canonical body."""
        if device not in self.surfaces:
            vertices = self.canonical.vertices.astype(np.float32)
            topology = topology_of(vertices, self.body.faces, device)
            self.surfaces[device] = BodySurface(torch.from_numpy(vertices)[None].to(device), topology)
        return self.surfaces[device]
