"""Avatars by seed."""

import hashlib
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

import avatargen
from avatargen import load_generator
from avatargen.avatar import CPU_CHUNK, AvatarSampler, load_single
from avatargen.body.load import save_body
from avatargen.errors import FieldError, InputError
from avatargen.generator.camera import front_camera
from avatargen.generator.checkpoint import save_checkpoint
from avatargen.generator.person_field import PersonField
from avatargen.shipped import shipped
from tests.bodies import capsule_body, smpl_like_body
from tests.generators import capsule_distance, points_near_body, random_generator

BODY = capsule_body(0.04)


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("weights") / "g.safetensors"
    save_checkpoint(random_generator(), path, {"licence": "CC0-1.0"})
    return path


@pytest.fixture(scope="module")
def sampler(weights: Path) -> AvatarSampler:
    return load_single(weights, BODY)


def test_fields_are_those_of_the_generator(sampler: AvatarSampler):
    avatar, generator = sampler.sample(3), random_generator()
    points, body = points_near_body(300)
    z = torch.randn(1, 16, generator=torch.Generator().manual_seed(3))
    with torch.no_grad():
        w = generator.mapping(z, front_camera().vector)
        sdf, color, _ = generator.field(generator.planes(w), generator.layers(w), points, body)
        assert np.allclose(avatar.betas, generator.betas(w)[0].numpy(), atol=1e-5)
    assert (avatar.sdf(points[0]) - sdf[0]).abs().max() < 1e-4
    assert (avatar.color(points[0]) - color[0].clamp(0, 1)).abs().max() < 1e-4
    assert avatar.sdf(points[0]).dtype == torch.float32


def test_the_same_seed_is_the_same_person_and_others_differ(sampler: AvatarSampler):
    points = points_near_body(200)[0][0]
    first, again, other = (sampler.sample(seed) for seed in (7, 7, 8))
    assert torch.equal(first.sdf(points), again.sdf(points))
    assert torch.equal(first.color(points), again.color(points))
    assert np.array_equal(first.betas, again.betas)
    assert not torch.allclose(first.color(points), other.color(points))
    assert torch.equal(
        sampler.sample(1, truncation=0.0).sdf(points), sampler.sample(2, truncation=0.0).sdf(points)
    )


def test_sampling_neither_uses_nor_changes_the_global_random_state(sampler: AvatarSampler):
    torch.manual_seed(0)
    before = torch.get_rng_state()
    first = sampler.sample(5).betas
    assert torch.equal(torch.get_rng_state(), before)
    torch.manual_seed(1)
    assert np.array_equal(sampler.sample(5).betas, first)


def test_chunks_do_not_show(sampler: AvatarSampler):
    avatar = sampler.sample(0)
    points = points_near_body(CPU_CHUNK + 1000)[0][0]
    whole = avatar.sdf(points)
    parts = torch.cat([avatar.sdf(part) for part in points.split(9999)])
    assert (whole - parts).abs().max() < 1e-5
    assert avatar.color(points[:0]).shape == (0, 3)
    assert avatar.sdf(points[:0]).shape == (0,)


def test_threads_do_not_show(sampler: AvatarSampler):
    avatar, points = sampler.sample(0), points_near_body(3 * CPU_CHUNK)[0][0]
    before, answers = torch.get_num_threads(), []
    for threads in (1, 2, 3):
        torch.set_num_threads(threads)
        answers.append(avatar.color(points))
        assert torch.get_num_threads() == threads
    torch.set_num_threads(before)
    assert torch.equal(answers[0], answers[1]) and torch.equal(answers[0], answers[2])


def test_what_an_avatar_says_of_itself(sampler: AvatarSampler, weights: Path):
    avatar = sampler.sample(2**63 - 1)
    assert (avatar.seed, avatar.info.version, avatar.info.licence) == (
        2**63 - 1,
        avatargen.__version__,
        "CC0-1.0",
    )
    assert len(bytes.fromhex(avatar.info.weights_hash)) == hashlib.sha256().digest_size
    assert avatar.bounds.shape == (2, 3)
    assert (avatar.bounds[0] < avatar.body.vertices.min(axis=0)).all()
    assert (avatar.bounds[1] > avatar.body.vertices.max(axis=0)).all()
    assert not avatar.sdf(torch.zeros(1, 3)).requires_grad


