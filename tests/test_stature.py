"""How tall the wardrobe's people are, and that exported people are as tall as they should be."""

import numpy as np
import pytest
import torch

import avatargen
from assets import BuildConfig, build_content
from avatargen.avatar import AvatarSampler, load_single, shipped
from avatargen.body.load import load_body
from avatargen.body.model import pose, shape
from avatargen.body.pose import named_pose
from avatargen.wardrobe.attributes import LATENT_SIZE, People
from avatargen.wardrobe.stature import MEN, SPREAD, TAIL, WOMEN, Sizing, stature

BODY = load_body(shipped("body.npz"))


@pytest.fixture(scope="module")
def sampler() -> AvatarSampler:
    return load_single(shipped("generator.safetensors"))


@pytest.fixture(scope="module")
def people() -> People:
    return People(torch.randn(4000, LATENT_SIZE, generator=torch.Generator().manual_seed(2)))


def measured(betas: np.ndarray) -> float:
    """Crown to soles of the whole body standing straight, metres."""
    return float(np.ptp(shape(BODY, betas).vertices[:, 1]))


def with_height(normal: torch.Tensor, woman: float) -> People:
    """People who differ in their height coordinate alone."""
    at = People(torch.arange(float(LATENT_SIZE))[None])
    z = torch.zeros(len(normal), LATENT_SIZE)
    z[:, int(at.normal("height"))] = normal
    z[:, int(at.normal("woman"))] = woman
    return People(z)


@pytest.mark.parametrize(("woman", "mean"), [(1.0, WOMEN), (-1.0, MEN)])
def test_stature_rises_smoothly_with_its_coordinate_and_ends_at_the_tails(woman: float, mean: float):
    metres = stature(with_height(torch.linspace(-6, 6, 1201), woman))[:, 0].numpy()

    assert (np.diff(metres[250:950]) > 1e-5).all() and (np.diff(metres) >= 0).all()
    assert np.abs(np.diff(metres, n=2)).max() < 1e-5  # of steps of a hundredth: no kink
    assert metres[600] == pytest.approx(mean, abs=1e-6)
    assert metres[[0, -1]] == pytest.approx([mean - TAIL * SPREAD, mean + TAIL * SPREAD], abs=1e-3)
    ends = stature(with_height(torch.tensor([-40.0, 40.0]), woman))
    assert torch.isfinite(ends).all()


def test_women_and_men_are_as_tall_as_adults(people: People):
    metres, woman = stature(people)[:, 0], people.choice("woman")[:, 0] > 0

    for found, mean in ((metres[woman], WOMEN), (metres[~woman], MEN)):
        assert float(found.mean()) == pytest.approx(mean, abs=0.005)
        assert float(found.std()) == pytest.approx(SPREAD, abs=0.004)
    assert float((metres > 1.95).double().mean()) < 0.005


def test_the_ends_of_the_body_tell_its_stature(people: People):
    betas = torch.randn(40, BODY.shapedirs.shape[2], generator=torch.Generator().manual_seed(3)) * 1.3
    told = Sizing(BODY).stature(betas)[:, 0].numpy()

    np.testing.assert_allclose(told, [measured(row) for row in betas.numpy()], atol=1e-9)


def test_any_shape_can_be_given_any_stature():
    sizing, betas = Sizing(BODY), torch.randn(20, 10, generator=torch.Generator().manual_seed(4))
    wanted = torch.linspace(1.4, 2.1, 20)[:, None]
    sized = sizing.sized(betas, wanted)

    assert [measured(row) for row in sized.numpy()] == pytest.approx(wanted[:, 0].tolist(), abs=1e-5)
    again = sizing.sized(sized, wanted)
    assert (again - sized).abs().max() < 1e-5
    aside = torch.linalg.matrix_rank((sized - betas).double(), rtol=1e-4)
    assert aside == 1  # one direction, the body's own height


def test_training_and_the_sampler_give_the_same_stature(sampler: AvatarSampler, people: People):
    few = People(people.z[:30])
    target = Sizing(BODY).betas(few)
    assert [measured(row) for row in target.numpy()] == pytest.approx(stature(few)[:, 0].tolist(), abs=1e-5)
    assert target.abs().max() < 3  # what a generator can say
    for seed in range(4):
        z = torch.randn(1, LATENT_SIZE, generator=torch.Generator().manual_seed(seed))
        avatar = sampler.sample(seed)
        assert avatar.height == pytest.approx(float(stature(People(z))), abs=1e-5)
        assert avatar.height == measured(avatar.betas)


def test_the_exported_body_stands_as_tall(sampler: AvatarSampler):
    """In the rest pose: the body's own vertices, and the joints of the file with them."""
    avatar = sampler.sample(9)
    asset = build_content(avatar, BuildConfig(resolution=128, faces=4000, texture=64))
    posed = pose(BODY, shape(BODY, avatar.betas), named_pose("a", BODY.joint_names))
    assert np.ptp(posed.vertices[:, 1]) == pytest.approx(avatar.height, abs=0.005)
    joints = asset.skeleton.T_world_joint[:, :3, 3]  # pyright: ignore[reportAttributeAccessIssue]
    np.testing.assert_allclose(joints - joints[0], posed.joints - posed.joints[0], atol=1e-6)
    assert avatar.height < np.ptp(asset.vertices[:, 1]) < avatar.height + 0.12  # soles and hair on top


def test_the_mean_person_is_between_women_and_men(sampler: AvatarSampler):
    assert sampler.sample(1, truncation=0.0).height == pytest.approx((WOMEN + MEN) / 2, abs=1e-5)


def test_on_another_body_everybody_is_as_tall_as_it():
    import dataclasses

    other = dataclasses.replace(BODY, v_template=BODY.v_template * np.float32(0.9))
    sampler = avatargen.load_generator(body=other)
    assert not sampler.sample(0).betas.any()
    assert sampler.sample(0).height == pytest.approx(0.9 * measured(np.zeros(10)), abs=1e-4)
