"""Texture coordinates of any surface: each of its parts is cut into charts by xatlas, and all charts are
packed into one square. People have charts along the seams of clothes first (`assets.texture.guided`).

xatlas runs in a process of its own under a time limit. Where it fails, runs out of time or leaves a face
out, the faces are packed one by one instead: a plain atlas with a seam at every edge, but never a wrong one.

Letters: V welded vertices, W vertices after the seams have split them, F faces. uv in 0..1, origin at the
texture's top left.
"""

import io
import os
import subprocess
import sys
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float32, Float64, Int64

from assets.errors import GeometryError
from assets.mesh.surface import Surface, compact, directed_edges, edge_lengths, face_areas, opposite_edges
from assets.texture import charts as charts_program
from avatargen.errors import InputError

NO_AREA = 1e-9  # square metres of a face that may lie flat in the texture
ROUNDS = 8  # of adding faces beside those already there: a chain of so many tiny faces is found
FINEST_PACKING = 768  # cells along the side of the grid that charts are packed on: time goes with its square
SIDE_TO_PADDING = 128  # cells of that grid's side for each cell between charts: 8 of 1,024 texels
MARGIN = 1.5  # texels between a face packed alone and its cell's border


@dataclass(frozen=True, kw_only=True)
class AtlasConfig:
    """The texture the atlas is for, and how xatlas may spend its time."""

    texture_size: int = 1024  # texels along a side
    time_limit: float = 30.0  # seconds, for each 10,000 faces
    # parts with texels finer than the others', by factor
    scales: tuple[tuple[int, float], ...] = field(default=())

    def __post_init__(self) -> None:
        if not 16 <= self.texture_size <= 16384:
            raise InputError(f"atlas: a texture of {self.texture_size} texels; choose 16 to 16384")
        if any(not 0.1 <= scale <= 10 for _, scale in self.scales):
            raise InputError("atlas: a part's scale must lie in 0.1 to 10")

    @property
    def packing(self) -> int:
        """Cells along the side of the grid that charts are packed on."""
        return min(self.texture_size, FINEST_PACKING)

    @property
    def padding(self) -> int:
        """Cells between charts: room for what smaller copies of the texture take in around one."""
        return max(2, self.packing // SIDE_TO_PADDING)


@dataclass(frozen=True, kw_only=True)
class Atlas:
    """Split vertices with their texture coordinates; face f is face f of the welded surface."""

    vertex_map: Int64[np.ndarray, " W"]  # welded vertex of each split one
    uv: Float32[np.ndarray, "W 2"]
    faces: Int64[np.ndarray, "F 3"]
    plain: str = ""  # why faces were packed one by one; empty for charts
    unguided: str = ""  # why charts do not follow the seams of clothes; empty where they do, or need not

    def __post_init__(self) -> None:
        if len(self.vertex_map) != len(self.uv) or len(self.faces) == 0 or self.faces.max() >= len(self.uv):
            raise GeometryError(
                f"atlas: {len(self.uv)} uv do not fit {len(self.vertex_map)} vertices or the faces"
            )
        if not (self.uv.min() >= 0 and self.uv.max() <= 1):  # also catches NaN
            raise GeometryError(
                f"atlas: uv reach from {self.uv.min():g} to {self.uv.max():g}; 0 to 1 is needed"
            )


def unwrap(surface: Surface, parts: Int64[np.ndarray, " F"], config: AtlasConfig | None = None) -> Atlas:
    """Charts that do not cross from one part to another, at one density but for the parts' scales.

    `parts` has a label for each face.

    Raises:
        GeometryError: parts that do not fit the faces.
    """
    config = config or AtlasConfig()
    if len(parts) != len(surface.faces):
        raise GeometryError(
            f"atlas: {len(parts)} part labels for {len(surface.faces)} faces; give one a face"
        )
    try:
        return chart_atlas(surface, parts, config)
    except (GeometryError, subprocess.SubprocessError) as error:
        return plain_atlas(surface, parts, config, reason=str(error))


def run_xatlas(arrays: dict[str, np.ndarray], time_limit: float) -> dict[str, np.ndarray]:
    """Charts of meshes, by a process of its own; arrays as in `assets.texture.charts`.

    It works in threads, and a machine may run short of memory: a crash that does not come again costs a
    second run and no charts.

    Raises:
        SubprocessError: it crashed twice or ran out of time (seconds).
    """
    command = [sys.executable, "-P", str(charts_program.__file__)]
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}  # more take time to start and have no work
    stream = io.BytesIO()
    np.savez(stream, **arrays)  # pyright: ignore

    def run() -> subprocess.CompletedProcess[bytes]:
        return subprocess.run(
            command, input=stream.getvalue(), capture_output=True, timeout=time_limit, env=environment
        )

    done = run()
    if done.returncode:
        done = run()
    done.check_returncode()
    with np.load(io.BytesIO(done.stdout)) as file:
        return {name: file[name] for name in file.files}


