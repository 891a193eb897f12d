"""How good an atlas is to paint on: islands, the share of the texture that is used, and stretch.

Stretch is that of Sander et al. 2001 ("Texture mapping progressive meshes"): how much longer lines become on
the way from the texture to the surface, as the root of the mean square over directions and over the surface,
1 for an atlas without any. It is measured beside the density of each face's part, which may differ.

Letters: F faces, W vertices after the seams have split them.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from assets.mesh.surface import Surface
from assets.texture.atlas import Atlas, uv_areas
from assets.texture.bake import cover_texels
from assets.texture.flatten import Sheets, singular_values
from assets.texture.seams import components

SIZE = 1024  # texels along a side at which the share in use is measured
TINY = 1e-9


@dataclass(frozen=True, kw_only=True)
class AtlasQuality:
    """What a painter sees of an atlas."""

    islands: int
    used: float  # share of texels under a face
    stretch: float  # 1 or more
    shear_p99: float  # longest over shortest line of a round brush, worst but for a hundredth of the surface


def measure_atlas(surface: Surface, atlas: Atlas, density: Float64[np.ndarray, " F"]) -> AtlasQuality:
    """Of an atlas whose faces were to have texels as fine as `density`, one number a face in any unit."""
    islands, _ = components(
        len(atlas.uv), atlas.faces[:, [0, 1]].reshape(-1), atlas.faces[:, [1, 2]].reshape(-1)
    )
    sheets = Sheets(
        vertices=surface.vertices[atlas.vertex_map],
        faces=atlas.faces,
        chart=np.zeros(len(atlas.faces), dtype=np.int64),
    )
    uv = atlas.uv.astype(np.float64)
    large, small = np.abs(singular_values(sheets, uv[:, 0] - 1j * uv[:, 1])) / density
    area = sheets.areas * density**2
    unit = np.sqrt(np.abs(uv_areas(atlas)).sum() / area.sum())
    large, small = np.maximum(large / unit, TINY), np.maximum(small / unit, TINY)
    squares = 0.5 * (1 / large**2 + 1 / small**2)
    shear = large / small
    order = np.argsort(shear)
    most = np.searchsorted(np.cumsum(area[order]), 0.99 * area.sum())
    covered = cover_texels(uv[atlas.faces] * SIZE, SIZE) >= 0
    return AtlasQuality(
        islands=islands,
        used=float(covered.mean()),
        stretch=float(np.sqrt((squares * area).sum() / area.sum())),
        shear_p99=float(shear[order[most]]),
    )
