"""What is carried to a face made soft: no edge of the skin is torn where one motion borders on another.

Letters: S the skin's welded vertices, N fixed ones, K corners of the lips. Metres.
"""

import numpy as np
from jaxtyping import Float64, Int64
from scipy.sparse import coo_array, csr_array, diags_array
from scipy.sparse.linalg import splu

from assets.face.curves import Curves
from assets.face.cut import CutMesh
from avatargen.smoothstep import smoothstep

ROUNDS = 8  # of smoothing what is carried
SMOOTHED = 0.02  # m from the curves
FREE, HELD = 0.004, 0.012  # m from a corner of the lips: up to which all bends freely, from where all is held
HOLD = 0.1  # how strongly what is carried is held in between
LEAST = 1e-6  # share of a displacement; less is none
TENSION = 0.05  # of the plate, by its stiffness: more is less pulled, but flattens smiles


def edge_matrix(mesh: CutMesh) -> csr_array:
    """One over the length of each edge, both ways."""
    edges, points = mesh.edges(), mesh.points
    value = 1 / np.maximum(np.linalg.norm(points[edges[:, 1]] - points[edges[:, 0]], axis=1), 1e-5)
    rows, columns = np.concatenate([edges, edges[:, ::-1]]).T
    return csr_array(coo_array((np.concatenate([value, value]), (rows, columns)), shape=(len(points),) * 2))


def smoothed(mesh: CutMesh, carry: csr_array, curves: Curves, fixed: Int64[np.ndarray, " N"]) -> csr_array:
    """What is carried near the curves as the mean of neighbours'; of fixed vertices as it is."""
    share = (curves.distance(mesh.points) < SMOOTHED).astype(np.float64)
    share[fixed] = 0
    step = towards_neighbours(mesh, share)
    for _ in range(ROUNDS):
        carry = csr_array(step @ carry)
    return carry


def towards_neighbours(mesh: CutMesh, share: Float64[np.ndarray, " S"]) -> csr_array:
    """Times what vertices have, it gives halves of that and of the mean of their neighbours', where the share
    is 1."""
    graph = edge_matrix(mesh)
    mean = diags_array(1 / np.maximum(graph.sum(axis=1), 1e-12)) @ graph
    return csr_array(diags_array(1 - share / 2) + diags_array(share / 2) @ mean)


def eased(mesh: CutMesh, carry: csr_array, corners: Int64[np.ndarray, " K"]) -> csr_array:
    """What is carried around the corners of the lips, bent as a stiff plate under tension would be: there
    one lip goes with the jaw and the other does not, and the body's own displacements leap within a
    millimetre. The plate is slit as the mesh is."""
    points = mesh.points
    away = np.min([np.linalg.norm(points - points[corner], axis=1) for corner in corners], axis=0)
    free, held = np.flatnonzero(away < HELD), np.flatnonzero(away >= HELD)
    graph = edge_matrix(mesh)
    bend = diags_array(np.ones(len(points))) - diags_array(1 / graph.sum(axis=1)) @ graph
    plate = csr_array(bend.T @ bend + TENSION * bend)[free]
    part = smoothstep(away[free], FREE, HELD)
    hold = HOLD * part / np.maximum(1 - part, 1e-9)
    columns = np.unique(carry[np.unique(plate.indices)].indices)
    known = carry[:, columns]
    wanted = hold[:, None] * known[free].toarray() - (plate[:, held] @ known[held]).toarray()
    found = splu((plate[:, free] + diags_array(hold)).tocsc()).solve(wanted)
    rows, row = np.nonzero(np.abs(found) > LEAST)
    own = coo_array((found[rows, row], (free[rows], columns[row])), shape=carry.shape)
    kept = np.ones(len(points))
    kept[free] = 0
    return csr_array(diags_array(kept) @ carry + own)
