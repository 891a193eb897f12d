"""An order in which points that are near each other follow each other: along Morton's space-filling curve."""

import numpy as np
from jaxtyping import Float, Int64

STEPS = 255  # cells along the longest side of the points' box, less one: eight bits a coordinate
# each number of eight bits with its bits two places apart, so that three such numbers fit into each other
SPREAD_BITS = np.bitwise_or.reduce(
    [(np.arange(256, dtype=np.uint32) >> bit & 1) << 3 * bit for bit in range(8)]
)


def morton_order(points: Float[np.ndarray, "N 3"]) -> Int64[np.ndarray, " N"]:
    """Indices that sort points, in any unit, along the curve: by the interleaved bits of their cells
    (Morton 1966), cells of 1/256 of the points' box. Points of one cell keep their order."""
    if len(points) < 2:
        return np.arange(len(points))
    columns = [np.ascontiguousarray(column, dtype=np.float64) for column in points.T]
    scale = STEPS / max(1e-12, *(np.ptp(column) for column in columns))
    x, y, z = (SPREAD_BITS[((column - column.min()) * scale).astype(np.uint8)] for column in columns)
    code = x | y << 1 | z << 2
    order = np.argsort((code & 0xFFFF).astype(np.uint16), kind="stable")  # linear for numbers so small
    return order[np.argsort((code >> 16).astype(np.uint8)[order], kind="stable")]
