"""Field decoder (section 3.2): features at a canonical point to signed distance, colour and picture features.

Signed distance = body distance + residual. The residual's last row starts at zero: untrained, it is the body.

Letters: B people, N points, C plane channels, D size of w, V body vertices, K features. Metres; negative
inside.
"""

import itertools
import math
from dataclasses import dataclass
from typing import Literal

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn
from torch.nn import functional as F

from avatargen.body.distance import BodyHit
from avatargen.body.model import CanonicalBody
from avatargen.body.reach import outer_reach
from avatargen.errors import InputError
from avatargen.generator.config import DecoderConfig
from avatargen.generator.layers import ACTIVATION_GAIN, LEAK, EqualLinear, leaky_relu, may_branch
from avatargen.generator.parts import Shares

Heads = Literal["shape", "color", "both"]
PLANE_GAIN = 1 / 3  # of the sum of three planes: brings it near unit size
REGION_GAIN = 6.0  # steepness of the softmax that chooses a colour
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
    body: BodyPoints, points: Float[Tensor, "B N 3"], vertices: Float[Tensor, "#B V 3"]
) -> BodyPoints:
    """The same body points, with a distance that passes gradients on to the points."""
    first = torch.arange(len(vertices), device=points.device)[:, None, None] * vertices.shape[1]
    index = body.vertices + first
    corners = vertices.flatten(0, 1).index_select(0, index.flatten()).unflatten(0, index.shape)
    closest = (corners * body.barycentric[..., None]).sum(dim=2)
    away = points.detach() - closest
    length = away.norm(dim=-1, keepdim=True).clamp_min(1e-9)
    normal = away / length * torch.sign(body.distance)[..., None]
    step = ((points - points.detach()) * normal).sum(dim=-1)  # zero, with the wanted gradient
    return BodyPoints(distance=body.distance + step, vertices=body.vertices, barycentric=body.barycentric)


@dataclass(frozen=True, kw_only=True)
class Matrix:
    """A linear layer as people have it: each their own, or, without a leading B, one for all."""

    weight: Float[Tensor, "*B i o"]
    bias: Float[Tensor, "*B 1 o"]

    def __call__(self, x: Float[Tensor, "B N i"]) -> Float[Tensor, "B N o"]:
        if self.weight.ndim == 2:
            return x @ self.weight + self.bias
        return torch.baddbmm(self.bias, x, self.weight)

    def of_each(self, count: int) -> "list[Matrix]":
        """The layer of `count` people, person by person."""
        if self.weight.ndim == 2:
            return [self] * count
        pairs = zip(self.weight.split(1), self.bias.split(1), strict=True)
        return [Matrix(weight=weight, bias=bias) for weight, bias in pairs]

    def columns(self, *parts: slice) -> "Matrix":
        """The same for some of the outputs."""
        weight, bias = (torch.cat([m[..., part] for part in parts], dim=-1) for m in (self.weight, self.bias))
        return Matrix(weight=weight, bias=bias)


class PersonalLinear(nn.Module):
    """Linear layer to whose weights and biases each person adds their own, made from a code.

    What a code adds starts at zero. Without a code the layer is the same for all.
    """

    def __init__(self, inputs: int, outputs: int, code_size: int, *, zero: bool = False) -> None:
        super().__init__()
        size = (inputs, outputs)
        self.weight = nn.Parameter(torch.zeros(size) if zero else torch.randn(size))
        self.bias = nn.Parameter(torch.zeros(outputs))
        self.gain = 1 / math.sqrt(inputs)
        self.own = EqualLinear(code_size, (inputs + 1) * outputs, zero=True) if code_size else None

    def forward(self, code: Float[Tensor, "B c"] | None) -> Matrix:
        if self.own is None or code is None:
            return Matrix(weight=self.weight * self.gain, bias=self.bias[None])
        own = self.own(code).unflatten(1, (-1, len(self.bias)))  # B i+1 o
        return Matrix(weight=(self.weight + own[:, :-1]) * self.gain, bias=self.bias + own[:, -1:])


@dataclass(frozen=True, kw_only=True)
class PartLayers:
    """One part's network as people have it."""

    hidden: tuple[Matrix, ...]
    geometry: Matrix
    picture: Matrix
    palette: Float[Tensor, "B R 3"] | None  # the colour of each region, before the sigmoid

    def of_each(self, count: int) -> "list[PartLayers]":
        """The layers of `count` people, person by person, each a batch of one."""
        hidden = zip(*(matrix.of_each(count) for matrix in self.hidden), strict=True)
        geometry, picture = self.geometry.of_each(count), self.picture.of_each(count)
        palettes = [None] * count if self.palette is None else self.palette.split(1)
        return [
            PartLayers(hidden=h, geometry=g, picture=p, palette=c)
            for h, g, p, c in zip(hidden, geometry, picture, palettes, strict=True)
        ]


