"""People of the artist-made wardrobe: the truth that the generator of dressed people learns."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import igl
import numpy as np
from jaxtyping import Bool, Float, Float32, Float64

from avatargen.body.distance import BodyHit
from avatargen.body.model import CanonicalBody
from avatargen.errors import InputError
from avatargen.wardrobe.appearance import Dye
from avatargen.wardrobe.colour_names import lab
from avatargen.wardrobe.dressed import EDGE_ZONE, Cloth, DressedField, Opening
from avatargen.wardrobe.makehuman.choose import Attributes, Draw, choose, draw_latent
from avatargen.wardrobe.makehuman.face import SkinPaint
from avatargen.wardrobe.makehuman.grooming import hairdo_of, paint_of
from avatargen.wardrobe.makehuman.hm08 import load_hm08
from avatargen.wardrobe.makehuman.load import FittedGarment, load_folder, read_texture
from avatargen.wardrobe.makehuman.pattern import padded, pattern_places, trim_texels, used_texels
from avatargen.wardrobe.makehuman.solid import Solid
from avatargen.wardrobe.makehuman.strands import Strands
from avatargen.wardrobe.makehuman.texture import texels
from avatargen.wardrobe.stature import Sizing
from avatargen.wardrobe.tailored.collection import PATTERNS, Pattern
from avatargen.wardrobe.tailored.collection import made as sewn_garment
from avatargen.wardrobe.worn_hair import WornHair

ALONG = 0.6  # cosine between skin and cloth from which cloth runs along the skin
POKE = 0.015  # m that skin may stick out of cloth that runs along it, to be counted as hidden
MARGIN = 0.04  # m around everything
COLOURED = 0.03  # m from a garment beyond which it has no colour


@dataclass(frozen=True, kw_only=True, eq=False)
class ArtistGarment:
    """A garment as its artist made it, on the canonical body."""

    solid: Solid
    body: CanonicalBody

    @cached_property
    def texture(self) -> np.ndarray:
        """With texels beyond the seams."""
        return padded(self.solid.garment.texture, self.used)

    @cached_property
    def used(self) -> np.ndarray:
        return used_texels(self.solid.garment)

    @cached_property
    def middle(self) -> tuple[float, float, float]:
        """The median of the colours that a dye takes, CIELAB."""
        own = self.solid.garment.texture[self.used & ~self.trim][:, :3]
        lightness, a, b = np.median(lab(own / 255), axis=0).tolist()
        return (lightness, a, b)

    def own(self, uv: Float[np.ndarray, "N 2"]) -> Float64[np.ndarray, "N 4"]:
        """Colour at texture coordinates, and how far a dye takes."""
        return texels(np.concatenate([self.texture[..., :3], self.takes], axis=2), uv)

    @cached_property
    def takes(self) -> np.ndarray:
        """255 where a dye takes, 0 on what keeps its colour."""
        return padded(np.where(self.trim, 0, 255).astype(np.uint8)[..., None], self.used)

    @cached_property
    def trim(self) -> np.ndarray:
        return trim_texels(self.solid.garment)

    @cached_property
    def places(self) -> Float64[np.ndarray, "F 3 2"]:
        return pattern_places(self.solid.garment)

    @cached_property
    def hidden(self) -> Bool[np.ndarray, " V"]:
        """The body's vertices that the garment's files name, and those that lie under or just through cloth
        that runs along them away from its edges."""
        garment, body = self.solid.garment, self.body
        hidden = np.zeros(len(body.vertices), dtype=bool)
        hidden[garment.hidden] = True
        hit = self.solid.hit(body.vertices)
        corners = garment.faces[hit.face]
        cloth = unit_normals(garment.vertices, garment.faces)[corners[:, 0]]
        along = (cloth * unit_normals(body.vertices, body.faces)).sum(axis=1) > ALONG
        way = body.vertices - np.einsum("nk,nka->na", hit.barycentric, garment.vertices[corners])
        before = (cloth * way).sum(axis=1) < ALONG * hit.distance  # as a hand is before a turned-in cuff
        beside = (hit.distance > 0) & before
        return hidden | ((hit.rim > EDGE_ZONE) & (hit.distance < POKE) & along & ~beside)

    @cached_property
    def opening(self) -> Opening | None:
        """The plane of a hat's longest edge."""
        if self.solid.garment.kind != "hat":
            return None
        at, up = self.solid.opening
        return Opening(at=at, up=up)

    def least(self, points: Float32[np.ndarray, "N 3"]) -> Float32[np.ndarray, " N"]:
        """Metres to the garment's box."""
        return to_box(points, self.solid.garment.vertices)