@pytest.mark.parametrize("seed", [-1, 2**63, 1.0, "3", None, True])
def test_bad_seeds_are_refused(sampler: AvatarSampler, seed):
    with pytest.raises((InputError, TypeError), match="seed"):
        sampler.sample(seed)


def test_nan_points_and_nan_fields_are_refused(sampler: AvatarSampler):
    avatar = sampler.sample(0)
    with pytest.raises(FieldError, match="NaN"):
        avatar.sdf(torch.tensor([[0.0, torch.nan, 0.0]]))
    assert isinstance(avatar.field, PersonField)
    broken = replace(avatar, field=replace(avatar.field, table=avatar.field.table * torch.nan))
    for field in (broken.sdf, broken.color):
        with pytest.raises(FieldError, match="check the weights"):
            field(torch.zeros(1, 3))


def test_another_body_needs_the_one_that_was_trained_on(weights: Path):
    with pytest.raises(InputError, match="another body"):
        load_generator(weights, smpl_like_body())
    with pytest.raises(InputError, match="no file"):
        load_generator(weights.with_name("none.safetensors"), BODY)
    with pytest.raises(InputError, match="cannot read"):
        load_generator(weights, weights.with_name("none.npz"))


def test_another_body_wears_the_same_people(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, weights: Path):
    """A finer mesh of the same figure, standing elsewhere: nearly the same field, moved."""
    save_body(BODY, tmp_path / "body.npz")
    monkeypatch.setattr("avatargen.avatar.shipped", lambda name: tmp_path / name)
    step = np.array([0.3, -0.5, 0.2], dtype=np.float32)
    moved = replace(BODY, v_template=BODY.v_template + step)
    own = load_generator(weights).sample(4)
    other = load_generator(weights, moved).sample(4)
    points = points_near_body(500)[0][0]

    assert not other.betas.any()
    distance = (other.sdf(points + torch.from_numpy(step)) - own.sdf(points)).abs()
    color = (other.color(points + torch.from_numpy(step)) - own.color(points)).abs().amax(dim=1)
    # where two faces are equally near, rounding decides which one lends its features
    share = ((distance < 1e-4) & (color < 1e-3)).float().mean()
    assert share > 0.9
    finer = load_generator(weights, smpl_like_body()).sample(4)
    assert torch.isfinite(finer.sdf(points)).all()


def test_the_body_distance_is_shared_between_people(sampler: AvatarSampler):
    first, second = sampler.sample(0), sampler.sample(1)
    assert isinstance(first.field, PersonField) and isinstance(second.field, PersonField)
    assert first.field.distance is second.field.distance
    points = points_near_body(50)[0][0].numpy()
    assert np.array_equal(
        first.field.distance.query(points).distance, capsule_distance().query(points).distance
    )


def test_importing_the_package_is_light():
    code = "import sys, avatargen; assert 'torch' not in sys.modules and 'numpy' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
    assert avatargen.load_generator is load_generator
    with pytest.raises(AttributeError, match="nothing"):
        _ = avatargen.nothing  # pyright: ignore[reportAttributeAccessIssue]


def test_beyond_the_bounds_the_field_grows_with_the_way_back():
    avatar = load_single(shipped("generator.safetensors")).sample(114)  # whose skirt reaches them
    edge = torch.tensor([-0.192, -0.705, float(avatar.bounds[0, 2])])
    steps = torch.linspace(0, 0.5, 11)
    found = avatar.sdf(edge - steps[:, None] * torch.tensor([0.0, 0.0, 1.0]))
    assert torch.allclose(found, found[0] + steps, atol=1e-6)
    with pytest.raises(FieldError, match="finite points"):
        avatar.sdf(torch.tensor([[0.0, float("inf"), 0.0]]))
