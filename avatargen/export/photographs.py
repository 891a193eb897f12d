"""People of photographs: the generator's person who is most like the one that is seen, and the photographs'
own colours on that person's texture."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float64, UInt8

import avatargen
from assets.asset.asset import PlainAsset, TexturedAsset
from assets.picture.preview import sample_texture
from assets.texture.atlas import Atlas
from assets.texture.bake import TexelMap, map_texels
from avatargen.avatar import Avatar, Sampler
from avatargen.body.model import CanonicalBody
from avatargen.dressed_avatar import DressedSampler
from avatargen.errors import InputError
from avatargen.export.request import ExportRequest
from avatargen.photo.face_shift import face_shift
from avatargen.photo.fit import Fitter, check_whole
from avatargen.photo.picture import Picture, read_mask, read_picture
from avatargen.photo.pixels import Shown, evened, of_one_stuff, scene_of, show, trust
from avatargen.photo.problem import Fit
from avatargen.photo.resembling.person import attributes_of, avatar_of
from avatargen.photo.resembling.pieces import Dresser
from avatargen.photo.resembling.resemble import SKIN, Resemblance, Wardrobe, resemble
from avatargen.photo.seeing.face import find_face
from avatargen.photo.seeing.network import Network
from avatargen.photo.seeing.see import Eyes, open_eyes, see
from avatargen.photo.sighting import Sighting
from avatargen.wardrobe.choosing import Traits

GENDERS = ("woman", "man")
GAMMA = 2.2  # of `sample_texture`'s linear light
AGE = "young"  # where nobody tells
SHARES = {"fit": 0.15, "resemble": 0.4, "refine": 0.7}  # of the work, that lies behind when a stage begins
Progress = Callable[[str, float], None]  # name of the stage that begins, share of the work behind it


def silent(stage: str, share: float) -> None:
    """Progress that nobody watches."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FoundPerson:
    """A person in photographs, and the person of the generator who is most like them."""

    sightings: tuple[Sighting, ...]
    fits: tuple[Fit, ...]
    resemblance: Resemblance
    avatar: Avatar
    gender_told: bool
    seconds: dict[str, float]

    @property
    def seen_colors(self) -> list[np.ndarray]:
        """Middle colours of what is worn and seen, CIELAB."""
        worn = [name for name in self.resemblance.outfit.pieces if name != SKIN]
        return [color for name in worn if (color := self.resemblance.colors.get(name)) is not None]

    def facts(self) -> dict[str, object]:
        """What was found, for scripts to read."""
        return {
            "photos": [each.picture.name for each in self.sightings],
            "people": [each.people for each in self.sightings],
            "gender_told": self.gender_told,
            "height_told": self.fits[0].height_known,
            "uncertain": [list(each.uncertain) for each in self.fits],
            "miss": round(self.resemblance.miss, 3),
            "seconds": {name: round(value, 3) for name, value in self.seconds.items()},
        }

    def lines(self) -> list[str]:
        """What whoever gave the photographs should know."""
        found = []
        for sighting, fit in zip(self.sightings, self.fits, strict=True):
            name = sighting.picture.name
            if sighting.people > 1:
                found.append(f"{name}: {sighting.people} people; the largest was taken")
            if fit.uncertain:
                found.append(f"{name}: it does not show well where {', '.join(fit.uncertain)} are")
        if not self.gender_told:
            found.append(f"taken for a {self.resemblance.sex}, by clothes and hair; --gender tells")
        if not self.fits[0].height_known:
            tall = f"{self.fits[0].height:.2f} m"
            found.append(f"a picture does not show how tall somebody is: taken as {tall}; --height tells")
        return found


