"""The surface in a rest pose with a person's own shape: what an asset's vertices and skeleton are.

    canonical pose --inverse skinning--> T-pose, betas 0 --shape and pose offsets--> T-pose, betas
                   --skinning--> rest pose

The same four weights a vertex take it from the T-pose to the rest pose as take it on in an engine. The rest
pose is baked: every joint's rest rotation is the identity, so a bind is a translation. Letters: V vertices,
J joints, B vertices of the body, b betas.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float64

from assets.errors import GeometryError
from assets.mesh.surface import Surface, vertex_normals
from assets.skin.attach import Carrier
from assets.skin.skin import Skin
from avatargen.body.model import CanonicalBody, PosedBody, pose, pose_canonically, shape
from avatargen.body.skinning import skin as skin_points
from avatargen.body.skinning import unskin


@dataclass(frozen=True, kw_only=True)
class RestMesh:
    """Vertices, unit normals and joint frames in the rest pose; world axes at every joint.

    `rest_rotations` took the joints there from the T-pose.
    """

    vertices: Float64[np.ndarray, "V 3"]
    normals: Float64[np.ndarray, "V 3"]
    T_world_joint: Float64[np.ndarray, "J 4 4"]
    rest_rotations: Float64[np.ndarray, "J 3 3"]

    @property
    def joints(self) -> Float64[np.ndarray, "J 3"]:
        """Rest positions of the joints, metres."""
        return self.T_world_joint[:, :3, 3]


def to_rest(
    surface: Surface,
    skin: Skin,
    attachment: Carrier,
    body: CanonicalBody,
    betas: Float[np.ndarray, " b"],
    rotations: Float[np.ndarray, "J 3"],
    on_ground: bool = True,
    moved: Skin | None = None,
) -> RestMesh:
    """Bring a canonical surface to the rest pose `rotations` (axis-angle) and the shape `betas`.

    `on_ground` lifts the person until the lowest vertex is at y = 0. `moved` are the weights from the T-pose
    on; by default those that lead there.

    Raises:
        InputError: betas or rotations that do not fit the body.
        GeometryError: a vertex ends at no finite place.
    """
    canonical = pose_canonically(body.source)
    rest = pose(body.source, shape(body.source, betas), rotations)
    weights = skin.dense(len(body.parents))
    straight = unskin(surface.vertices, weights, canonical.T_posed_rest)
    straight = straight + attachment.carry(offsets(canonical, rest))
    onward = weights if moved is None else moved.dense(len(body.parents))
    vertices = skin_points(straight, onward, rest.T_posed_rest)
    if not np.isfinite(vertices).all():
        raise GeometryError("rest: vertices end at NaN or infinity; check the betas and the pose")
    lift = np.array([0.0, -vertices[:, 1].min() if on_ground else 0.0, 0.0])
    T_world_joint = np.tile(np.eye(4), (len(body.parents), 1, 1))
    T_world_joint[:, :3, 3] = rest.joints + lift
    posed = Surface(vertices=vertices + lift, faces=surface.faces)
    return RestMesh(
        vertices=posed.vertices,
        normals=vertex_normals(posed),
        T_world_joint=T_world_joint,
        rest_rotations=rest.T_world_joint[:, :3, :3],
    )


def offsets(canonical: PosedBody, rest: PosedBody) -> Float64[np.ndarray, "B 3"]:
    """How far the body's T-pose vertices move from the canonical shape and pose to the person's own,
    metres."""
    before = canonical.shaped.vertices + canonical.offsets
    return rest.shaped.vertices + rest.offsets - before
