"""Reading MakeHuman's asset files: `.obj` meshes, `.mhclo` bindings to hm08, `.mhmat` materials.

Text files of anybody's: whatever is wrong with one ends in an InputError that names the file and the line.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from jaxtyping import Float64, Int64

from avatargen.errors import InputError
from avatargen.wardrobe.makehuman.hm08 import HM08_VERTICES

MAX_BYTES = 1 << 26  # of a text file; MakeHuman's largest has 2 MB


@dataclass(frozen=True, kw_only=True)
class Mesh:
    """An artist's mesh: triangles, and which texture coordinate each corner has (v counts upward)."""

    vertices: Float64[np.ndarray, "V 3"]
    uv: Float64[np.ndarray, "T 2"]
    faces: Int64[np.ndarray, "F 3"]
    corners: Int64[np.ndarray, "F 3"]  # rows of uv


@dataclass(frozen=True, kw_only=True)
class Binding:
    """How every vertex of a garment hangs on three vertices of hm08.

    A vertex lies at the weighted sum of its three plus its offset times `scales`: the distance of two
    vertices of hm08 along each axis, over a number.
    """

    name: str
    tags: tuple[str, ...]
    mesh: Path
    material: Path | None
    z_depth: int
    scales: tuple[tuple[int, int, float] | None, ...]  # x, y, z
    indices: Int64[np.ndarray, "V 3"]
    weights: Float64[np.ndarray, "V 3"]
    offsets: Float64[np.ndarray, "V 3"]
    hidden: Int64[np.ndarray, " H"]  # vertices of hm08 that the garment hides


def read_lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    """The words of every line that has any, with the line's number from 1.

    Raises:
        InputError: the file is missing, too large or no text.
    """
    try:
        if path.stat().st_size > MAX_BYTES:
            raise InputError(f"wardrobe: {path} has more than {MAX_BYTES} bytes; MakeHuman's files are small")
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise InputError(f"wardrobe: cannot read {path}: {error.strerror or error}; check it") from error
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split()
        if words and not words[0].startswith("#"):
            yield number, words


def bad_line(path: Path, number: int, words: list[str], wanted: str) -> InputError:
    """The error for a line that is not what its place asks for."""
    return InputError(f"wardrobe: {path}, line {number}: found {' '.join(words)[:60]!r}, wanted {wanted}")


def read_mesh(path: Path) -> Mesh:
    """An .obj file's vertices, texture coordinates and polygons, these cut into triangles.

    Raises:
        InputError: the file is missing, holds no faces, or a face names what is not there.
    """
    vertices: list[list[float]] = []
    uv: list[list[float]] = []
    faces: list[list[int]] = []
    corners: list[list[int]] = []
    for number, words in read_lines(path):
        try:
            if words[0] == "v":
                vertices.append([float(words[1]), float(words[2]), float(words[3])])
            elif words[0] == "vt":
                uv.append([float(words[1]), float(words[2])])
            elif words[0] == "f":
                at, textured = zip(*(corner(w, len(vertices), len(uv)) for w in words[1:]), strict=True)
                faces += [[at[0], *pair] for pair in pairwise(at[1:])]
                corners += [[textured[0], *pair] for pair in pairwise(textured[1:])]
        except (ValueError, IndexError) as error:
            raise bad_line(path, number, words, "numbers as .obj has them") from error
    mesh = Mesh(
        vertices=np.array(vertices, dtype=np.float64).reshape(-1, 3),
        uv=np.array(uv or [[0.0, 0.0]], dtype=np.float64).reshape(-1, 2),
        faces=np.array(faces, dtype=np.int64).reshape(-1, 3),
        corners=np.array(corners, dtype=np.int64).reshape(-1, 3),
    )
    if len(mesh.faces) == 0:
        raise InputError(f"wardrobe: {path} holds no faces; give a mesh")
    for indices, count, what in ((mesh.faces, len(vertices), "vertices"), (mesh.corners, len(mesh.uv), "uv")):
        if indices.min() < 0 or indices.max() >= count:
            raise InputError(f"wardrobe: {path} has faces that name {what} beyond its {count}; save it again")
    if not (np.isfinite(mesh.vertices).all() and np.isfinite(mesh.uv).all()):
        raise InputError(f"wardrobe: {path} holds NaN or infinity; save it again")
    return mesh


def corner(word: str, vertices: int, uv: int) -> tuple[int, int]:
    """The vertex and texture coordinate that `3/7` or `-1` names, counted from 0; 0 where it has none."""
    vertex, coordinate = (int(n or 0) for n in (*word.split("/"), "0")[:2])
    return (
        vertex + vertices if vertex < 0 else vertex - 1,
        coordinate + uv if coordinate < 0 else max(coordinate - 1, 0),
    )


