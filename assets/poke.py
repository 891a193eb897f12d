"""How far a person's parts come through one another in a pose: where skin, or a shirt, shows through what is
worn over it.

A vertex counts that some part hides in the canonical space. Its depth is how far it lies outside the posed
meshes of all parts that hide it there, 0 where it is inside one of them. Outside is where the winding number
(Jacobson et al. 2013) says so, as posed meshes cross themselves.

Letters: N points, J joints.
"""

from collections.abc import Callable, Mapping

import igl
import numpy as np
from jaxtyping import Float, Float64

from assets.asset.asset import Asset, apart
from assets.asset.posed import posed
from assets.mesh.measure import SurfaceError, summary
from assets.mesh.surface import Surface
from avatargen.mesh.closest import ClosestPoints

Cover = Callable[[np.ndarray], np.ndarray]  # of canonical points: how surely a part hides them, 0..1
INSIDE = 0.5  # winding number


def poke_through(
    asset: Asset, covers: Mapping[str, Cover], rotations: Float[np.ndarray, "J 3"]
) -> dict[str, SurfaceError]:
    """For each part beneath another one, over its hidden vertices: depth in millimetres in the pose that
    `rotations` (axis-angle, against the T-pose) give. `covers` are the parts from the skin outward."""
    there = apart(posed(asset, rotations, on_ground=False))
    outward, found = [name for name in there if name in covers], {}
    for number, name in enumerate(outward):
        canonical = there[name].canonical
        assert canonical is not None, "built from a field"
        depth = np.full(len(canonical), np.inf)
        for over in outward[number + 1 :]:
            hidden = np.flatnonzero(covers[over](canonical) > 0)
            if len(hidden):
                outside = depth_outside(there[name].vertices[hidden], surface_of(there[over]))
                depth[hidden] = np.minimum(depth[hidden], outside)
        if np.isfinite(depth).any():
            found[name] = summary(depth[np.isfinite(depth)])
    return found


def depth_outside(points: Float[np.ndarray, "N 3"], surface: Surface) -> Float64[np.ndarray, " N"]:
    """Metres from points outside a closed surface to it; 0 for those inside."""
    points = np.ascontiguousarray(points, dtype=np.float64)
    winding = np.asarray(igl.fast_winding_number(surface.vertices, surface.faces, points))
    squared, _, _ = ClosestPoints(surface.vertices, surface.faces).query(points)
    return np.where(winding > INSIDE, 0.0, np.sqrt(squared))


def surface_of(part: Asset) -> Surface:
    """The part's mesh, welded."""
    assert part.welded is not None, "built from a field"
    vertices = np.zeros((int(part.welded.max()) + 1, 3))
    vertices[part.welded] = part.vertices
    return Surface(vertices=vertices, faces=part.welded[part.faces])
