"""A sheet and its paint sewn into a garment as the wardrobe knows it."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float64

from avatargen.wardrobe.dressed import EDGE_ZONE
from avatargen.wardrobe.makehuman.load import FittedGarment
from avatargen.wardrobe.makehuman.solid import Solid
from avatargen.wardrobe.tailored.form import Sheet, default_body
from avatargen.wardrobe.tailored.painting import Texels, texels_of, texture_of
from avatargen.wardrobe.tailored.pieces import laid_out

UNDER = 0.0015  # m inside a garment from which the body is hidden

Paint = Callable[[Texels], Float64[np.ndarray, "N 3"]]


def sew(
    name: str, kind: str, tags: tuple[str, ...], sheet: Sheet, paint: Paint, depth: int = 50
) -> FittedGarment:
    """The garment of a sheet; it hides what of the body lies within it, away from its edges."""
    uv = laid_out(sheet)
    texels = texels_of(sheet, uv)
    bare = FittedGarment(
        name=name,
        kind=kind,
        tags=tags,
        vertices=sheet.vertices.astype(np.float32),
        faces=sheet.faces,
        uv=uv,
        texture=texture_of(texels, paint(texels)),
        z_depth=depth,
        hidden=np.zeros(0, dtype=np.int64),
    )
    hit = Solid(garment=bare).hit(default_body().vertices)
    hidden = np.flatnonzero((hit.distance < -UNDER) & (hit.rim > EDGE_ZONE))
    return FittedGarment(**{**vars(bare), "hidden": hidden.astype(np.int64)})
