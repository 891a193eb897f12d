"""glTF's one buffer while it grows: arrays and pictures become views and accessors."""

from dataclasses import dataclass, field

import numpy as np
import pygltflib as gltf
from jaxtyping import Float32, Int64, Shaped

COMPONENT_TYPES = {
    "int8": gltf.BYTE,
    "uint8": gltf.UNSIGNED_BYTE,
    "int16": gltf.SHORT,
    "uint16": gltf.UNSIGNED_SHORT,
    "uint32": gltf.UNSIGNED_INT,
    "float32": gltf.FLOAT,
}
ELEMENT_TYPES = {(): gltf.SCALAR, (2,): gltf.VEC2, (3,): gltf.VEC3, (4,): gltf.VEC4, (4, 4): gltf.MAT4}


@dataclass
class Binary:
    """The file's one buffer while it grows: every array or picture gets a view, 4-byte aligned."""

    data: bytearray = field(default_factory=bytearray)
    views: list[gltf.BufferView] = field(default_factory=list)
    accessors: list[gltf.Accessor] = field(default_factory=list)
    pictures: dict[bytes, int] = field(default_factory=dict)  # views of those that are there

    def add_bytes(self, raw: bytes, target: int | None = None, stride: int | None = None) -> int:
        """Append bytes; returns the index of their buffer view."""
        self.views.append(
            gltf.BufferView(
                buffer=0, byteOffset=len(self.data), byteLength=len(raw), target=target, byteStride=stride
            )
        )
        self.data += raw + bytes(-len(raw) % 4)
        return len(self.views) - 1

    def add_picture(self, raw: bytes) -> int:
        """Append a picture unless it is there; returns the index of its buffer view."""
        if raw not in self.pictures:
            self.pictures[raw] = self.add_bytes(raw)
        return self.pictures[raw]

    def add_array(
        self,
        array: Shaped[np.ndarray, "N ..."],
        target: int | None = None,
        bounds: bool = False,
        normalized: bool = False,
    ) -> int:
        """Append an array; returns its accessor's index. `bounds` stores its least and greatest values;
        `normalized` whole numbers are shares of their type's largest."""
        little_endian = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<"))
        stride = None
        if target == gltf.ARRAY_BUFFER and (short := -little_endian.strides[0] % 4):  # rows begin at fours
            stride = little_endian.strides[0] + short
            missing = short // little_endian.itemsize
            little_endian = np.pad(little_endian, ((0, 0), (0, missing)))
        accessor = gltf.Accessor(
            bufferView=self.add_bytes(little_endian.tobytes(), target, stride),
            componentType=COMPONENT_TYPES[array.dtype.name],
            count=len(array),
            type=ELEMENT_TYPES[array.shape[1:]],
            normalized=normalized,
        )
        if bounds:
            columns = array.reshape(len(array), -1)  # bounds are lists, of a single number too
            accessor.min, accessor.max = columns.min(axis=0).tolist(), columns.max(axis=0).tolist()
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def add_sparse(self, array: Float32[np.ndarray, "N 3"], bounds: bool = False) -> int:
        """Append an array that is zero nearly everywhere, as the rows that are not; returns its accessor's
        index."""
        rows = np.flatnonzero(array.any(axis=1))
        accessor = gltf.Accessor(byteOffset=None, componentType=gltf.FLOAT, count=len(array), type=gltf.VEC3)
        if len(rows):
            index_type = np.uint16 if len(array) <= 65535 else np.uint32
            accessor.sparse = gltf.Sparse(
                count=len(rows),
                indices=gltf.AccessorSparseIndices(
                    bufferView=self.add_bytes(rows.astype(np.dtype(index_type).newbyteorder("<")).tobytes()),
                    componentType=COMPONENT_TYPES[np.dtype(index_type).name],
                ),
                values=gltf.AccessorSparseValues(
                    bufferView=self.add_bytes(array[rows].astype("<f4").tobytes())
                ),
            )
        if bounds:
            accessor.min, accessor.max = array.min(axis=0).tolist(), array.max(axis=0).tolist()
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def add_indices(self, faces: Int64[np.ndarray, "F 3"], vertex_count: int) -> int:
        """Append the corners of faces; returns their accessor's index."""
        index_type = np.uint16 if vertex_count <= 65535 else np.uint32  # 65535 itself is reserved
        return self.add_array(faces.astype(index_type).ravel(), gltf.ELEMENT_ARRAY_BUFFER)
