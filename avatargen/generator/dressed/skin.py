"""A trained skin as one person has it: colours of the bare body.

Letters: N points, F faces, V vertices of the body. sRGB 0..1, metres.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64

from avatargen.body.distance import BodyHit
from avatargen.body.model import CanonicalBody
from avatargen.generator.dressed.config import SkinConfig
from avatargen.generator.dressed.generator import LearnedSkin
from avatargen.generator.dressed.tables import Surface, Table
from avatargen.wardrobe.bare import UNDERWEAR, underwear
from avatargen.wardrobe.dressed import chosen
from avatargen.wardrobe.face_paint import FaceLines, paint_face
from avatargen.wardrobe.hair_paint import HairPaint
from avatargen.wardrobe.makehuman.choose import Attributes
from avatargen.wardrobe.makehuman.grooming import paint_of
from avatargen.wardrobe.makehuman.hm08 import Hm08
from avatargen.wardrobe.makehuman.texture import texels


@dataclass(frozen=True, kw_only=True, eq=False)
class ReadySkin:
    """What all people's skins share, ready to be asked. `owner` is the table that each face is read from."""

    config: SkinConfig
    body: CanonicalBody
    hm08: Hm08
    tables: tuple[Surface, ...]
    owner: Int64[np.ndarray, " F"]
    mixing: Float64[np.ndarray, "S K 3"]
    middle: Float64[np.ndarray, "S 3"]
    irises: np.ndarray

    def of(self, person: Attributes) -> "PersonSkin":
        """One person's skin."""
        config = self.config
        shares = np.array([1 - person.skin_mix, person.skin_mix])
        rows = [config.skins.index(name) for name in person.skin]
        mixing = np.tensordot(shares, self.mixing[rows], axes=1)
        middle, tint = shares @ self.middle[rows], np.array(person.skin_tint)
        tables = tuple(
            Surface(
                segments=table.segments,
                face_nodes=table.face_nodes,
                values=((table.values @ mixing + middle) * tint).clip(0, 1).astype(np.float32),
            )
            for table in self.tables
        )
        return PersonSkin(
            ready=self,
            tables=tables,
            lines=person.face,
            hair_colour=person.hair_colour,
            iris=self.irises[config.irises.index(person.eyes)],
            chest_covered=person.sex == "woman",
            hair=paint_of(person),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class PersonSkin:
    """One person's skin and face."""

    ready: ReadySkin
    tables: tuple[Surface, ...]
    lines: FaceLines
    hair_colour: tuple[float, float, float]
    iris: np.ndarray
    chest_covered: bool
    hair: HairPaint

    def relief(self, points: Float32[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
        return self.hair.relief(points)

    def color(self, points: Float32[np.ndarray, "N 3"], hit: BodyHit) -> Float64[np.ndarray, "N 3"]:
        """sRGB at points whose closest point on the body is given."""
        ready, body = self.ready, self.ready.body
        colour = np.empty((len(hit.face), 3), np.float32)
        for number, table in enumerate(self.tables):
            index = np.flatnonzero(ready.owner[hit.face] == number)
            colour[index] = table.at(chosen(hit, index))
        corners = body.faces[hit.face]
        foot = np.einsum("nk,nka->na", hit.barycentric, body.vertices[corners]).astype(np.float64)
        colour = colour.astype(np.float64)
        colour += (UNDERWEAR - colour) * underwear(body, foot, self.chest_covered)[:, None]
        colour = self.hair.painted(colour, foot)
        on_eye = ((ready.hm08.hm08_of_body < 0)[corners] * hit.barycentric).sum(axis=1).astype(np.float64)
        eyes, lines = ready.hm08.eyes, self.lines
        return paint_face(colour, foot, on_eye, eyes, lines, self.hair_colour, self.own_iris).clip(0, 1)

    def own_iris(self, off: Float64[np.ndarray, "N 2"]) -> Float64[np.ndarray, "N 3"]:
        """Iris, pupil and white of the left eye seen from the front, in radii from its middle."""
        return texels(self.iris, ((off + 1) / 2).clip(0.01, 0.99))


def inner_faces(table: Surface) -> Bool[np.ndarray, " F"]:
    """The faces all of whose nodes the table has."""
    return np.asarray((table.face_nodes > 0).all(axis=1))


def ready_skin(learned: LearnedSkin, config: SkinConfig, body: CanonicalBody, hm08: Hm08) -> ReadySkin:
    """The arrays of a trained skin. Where tables overlap the later is read."""
    tables, owner = [], np.zeros(len(body.faces), np.int64)
    covered = learned.covered.numpy().astype(bool)
    for number, table in enumerate(learned.tables):
        assert isinstance(table, Table)
        tables.append(table.read(body.faces, covered[number]))
        owner[inner_faces(tables[-1])] = number
    return ReadySkin(
        config=config,
        body=body,
        hm08=hm08,
        tables=tuple(tables),
        owner=owner,
        mixing=learned.mixing.numpy().astype(np.float64),
        middle=learned.middle.numpy().astype(np.float64),
        irises=learned.irises.numpy(),
    )
