"""A capsule figure in layers: its skin, a shirt and a pair of shoes, each a function of points."""

import functools
from dataclasses import dataclass

import numpy as np
import torch

from assets.asset.asset import AssetInfo
from avatargen.body.model import CanonicalBody, canonical_body
from tests.bodies import capsule_body

SHIRT, SHOE = (-0.5, 1.0, 0.5, 1.45), 0.13  # m: the shirt's box; radius of a ball about each foot


@dataclass(frozen=True)
class Layer:
    """The capsule's skin, a shirt over it, or a pair of balls for shoes."""

    name: str
    body: CanonicalBody
    betas: np.ndarray
    info: AssetInfo

    @property
    def bounds(self):
        return np.stack([self.body.vertices.min(axis=0) - 0.15, self.body.vertices.max(axis=0) + 0.15])

    def sdf(self, points):
        places = points.numpy()
        skin = self.body.distance.query(places).distance
        if self.name == "body":
            found = skin - 0.004
        elif self.name == "top":
            found = np.maximum(skin - 0.016, self.box(places))
        else:
            feet = self.body.joints[[self.body.joint_names.index(f"{s}_ankle") for s in ("left", "right")]]
            found = np.linalg.norm(places[:, None] - feet, axis=2).min(axis=1) - SHOE
        return torch.from_numpy(found.astype(np.float32))

    def box(self, places):
        """Metres outside the shirt's ends."""
        low_x, low_y, high_x, high_y = SHIRT
        x, y = places[:, 0], places[:, 1]
        return np.max([low_x - x, x - high_x, low_y - y, y - high_y], axis=0)

    def color(self, points):
        return 0.5 + 0.3 * torch.sin(3 * points + len(self.name))

    def cover(self, points):
        if self.name == "body":
            return np.zeros(len(points))
        within = self.sdf(torch.from_numpy(points.astype(np.float32))).numpy() < 0
        ends = -self.box(points) if self.name == "top" else np.full(len(points), 1.0)
        return within * np.clip((ends - 0.02) / 0.03, 0, 1)


@dataclass(frozen=True)
class Dressed(Layer):
    """All of them."""

    @property
    def layers(self):
        parts = ("body", "shoes", "top")
        return {name: Layer(name, self.body, self.betas, self.info) for name in parts}

    @property
    def hidden(self) -> np.ndarray:
        covers = [layer.cover(self.body.vertices.astype(np.float64)) for layer in self.layers.values()]
        return np.sum(covers, axis=0) > 0.3


@functools.cache
def person() -> Dressed:
    body = canonical_body(capsule_body())
    betas = np.array([1.0, -0.5, 0.25], dtype=np.float32)
    info = AssetInfo(seed=3, weights_hash="ab" * 32, version="0.1.0", licence="CC0-1.0")
    return Dressed("person", body, betas, info)
