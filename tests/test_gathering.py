"""The compiled inputs of the field's networks, against those that torch makes."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from avatargen.avatar import load_single
from avatargen.body.distance import BodyHit
from avatargen.generator.gathering import Rows, gathering_of
from avatargen.generator.person_field import PersonField
from avatargen.generator.planes import lookup_bilinear, plane_table
from avatargen.shipped import shipped
from tests.generators import capsule_canonical, capsule_distance, points_near_body, random_generator

PARTS = (((0.0, 0.5, 0.0),), ((0.3, 0.4, 0.0), (-0.3, 0.4, 0.0)), ((0.1, -0.4, 0.0), (-0.1, -0.4, 0.0)))


def near_points(count: int) -> tuple[np.ndarray, BodyHit]:
    points = points_near_body(count, spread=0.1)[0][0].numpy()
    points[::50] *= 3  # far out of the planes' box too
    return points, capsule_distance().query(points)


@pytest.mark.parametrize(
    "decoder",
    [
        {},
        {"parts": PARTS},
        {"vertex_features": 0},
        {"frequencies": 0},
        {"parts": PARTS, "vertex_features": 16, "frequencies": 6},
        {"parts": PARTS, "vertex_features": 0, "frequencies": 0},
    ],
    ids=str,
)
def test_rows_hold_what_torch_computes(decoder: dict):
    generator = random_generator(**decoder).double()
    network, frame = generator.decoder, generator.frame
    points, hit = near_points(700)
    exact = torch.from_numpy(points.astype(np.float64))
    body = points_near_body(700, spread=0.1)[1]
    body = replace(
        body,
        distance=torch.from_numpy(hit.distance.astype(np.float64))[None],
        vertices=torch.from_numpy(capsule_canonical().faces[hit.face])[None],
        barycentric=torch.from_numpy(hit.barycentric.astype(np.float64))[None],
    )
    w = torch.randn(1, generator.config.mapping.w_size, generator=torch.Generator().manual_seed(0)).double()
    with torch.no_grad():
        table = plane_table(generator.planes(w))[0]
        features = lookup_bilinear(table, frame(exact))[None]
        wanted = network.inputs(features, frame.centered(exact)[None], body)[0].numpy()
        shares = np.ones((len(points), 1)) if network.shares is None else network.shares(exact).numpy()
    rows = gathering_of(network, frame, capsule_canonical().faces).rows(
        exact.numpy(), hit, table.numpy().astype(np.float32)
    )

    size = np.abs(wanted).max(axis=0)
    # torch holds pi as float32, of which 32 pi radians tell
    assert (np.abs(rows.inputs - wanted[rows.point]) < 2e-5 * np.maximum(size, 1)).all()
    assert np.abs(given_shares(rows, shares.shape) - shares).max() < 1e-6
    assert (given_shares(rows, shares.shape) > 0).sum() == len(rows.point)


def given_shares(rows: Rows, shape: tuple[int, ...]) -> np.ndarray:
    """[N P] shares, by rows; every point has each part once at most."""
    part = np.searchsorted(rows.ends, np.arange(len(rows.point)), side="right")
    assert len(np.unique(rows.point * shape[1] + part)) == len(rows.point)
    shares = np.zeros(shape)
    shares[rows.point, part] = rows.share
    return shares


def test_the_shipped_person_is_the_same_with_and_without():
    avatar = load_single(shipped("generator.safetensors")).sample(3)
    assert isinstance(avatar.field, PersonField)
    by_torch = replace(avatar, field=replace(avatar.field, gathering=None))
    draw = np.random.default_rng(0)
    vertices = avatar.body.vertices[draw.integers(0, len(avatar.body.vertices), 20_000)]
    points = torch.from_numpy((vertices + draw.normal(0, 0.02, vertices.shape)).astype(np.float32))

    assert (avatar.sdf(points) - by_torch.sdf(points)).abs().max() < 5e-6  # metres
    assert (avatar.color(points) - by_torch.color(points)).abs().max() < 1e-3
