"""A generator of a file as a model that is measured, with more samples along rays than it learned with."""

import copy
from dataclasses import replace

from avatargen.body.model import Body
from avatargen.generator.generator import AvatarGenerator
from avatargen.generator.picture import CanonicalSurface
from avatargen.training.adversarial_config import LossConfig
from avatargen.training.avatar_model import AvatarModel


def model_of(generator: AvatarGenerator, body: Body, samples: int | None) -> AvatarModel:
    """The generator on a body; none: with its own samples."""
    networks = generator if samples is None else finer(generator, samples)
    return AvatarModel(networks, CanonicalSurface(body), LossConfig())


def finer(generator: AvatarGenerator, samples: int) -> AvatarGenerator:
    """The same networks, with so many samples a ray."""
    other = copy.copy(generator)
    render = replace(generator.config.render, samples=samples)
    other.config = replace(generator.config, render=render)
    return other
