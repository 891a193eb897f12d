"""AvatarGen's generator on a body, as adversarial training takes it.

Letters as in `picture_model`.
"""

import copy
import dataclasses
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from avatargen.body.model import Body, canonical_body
from avatargen.errors import TrainingError
from avatargen.generator.camera import camera_of_vector
from avatargen.generator.checkpoint import Checkpoint, save_checkpoint
from avatargen.generator.config import GeneratorConfig, for_body
from avatargen.generator.decoder import fit_reach
from avatargen.generator.density import Density
from avatargen.generator.generator import AvatarGenerator
from avatargen.generator.layers import may_branch
from avatargen.generator.picture import CanonicalSurface, People, make_people, picture_people
from avatargen.generator.room import Room, survey
from avatargen.training.adversarial_config import NETWORKS, AdversarialConfig, LossConfig, OptimizerConfig
from avatargen.training.losses import geometry_losses
from avatargen.training.picture_model import Asked, Generated, PictureModel

HALF_DIGITS = 2e-3  # share by which a number moves when a file keeps it in 16 bits, and some


class AvatarModel(PictureModel):
    """The generator's networks, the body they are made for, and the weights of the geometry losses."""

    def __init__(self, networks: AvatarGenerator, surface: CanonicalSurface, losses: LossConfig) -> None:
        super().__init__()
        self.networks, self.surface, self.weights = networks, surface, losses
        self.z_size = networks.config.mapping.z_size
        self.blocks = len(networks.config.synthesis.blocks)
        self.render = networks.config.render

    def __deepcopy__(self, memo: dict[int, Any]) -> "AvatarModel":
        return AvatarModel(copy.deepcopy(self.networks, memo), self.surface, self.weights)

    def generate(self, asked: Asked) -> Generated:
        networks = self.networks
        w = networks.mapping(asked.z, asked.mapped_camera)
        planes, late = networks.planes(w), w
        if asked.crossover:
            late = networks.mapping(asked.other_z, asked.mapped_camera)
            planes = networks.synthesis(w, late, asked.crossover)
        people = make_people(networks, self.surface, late.float(), planes.float(), asked.pose, asked.betas)
        camera = camera_of_vector(asked.camera)
        picture = picture_people(networks, people, camera, asked.seeds, asked.room)
        seeds = torch.zeros(len(people), dtype=torch.long, device=people.w.device)
        seeds = seeds if asked.seeds is None else asked.seeds
        return Generated(picture=picture, losses=lambda: self.losses_of(people, seeds))

    def losses_of(self, people: People, seeds: Int64[Tensor, " B"]) -> dict[str, Float[Tensor, ""]]:
        """The geometry losses, weighted."""
        weights = self.weights
        shape = geometry_losses(self.networks, people, weights.points, seeds)
        return {
            "eikonal": weights.eikonal * shape.eikonal,
            "minimal_surface": weights.minimal_surface * shape.minimal_surface,
            "smpl": weights.smpl * shape.smpl,
        }

    def survey(self, labels: tuple[Tensor, Tensor, Tensor]) -> Room | None:
        place = self.networks.density.p
        if may_branch(place):
            return None
        return survey(self.networks.config.render, self.surface, labels, place.device)

    def settings(self) -> dict[str, Any]:
        return dataclasses.asdict(self.networks.config)

    def save(self, path: Path, notes: dict[str, str]) -> None:
        save_checkpoint(self.networks, path, {"licence": "Apache-2.0", **notes})

    def groups(self, config: OptimizerConfig) -> list[dict[str, Any]]:
        """All parameters at one rate, but the density's, which a step of that size would undo."""
        density = list(self.networks.density.parameters())
        others = [p for name, p in self.networks.named_parameters() if not name.startswith("density.")]
        rate = config.generator_rate
        return [{"params": others, "lr": rate}, {"params": density, "lr": rate * config.density_share}]

    def numbers(self) -> dict[str, Float[Tensor, ""]]:
        return {"alpha": self.networks.density.alpha.detach()}

    @torch.no_grad()
    def settle(self, z: Float[Tensor, "N Z"], camera: Float[Tensor, "N 25"]) -> None:
        mapping = self.networks.mapping
        mapping.average.copy_(mapping(z, camera).mean(dim=0))


def avatar_model(config: AdversarialConfig, body: Body, start: Checkpoint | None = None) -> AvatarModel:
    """Seeded networks of a run, with the weights of `start` where given.

    Raises:
        TrainingError: those weights are of another body or of other networks.
    """
    networks = generator_config(config, body, start)
    torch.manual_seed(config.seed)
    generator = AvatarGenerator(networks)
    if start is None:
        fit_reach(generator.decoder, canonical_body(body))
    else:
        take_weights(generator, first_weights(start, config))
    return AvatarModel(generator, CanonicalSurface(body), config.losses)


def take_weights(generator: AvatarGenerator, start: dict[str, Tensor]) -> None:
    """Begin with these weights, which may leave out the deformation's.

    Raises:
        TrainingError: they are of other networks.
    """
    try:
        generator.load_state_dict(generator.deformation.state_dict(prefix="deformation.") | start)
    except RuntimeError as error:
        raise TrainingError(
            "train: the weights to start from are of other networks "
            f"({str(error).splitlines()[-1].strip()}); change the picture sizes or start without them"
        ) from error


def generator_config(config: AdversarialConfig, body: Body, start: Checkpoint | None) -> GeneratorConfig:
    """The networks of the preset, or of the weights to start from, with this run's geometry and rendering.

    The deformation is also this run's, unless the weights bring one that has learned.

    Raises:
        TrainingError: those weights are of another body.
    """
    fresh = for_body(NETWORKS[config.networks], canonical_body(body))
    networks = start.generator.config if start else fresh
    if networks.body_hash != fresh.body_hash:
        raise TrainingError("train: the weights to start from are of another body; start without them")
    decoder = networks.decoder
    if config.geometry.prior == "none":
        decoder = replace(decoder, vertex_features=0)
    learned = start is not None and learned_deformation(start.generator)
    deformation = networks.deformation if learned else config.deformation
    return replace(
        networks, geometry=config.geometry, render=config.render, decoder=decoder, deformation=deformation
    )


def learned_deformation(generator: AvatarGenerator) -> bool:
    """Whether the deformation moves anything; before adversarial training it does not."""
    leave = generator.deformation.leave
    return bool(leave.weight.any() or leave.bias.any())


def first_weights(start: Checkpoint, config: AdversarialConfig) -> dict[str, Tensor]:
    """The weights to start from; where nothing was rendered in their training, with this run's sharpness. A
    deformation that has not learned is left out, and begins anew.
    """
    weights, rendering = start.generator.state_dict(), start.generator.config.render
    if not learned_deformation(start.generator):
        weights = {name: value for name, value in weights.items() if not name.startswith("deformation.")}
    untrained = Density(rendering.initial_alpha).p.detach()
    if torch.isclose(weights["density.p"].cpu(), untrained, rtol=HALF_DIGITS):
        weights["density.p"] = Density(config.render.initial_alpha).p.detach()
    return weights
