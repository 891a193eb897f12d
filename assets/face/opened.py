"""A face that can open: the mesh cut along lips and lids, with the inside of a mouth, and how the canonical
body's displacements reach each of its vertices.

Letters: V welded vertices, the skin's and then the mouth's own; S the skin's. Metres.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from assets.errors import GeometryError
from assets.face.carry import carriers, near_lips
from assets.face.curves import Curves, cut_lids, cut_lips, face_curves, refined
from assets.face.cut import CutMesh, border, double, without
from assets.face.mouth import Inside, mouth_inside
from assets.face.soften import eased, edge_matrix, smoothed
from avatargen.body.face import FaceUnits
from avatargen.body.model import CanonicalBody

UV = slice(6, 8)  # columns of a vertex's values
STANDS_OFF = 0.006  # m from the body that a face's skin may lie: beyond it is hair or a mask


@dataclass(frozen=True, kw_only=True)
class EyeFaces:
    """The left eye as it was on the skin: corners of its faces, canonical and in the texture."""

    places: Float64[np.ndarray, "F 3 3"]
    uv: Float64[np.ndarray, "F 3 2"]


@dataclass(frozen=True, kw_only=True)
class OpenFace:
    """The mesh and what its shapes are made of."""

    mesh: CutMesh
    kept: Int64[np.ndarray, " _"]  # of the vertices before, those that are left, first of the mesh's
    margins: tuple[Int64[np.ndarray, " _"], Int64[np.ndarray, " _"]]  # of the lids, left eye first
    shown: EyeFaces
    inside: Inside
    upper: Int64[np.ndarray, " K"]  # the lips' rims, welded, from the right corner to the left
    lower: Int64[np.ndarray, " K"]
    above: Bool[np.ndarray, " S"]  # on the upper lip's side
    carry: csr_array  # S x the units' vertices
    curves: Curves
    units: FaceUnits

    @property
    def places(self) -> Float64[np.ndarray, "V 3"]:
        """Canonical places."""
        return np.concatenate([self.mesh.points, self.inside.places])

    @property
    def faces(self) -> Int64[np.ndarray, "F 3"]:
        """Of welded vertices."""
        return np.concatenate([self.mesh.welded_faces, self.inside.faces])

    def unit(self, name: str) -> Float64[np.ndarray, "V 3"]:
        """How far a unit moves each vertex, canonically."""
        moved = self.units.unit(name, self.units.body_vertices + len(self.units.inner))
        return np.concatenate([self.carry @ moved, moved[self.inside.source]])


def open_face(mesh: CutMesh, body: CanonicalBody, units: FaceUnits) -> OpenFace:
    """Cut a mesh in canonical space along the body's lips and lids.

    Raises:
        GeometryError: something else than skin lies over them, or the lips' line breaks off.
    """
    at = body.vertices.astype(np.float64)
    curves = face_curves(units, at, body.faces)
    require_skin(mesh.points, body, curves)
    count = len(mesh.welded)
    mesh, kept, margins, shown = hollowed(refined(mesh, curves), curves)
    mesh, upper = cut_lips(mesh, curves)
    mesh, lower = double(mesh, upper)
    above = upper_side(mesh, upper, lower, curves)
    carry = carriers(mesh.points, above, upper, lower, margins, units, at, body.faces, curves)
    fixed = np.concatenate([upper, lower, *margins])
    return OpenFace(
        mesh=mesh,
        kept=kept[kept < count],
        margins=margins,
        shown=shown,
        inside=mouth_inside(mesh, upper, lower, units, at),
        upper=upper,
        lower=lower,
        above=above,
        carry=eased(mesh, smoothed(mesh, carry, curves, fixed), upper[[0, -1]]),
        curves=curves,
        units=units,
    )


def require_skin(points: Float64[np.ndarray, "S 3"], body: CanonicalBody, curves: Curves) -> None:
    """Raises GeometryError where the surface over lips and eyes is not the body's."""
    near = np.flatnonzero(curves.distance(points) < 0.004)
    if not len(near):
        return
    off = np.abs(body.distance.query(points[near]).distance)
    if off.max() > STANDS_OFF:
        raise GeometryError(
            f"face: something lies {1e3 * off.max():.0f} mm before lips or eyes; leave the face as it is"
        )


def hollowed(
    mesh: CutMesh, curves: Curves
) -> tuple[
    CutMesh, Int64[np.ndarray, " _"], tuple[Int64[np.ndarray, " _"], Int64[np.ndarray, " _"]], EyeFaces
]:
    """The mesh without what lies within the lids, the vertices that are left of it, the margins of the lids,
    and what was taken away."""
    mesh, left = cut_lids(mesh, curves, 0)
    mesh, right = cut_lids(mesh, curves, 1)
    left = np.concatenate([left, np.zeros(len(right) - len(left), bool)])
    faces = mesh.welded_faces
    of_eye = [np.asarray(within[faces].any(axis=1)) for within in (left, right)]
    near = [np.unique(faces[each]) for each in of_eye]
    rows = mesh.faces[of_eye[0]]
    shown = EyeFaces(places=mesh.places[rows], uv=mesh.values[rows][:, :, UV])
    found, kept, number = without(mesh, np.logical_or(*of_eye))
    after = found.welded_faces
    loops = [border(after, number[each][number[each] >= 0]) for each in near]
    return found, kept, (loops[0], loops[1]), shown


def upper_side(
    mesh: CutMesh, upper: Int64[np.ndarray, " K"], lower: Int64[np.ndarray, " K"], curves: Curves
) -> Bool[np.ndarray, " S"]:
    """Whether a vertex lies nearer, along the surface, to the upper lip's rim than to the lower one's."""
    points = mesh.points
    above = curves.above_lips(points) > 0
    near = np.flatnonzero(near_lips(points, curves))
    lengths = edge_matrix(mesh)
    lengths.data = 1 / lengths.data
    number = np.full(len(points), -1)
    number[near] = np.arange(len(near))
    way = [
        dijkstra(lengths[near][:, near], directed=False, indices=number[rim[1:-1]], min_only=True)
        for rim in (upper, lower)
    ]
    told = np.isfinite(way[0]) | np.isfinite(way[1])
    above[near[told]] = (way[0] < way[1])[told]
    return above
