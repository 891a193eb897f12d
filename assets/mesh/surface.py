"""A triangle surface and what can be wrong with it.

Letters: V vertices, F faces, E directed edges (three a face, face by face). Metres; faces counter-clockwise
from outside.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64

from assets.errors import GeometryError

THIN = 1e-9  # area of a face over the square of its longest edge, at or under which it counts as none
FLAT = 1e-9  # volume of a surface over the cube of its extent, at or under which it counts as none


@dataclass(frozen=True, kw_only=True)
class Surface:
    """Vertices and faces; finite, and every face names existing vertices."""

    vertices: Float64[np.ndarray, "V 3"]
    faces: Int64[np.ndarray, "F 3"]

    def __post_init__(self) -> None:
        if not np.isfinite(self.vertices).all():
            raise GeometryError("surface: vertices hold NaN or infinity; the stage before failed")
        if len(self.faces) and not (self.faces.min() >= 0 and self.faces.max() < len(self.vertices)):
            named = f"{self.faces.min()}..{self.faces.max()}"
            raise GeometryError(f"surface: faces name vertices {named}; there are {len(self.vertices)}")


@dataclass(frozen=True, kw_only=True)
class Defects:
    """How many of each defect a surface has; all zero for one closed, manifold, outward component."""

    bad_edges: int  # directed edges without exactly one opposite: open, non-manifold or inconsistently turned
    bad_vertices: int  # vertices whose faces form more than one fan, or none
    thin_faces: int  # faces that name a vertex twice or have no area to speak of
    extra_components: int  # beyond those there are to be
    inward: int  # 1 if the enclosed volume is negative or nothing to speak of

    def __bool__(self) -> bool:
        return any(vars(self).values())

    def __str__(self) -> str:
        return ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in vars(self).items() if count)


def find_defects(surface: Surface, components: int | None = None, pieces: int = 1) -> Defects:
    """Check everything the pipeline promises about its meshes; `components` where their number is known,
    `pieces` where there may be more than one, as of a pair of shoes."""
    components = label_components(surface)[0] if components is None else components
    twin = opposite_edges(surface.faces, len(surface.vertices))
    return Defects(
        bad_edges=int((twin < 0).sum()),
        bad_vertices=count_split_vertices(surface, twin),
        thin_faces=count_thin_faces(surface),
        extra_components=max(0, components - pieces),
        inward=int(not volume(surface) > FLAT * extent(surface) ** 3),
    )


def count_thin_faces(surface: Surface) -> int:
    """Faces whose area is nothing beside the square of their longest edge."""
    a, b, c = corners_of(surface)
    u, v = b - a, c - a
    longest = np.maximum(np.maximum(squares(u), squares(v)), squares(v - u))
    return int((0.5 * np.sqrt(squares(cross(u, v))) <= THIN * longest).sum())


def corners_of(surface: Surface) -> tuple[Float64[np.ndarray, "3 F"], ...]:
    """The three corners of each face. Coordinates come first, so that what follows runs through memory."""
    points, corners = np.ascontiguousarray(surface.vertices.T), np.ascontiguousarray(surface.faces.T)
    a, b, c = (points.take(corner, axis=1) for corner in corners)
    return a, b, c


def cross(u: Float64[np.ndarray, "3 N"], v: Float64[np.ndarray, "3 N"]) -> Float64[np.ndarray, "3 N"]:
    """Cross products."""
    return np.stack([u[i - 2] * v[i - 1] - u[i - 1] * v[i - 2] for i in range(3)])


def squares(vectors: Float64[np.ndarray, "3 N"]) -> Float64[np.ndarray, " N"]:
    """Squared lengths."""
    return (vectors * vectors).sum(axis=0)


def directed_edges(faces: Int64[np.ndarray, "F 3"]) -> Int64[np.ndarray, "E 2"]:
    """Edge i of a face runs from its corner i to the next one."""
    return np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)


def edge_lengths(surface: Surface, edges: Int64[np.ndarray, "E 2"]) -> Float64[np.ndarray, " E"]:
    """Metres."""
    return np.linalg.norm(surface.vertices[edges[:, 0]] - surface.vertices[edges[:, 1]], axis=1)


def opposite_edges(faces: Int64[np.ndarray, "F 3"], vertex_count: int) -> Int64[np.ndarray, " E"]:
    """For each directed edge the index of its one opposite, or -1 where it has none or several, or is itself
    repeated."""
    from assets.mesh.connectivity import match_edges

    return match_edges(np.ascontiguousarray(faces), vertex_count)


def count_split_vertices(surface: Surface, twin: Int64[np.ndarray, " E"]) -> int:
    """Vertices without faces or with faces in several fans."""
    from assets.mesh.connectivity import count_split

    return count_split(np.ascontiguousarray(surface.faces), twin, len(surface.vertices))


def count_pieces(surface: Surface) -> int:
    """Number of connected components."""
    return label_components(surface)[0]


def label_components(surface: Surface) -> tuple[int, Int64[np.ndarray, " V"]]:
    """Number of connected components and the component of each vertex."""
    from assets.mesh.connectivity import label_vertices

    return label_vertices(np.ascontiguousarray(surface.faces), len(surface.vertices))


def face_normals(surface: Surface) -> Float64[np.ndarray, "F 3"]:
    """Outward normals, as long as twice the face's area."""
    a, b, c = corners_of(surface)
    return np.ascontiguousarray(cross(b - a, c - a).T)