@dataclass(frozen=True, kw_only=True, eq=False)
class WornCloth:
    """An artist's garment as one person has it."""

    garment: ArtistGarment
    appearance: Dye

    @property
    def kind(self) -> str:
        return self.garment.solid.garment.kind

    @property
    def hidden(self) -> Bool[np.ndarray, " V"]:
        return self.garment.hidden

    @property
    def opening(self) -> Opening | None:
        return self.garment.opening

    def least(self, points: Float32[np.ndarray, "N 3"]) -> Float32[np.ndarray, " N"]:
        return self.garment.least(points)

    def cloth(self, points: Float32[np.ndarray, "M 3"], hit: BodyHit, *, coloured: bool) -> Cloth:
        solid = self.garment.solid
        found = solid.hit(points, reach=1.0)
        colour = np.full((len(points), 3), 0.5, np.float32)
        near = np.flatnonzero(found.distance < COLOURED) if coloured else np.zeros(0, np.int64)
        if len(near):
            at, face = found.barycentric[near], found.face[near]
            own = self.garment.own(np.einsum("nk,nka->na", at, solid.garment.uv[face]))
            place = np.einsum("nk,nka->na", at, self.garment.places[face])
            colour[near] = self.appearance.color(own, place)
        return Cloth(distance=found.distance, rim=found.rim, color=colour)


def to_box(points: Float32[np.ndarray, "N 3"], cloud: np.ndarray) -> Float32[np.ndarray, " N"]:
    """Metres to the box around a cloud of points."""
    low, high = cloud.min(axis=0), cloud.max(axis=0)
    return np.linalg.norm(points - np.clip(points, low, high), axis=1).astype(np.float32)


def unit_normals(vertices: np.ndarray, faces: np.ndarray) -> Float64[np.ndarray, "V 3"]:
    """Unit normals of a mesh's vertices."""
    return np.asarray(igl.per_vertex_normals(vertices.astype(np.float64), np.asarray(faces)))


class Wardrobe:
    """A folder of MakeHuman's assets and tailored garments on a canonical body: people by seed."""

    def __init__(self, folder: Path, body: CanonicalBody, patterns: Mapping[str, Pattern] = PATTERNS) -> None:
        self.folder, self.body, self.hm08 = folder, body, load_hm08()
        if len(body.vertices) != len(self.hm08.hm08_of_body):
            raise InputError("wardrobe: it fits the body that comes with the package; give no other body")
        self.sizing = Sizing(body.source)
        self.loaded = {garment.name: garment for garment in load_folder(folder)}
        self.garments: dict[str, FittedGarment | Pattern] = {**self.loaded, **patterns}
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

    def bounds(self, found: Attributes) -> Float32[np.ndarray, "2 3"]:
        """A box around a person, m."""
        clouds = [self.body.vertices, *[self.fitted(name).vertices for name in found.garments]]
        if found.hair is not None:
            clouds.append(self.loaded[found.hair].vertices)
        low = np.min([cloud.min(axis=0) for cloud in clouds], axis=0) - MARGIN
        high = np.max([cloud.max(axis=0) for cloud in clouds], axis=0) + MARGIN
        return np.stack([low, high]).astype(np.float32)

    def dress(self, found: Attributes) -> DressedField:
        """The field of a person."""
        hair = self.loaded.get(found.hair or "")
        return DressedField(
            body=self.body,
            distance=self.body.distance,
            skin=SkinPaint(
                hm08=self.hm08,
                body=self.body,
                skin=self.skin(found),
                iris=read_texture(self.irises[found.eyes]),
                lines=found.face,
                hair_colour=found.hair_colour,
                chest_covered=found.sex == "woman",
                hair=paint_of(found),
            ),
            garments=tuple(
                self.wear(name, colour, kind, found)
                for name, colour, kind in zip(found.garments, found.colours, found.prints, strict=True)
            ),
            hair=WornHair(
                volume=Strands(garment=hair, body=self.body.distance),
                hairdo=hairdo_of(found),
                body=self.body,
            )
            if hair
            else None,
            offset=np.zeros(3, np.float32),
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

    def made(self, name: str) -> ArtistGarment:
        """A garment as its artist made it."""
        return ArtistGarment(solid=Solid(garment=self.fitted(name)), body=self.body)

    def fitted(self, name: str) -> FittedGarment:
        """A garment of the folder, or one that is sewn when it is first asked for."""
        return self.loaded[name] if name in self.loaded else sewn_garment(name)

    def wear(
        self, name: str, colour: tuple[float, float, float] | None, kind: str, found: Attributes
    ) -> WornCloth:
        """A garment in one person's colours."""
        garment = self.made(name)
        return WornCloth(
            garment=garment,
            appearance=Dye(
                middle=garment.middle, dye=colour, kind=kind, ink=found.print_colour, width=found.print_width
            ),
        )
