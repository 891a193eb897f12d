"""Keep one whole component and repair what is not manifold: the result is closed, manifold, outward and in
one piece; or in a few, of what comes in pairs."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from assets.errors import GeometryError
from assets.mesh.repair import repair
from assets.mesh.surface import (
    Surface,
    compact,
    count_pieces,
    find_defects,
    label_components,
    volume,
    volume_parts,
)

# pymeshlab's filters, in an order that removes faces without area before edges are split: it rips them open
# otherwise
REPAIRS = (
    "meshing_remove_duplicate_vertices",
    "meshing_remove_unreferenced_vertices",
    "meshing_remove_duplicate_faces",
    "meshing_remove_folded_faces",
    "meshing_remove_null_faces",
    "meshing_repair_non_manifold_edges",
    "meshing_repair_non_manifold_vertices",
)
MAX_HOLE_EDGES = 200
T_VERTEX = 1e4  # longest edge over height, at which a face has no area to speak of and its edge is flipped


@dataclass(frozen=True, kw_only=True)
class Cleaning:
    """A sound surface and what it took."""

    surface: Surface
    dropped_components: int
    repaired: str  # the defects found in the component that was kept; empty for none


def clean(surface: Surface, least: float = 1.0) -> Cleaning:
    """The largest component, repaired where needed: one closed, manifold, outward surface; and what that
    took. With `least` under 1 other components stay too, those of at least that share of its volume.

    Raises:
        GeometryError: nothing to keep, or defects that no repair removes.
    """
    kept, dropped = keep_largest(surface, least)
    pieces = 1 if least == 1 else count_pieces(kept)
    defects = find_defects(kept, components=pieces, pieces=pieces)
    if not defects:
        return Cleaning(surface=kept, dropped_components=dropped, repaired="")
    for method in (repair, repair_by_pymeshlab):
        repaired, lost = keep_largest(method(kept), least)
        pieces = 1 if least == 1 else count_pieces(repaired)
        left = find_defects(repaired, components=pieces, pieces=pieces)
        if not left:
            return Cleaning(surface=repaired, dropped_components=dropped + lost, repaired=str(defects))
    raise GeometryError(
        f"clean: {left} are left; one closed manifold surface is needed, try another resolution"
    )


def keep_largest(surface: Surface, least: float = 1.0) -> tuple[Surface, int]:
    """The component that encloses the largest volume, facing outward, and the number of others dropped; with
    `least` under 1 those stay as well that face outward and enclose that share of it.

    An inner shell, a bubble or a stray blob is a component of its own, and goes.

    Raises:
        GeometryError: there are no faces.
    """
    if len(surface.faces) == 0:
        raise GeometryError("clean: the surface has no faces; nothing can be kept")
    count, label = label_components(surface)
    if count == 1 and volume(surface) > 0:
        return surface, 0
    of_face = label[surface.faces[:, 0]]
    volumes = np.bincount(of_face, volume_parts(surface), minlength=count)
    largest = int(np.argmax(np.abs(volumes)))
    outward = volumes * np.sign(volumes[largest])
    kept = np.flatnonzero(outward >= least * outward[largest]) if least < 1 else np.array([largest])
    faces = surface.faces[np.isin(of_face, kept)]
    if volumes[largest] < 0:
        faces = faces[:, ::-1]
    with_faces = len(np.unique(of_face))
    return compact(surface.vertices, np.ascontiguousarray(faces)), with_faces - len(kept)


def repair_by_pymeshlab(surface: Surface) -> Surface:
    """pymeshlab's filters, then what is still open or crowded repaired. Raises their errors."""
    return repair(filter_by_pymeshlab(surface))


def filter_by_pymeshlab(surface: Surface) -> Surface:
    """Merge, remove and split until edges and vertices are manifold, then close small holes; what is sound
    stays as it is.

    Raises:
        GeometryError: pymeshlab gives up.
    """
    import pymeshlab

    meshes = to_pymeshlab(surface)
    try:
        for name in REPAIRS:
            meshes.apply_filter(name)
        if find_defects(from_pymeshlab(meshes)).thin_faces:
            meshes.apply_filter("meshing_remove_t_vertices", method="Edge Flip", threshold=T_VERTEX)
        meshes.apply_filter("meshing_close_holes", maxholesize=MAX_HOLE_EDGES, newfaceselected=False)
        meshes.apply_filter("meshing_re_orient_faces_coherently")
    except pymeshlab.PyMeshLabException as error:  # pyright: ignore
        detail = str(error).strip().splitlines()[-1]
        raise GeometryError(
            f"clean: pymeshlab cannot repair the surface ({detail}); try another resolution"
        ) from error
    return from_pymeshlab(meshes)


def to_pymeshlab(surface: Surface) -> Any:
    """A pymeshlab MeshSet (its types are compiled and carry no stubs) that holds this surface."""
    import pymeshlab

    meshes = pymeshlab.MeshSet(verbose=False)  # pyright: ignore
    mesh = pymeshlab.Mesh(surface.vertices, surface.faces.astype(np.int32))  # pyright: ignore
    meshes.add_mesh(mesh)
    return meshes


def from_pymeshlab(meshes: Any) -> Surface:
    """The current mesh of a pymeshlab MeshSet."""
    mesh = meshes.current_mesh()
    vertices = np.array(mesh.vertex_matrix(), dtype=np.float64)
    return Surface(vertices=vertices, faces=mesh.face_matrix().astype(np.int64))