class PartNetwork(nn.Module):
    """The field's network for one part of the body: two heads on shared hidden layers.

    Letters beside the module's: I inputs, H width.
    """

    def __init__(self, config: DecoderConfig, inputs: int, w_size: int) -> None:
        super().__init__()
        self.config = config
        size = config.code_size
        self.code = EqualLinear(w_size, size) if size else None
        sizes = [inputs, *[config.width] * config.depth]
        self.layers = nn.ModuleList(PersonalLinear(i, o, size) for i, o in itertools.pairwise(sizes))
        self.geometry = PersonalLinear(config.width, 2 if config.gated else 1, size, zero=True)
        self.picture = PersonalLinear(config.width, config.features + config.regions, size)
        if config.regions:
            self.palette = EqualLinear(w_size, 3 * config.regions)

    def layers_of(self, w: Float[Tensor, "B D"]) -> PartLayers:
        """The layers of people."""
        code = None if self.code is None else self.code(w)
        regions = self.config.regions
        return PartLayers(
            hidden=tuple(layer(code) for layer in self.layers),
            geometry=self.geometry(code),
            picture=self.picture(code),
            palette=self.palette(w).unflatten(1, (regions, 3)) if regions else None,
        )

    def forward(self, x: Float[Tensor, "B N I"], layers: PartLayers, heads: Heads) -> Float[Tensor, "B N O"]:
        """The heads' outputs: `shape`'s two columns, `dye`'s three, or both `shape`'s and `paint`'s."""
        for layer in layers.hidden:
            x = self.activate(layer(x))
        if heads == "shape":
            return self.shape(x, layers)
        if heads == "color":
            return self.dye(x, layers)
        return torch.cat([self.shape(x, layers), self.paint(x, layers)], dim=-1)

    def activate(self, x: Float[Tensor, "B N H"]) -> Float[Tensor, "B N H"]:
        """The hidden layers' activation; in place where no gradient asks for what was there."""
        if self.config.activation == "softplus":
            return F.softplus(x)
        if torch.is_grad_enabled():
            return leaky_relu(x)
        return F.leaky_relu_(x, LEAK).mul_(ACTIVATION_GAIN)

    def shape(self, hidden: Float[Tensor, "B N H"], layers: PartLayers) -> Float[Tensor, "B N 2"]:
        """The residual, in metres and never past `residual_limit`; and the share of the body's distance,
        within -1..1, that it takes back.
        """
        raw = layers.geometry(hidden)
        limit = self.config.residual_limit
        residual = limit * torch.tanh(raw[..., :1] * (self.config.residual_scale / limit))
        taken = torch.tanh(raw[..., 1:]) if self.config.gated else torch.zeros_like(residual)
        return torch.cat([residual, taken], dim=-1)

    def dye(self, hidden: Float[Tensor, "B N H"], layers: PartLayers) -> Float[Tensor, "B N 3"]:
        """The colour alone."""
        regions = slice(self.config.features, self.config.features + self.config.regions)
        raw = layers.picture.columns(slice(3), regions)(hidden)
        return self.color(raw[..., :3], raw[..., 3:], layers)

    def paint(self, hidden: Float[Tensor, "B N H"], layers: PartLayers) -> Float[Tensor, "B N K"]:
        """Features; the first three are the colour."""
        raw = layers.picture(hidden)
        features, regions = raw.split([self.config.features, self.config.regions], dim=-1)
        return torch.cat([self.color(features[..., :3], regions, layers), features[..., 3:]], dim=-1)

    def color(
        self, raw: Float[Tensor, "B N 3"], regions: Float[Tensor, "B N R"], layers: PartLayers
    ) -> Float[Tensor, "B N 3"]:
        """sRGB, 0..1 within `COLOR_MARGIN`.

        With regions, a steep softmax says which of the person's few colours a point has.
        """
        if layers.palette is not None:
            raw = raw + torch.softmax(REGION_GAIN * regions, dim=-1) @ layers.palette
        return torch.sigmoid(raw) * (1 + 2 * COLOR_MARGIN) - COLOR_MARGIN