class Finder:
    """Finds a generator's people in photographs; what was made ready for one stays for the next. Seconds are
    those of `clock`.

    Raises:
        InputError: a generator of other people, or another body.
    """

    def __init__(self, sampler: Sampler, eyes: Eyes, clock: Callable[[], float] = time.perf_counter) -> None:
        if not isinstance(sampler, DressedSampler) or sampler.sizing is None:
            raise InputError(
                "found a photograph with people of other weights or another body; leave those out"
            )
        self.sampler, self.eyes, self.clock = sampler, eyes, clock
        self.fitter, self.wardrobe = Fitter(sampler.body.source, sampler.sizing), Wardrobe(sampler)

    def find(
        self,
        pictures: Sequence[Picture],
        traits: Traits,
        mask: Path | None = None,
        progress: Progress = silent,
    ) -> FoundPerson:
        """The person of the pictures; a mask is of the one picture. Raises InputError where they show no
        whole person."""
        seconds: dict[str, float] = {}
        progress("see", 0.0)
        with self.timed(seconds, "see"):
            sightings = [see(picture, self.eyes) for picture in pictures]
        for sighting in sightings:
            check_whole(sighting)
        if mask is not None:
            sightings = [replace(sightings[0], mask=read_mask(mask, pictures[0]))]
        return self.resembling(sightings, traits, seconds, progress)

    def resembling(
        self,
        sightings: Sequence[Sighting],
        traits: Traits,
        seconds: dict[str, float],
        progress: Progress = silent,
    ) -> FoundPerson:
        """Fit and dress the person who was seen. `traits` may tell gender, age and height; `seconds` are
        added to by stage."""
        sampler, fitter, wardrobe = self.sampler, self.fitter, self.wardrobe
        progress("fit", SHARES["fit"])
        with self.timed(seconds, "fit"):
            fits = fitter.fit_together(sightings, height=traits.height, gender=traits.gender)
        sexes = GENDERS if traits.gender is None else (traits.gender,)
        progress("resemble", SHARES["resemble"])
        with self.timed(seconds, "resemble"):
            found = [resemble(sampler, wardrobe, sightings, fits, sex) for sex in sexes]
            best = min(found, key=lambda each: each.miss)
            clothes = wardrobe.clothes(best.outfit, fitter.figure)
        progress("refine", SHARES["refine"])
        with self.timed(seconds, "refine"):
            fits = fitter.refine(sightings, fits, best.sex, clothes)
        with self.timed(seconds, "resemble"):
            best = resemble(sampler, wardrobe, sightings, fits, best.sex)
        with self.timed(seconds, "refine"):  # to the clothes that were found now
            fits = fitter.refine(sightings, fits, best.sex, wardrobe.clothes(best.outfit, fitter.figure))
        person = attributes_of(sampler, best, traits.age or AGE)
        return FoundPerson(
            sightings=tuple(sightings),
            fits=fits,
            resemblance=best,
            avatar=avatar_of(sampler, person, fits[0]),
            gender_told=traits.gender is not None,
            seconds=seconds,
        )

    @contextmanager
    def timed(self, seconds: dict[str, float], name: str) -> Iterator[None]:
        """Adds what is done to the seconds of a stage."""
        started = self.clock()
        yield
        seconds[name] = seconds.get(name, 0.0) + self.clock() - started

    def painted(self, asset: PlainAsset, found: FoundPerson) -> PlainAsset:
        """The asset in the photographs' pixels; one without a texture as it is."""
        return painted(asset, found, self.eyes.face) if isinstance(asset, TexturedAsset) else asset


