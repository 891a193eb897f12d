"""Reach: balls that fit outside a surface, against shapes whose medial axis is known."""

import numpy as np
import skimage.measure
import torch

from assets.mesh.surface import Surface
from avatargen.body.distance import BodyDistance
from avatargen.body.reach import outer_reach
from avatargen.generator.decoder import body_points, fade, interpolate
from tests.shapes import icosphere, join, torus


def ring(major: float, minor: float) -> Surface:
    """A fine torus about the y axis."""
    axis = np.linspace(-0.4, 0.4, 81)
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    values = torus(major, minor)(torch.from_numpy(grid)).numpy().reshape(81, 81, 81)
    vertices, faces, _, _ = skimage.measure.marching_cubes(values, 0.0, spacing=(0.01,) * 3)
    return Surface(vertices=vertices.astype(np.float64) - 0.4, faces=faces.astype(np.int64))


def two_balls(gap: float) -> Surface:
    """Balls of radius 0.1 m side by side."""
    ball = icosphere(0.1, rounds=4)
    step = np.array([0.1 + gap / 2, 0, 0])
    return join(*(Surface(vertices=ball.vertices + side * step, faces=ball.faces) for side in (-1, 1)))


def test_a_convex_surface_reaches_as_far_as_one_asks():
    ball = icosphere(0.3, rounds=4)
    assert (outer_reach(ball.vertices, ball.faces, 0.5) == 0.5).all()


def test_the_hole_of_a_torus_is_shared_by_the_surface_around_it():
    surface = ring(0.25, 0.08)
    reach = outer_reach(surface.vertices, surface.faces, 0.5)
    inner = np.linalg.norm(surface.vertices[:, [0, 2]], axis=1) < 0.175
    outer = np.linalg.norm(surface.vertices[:, [0, 2]], axis=1) > 0.3

    # a ball on the axis touches the ring where its centre, the ring's own circle and the vertex line up
    across = np.linalg.norm(surface.vertices[inner][:, [0, 2]], axis=1)
    expected = 0.25 * 0.08 / (0.25 - across) - 0.08
    ratio = reach[inner] / expected
    assert ratio.min() > 0.8 and ratio.max() < 1.02 and abs(np.median(ratio) - 1) < 0.05
    assert (reach[outer] == 0.5).all()


def test_what_fades_at_the_reach_does_not_jump_with_the_closest_point():
    surface = two_balls(gap=0.05)
    random = np.random.default_rng(0)
    start = random.uniform([-2e-5, -0.06, -0.06], [2e-5, 0.06, 0.06], (4000, 3))
    points = np.stack([start, start + random.normal(0, 2e-5, start.shape)]).astype(np.float32)
    hit = BodyDistance(surface.vertices, surface.faces).query(points.reshape(-1, 3))
    near = body_points(hit, torch.from_numpy(surface.faces))
    inverse = torch.from_numpy(1 / outer_reach(surface.vertices, surface.faces, 0.5)).float()[:, None]
    side = torch.sign(torch.from_numpy(surface.vertices[:, :1])).float()  # a feature that knows its ball
    plain = interpolate(side, near)[0, :, 0]
    faded = plain * fade(near.distance, interpolate(inverse, near)[..., 0])[0]
    jump, faded_jump = ((v[:4000] - v[4000:]).abs().max().item() for v in (plain, faded))

    assert jump == 2  # some pairs straddle the plane halfway
    assert faded_jump < 0.005
    at_surface = fade(torch.zeros(1, 1), torch.full((1, 1), 1e4))
    assert at_surface == 1