def chart_atlas(surface: Surface, parts: Int64[np.ndarray, " F"], config: AtlasConfig) -> Atlas:
    """xatlas's charts, one mesh a part.

    Raises:
        GeometryError: a face was left out or has no room in the texture.
        SubprocessError: xatlas crashed or ran out of time.
    """
    labels = np.unique(parts)
    rows = [np.flatnonzero(parts == label) for label in labels]
    scales = [dict(config.scales).get(int(label), 1.0) for label in labels]
    arrays = {"resolution": np.array(config.packing), "padding": np.array(config.padding)}
    for index, (faces, scale) in enumerate(zip(rows, scales, strict=True)):
        mesh = compact(surface.vertices, surface.faces[faces])
        arrays[f"positions_{index}"] = (mesh.vertices * scale).astype(np.float32)
        arrays[f"faces_{index}"] = mesh.faces.astype(np.uint32)
    result = run_xatlas(arrays, config.time_limit * max(1.0, len(parts) / 10_000))
    for index, faces in enumerate(rows):
        found = len(result[f"faces_{index}"])
        if found != len(faces):
            raise GeometryError(
                f"atlas: xatlas returned {found} of {len(faces)} faces of part {labels[index]}"
            )
    atlas = add_left_out(surface, joined(surface, rows, result), largest=1 / config.texture_size)
    check_atlas(surface, atlas)
    return atlas


def joined(surface: Surface, rows: list[Int64[np.ndarray, " _"]], result: dict[str, np.ndarray]) -> Atlas:
    """One atlas of the charts that xatlas made of the parts' meshes; `rows` are the faces of each part."""
    faces, uv, vertex_map, first = np.full(surface.faces.shape, -1), [], [], 0
    for index, part in enumerate(rows):
        original = np.unique(surface.faces[part])  # the part's vertices, in the order of its mesh
        faces[part] = result[f"faces_{index}"].astype(np.int64) + first
        vertex_map.append(original[result[f"vertices_{index}"].astype(np.int64)])
        uv.append(result[f"uv_{index}"])
        first += len(uv[-1])
    return Atlas(
        vertex_map=np.concatenate(vertex_map),
        uv=np.clip(np.concatenate(uv) / result["size"].max(), 0, 1).astype(np.float32),
        faces=faces.astype(np.int64),
    )


