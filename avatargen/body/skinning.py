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
    singular = ~(np.linalg.det(blended[:, :3, :3]) > MINIMUM_DETERMINANT)  # also catches NaN
    if singular.any():
        blended[singular] = transforms[np.argmax(weights[singular], axis=1)]
    return np.linalg.inv(blended)


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
