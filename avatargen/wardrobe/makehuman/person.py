"""A whole person of the artist-made wardrobe, as an avatar: distance and colour at canonical points.

Layers from the skin outward. Each is a closed volume; what lies beneath one stays inside it, except near its
edges, where a sleeve lets an arm out.
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import igl
import numpy as np
import torch
from jaxtyping import Float, Float32, Float64
from torch import Tensor

from avatargen import __version__
from avatargen.avatar_info import AvatarInfo
from avatargen.body.model import CanonicalBody
from avatargen.errors import InputError
from avatargen.wardrobe.makehuman.choose import Attributes, Draw, choose, draw_latent
from avatargen.wardrobe.makehuman.dye import dyed, printed
from avatargen.wardrobe.makehuman.face import SkinPaint, between_lips
from avatargen.wardrobe.makehuman.hm08 import load_hm08
from avatargen.wardrobe.makehuman.load import FittedGarment, load_folder, read_texture
from avatargen.wardrobe.makehuman.pattern import padded, pattern_places, trim_texels, used_texels
from avatargen.wardrobe.makehuman.solid import Solid
from avatargen.wardrobe.makehuman.strands import Strands
from avatargen.wardrobe.makehuman.texture import texels
from avatargen.wardrobe.stature import Sizing, stature

GAP = 0.003  # m that a layer stays inside the one over it
EDGE_ZONE = 0.012  # m along the cloth from an edge, where what is beneath may come out
LOOSE = 0.04  # m that it may come out at the edge itself
CATCH = 0.025  # m outside a garment that what sticks out is still cut off
SEAM = 0.0006  # m, softness of the colour's edge between layers
AHEAD = 0.0015  # m that the layer beneath must come out to be seen: where both lie together, cloth is
POKE = 0.015  # m that skin may stick out of cloth that runs along it, to be counted as hidden
BRIM = 0.008  # m under a hat's opening that hair ends: brims hang lower in front
MARGIN = 0.04  # m around everything


@dataclass(frozen=True, kw_only=True, eq=False)
class Worn:
    """A garment as one person has it: dyed and printed."""

    solid: Solid
    texture: np.ndarray
    print_kind: str
    ink: tuple[float, float, float]
    width: float

    @cached_property
    def places(self) -> Float64[np.ndarray, "F 3 2"]:
        return pattern_places(self.solid.garment)

    def layer(
        self, points: Float32[np.ndarray, "N 3"]
    ) -> tuple[Float32[np.ndarray, " N"], Float32[np.ndarray, " N"], Float64[np.ndarray, "N 3"]]:
        """Signed distance and way to an edge, m, and colour."""
        hit, garment = self.solid.hit(points), self.solid.garment
        colour = np.full((len(points), 3), 0.5)
        near = np.flatnonzero(hit.distance < 0.03)
        if len(near):
            at = hit.barycentric[near]
            uv = np.einsum("nk,nka->na", at, garment.uv[hit.face[near]])
            colour[near] = texels(self.texture, uv)[:, :3]
            if self.print_kind != "plain":
                place = np.einsum("nk,nka->na", at, self.places[hit.face[near]])
                colour[near] = printed(colour[near], place, self.print_kind, self.ink, self.width)
            colour[near] *= np.where(hit.rim[near] > 0, 1.0, 0.75)[:, None]  # inside a hem it is dark
        return hit.distance, hit.rim, colour


@dataclass(frozen=True, kw_only=True, eq=False)
class DressedPerson:
    """One person as fields of canonical points, in the form of an `Avatar`."""

    attributes: Attributes
    body: CanonicalBody
    betas: Float32[np.ndarray, " B"]
    info: AvatarInfo
    paint: SkinPaint
    worn: tuple[Worn, ...]
    hair: Strands | None

    @property
    def seed(self) -> int:
        return self.info.seed

    @property
    def bounds(self) -> Float32[np.ndarray, "2 3"]:
        """A box around everything, m."""
        clouds = [self.body.vertices, *[worn.solid.garment.vertices for worn in self.worn]]
        if self.hair is not None:
            clouds.append(self.hair.garment.vertices)
        low = np.min([cloud.min(axis=0) for cloud in clouds], axis=0) - MARGIN
        high = np.max([cloud.max(axis=0) for cloud in clouds], axis=0) + MARGIN
        return np.stack([low, high]).astype(np.float32)

    @cached_property
    def hidden(self) -> Float64[np.ndarray, " W"]:
        """1 at the body's vertices that garments hide: those that their files name, and what lies under or
        just through cloth that runs along it away from its edges."""
        hidden = np.zeros(len(self.body.vertices))
        normals = unit_normals(self.body.vertices, self.body.faces)
        for worn in self.worn:
            garment = worn.solid.garment
            hidden[garment.hidden] = 1
            hit = worn.solid.hit(self.body.vertices)
            cloth = unit_normals(garment.vertices, garment.faces)[garment.faces[hit.face, 0]]
            along = (cloth * normals).sum(axis=1) > 0.6
            hidden[(hit.rim > EDGE_ZONE) & (hit.distance < POKE) & along] = 1
        return hidden

    def sdf(self, points: Float[Tensor, "N 3"]) -> Float[Tensor, " N"]:
        """Signed distance to the clothed surface, m, negative inside."""
        distance, _ = self.layers(points.cpu().numpy().astype(np.float32), coloured=False)
        return torch.from_numpy(distance.astype(np.float32))

    def color(self, points: Float[Tensor, "N 3"]) -> Float[Tensor, "N 3"]:
        """Colour at points on or near the surface, sRGB in 0..1."""
        _, colour = self.layers(points.cpu().numpy().astype(np.float32), coloured=True)
        return torch.from_numpy(colour.clip(0, 1).astype(np.float32))

    def layers(
        self, points: Float32[np.ndarray, "N 3"], coloured: bool
    ) -> tuple[Float64[np.ndarray, " N"], Float64[np.ndarray, "N 3"]]:
        """The layers laid over one another."""
        hit = self.body.distance.query(points)
        distance = hit.distance - between_lips(points)
        colour = self.paint.color(points, hit) if coloured else np.zeros((len(points), 3))
        bare = 1 - (self.hidden[self.body.faces[hit.face]] * hit.barycentric).sum(axis=1)
        laid = [worn.layer(points) for worn in self.worn]
        for outer, rim, _ in laid:
            distance = kept_inside(distance, outer, np.maximum(bare, near_edges(rim)))
        for index, (outer, rim_of, dye) in enumerate(laid):
            inner = outer.astype(np.float64)
            for over, rim, _ in laid[index + 1 :]:
                inner = kept_inside(inner, over, near_edges(rim))
            ahead = np.where(rim_of > 0, AHEAD, 0.0)  # a hem's inside is no cloth
            distance, colour = laid_over(distance, colour, inner, dye, ahead)
        if self.hair is not None:
            outer = self.hair.distance(points).astype(np.float64)
            for worn, (hat, _, _) in zip(self.worn, laid, strict=True):
                if worn.solid.garment.kind == "hat":
                    outer = under_hat(outer, hat, worn.solid.above_opening(points))
            dye = np.zeros((len(points), 3))
            near = np.flatnonzero(outer < 0.02)
            if coloured and len(near):
                dye[near] = self.strand_colour(points[near])
            distance, colour = laid_over(distance, colour, outer, dye, np.zeros(1))
        return distance, colour

    def strand_colour(self, points: Float32[np.ndarray, "N 3"]) -> Float64[np.ndarray, "N 3"]:
        """The person's hair colour in the shades of the artist's strands."""
        assert self.hair is not None
        shade = (1 + 0.75 * (self.hair.shade(points) - 1)).clip(0.45, 1.7)
        return np.array(self.attributes.hair_colour) * shade[:, None]


def unit_normals(vertices: np.ndarray, faces: np.ndarray) -> Float64[np.ndarray, "V 3"]:
    """Unit normals of a mesh's vertices."""
    return np.asarray(igl.per_vertex_normals(vertices.astype(np.float64), np.asarray(faces)))


