"""Shape sliders: what one more of each beta does to an asset in its rest pose.

With the pose fixed, vertices and joints depend on the betas linearly: the body's shape offsets are carried
over to the surface, the joints follow the body's, and linear blend skinning adds them up with weights and
rotations that no beta changes. So a sum of sliders is exactly the mesh built with those betas, in the rest
pose. In other poses it bends about the old joints. The pelvis keeps its height; soles may leave the ground.
Letters: V welded vertices, J joints, b betas.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Float, Float64

from assets.mesh.surface import Surface
from assets.skin.attach import Carrier
from assets.skin.rest import to_rest
from assets.skin.skin import Skin
from avatargen.body.model import CanonicalBody

MOST = 10  # sliders


@dataclass(frozen=True, kw_only=True)
class Slider:
    """How far vertices and joints move for one more of a beta, metres."""

    name: str
    vertices: Float64[np.ndarray, "V 3"]
    joints: Float64[np.ndarray, "J 3"]


def beta_sliders(
    surface: Surface,
    skin: Skin,
    attachment: Carrier,
    body: CanonicalBody,
    betas: Float[np.ndarray, " b"],
    rotations: Float[np.ndarray, "J 3"],
    moved: Skin | None = None,
) -> tuple[Slider, ...]:
    """A slider named beta_0, beta_1 ... for each of the body's first ten shape directions; `moved` are the
    weights from the T-pose on where they are others.

    Raises:
        InputError: betas or rotations that do not fit the body.
    """
    own = np.zeros(body.source.shapedirs.shape[2])
    own[: len(betas)] = betas
    place = partial(to_rest, surface, skin, attachment, body, on_ground=False, moved=moved)
    before = place(betas=own, rotations=rotations)
    sliders = []
    for index, step in enumerate(np.eye(len(own))[:MOST]):
        after = place(betas=own + step, rotations=rotations)
        sliders.append(
            Slider(
                name=f"beta_{index}",
                vertices=after.vertices - before.vertices,
                joints=after.joints - before.joints,
            )
        )
    return tuple(sliders)