def add_left_out(surface: Surface, atlas: Atlas, largest: float) -> Atlas:
    """Unfold the tiny faces that xatlas left out beside a neighbour's chart, over the longest edge they
    share; the vertices that they had of their own are dropped.

    Raises:
        GeometryError: one would stand out by more than `largest` (of the texture's side).
    """
    twin = opposite_edges(surface.faces, len(surface.vertices)).reshape(-1, 3)
    lengths = edge_lengths(surface, directed_edges(surface.faces)).reshape(-1, 3)
    faces, uv, vertex_map = atlas.faces.copy(), atlas.uv.astype(np.float64), atlas.vertex_map
    left = np.abs(uv_areas(atlas)) <= 0
    for _ in range(ROUNDS):
        if not left.any():
            break
        usable = np.where((twin >= 0) & ~left[twin // 3], lengths, -1.0)
        ready = np.flatnonzero(left & (usable.max(axis=1) > 0))
        edge = usable[ready].argmax(axis=1)
        neighbour, side = np.divmod(twin[ready, edge], 3)
        start, end = faces[neighbour, (side + 1) % 3], faces[neighbour, side]
        tip = surface.faces[ready, (edge + 2) % 3]
        ends = surface.vertices[vertex_map[np.stack([start, end])]]
        place, height = unfold(
            *ends, surface.vertices[tip], uv[start], uv[end], uv[faces[neighbour, (side + 2) % 3]]
        )
        if height.max(initial=0) > largest:
            raise GeometryError(
                f"atlas: xatlas left out a face that is {height.max() / largest:.1f} texels high"
            )
        new = len(uv) + np.arange(len(ready))
        for corner, vertices in enumerate((start, end, new)):
            faces[ready, (edge + corner) % 3] = vertices
        uv, vertex_map = np.concatenate([uv, place]), np.concatenate([vertex_map, tip])
        left[ready] = False
    named, corner = np.unique(faces, return_inverse=True)
    return Atlas(
        vertex_map=vertex_map[named],
        uv=np.clip(uv[named], 0, 1).astype(np.float32),
        faces=corner.reshape(faces.shape).astype(np.int64),
    )


def unfold(
    start: Float64[np.ndarray, "N 3"],
    end: Float64[np.ndarray, "N 3"],
    tip: Float64[np.ndarray, "N 3"],
    uv_start: Float64[np.ndarray, "N 2"],
    uv_end: Float64[np.ndarray, "N 2"],
    uv_behind: Float64[np.ndarray, "N 2"],
) -> tuple[Float64[np.ndarray, "N 2"], Float64[np.ndarray, " N"]]:
    """Where the tips of triangles (metres) lie in the texture when they are turned flat about an edge, from
    `start` to `end`, away from `uv_behind`; and how far from that edge, of the texture's side."""
    edge, uv_edge = end - start, uv_end - uv_start
    length = np.maximum(np.linalg.norm(edge, axis=1), 1e-12)
    along = np.einsum("nd,nd->n", tip - start, edge) / length**2
    height = np.linalg.norm(tip - start - along[:, None] * edge, axis=1) / length
    across = np.stack([-uv_edge[:, 1], uv_edge[:, 0]], axis=1)
    away = -np.sign(np.einsum("nd,nd->n", across, uv_behind - uv_start))
    place = uv_start + along[:, None] * uv_edge + (away * height)[:, None] * across
    return place, height * np.linalg.norm(uv_edge, axis=1)


def check_atlas(surface: Surface, atlas: Atlas) -> None:
    """Every face keeps its vertices and has room in the texture.

    Raises:
        GeometryError: one does not.
    """
    if not np.array_equal(atlas.vertex_map[atlas.faces], surface.faces):
        raise GeometryError("atlas: xatlas changed the faces")
    flat = (np.abs(uv_areas(atlas)) <= 0) & (face_areas(surface) > NO_AREA)
    if flat.any():
        raise GeometryError(f"atlas: {int(flat.sum())} faces have no room in the texture")


def uv_areas(atlas: Atlas) -> Float64[np.ndarray, " F"]:
    """Signed area of each face in the texture, of 1 in all."""
    a, b, c = (atlas.uv[atlas.faces[:, corner]].astype(np.float64) for corner in range(3))
    return 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])


def plain_atlas(surface: Surface, parts: Int64[np.ndarray, " F"], config: AtlasConfig, reason: str) -> Atlas:
    """Every face alone, flat, and two to a square cell of an even grid; `reason` says why."""
    del parts  # one density for all
    count = len(surface.faces)
    columns = int(np.ceil(np.sqrt((count + 1) // 2)))
    cell = 1.0 / columns
    margin = min(MARGIN / config.texture_size, 0.2 * cell)
    index = np.arange(count)
    corner = np.stack([index // 2 % columns, index // 2 // columns], axis=1) * cell
    lower = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]) * (cell - 3 * margin) + margin
    upper = cell - lower
    uv = corner[:, None] + np.where((index % 2 == 0)[:, None, None], lower, upper)
    return Atlas(
        vertex_map=surface.faces.reshape(-1).copy(),
        uv=uv.reshape(-1, 2).astype(np.float32),
        faces=np.arange(3 * count).reshape(-1, 3),
        plain=reason,
    )