def near_edges(rim: np.ndarray) -> np.ndarray:
    """1 at the edges of a garment, where what is beneath may come out, 0 away from them."""
    return 1 - np.clip(rim / EDGE_ZONE, 0, 1)


def kept_inside(
    beneath: Float64[np.ndarray, " N"], outer: np.ndarray, free: np.ndarray
) -> Float64[np.ndarray, " N"]:
    """What lies beneath a layer, cut off where it would come out of it and is not `free` (1) to."""
    return np.maximum(beneath, outer + GAP - LOOSE * free - 4 * np.maximum(outer - CATCH, 0))


def under_hat(
    hair: Float64[np.ndarray, " N"], hat: np.ndarray, above: Float64[np.ndarray, " N"]
) -> Float64[np.ndarray, " N"]:
    """Hair with a hat over it: what is `above` (m) the hat's opening, or just under it, stays inside."""
    return np.maximum(hair, np.minimum(hat + GAP, above + BRIM))


def laid_over(
    beneath: Float64[np.ndarray, " N"],
    colour: Float64[np.ndarray, "N 3"],
    outer: np.ndarray,
    dye: Float64[np.ndarray, "N 3"],
    ahead: np.ndarray,
) -> tuple[Float64[np.ndarray, " N"], Float64[np.ndarray, "N 3"]]:
    """Union of two layers; the colour is that of the one further out, which the one beneath must be by
    `ahead` (m)."""
    seen = 1 / (1 + np.exp(np.clip((outer - beneath - ahead) / SEAM, -30, 30)))
    return np.minimum(beneath, outer), colour + (dye - colour) * seen[:, None]


