"""Linear blend skinning and its inverse, in float64.

Letters: N points, J joints. `T_posed_rest` [J 4 4] takes a point that is rigidly fixed to a joint from the
rest pose to the posed one; a point moves by the weighted mean of its joints' transforms.
"""

import numpy as np
from jaxtyping import Float

# The mean of two rotations t apart has determinant cos(t/2)^2, so this is 178.9 degrees.
MINIMUM_DETERMINANT = 1e-4


def blend(
    weights: Float[np.ndarray, "N J"], transforms: Float[np.ndarray, "J 4 4"]
) -> Float[np.ndarray, "N 4 4"]:
    """Each point's weighted mean of the joints' transforms."""
    flat = np.asarray(transforms, dtype=np.float64).reshape(len(transforms), 16)
    return (np.asarray(weights, dtype=np.float64) @ flat).reshape(-1, 4, 4)


def invert_blend(
    weights: Float[np.ndarray, "N J"], transforms: Float[np.ndarray, "J 4 4"]
) -> Float[np.ndarray, "N 4 4"]:
    """The inverse of each point's blended transform.

    A mean of opposite rotations has no inverse (a joint bent by 180 degrees). Where the determinant falls
    below `MINIMUM_DETERMINANT` the point follows its heaviest joint alone, whose rigid transform always has
    one.
    """
    blended = blend(weights, transforms)
    across, determinant = adjugate(blended[:, :3, :3])
    singular = ~(determinant > MINIMUM_DETERMINANT)  # also catches NaN
    if singular.any():
        blended[singular] = transforms[np.argmax(weights[singular], axis=1)]
        across[singular], determinant[singular] = adjugate(blended[singular, :3, :3])
    inverse = np.zeros_like(blended)
    inverse[:, :3, :3] = across / determinant[:, None, None]
    inverse[:, 3, 3] = 1 / blended[:, 3, 3]
    inverse[:, :3, 3] = np.einsum("nij,nj->ni", inverse[:, :3, :3], blended[:, :3, 3])
    inverse[:, :3, 3] *= -inverse[:, 3, 3, None]
    return inverse


def adjugate(
    matrices: Float[np.ndarray, "N 3 3"],
) -> tuple[Float[np.ndarray, "N 3 3"], Float[np.ndarray, " N"]]:
    """What over the determinant is the inverse, and the determinant; faster than a general inverse."""
    a, b, c = np.moveaxis(matrices, 1, 0)
    across = np.stack([cross(b, c), cross(c, a), cross(a, b)], axis=2)
    return across, np.einsum("ni,ni->n", a, across[:, :, 0])


def cross(a: Float[np.ndarray, "N 3"], b: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3"]:
    """Cross products, several times as fast as numpy's."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)


def transform(
    transforms: Float[np.ndarray, "N 4 4"], points: Float[np.ndarray, "N 3"]
) -> Float[np.ndarray, "N 3"]:
    """Apply to each point its own affine transform."""
    return np.einsum("nij,nj->ni", transforms[:, :3, :3], points) + transforms[:, :3, 3]


def skin(
    points: Float[np.ndarray, "N 3"],
    weights: Float[np.ndarray, "N J"],
    T_posed_rest: Float[np.ndarray, "J 4 4"],
) -> Float[np.ndarray, "N 3"]:
    """Rest points to posed points (metres, float64)."""
    return transform(blend(weights, T_posed_rest), points)


def unskin(
    points: Float[np.ndarray, "N 3"],
    weights: Float[np.ndarray, "N J"],
    T_posed_rest: Float[np.ndarray, "J 4 4"],
) -> Float[np.ndarray, "N 3"]:
    """Posed points back to rest points: the inverse of `skin` for the same weights (metres, float64)."""
    return transform(invert_blend(weights, T_posed_rest), points)
