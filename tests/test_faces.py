"""Faces of the wardrobe's people: directions of the default body beyond its builds."""

import dataclasses

import numpy as np
import pytest
import torch

import avatargen
from avatargen.avatar import load_single, shipped
from avatargen.body.load import load_body
from avatargen.body.model import shape
from avatargen.wardrobe.attributes import LATENT_SIZE, People, coordinate
from avatargen.wardrobe.faces import FACE_SHAPES, MOST, face_betas
from avatargen.wardrobe.stature import ENDS, Sizing

BODY = load_body(shipped("body.npz"))
BUILDS = 10
heights = BODY.v_template[:, 1]


@pytest.fixture(scope="module")
def people() -> People:
    return People(torch.randn(60, LATENT_SIZE, generator=torch.Generator().manual_seed(7)))


def test_faces_are_on_the_head_alone_and_leave_the_crown_as_high():
    faces = BODY.shapedirs[:, :, BUILDS:]
    reach = np.linalg.norm(faces, axis=1).max(axis=0)  # m, of the vertex that moves most

    assert faces.shape[2] == len(FACE_SHAPES)
    assert (reach > 0.0012).all() and (reach < 0.02).all(), dict(zip(FACE_SHAPES, reach, strict=True))
    assert not faces[heights > heights.max() - ENDS, 1].any()
    assert not faces[BODY.weights[:, BODY.joint_names.index("head")] == 0].any()


def test_statures_do_not_depend_on_faces(people: People):
    sizing = Sizing(BODY)
    betas = sizing.betas(people)
    plain = torch.cat([betas[:, :BUILDS], torch.zeros(len(betas), len(FACE_SHAPES))], dim=1)

    assert torch.equal(sizing.stature(betas), sizing.stature(plain))
    taller = sizing.sized(betas, sizing.stature(betas) + 0.1)
    assert torch.equal(taller[:, BUILDS:], betas[:, BUILDS:])
    assert float((sizing.stature(taller) - sizing.stature(betas) - 0.1).abs().max()) < 1e-5


def test_women_and_men_have_faces_of_their_own(people: People):
    """With all else alike they differ by millimetres where noses, brows and jaws are."""
    z = torch.zeros(2, LATENT_SIZE)
    z[:, coordinate("woman")] = torch.tensor([1.0, -1.0])
    faces = Sizing(BODY).betas(People(z))[:, BUILDS:].double().numpy()
    apart = np.linalg.norm(BODY.shapedirs[:, :, BUILDS:] @ (faces[0] - faces[1]), axis=1)
    assert 0.003 < apart.max() < 0.02

    drawn = face_betas(people)
    assert drawn.shape == (60, len(FACE_SHAPES)) and drawn.abs().max() <= MOST
    assert (drawn.std(dim=0) > 0.2).all()
    assert Sizing(BODY).betas(people).abs().max() < 3  # what a generator can say


def test_no_face_folds(people: People):
    """Triangles of the head keep facing outward: few turn by more than 75 degrees beside the same build."""
    heads = BODY.faces[(BODY.weights[BODY.faces, BODY.joint_names.index("head")] > 0.9).all(axis=1)]

    def normals(betas: np.ndarray) -> np.ndarray:
        corners = shape(BODY, betas).vertices[heads]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        return normal / np.linalg.norm(normal, axis=1, keepdims=True)

    for betas in Sizing(BODY).betas(people)[:20].numpy():
        turned = (normals(betas) * normals(betas[:BUILDS])).sum(axis=1) < np.cos(np.radians(75))
        assert turned.mean() < 0.005


def test_the_shipped_weights_wear_the_wardrobes_faces():
    """The sampler's people have the faces of their latents, on the body that the weights were trained on."""
    sampler = load_single(shipped("generator.safetensors"))
    z = torch.randn(1, LATENT_SIZE, generator=torch.Generator().manual_seed(5))
    assert sampler.own_body
    np.testing.assert_array_equal(sampler.sample(5).betas[BUILDS:], face_betas(People(z))[0].numpy())
    assert not sampler.sample(5, truncation=0.0).betas[BUILDS:].any()


def test_a_body_without_faces_still_works(people: People):
    plain = dataclasses.replace(BODY, shapedirs=BODY.shapedirs[:, :, :BUILDS].copy())
    assert torch.equal(Sizing(plain).betas(people), Sizing(BODY).betas(people)[:, :BUILDS])
    avatar = avatargen.load_generator(body=plain).sample(5)
    assert len(avatar.betas) == BUILDS and avatar.height == pytest.approx(
        avatargen.load_generator().sample(5).height, abs=1e-6
    )