class Wardrobe:
    """A folder of MakeHuman's assets on a canonical body: people by seed."""

    def __init__(self, folder: Path, body: CanonicalBody) -> None:
        self.folder, self.body, self.hm08 = folder, body, load_hm08()
        if len(body.vertices) != len(self.hm08.hm08_of_body):
            raise InputError("wardrobe: it fits the body that comes with the package; give no other body")
        self.sizing = Sizing(body.source)
        self.garments: dict[str, FittedGarment] = {g.name: g for g in load_folder(folder)}
        self.skins = {path.stem: path for path in sorted(folder.glob("skins/*/*_diffuse*.*"))}
        self.irises = {
            path.stem.removesuffix("_eye"): path for path in sorted(folder.glob("eyes/materials/*_eye.png"))
        }
        if not self.skins or not self.irises:
            raise InputError(
                f"wardrobe: {folder} holds no skins/textures/*_diffuse.jpg or no eyes/materials/*_eye.png; "
                "give a whole folder of MakeHuman's assets"
            )

    def attributes(self, seed: int) -> Attributes:
        """What the person of a seed is and wears."""
        return choose(Draw(draw_latent(seed)), self.garments, list(self.skins), list(self.irises))

    def sample(self, seed: int) -> DressedPerson:
        """The person of a seed."""
        draw = Draw(draw_latent(seed))
        found = self.attributes(seed)
        hair = self.garments.get(found.hair or "")
        return DressedPerson(
            attributes=found,
            body=self.body,
            betas=self.sizing.betas(draw.people)[0].numpy(),
            info=AvatarInfo(
                seed=seed,
                weights_hash="wardrobe",
                version=__version__,
                licence="CC0-1.0 (MakeHuman assets)",
                height_m=float(stature(draw.people)),
                attributes=found,
            ),
            paint=SkinPaint(
                hm08=self.hm08,
                body=self.body,
                skin=self.skin(found),
                iris=read_texture(self.irises[found.eyes]),
                brows=self.garments.get(found.brows),
                lashes=self.garments.get(found.lashes),
                chest_covered=found.sex == "woman",
                brow_colour=0.55 * np.array(found.hair_colour) + 0.02,
            ),
            worn=tuple(
                self.wear(name, colour, kind, found)
                for name, colour, kind in zip(found.garments, found.colours, found.prints, strict=True)
            ),
            hair=Strands(garment=hair, body=self.body.distance) if hair else None,
        )

    def skin(self, found: Attributes) -> np.ndarray:
        """Two photographs mixed and tinted."""
        first, second = (read_texture(self.skins[name]) for name in found.skin)
        side = max(first.shape[0], second.shape[0])
        first, second = (
            np.repeat(np.repeat(t, side // t.shape[0], axis=0), side // t.shape[1], axis=1)
            for t in (first, second)
        )
        mixed = first[..., :3] * (1 - found.skin_mix) + second[..., :3] * found.skin_mix
        return (mixed * np.array(found.skin_tint)).clip(0, 255).astype(np.uint8)

    def wear(
        self, name: str, colour: tuple[float, float, float] | None, kind: str, found: Attributes
    ) -> Worn:
        """A garment in one person's colours."""
        garment = self.garments[name]
        used = used_texels(garment)
        own = used & ~trim_texels(garment)
        texture = garment.texture if colour is None else dyed(garment.texture, own, colour)
        texture = padded(texture, used)
        return Worn(
            solid=Solid(garment=garment),
            texture=texture,
            print_kind=kind,
            ink=found.print_colour,
            width=found.print_width,
        )
