"""Field decoder (section 3.2): features at a canonical point to signed distance, colour and picture features.

Signed distance = body distance + residual. The residual's last row starts at zero: untrained, it is the body.

Letters: B people, N points, C plane channels, D size of w, V body vertices, K features. Metres; negative
inside.
"""

import itertools
import math
from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn
from torch.nn import functional as F

from avatargen.body.distance import BodyHit
from avatargen.body.model import CanonicalBody
from avatargen.body.reach import outer_reach
from avatargen.errors import InputError
from avatargen.generator.config import DecoderConfig
from avatargen.generator.layers import EqualLinear, leaky_relu

PLANE_GAIN = 1 / 3  # of the sum of three planes: brings it near unit size
COLOR_MARGIN = 0.001  # lets the sigmoid reach 0 and 1


@dataclass(frozen=True, kw_only=True)
class BodyPoints:
    """The body at the field's points: signed distance, and the closest point as three weighted vertices."""

    distance: Float[Tensor, "B N"]
    vertices: Int[Tensor, "B N 3"]
    barycentric: Float[Tensor, "B N 3"]


def body_points(hit: BodyHit, faces: Int[Tensor, "F 3"]) -> BodyPoints:
    """A query of the body as the field takes it, for one person."""
    return BodyPoints(
        distance=torch.from_numpy(hit.distance)[None].to(faces.device),
        vertices=faces[torch.from_numpy(hit.face).to(faces.device)][None],
        barycentric=torch.from_numpy(hit.barycentric)[None].to(faces.device),
    )


def attach_gradient(
    body: BodyPoints, points: Float[Tensor, "B N 3"], vertices: Float[Tensor, "V 3"]
) -> BodyPoints:
    """The same body points, with a distance that passes gradients on to the points."""
    closest = (vertices[body.vertices] * body.barycentric[..., None]).sum(dim=2)
    away = points.detach() - closest
    length = away.norm(dim=-1, keepdim=True).clamp_min(1e-9)
    normal = away / length * torch.sign(body.distance)[..., None]
    step = ((points - points.detach()) * normal).sum(dim=-1)  # zero, with the wanted gradient
    return BodyPoints(distance=body.distance + step, vertices=body.vertices, barycentric=body.barycentric)


class ModulatedLinear(nn.Module):
    """Linear layer whose inputs are scaled and outputs shifted per person; the batch runs as one matrix
    product each.

    The modulation starts as identity.
    """

    def __init__(self, inputs: int, outputs: int, w_size: int, *, modulated: bool) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.randn(inputs, outputs))
        self.bias = nn.Parameter(torch.zeros(outputs))
        self.gain = 1 / math.sqrt(inputs)
        self.modulated = modulated
        if modulated:
            self.scale = EqualLinear(w_size, inputs, bias=1.0, zero=True)
            self.shift = EqualLinear(w_size, outputs, zero=True)

    def forward(self, x: Float[Tensor, "B N i"], w: Float[Tensor, "B D"]) -> Float[Tensor, "B N o"]:
        weight, bias = self.weight * self.gain, self.bias
        if not self.modulated:
            return x @ weight + bias
        return torch.baddbmm((bias + self.shift(w))[:, None], x, weight * self.scale(w)[:, :, None])


