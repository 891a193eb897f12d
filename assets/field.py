"""Fields: plain functions of points, asked in chunks and checked.

A distance field takes torch float32 [N, 3] metres and gives [N] metres, negative inside; a colour field
gives [N, 3] sRGB in 0..1. Nothing in this package knows where they come from, so a sphere is as good as a
network.
"""

from collections.abc import Callable

import numpy as np
import torch
from jaxtyping import Float, Float64
from torch import Tensor

from avatargen.errors import FieldError

Field = Callable[[Tensor], Tensor]
CHUNK = 1 << 18  # points asked at once; a field may cut them smaller


def ask(field: Field, points: Float[np.ndarray, "N 3"], *channels: int) -> Float64[np.ndarray, "N *C"]:
    """Values of a field at points (metres), as float64; `channels` is the shape of one value, () for a
    distance.

    Raises:
        FieldError: values of another shape, NaN or infinite.
    """
    values = np.empty((len(points), *channels))
    with torch.no_grad():
        for start in range(0, len(points), CHUNK):
            chunk = torch.from_numpy(np.ascontiguousarray(points[start : start + CHUNK], dtype=np.float32))
            answer = field(chunk)
            if answer.shape != (len(chunk), *channels):
                wanted = (len(chunk), *channels)
                raise FieldError(
                    f"field: gave shape {tuple(answer.shape)} for {len(chunk)} points; {wanted} is needed"
                )
            values[start : start + CHUNK] = answer.cpu().numpy()
    if not np.isfinite(values).all():
        bad = int((~np.isfinite(values)).sum())
        raise FieldError(
            f"field: {bad} of {values.size} values are NaN or infinite; check the weights and the bounds"
        )
    return values
