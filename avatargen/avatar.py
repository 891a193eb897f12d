"""An avatar: one person as functions of canonical points, and the generator that draws them.

    load_single(weights) -> AvatarSampler --sample(seed)--> Avatar --sdf(points), color(points)--> numbers

Canonical space: X-pose, betas 0, metres, y up, facing +z. Letters: N points, D size of w, B directions of
shape, V vertices of the body.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Bool, Float, Float32
from torch import Tensor, nn

from avatargen import __version__
from avatargen.avatar_info import AvatarInfo, Described
from avatargen.body.distance import BodyDistance
from avatargen.body.fingers import without_fingers
from avatargen.body.load import load_body
from avatargen.body.model import Body, CanonicalBody, canonical_body, shape
from avatargen.errors import FieldError, InputError
from avatargen.generator.camera import front_camera
from avatargen.generator.checkpoint import load_checkpoint
from avatargen.generator.config import GeneratorConfig, PlanesConfig, body_hash
from avatargen.generator.decoder import body_points, fit_reach, interpolate
from avatargen.generator.gathering import Gathering, gathering_of
from avatargen.generator.generator import AvatarGenerator
from avatargen.generator.person_field import PersonField
from avatargen.generator.planes import plane_table
from avatargen.mesh.morton import morton_order
from avatargen.shipped import shipped
from avatargen.threads import spread
from avatargen.wardrobe.attributes import CODING
from avatargen.wardrobe.choosing import Traits, traits_of
from avatargen.wardrobe.condition import condition
from avatargen.wardrobe.describe import describe, people_of
from avatargen.wardrobe.dressed import DressedField
from avatargen.wardrobe.faces import BUILDS
from avatargen.wardrobe.stature import MEAN_PERSON, Sizing, stature

LARGEST_SEED = 2**63 - 1
CPU_CHUNK = 1 << 13  # points that go through the network at once: stays in a core's cache
WORTH_A_THREAD = 1 << 10  # points
FEWEST_CHUNKS = 4  # of points that are worth as many threads
GPU_CHUNK = 1 << 18
HALF = 0.5  # of a hidden neighbourhood, from which a vertex counts as hidden
BOX_MARGIN = 0.05  # metres around the body that an avatar's box always has


@runtime_checkable
class Fields(Protocol):
    """Distance and colour of a whole person (`PersonField`, `DressedField`) or of one layer."""

    @property
    def device(self) -> torch.device: ...

    def sdf(self, points: np.ndarray) -> np.ndarray: ...

    def color(self, points: np.ndarray) -> np.ndarray: ...


@dataclass(frozen=True, kw_only=True, eq=False)
class Avatar:
    """One person in the canonical space."""

    body: CanonicalBody
    betas: Float32[np.ndarray, " B"]
    bounds: Float32[np.ndarray, "2 3"]
    info: AvatarInfo
    field: Fields

    @property
    def seed(self) -> int:
        return self.info.seed

    @property
    def height(self) -> float:
        """How tall the body stands without clothes and hair, crown of the head to the soles, metres."""
        return self.info.height_m

    @property
    def attributes(self) -> Described | None:
        """The person in words; None where the weights do not say, or the person is drawn to the mean."""
        return self.info.attributes

    @property
    def layers(self) -> dict[str, "Avatar"]:
        """The person layer by layer, each an avatar with a distance and a colour of its own, built as any:
        body, then what is worn from the skin outward (socks, shoes, bottom, top, overall, outer, hat), hair.

        Raises:
            InputError: the person is one field, not layers, as the paper's generator makes them.
        """
        if not isinstance(self.field, DressedField):
            raise InputError(
                "layers: this person is one field; draw one from a generator of dressed people, as the "
                "shipped weights are"
            )
        from avatargen.wardrobe.alone import layers_of  # most people are made whole

        return {name: replace(self, field=layer) for name, layer in layers_of(self.field).items()}

    def cover(self, points: Float32[np.ndarray, "N 3"]) -> Float[np.ndarray, " N"]:
        """Of a layer: how surely it hides what lies beneath it at canonical points, 0..1. A whole person, a
        body and hair hide nothing."""
        from avatargen.wardrobe.alone import LayerField

        if not isinstance(self.field, LayerField):
            return np.zeros(len(points))
        return self.field.cover(points.astype(np.float32))

    @cached_property
    def hidden(self) -> Bool[np.ndarray, " V"]:
        """The body's vertices that clothes hide; none where the person is one field."""
        if not isinstance(self.field, DressedField):
            return np.zeros(len(self.body.vertices), dtype=bool)
        from avatargen.wardrobe.alone import hidden_under

        worn = hidden_under(self.field)
        if self.field.fitted is None:
            return worn
        hit, _ = self.field.closest(self.body.vertices.astype(np.float32))
        return (worn[self.field.body.faces[hit.face]] * hit.barycentric).sum(axis=1) > HALF

    @torch.inference_mode()
    def sdf(self, points: Float[Tensor, "N 3"]) -> Float[Tensor, " N"]:
        """Signed distance to the clothed surface, metres, negative inside.

        Beyond the bounds, where nothing was learned, it is that of the nearest point within plus the way to
        it: a skirt that reaches them ends.

        Raises:
            FieldError: a point or a value is NaN or infinite.
        """
        given = points.to("cpu", torch.float32).numpy()
        within = np.clip(given, *self.bounds)
        beyond = np.sqrt(((given - within) ** 2).sum(axis=1))
        if not np.isfinite(beyond).all():
            within = given  # which is refused
        values = self.evaluate(within, self.field.sdf, "signed distance") + beyond
        return torch.from_numpy(values).to(points.device)

    @torch.inference_mode()
    def color(self, points: Float[Tensor, "N 3"]) -> Float[Tensor, "N 3"]:
        """Colour at points on or near the surface, sRGB in 0..1.

        Raises:
            FieldError: a point or a value is NaN or infinite.
        """
        given = points.to("cpu", torch.float32).numpy()
        values = self.evaluate(given, self.field.color, "colour")
        return torch.from_numpy(values.clip(0, 1)).to(points.device)

    def evaluate(
        self,
        given: Float32[np.ndarray, "N 3"],
        field: Callable[[np.ndarray], np.ndarray],
        what: str,
    ) -> Float32[np.ndarray, "N *C"]:
        """Ask the field at any number of points, in chunks of neighbours.

        All but the networks is numpy's here: torch's own threads, once woken, stand in the way of ours.
        """
        if not np.isfinite(given).all():
            raise FieldError("avatar: points hold NaN or infinity; ask at finite points")
        order = morton_order(given)

        def answer(index: np.ndarray) -> np.ndarray:
            return field(given[index])

        on_cpu = self.field.device.type == "cpu"
        count = -(-len(order) // (CPU_CHUNK if on_cpu else GPU_CHUNK))
        if on_cpu:
            count = max(count, min(FEWEST_CHUNKS, len(order) // WORTH_A_THREAD))
        chunks = np.array_split(order, max(count, 1))
        found = np.concatenate(spread(answer, chunks) if on_cpu else list(map(answer, chunks)))
        values = np.empty_like(found)
        values[order] = found
        if not np.isfinite(values).all():
            raise FieldError(f"avatar: the {what} of seed {self.seed} is NaN or infinite; check the weights")
        return values


@runtime_checkable
class Sampler(Protocol):
    """A generator on a body: draws avatars by seed."""

    @property
    def body(self) -> CanonicalBody: ...

    @property
    def weights_hash(self) -> str: ...

    def sample(
        self,
        seed: int,
        truncation: float = 1.0,
        traits: Traits | Mapping[str, str | float] | None = None,
        wear: Mapping[str, int] | None = None,
    ) -> Avatar: ...


@dataclass(frozen=True, kw_only=True, eq=False)
class AvatarSampler:
    """A trained generator on a body: draws avatars by seed."""

    generator: AvatarGenerator
    body: CanonicalBody
    distance: BodyDistance
    gathering: Gathering | None
    offset: Float[Tensor, "3"]
    bounds: Float32[np.ndarray, "2 3"]
    own_body: (
        bool  # the body is the one the generator was trained on, so its betas mean what the generator learned
    )
    coded: bool  # z is the wardrobe's coding of attributes
    sizing: Sizing | None  # statures of the body's shapes; None where these or z mean other things
    weights_hash: str
    licence: str

    @torch.inference_mode()
    def sample(
        self,
        seed: int,
        truncation: float = 1.0,
        traits: Traits | Mapping[str, str | float] | None = None,
        wear: Mapping[str, int] | None = None,
    ) -> Avatar:
        """Draw a person. The latent is drawn on the CPU: the same seed is the same person on any machine.

        With `traits`, such as {"gender": "woman", "hair": "long", "height": 1.7}, a person who has them, and
        is otherwise as the seed has it (`avatargen traits` lists them). Women are 1.63 m tall in the mean and
        men 1.76 m, each seed by its own height coordinate. With another body everybody is as tall as it.

        Raises:
            InputError: the seed is no whole number in 0..2^63 - 1, truncation is not in 0..1, or traits are
            unknown, contradict each other, or are none that these weights or this body can show; or `wear`
            names garments, which people who are one field do not have.
        """
        require_truncation(truncation)
        if wear:
            raise InputError("wear: people of these weights are one field; use the shipped weights")
        z = latent_of(seed, self.generator.config.mapping.z_size)
        chosen = traits if isinstance(traits, Traits) else traits_of(traits or {})
        if chosen.given():
            require_shown(chosen, truncation, coded=self.coded, sizing=self.sizing)
            z = condition(z, chosen)
        device = self.offset.device
        w = self.generator.mapping(z.to(device), front_camera().vector.to(device), truncation)
        betas = self.shape_of(w, z, truncation, chosen.height).numpy()
        height = float(np.ptp(shape(self.body.source, betas).vertices[:, 1]))
        return Avatar(
            body=self.body,
            betas=betas,
            bounds=self.bounds,
            info=AvatarInfo(
                seed=seed,
                weights_hash=self.weights_hash,
                version=__version__,
                licence=self.licence,
                height_m=height,
                attributes=describe(people_of(z), height) if self.coded and truncation == 1 else None,
            ),
            field=PersonField(
                generator=self.generator,
                distance=self.distance,
                faces=torch.from_numpy(self.body.faces).to(device),
                gathering=self.gathering,
                w=w,
                table=plane_table(self.generator.planes(w))[0].contiguous(),
                layers=self.generator.layers(w),
                offset=self.offset,
            ),
        )

    def shape_of(
        self, w: Float[Tensor, "1 D"], z: Float[Tensor, "1 Z"], truncation: float, height: float | None
    ) -> Float[Tensor, " B"]:
        """The person's shape coefficients, at the stature asked for or the person's own."""
        if not self.own_body:
            return torch.zeros(self.body.source.shapedirs.shape[2])
        betas = self.generator.betas(w).cpu()
        if self.sizing is not None:
            tall = MEAN_PERSON + truncation * (stature(people_of(z)) - MEAN_PERSON)
            betas = self.sizing.sized(betas, tall if height is None else torch.full_like(tall, height))
            betas = self.sizing.faced(betas, people_of(z), truncation)
        return betas[0]


def require_seed(seed: int) -> None:
    """Raise InputError for a seed that is no whole number from 0 to 2^63 - 1."""
    if isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed <= LARGEST_SEED:
        raise InputError(f"seed: {seed!r} is none; a seed is a whole number from 0 to 2^63 - 1")


def latent_of(seed: int, size: int) -> Float[Tensor, "1 Z"]:
    """A seed's latent, drawn on the CPU: the same on any machine.

    Raises:
        InputError: the seed is no whole number from 0 to 2^63 - 1.
    """
    require_seed(seed)
    return torch.randn(1, size, generator=torch.Generator().manual_seed(seed))


def require_truncation(truncation: float) -> None:
    """Raise InputError for a truncation that is not in 0..1."""
    if not 0 <= truncation <= 1:
        raise InputError(f"truncation: {truncation} is out of range; choose 0 (the mean person) to 1")


def require_shown(traits: Traits, truncation: float, *, coded: bool, sizing: Sizing | None) -> None:
    """Raise InputError for traits that weights, or a body, do not show: without the wardrobe's coding, or
    without statures.
    """
    if not coded:
        raise InputError(
            "traits: these weights do not say what their latents mean; use the shipped ones, or no traits"
        )
    if truncation < 1:
        raise InputError(f"traits: truncation {truncation:g} would draw them to the mean; leave it at 1")
    if traits.height is not None and sizing is None:
        raise InputError(
            "height: the shape directions of this body are not known; leave out the height, or the body"
        )


def box_around(body: CanonicalBody, config: PlanesConfig, offset: np.ndarray) -> Float32[np.ndarray, "2 3"]:
    """A box that holds the planes' box, moved to this body, and the body with a margin, metres."""
    low = np.minimum(np.array(config.low) - offset, body.vertices.min(axis=0) - BOX_MARGIN)
    high = np.maximum(np.array(config.high) - offset, body.vertices.max(axis=0) + BOX_MARGIN)
    return np.stack([low, high]).astype(np.float32)


def load_single(
    weights: str | Path,
    body: str | Path | Body | None = None,
    device: str | torch.device = "cpu",
) -> AvatarSampler:
    """Load a generator whose one field is the whole person, on its own body or on another.

    Another body than the one the weights were trained on wears the same people: what the generator learned at
    the vertices of its body is carried to the other's by closest points, pelvis to pelvis. Its betas are zero
    then, as its shape directions mean other things.

    Raises:
        InputError: a file is missing or damaged, or the weights fit neither this body nor the default one.
    """
    checkpoint = load_checkpoint(weights)
    generator, config = checkpoint.generator, checkpoint.generator.config
    require_exportable(config)
    source = body if isinstance(body, Body) else load_body(body or shipped("body.npz"))
    canonical = canonical_body(source)
    own_body = body_hash(canonical) == config.body_hash
    offset = torch.zeros(3)
    if not own_body:
        trained = trained_body(config.body_hash)
        offset = torch.from_numpy(trained.joints[0] - canonical.joints[0])
        carry_vertex_features(generator, trained, canonical, offset.numpy())
    on_cpu = torch.device(device).type == "cpu"
    coded = checkpoint.notes.get("coding") == CODING
    return AvatarSampler(
        generator=generator.to(device).requires_grad_(False),
        body=canonical,
        distance=canonical.distance,
        gathering=gathering_of(generator.decoder, generator.frame, canonical.faces) if on_cpu else None,
        offset=offset.to(device),
        bounds=box_around(canonical, config.planes, offset.numpy()),
        own_body=own_body,
        coded=coded,
        sizing=Sizing(source) if own_body and coded else None,
        weights_hash=checkpoint.weights_hash,
        licence=checkpoint.notes.get("licence", "unknown"),
    )


def require_exportable(config: GeneratorConfig) -> None:
    """Raise InputError for a generator whose surface is not the canonical body plus a residual."""
    geometry = config.geometry
    if (geometry.representation, geometry.prior, geometry.distance) != ("sdf", "canonical", "residual"):
        raise InputError(
            f"weights: trained with {geometry.representation}, prior {geometry.prior}, distance "
            f"{geometry.distance}; only sdf, canonical, residual has a canonical surface to export"
        )


def training_body(path: Path | None = None) -> Body:
    """The body of a file; or the default one as its data sets have it: on SMPL's 24 joints, without fingers,
    and with ten directions of shape, which leave faces alone.

    Raises:
        InputError: the file is missing or damaged.
    """
    if path:
        return load_body(path)
    body = without_fingers(load_body(shipped("body.npz")))
    return replace(body, shapedirs=body.shapedirs[..., :BUILDS])


def trained_body(wanted: str) -> CanonicalBody:
    """The body that weights with this hash were trained on, if it is the one that comes with the package.

    Raises:
        InputError: it is another one.
    """
    default = canonical_body(load_body(shipped("body.npz")))
    if body_hash(default) != wanted:
        raise InputError("weights: they were trained on another body; give that body's file as the body")
    return default


def carry_vertex_features(
    generator: AvatarGenerator, trained: CanonicalBody, other: CanonicalBody, offset: Float[np.ndarray, "3"]
) -> None:
    """Carry the learned features from the trained body's vertices to another body's, and set its reach."""
    decoder = generator.decoder
    if not decoder.config.vertex_features:
        return
    hit = trained.distance.query(other.vertices + offset)
    near = body_points(hit, torch.from_numpy(trained.faces))
    features = interpolate(decoder.vertex_features, near)[0]
    decoder.vertex_features = nn.Parameter(features.detach())
    decoder.inverse_reach = torch.zeros(len(other.vertices))
    fit_reach(decoder, other)