@dataclass
class Sections:
    """What the lines of a `.mhclo` file hold, as they are read."""

    section: str = ""
    words_of: dict[str, list[str]] = field(default_factory=dict)
    scales: dict[str, tuple[int, int, float]] = field(default_factory=dict)
    tags: list[str] = field(default_factory=list)
    rows: list[list[float]] = field(default_factory=list)
    hidden: list[int] = field(default_factory=list)

    def take(self, words: list[str]) -> None:
        """One line. Raises ValueError or IndexError where it is not what the format has there."""
        first = words[0]
        if first in ("verts", "weights", "delete_verts"):
            self.section = first
        elif first in ("x_scale", "y_scale", "z_scale"):
            self.scales[first[0]] = (int(words[1]), int(words[2]), float(words[3]))
        elif first == "tag":
            self.tags.append(" ".join(words[1:]))
        elif not first.lstrip("-").isdigit():
            self.words_of[first] = words[1:]  # also between a section's name and its rows
        elif self.section == "verts":
            self.rows.append(binding_row(words))
        elif self.section == "delete_verts":
            self.hidden += hidden_range(words)


def read_binding(path: Path) -> Binding:
    """A `.mhclo` file.

    Raises:
        InputError: the file is missing, for another base mesh, or a line is not what the format asks for.
    """
    found = Sections()
    for number, words in read_lines(path):
        try:
            found.take(words)
        except (ValueError, IndexError) as error:
            raise bad_line(path, number, words, "what .mhclo has there") from error
    words_of = found.words_of
    if (made_for := words_of.get("basemesh", ["hm08"])) != ["hm08"]:
        raise InputError(f"wardrobe: {path} is made for {' '.join(made_for)}; hm08 is read")
    if not found.rows or "obj_file" not in words_of:
        raise InputError(f"wardrobe: {path} names no mesh or binds no vertices; give a whole .mhclo")
    table = np.array(found.rows)
    hidden = np.array(found.hidden, dtype=np.int64)
    named = np.concatenate([table[:, :3].ravel(), hidden, *[s[:2] for s in found.scales.values()]])
    if not np.isfinite(table).all() or named.min() < 0 or named.max() >= HM08_VERTICES:
        raise InputError(f"wardrobe: {path} names vertices outside hm08's {HM08_VERTICES}, or NaN")
    material = words_of.get("material")
    return Binding(
        name=" ".join(words_of.get("name", [path.stem])),
        tags=tuple(found.tags),
        mesh=path.parent / " ".join(words_of["obj_file"]),
        material=path.parent / " ".join(material) if material else None,
        z_depth=whole_number(path, words_of.get("z_depth", ["50"])),
        scales=tuple(found.scales.get(axis) for axis in "xyz"),
        indices=table[:, :3].astype(np.int64),
        weights=table[:, 3:6],
        offsets=table[:, 6:],
        hidden=hidden,
    )


def whole_number(path: Path, words: list[str]) -> int:
    """The whole number that a property holds."""
    try:
        return int(words[0])
    except (ValueError, IndexError) as error:
        raise InputError(f"wardrobe: {path}: z_depth {words}, wanted a whole number") from error


def binding_row(words: list[str]) -> list[float]:
    """Three indices, three weights and an offset, from one index, or from six or nine numbers."""
    if len(words) == 1:
        return [float(int(words[0]))] * 3 + [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    indices, numbers = [float(int(w)) for w in words[:3]], [float(w) for w in words[3:9]]
    if len(numbers) not in (3, 6):
        raise ValueError("neither weights nor weights and an offset")
    return [*indices, *numbers, 0.0, 0.0, 0.0][:9]


def hidden_range(words: list[str]) -> list[int]:
    """Numbers and ranges such as `7 12 - 15`."""
    found: list[int] = []
    position = 0
    while position < len(words):
        if words[position] == "-":
            last = int(words[position + 1])
            if not found or not found[-1] <= last < HM08_VERTICES:
                raise ValueError("a range that does not run upward")
            found += range(found[-1] + 1, last + 1)
            position += 2
        else:
            found.append(int(words[position]))
            position += 1
    return found


def read_material(path: Path) -> Path | None:
    """The diffuse texture that a `.mhmat` file names, if it is there, in any of the usual picture formats.

    Raises:
        InputError: the file is missing.
    """
    for _, words in read_lines(path):
        if words[0] == "diffuseTexture" and len(words) > 1:
            return picture_beside(path.parent / " ".join(words[1:]))
    return None


def picture_beside(path: Path) -> Path | None:
    """The picture, or one of its name in another format: collections re-encode textures."""
    for suffix in (path.suffix, ".png", ".jpg", ".jpeg", ".tga"):
        if (candidate := path.with_suffix(suffix)).is_file():
            return candidate
    return None
