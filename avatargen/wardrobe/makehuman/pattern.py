"""A garment's pattern pieces: the islands of its texture, and which of them keep their colours."""

import numpy as np
from jaxtyping import Bool, Int64, UInt8
from scipy.ndimage import distance_transform_edt
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from skimage.color import rgb2lab
from skimage.draw import polygon

from avatargen.wardrobe.makehuman.load import FittedGarment

TRIM = 25.0  # CIELAB units between a garment and a piece of it that is of another colour
MOST_TRIM = 0.4  # of its texels


def islands(garment: FittedGarment) -> Int64[np.ndarray, " F"]:
    """The pattern piece that each face belongs to: faces that share corners in the texture."""
    flat = np.round(garment.uv.reshape(-1, 2) * 1e5).astype(np.int64)
    _, corner = np.unique(flat, axis=0, return_inverse=True)
    corner = corner.reshape(-1, 3)
    ends = np.concatenate([corner[:, :2], corner[:, 1:]])
    graph = coo_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(corner.max() + 1,) * 2)
    return connected_components(graph, directed=False)[1][corner[:, 0]].astype(np.int64)


def padded(texture: UInt8[np.ndarray, "H W C"], used: Bool[np.ndarray, "H W"]) -> UInt8[np.ndarray, "H W C"]:
    """The texture with every other texel as the nearest used one, so that no background shows at seams."""
    rows, columns = np.asarray(distance_transform_edt(~used, return_distances=False, return_indices=True))
    return texture[rows, columns]


def used_texels(garment: FittedGarment) -> Bool[np.ndarray, "H W"]:
    """The texels that the garment's faces lie on."""
    used = drawn(garment, np.arange(len(garment.faces)))
    return used if used.any() else np.ones_like(used)


def drawn(garment: FittedGarment, faces: Int64[np.ndarray, " n"]) -> Bool[np.ndarray, "H W"]:
    """The texels that these faces lie on."""
    height, width = garment.texture.shape[:2]
    on = np.zeros((height, width), dtype=bool)
    for corners in garment.uv[faces] * (width, height):
        rows, columns = polygon(corners[:, 1], corners[:, 0], shape=on.shape)
        on[rows, columns] = True
    return on


def trim_texels(garment: FittedGarment) -> Bool[np.ndarray, "H W"]:
    """The texels of pattern pieces that keep their colours when a garment is dyed: a suit's shirt front with
    its tie, cuffs, buttons. Their own median is far from the garment's, and they are the lesser part of it.
    """
    used, label = used_texels(garment), islands(garment)
    lab = rgb2lab(garment.texture[..., :3])
    middle = np.median(lab[used], axis=0)
    trim = np.zeros_like(used)
    for piece in np.unique(label):
        texels = drawn(garment, np.flatnonzero(label == piece))
        if texels.any() and np.linalg.norm(np.median(lab[texels], axis=0) - middle) > TRIM:
            trim |= texels
    return trim if trim.sum() < MOST_TRIM * used.sum() else np.zeros_like(used)