class Decoder(nn.Module):
    """The field's network. `inverse_reach` (1/m) is set by `fit_reach`; at zero, vertex features never fade.

    Raises:
        InputError: vertex features are asked for but there are no vertices.
    """

    inverse_reach: Tensor

    def __init__(self, config: DecoderConfig, *, plane_channels: int, w_size: int, vertex_count: int) -> None:
        super().__init__()
        if config.vertex_features and not vertex_count:
            raise InputError(
                "generator config: vertex features need a body; fit the preset by for_body(config, body)"
            )
        self.config = config
        inputs = plane_channels + len(DISTANCE_SCALES) + 1 + config.vertex_features
        inputs += 3 * (1 + 2 * config.frequencies) if config.frequencies else 0
        sizes = [inputs, *[config.width] * config.depth]
        self.layers = nn.ModuleList(
            ModulatedLinear(i, o, w_size, modulated=config.modulated) for i, o in itertools.pairwise(sizes)
        )
        if config.vertex_features:
            self.vertex_features = nn.Parameter(torch.randn(vertex_count, config.vertex_features) * 0.1)
            self.register_buffer("inverse_reach", torch.zeros(vertex_count))
        self.residual = EqualLinear(config.width, 1, zero=True)
        self.features = EqualLinear(config.width, config.features)
        if (
            config.modulated
        ):  # what is masked by one person's hidden units gets that person's own distance and colour
            self.person = EqualLinear(w_size, config.width * PERSON_ROWS, zero=True)

    def hidden(
        self,
        plane_features: Float[Tensor, "B N C"],
        w: Float[Tensor, "B D"],
        centered: Float[Tensor, "B N 3"],
        body: BodyPoints,
    ) -> Float[Tensor, "B N width"]:
        """What both heads read. `centered` are the points scaled so that the box is -1..1."""
        inputs = [plane_features * PLANE_GAIN, distance_features(body.distance)]
        if self.config.vertex_features:
            inputs.append(self.features_at_body(body))
        if self.config.frequencies:
            inputs.append(encode(centered, self.config.frequencies))
        x = torch.cat(inputs, dim=-1)
        for layer in self.layers:
            x = layer(x, w)
            x = leaky_relu(x) if self.config.activation == "leaky_relu" else F.softplus(x)
        return x

    def features_at_body(self, body: BodyPoints) -> Float[Tensor, "B N K"]:
        """Vertex features at the closest body points, faded out before the closest point jumps."""
        inverse_reach = interpolate(self.inverse_reach[:, None], body)[..., 0]
        return interpolate(self.vertex_features, body) * fade(body.distance, inverse_reach)[..., None]

    def person_rows(self, w: Float[Tensor, "B D"]) -> Float[Tensor, "B width 4"]:
        """Each person's own addition to the last layer: a column for the residual, three for the colour."""
        if not self.config.modulated:
            return w.new_zeros(len(w), self.config.width, PERSON_ROWS)
        return self.person(w).unflatten(1, (self.config.width, PERSON_ROWS))

    def signed_distance(
        self, hidden: Float[Tensor, "B N width"], w: Float[Tensor, "B D"], body: BodyPoints
    ) -> Float[Tensor, "B N"]:
        """Body distance plus the residual, in metres; the residual never passes `residual_limit`."""
        limit = self.config.residual_limit
        raw = self.residual(hidden) + hidden @ self.person_rows(w)[..., :1]
        return body.distance + limit * torch.tanh(raw[..., 0] * (self.config.residual_scale / limit))

    def picture_features(
        self, hidden: Float[Tensor, "B N width"], w: Float[Tensor, "B D"]
    ) -> tuple[Float[Tensor, "B N 3"], Float[Tensor, "B N K"]]:
        """Colour (sRGB, 0..1 within `COLOR_MARGIN`), and the features that begin with it."""
        raw = self.features(hidden)
        own = hidden @ self.person_rows(w)[..., 1:]
        color = torch.sigmoid(raw[..., :3] + own) * (1 + 2 * COLOR_MARGIN) - COLOR_MARGIN
        return color, torch.cat([color, raw[..., 3:]], dim=-1)


PERSON_ROWS = 4
# metres from the body over which vertex features fade at least, for lips and toes touch; and at most, as a
# mesh's shallow dents make the closest point of distant points jump
NEAREST, FARTHEST = 0.005, 0.06
DISTANCE_SCALES = (0.02, 0.1)  # metres; the body distance also enters as tanh(d / scale)


def distance_features(distance: Float[Tensor, "B N"]) -> Float[Tensor, "B N 3"]:
    """The body distance at three ranges: 10 d, tanh(d / 2 cm), tanh(d / 10 cm)."""
    soft = [torch.tanh(distance / scale) for scale in DISTANCE_SCALES]
    return torch.stack([distance * 10, *soft], dim=-1)


def fade(distance: Float[Tensor, "B N"], inverse_reach: Float[Tensor, "B N"]) -> Float[Tensor, "B N"]:
    """1 on the body and inside it, smoothly down to 0 at the reach and beyond."""
    share = (distance.clamp_min(0) * inverse_reach).clamp_max(1)
    return (1 - share.square()).square()


def fit_reach(decoder: Decoder, body: CanonicalBody) -> None:
    """Tell the decoder how far the vertices of its body reach."""
    if decoder.config.vertex_features:
        reach = torch.from_numpy(outer_reach(body.vertices, body.faces, FARTHEST))
        decoder.inverse_reach.copy_(1 / reach.clamp_min(NEAREST))


def interpolate(table: Float[Tensor, "V K"], body: BodyPoints) -> Float[Tensor, "B N K"]:
    """Features of the body's vertices at the closest body points."""
    index = body.vertices.flatten(0, 1)
    weights = body.barycentric.flatten(0, 1).to(table.dtype)
    mixed = F.embedding_bag(index, table, per_sample_weights=weights, mode="sum")
    return mixed.unflatten(0, body.distance.shape)


def encode(centered: Float[Tensor, "B N 3"], frequencies: int) -> Float[Tensor, "B N code"]:
    """The point, and its sines and cosines at pi, 2 pi, 4 pi ..."""
    scales = torch.pi * 2.0 ** torch.arange(frequencies, device=centered.device)
    mix = torch.kron(scales, torch.eye(3, device=centered.device)).to(centered.dtype)  # 3, 3 frequencies
    angles = centered @ mix
    return torch.cat([centered, torch.sin(angles), torch.cos(angles)], dim=-1)
