"""Run xatlas on meshes: a program of its own, so that its time can be limited and a crash stays outside.

Standard input holds an .npz: `resolution`, `padding`, and for each mesh i `positions_i` [V 3] and `faces_i`
[F 3]. Standard output is an .npz: `size` (of the atlas, texels) and for each mesh `vertices_i` (index into
its input), `faces_i` and `uv_i` (texels). Imports nothing of this package, so that it starts quickly.
"""

import io
import sys

import numpy as np
import xatlas

# at which a chart stops growing, and the weight of how far a face turns from it: a tenth more charts than
# with 2 and 2, which are xatlas's own, half as many faces so steep that the texture is stretched on them more
# than twice, in seven tenths of the time
MAX_COST, NORMAL_WEIGHT = 1.4, 4.0


def unwrap(arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Charts for all meshes, packed together."""
    atlas = xatlas.Atlas()
    count = sum(name.startswith("positions_") for name in arrays)
    for index in range(count):
        atlas.add_mesh(arrays[f"positions_{index}"], arrays[f"faces_{index}"])
    pack = xatlas.PackOptions()
    pack.resolution = int(arrays["resolution"])
    pack.padding = int(arrays["padding"])
    pack.bilinear = True
    chart = xatlas.ChartOptions()
    chart.max_cost, chart.normal_deviation_weight = MAX_COST, NORMAL_WEIGHT
    atlas.generate(chart, pack, False)
    result = {"size": np.array([atlas.width, atlas.height])}
    scale = np.array([atlas.width, atlas.height], dtype=np.float64)
    for index in range(count):
        vertices, faces, uv = atlas[index]
        result |= {f"vertices_{index}": vertices, f"faces_{index}": faces, f"uv_{index}": uv * scale}
    return result


def main() -> None:
    with np.load(io.BytesIO(sys.stdin.buffer.read())) as file:
        arrays = {name: file[name] for name in file.files}
    stream = io.BytesIO()
    np.savez(stream, **unwrap(arrays))  # pyright: ignore
    sys.stdout.buffer.write(stream.getvalue())


if __name__ == "__main__":
    main()