class PhotoPeople:
    """The person of a request's photographs."""

    def __init__(self, request: ExportRequest) -> None:
        self.pictures = [read_picture(path) for path in request.photos]
        eyes = open_eyes()  # what may fail at once comes first
        sampler = avatargen.load_generator(request.weights, body=request.body, device=request.device)
        self.request, self.finder = request, Finder(sampler, eyes)
        self.seen: FoundPerson | None = None

    @property
    def body(self) -> CanonicalBody:
        return self.finder.sampler.body

    @property
    def found(self) -> FoundPerson:
        assert self.seen is not None, "sampled first"
        return self.seen

    def sample(self, seed: int) -> Avatar:
        """Look at the photographs. Raises InputError where they show no whole person."""
        self.seen = self.finder.find(self.pictures, self.request.traits, self.request.mask)
        return self.seen.avatar

    def pose(self, joint_names: tuple[str, ...]) -> Float64[np.ndarray, "J 3"]:
        """The first photograph's pose, upright where its camera was level."""
        names = self.body.joint_names
        rows = [names.index(DRIVER.get(name, name)) for name in joint_names]
        return self.found.fits[0].rotations[rows]

    def painted(self, asset: PlainAsset) -> PlainAsset:
        """The asset in the photographs' pixels; one without a texture as it is."""
        return self.finder.painted(asset, self.found)


DRIVER = {f"{side}_hand": f"{side}_middle1" for side in ("left", "right")}  # of a skeleton without fingers


def painted(asset: TexturedAsset, found: FoundPerson, face: Network | None = None) -> TexturedAsset:
    """The asset, where photographs show it well in their own colours; where several do, the best one's most.
    With the face network, features of the face lie where the asset has them."""
    assert asset.canonical is not None
    texels = map_texels(
        Atlas(vertex_map=np.arange(len(asset.vertices)), uv=asset.uv, faces=asset.faces), len(asset.texture)
    )
    dresser = Dresser(found.avatar.body)
    shown = [
        shown_by(asset, texels, dresser.move(asset.canonical, fit), found, number, face)
        for number, fit in enumerate(found.fits)
    ]
    return replace(asset, texture=blended(asset.texture, texels, shown))


def shown_by(
    asset: TexturedAsset,
    texels: TexelMap,
    vertices: Float64[np.ndarray, "W 3"],
    found: FoundPerson,
    number: int,
    face: Network | None,
) -> Shown:
    """The texels that filtering reads, in one photograph."""
    sighting, fit = found.sightings[number], found.fits[number]
    scene = scene_of(vertices, asset.faces, fit.camera)
    tall = float((sighting.mask > 0.5).any(axis=1).sum())
    trusted = trust(scene.seen, sighting.mask, tall)
    own = np.zeros(sighting.picture.pixels.shape)
    at = scene.seen.mask
    own[at] = sample_texture(asset, scene.seen.face[at], scene.seen.barycentric[at]).clip(0, 1) ** (1 / GAMMA)
    pixels, asked = sighting.picture.pixels, texels.asked
    stuffs = np.stack([found.resemblance.skin, *found.seen_colors])
    built = np.where(at[..., None], np.rint(255 * own), pixels).astype(np.uint8)
    shift = None if face is None else face_shift(find_face(face, built, sighting.pixels), sighting.face)
    alike = of_one_stuff(pixels, own, stuffs, trusted, tall)
    if shift is not None:  # glasses and beards are no other stuff
        alike = np.maximum(alike, trusted * shift.cover(*trusted.shape))
    trusted = alike
    photograph = evened(pixels, own, trusted, tall)
    return show(scene, texels.face[asked], texels.barycentric(asked), photograph, trusted, shift)


def blended(
    texture: UInt8[np.ndarray, "S S 3"], texels: TexelMap, shown: Sequence[Shown]
) -> UInt8[np.ndarray, "S S 3"]:
    """The texture with what is shown laid over it."""
    values = texture.reshape(-1, 3).astype(np.float64)
    weights = np.stack([each.weight**2 for each in shown])
    most = np.max([each.weight for each in shown], axis=0)
    colors = np.einsum("pt,ptc->tc", weights, np.stack([each.color for each in shown]))
    colors /= np.maximum(weights.sum(axis=0), 1e-9)[:, None]
    old = values[texels.asked]
    values[texels.asked] = old + most[:, None] * (255 * colors - old)
    return texels.spread(np.rint(values).astype(np.uint8).reshape(texture.shape))