def face_areas(surface: Surface) -> Float64[np.ndarray, " F"]:
    """Square metres."""
    a, b, c = corners_of(surface)
    return 0.5 * np.sqrt(squares(cross(b - a, c - a)))


def volume_parts(surface: Surface) -> Float64[np.ndarray, " F"]:
    """Signed volume of the tetrahedron of each face and the vertices' centre; they sum to the enclosed
    volume."""
    middle = surface.vertices.mean(axis=0) if len(surface.vertices) else np.zeros(3)
    a, b, c = (corner - middle[:, None] for corner in corners_of(surface))
    return (a * cross(b, c)).sum(axis=0) / 6


def volume(surface: Surface) -> float:
    """Enclosed volume in cubic metres, positive if faces point outward."""
    return float(volume_parts(surface).sum())


def extent(surface: Surface) -> float:
    """Length of the diagonal of the box around the vertices, metres."""
    return float(np.linalg.norm(np.ptp(surface.vertices.T.copy(), axis=1))) if len(surface.vertices) else 0.0


def euler_number(surface: Surface) -> int:
    """Of a closed surface: vertices less edges plus faces; 2 for a ball, 2 less for each handle."""
    return len(surface.vertices) - len(surface.faces) // 2


def vertex_normals(surface: Surface) -> Float64[np.ndarray, "V 3"]:
    """Unit normals, the mean of the faces' normals weighted by their angles at the vertex; +y where that
    vanishes."""
    corners = surface.vertices[surface.faces]  # F 3 3
    normal = face_normals(surface)
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    total = sum_at_vertices(surface, corner_angles(corners)[..., None] * normal[:, None])
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.where(length > 1e-12, total / np.maximum(length, 1e-12), [0.0, 1.0, 0.0])


def sum_at_vertices(surface: Surface, values: Float64[np.ndarray, "F 3 C"]) -> Float64[np.ndarray, "V C"]:
    """Sum of values given at each corner of each face."""
    index = surface.faces.reshape(-1)
    flat = values.reshape(len(index), -1)
    count = len(surface.vertices)
    return np.stack([np.bincount(index, column, minlength=count) for column in flat.T], axis=1)


def compact(vertices: Float64[np.ndarray, "V 3"], faces: Int64[np.ndarray, "F 3"]) -> Surface:
    """A surface without the vertices that no face names; the others keep their order."""
    used = np.zeros(len(vertices), dtype=bool)
    used[faces.reshape(-1)] = True
    place = np.cumsum(used) - 1
    return Surface(vertices=vertices[used], faces=place[faces].astype(np.int64))


def smallest_angles(surface: Surface) -> Float64[np.ndarray, " F"]:
    """The smallest angle of each face, degrees."""
    return smallest_angle_of(surface.vertices[surface.faces])


def smallest_angle_of(corners: Float64[np.ndarray, "F 3 3"]) -> Float64[np.ndarray, " F"]:
    """The smallest angle of triangles, degrees: where the product of the sides is largest."""
    double_area, products = products_of_sides(corners)
    return np.degrees(np.arctan2(double_area, products.max(axis=0)))


def normals_of(corners: Float64[np.ndarray, "F 3 3"]) -> Float64[np.ndarray, "F 3"]:
    """Outward normals of triangles, as long as twice their area."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def spoilt(
    before: Float64[np.ndarray, "F 3 3"],
    after: Float64[np.ndarray, "F 3 3"],
    largest_turn: float,
    thin: float,
) -> Bool[np.ndarray, " F"]:
    """Which triangles turn by more than an angle of this cosine, or shrink their smallest angle to fewer than
    `thin` degrees."""
    old, new = normals_of(before), normals_of(after)
    lengths = np.linalg.norm(old, axis=1) * np.linalg.norm(new, axis=1)
    turned = np.einsum("fd,fd->f", old, new) <= largest_turn * lengths
    was, angle = smallest_angle_of(before), smallest_angle_of(after)
    return turned | ((angle < thin) & (angle < was))


def corner_angles(corners: Float64[np.ndarray, "F 3 3"]) -> Float64[np.ndarray, "F 3"]:
    """The angle at each corner of triangles, radians."""
    double_area, products = products_of_sides(corners)
    return np.arctan2(double_area, products).T


def products_of_sides(
    corners: Float64[np.ndarray, "F 3 3"],
) -> tuple[Float64[np.ndarray, " F"], Float64[np.ndarray, "3 F"]]:
    """Of the two sides at a corner the cross product's length, the same at all three, and the dot product at
    each. Coordinates come first, so that the sums run through memory."""
    points = np.ascontiguousarray(corners.transpose(1, 2, 0))
    (ux, uy, uz), (vx, vy, vz), _ = sides = points[[1, 2, 0]] - points
    double_area = np.sqrt((uy * vz - uz * vy) ** 2 + (uz * vx - ux * vz) ** 2 + (ux * vy - uy * vx) ** 2)
    products = np.stack([(sides[i] * -sides[i - 1]).sum(axis=0) for i in range(3)])
    return double_area, products + 0.0  # no negative zero, whose angle to nothing is 180 degrees