class Decoder(nn.Module):
    """The field's network: one for the whole body, or one for each of its parts, blended at their borders.

    `inverse_reach` (1/m) is set by `fit_reach`; at zero, vertex features never fade.

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
        if config.vertex_features:
            self.vertex_features = nn.Parameter(torch.randn(vertex_count, config.vertex_features) * 0.1)
            self.register_buffer("inverse_reach", torch.zeros(vertex_count))
        self.shares = Shares(config.parts) if config.parts else None
        self.networks = nn.ModuleList(
            PartNetwork(config, inputs, w_size) for _ in range(max(1, len(config.parts)))
        )

    def inputs(
        self, plane_features: Float[Tensor, "B N C"], centered: Float[Tensor, "B N 3"], body: BodyPoints
    ) -> Float[Tensor, "B N I"]:
        """What the networks read. `centered` are the points scaled so that the box is -1..1."""
        inputs = [plane_features * PLANE_GAIN, distance_features(body.distance)]
        if self.config.vertex_features:
            inputs.append(self.features_at_body(body))
        if self.config.frequencies:
            inputs.append(encode(centered, self.config.frequencies))
        return torch.cat(inputs, dim=-1)

    def features_at_body(self, body: BodyPoints) -> Float[Tensor, "B N K"]:
        """Vertex features at the closest body points, faded out before the closest point jumps."""
        inverse_reach = interpolate(self.inverse_reach[:, None], body)[..., 0]
        return interpolate(self.vertex_features, body) * fade(body.distance, inverse_reach)[..., None]

    def layers_of(self, w: Float[Tensor, "B D"]) -> tuple[PartLayers, ...]:
        """The layers of people, part by part; those who ask much of one person make them once."""
        return tuple(network.layers_of(w) for network in self.networks)  # pyright: ignore[reportCallIssue]

    def forward(
        self,
        x: Float[Tensor, "B N I"],
        points: Float[Tensor, "B N 3"],
        layers: tuple[PartLayers, ...],
        heads: Heads = "both",
    ) -> Float[Tensor, "B N O"]:
        """The heads' outputs at canonical points, the parts' blended by the points' shares in them."""
        people, count, _ = x.shape
        if self.shares is None or not count:
            return self.networks[0](x, layers[0], heads)
        shares = self.shares(points)
        if not may_branch(x):  # nobody waits for how many points each part has
            pairs = zip(self.networks, layers, shares.split(1, dim=2), strict=True)
            return sum_of([network(x, own, heads) * share for network, own, share in pairs])
        present = (shares > 0).sum(dim=1).amax(dim=0).tolist()  # points that each part has at most
        if max(present) == count and sum(present) == count:  # all points lie in one part alone
            part = present.index(count)
            return self.networks[part](x, layers[part], heads)
        first = torch.arange(people, device=x.device)[:, None] * count
        total = None
        for part, some in enumerate(present):
            if not some:
                continue
            share, index = shares[..., part].topk(some, dim=1, sorted=False)
            rows = (index + first).flatten()
            part_x = x.flatten(0, 1).index_select(0, rows).unflatten(0, index.shape)
            own = (self.networks[part](part_x, layers[part], heads) * share[..., None]).flatten(0, 1)
            if total is None:
                total = own.new_zeros(people * count, own.shape[-1])
            total = total.index_add(0, rows, own)
        assert total is not None  # every point has a share somewhere
        return total.unflatten(0, (people, count))

    def signed_distance(
        self, shape: Float[Tensor, "B N 2"], distance: Float[Tensor, "B N"]
    ) -> Float[Tensor, "B N"]:
        """Body distance, less what is taken back of it, plus the residual, metres."""
        return distance * (1 - shape[..., 1]) + shape[..., 0]


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
    if may_branch(table):
        mixed = F.embedding_bag(index, table, per_sample_weights=weights, mode="sum")
    else:  # a GPU would sort the rows in its backward pass
        mixed = sum_of([table.index_select(0, index[:, i]) * weights[:, i, None] for i in range(3)])
    return mixed.unflatten(0, body.distance.shape)


def sum_of(parts: list[Tensor]) -> Tensor:
    """Sum of some tensors."""
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return total


def encode(centered: Float[Tensor, "B N 3"], frequencies: int) -> Float[Tensor, "B N code"]:
    """The point, and its sines and cosines at pi, 2 pi, 4 pi ..."""
    scales = torch.pi * 2.0 ** torch.arange(frequencies, device=centered.device, dtype=centered.dtype)
    angles = (centered[..., None, :] * scales[:, None]).flatten(-2)
    return torch.cat([centered, torch.sin(angles), torch.cos(angles)], dim=-1)
