"""People of photographs: the generator's person who is most like the one that is seen, and the photographs'
own colours on that person's texture."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from jaxtyping import Float64

import avatargen
from assets.asset.asset import PlainAsset, TexturedAsset
from avatargen.avatar import Avatar, Sampler
from avatargen.body.model import CanonicalBody
from avatargen.dressed_avatar import DressedSampler
from avatargen.errors import InputError
from avatargen.export.photo_pixels import Look, look_of, painted
from avatargen.export.request import ExportRequest
from avatargen.photo.fit import Fitter, check_whole
from avatargen.photo.picture import Picture, read_mask, read_picture
from avatargen.photo.problem import Fit
from avatargen.photo.resembling.person import attributes_of, avatar_of
from avatargen.photo.resembling.resemble import SKIN, Resemblance, Wardrobe, resemble
from avatargen.photo.resembling.seen_skin import AGE
from avatargen.photo.seeing.see import Eyes, open_eyes, see
from avatargen.photo.sighting import Sighting
from avatargen.wardrobe.choosing import Traits

GENDERS = ("woman", "man")
SHARES = {"fit": 0.15, "resemble": 0.4, "refine": 0.7}  # of the work, that lies behind when a stage begins
Progress = Callable[[str, float], None]  # name of the stage that begins, share of the work behind it
DRIVER = {f"{side}_hand": f"{side}_middle1" for side in ("left", "right")}  # of a skeleton without fingers


def silent(stage: str, share: float) -> None:
    """Progress that nobody watches."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Stage:
    """What is known of a person when a stage of the work ends; clothes once some were tried on."""

    name: str
    fits: tuple[Fit, ...]
    resemblance: Resemblance | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class FoundPerson:
    """A person in photographs, and the person of the generator who is most like them."""

    sightings: tuple[Sighting, ...]
    fits: tuple[Fit, ...]
    resemblance: Resemblance
    avatar: Avatar
    gender_told: bool
    seconds: dict[str, float]

    @cached_property
    def looks(self) -> tuple[Look, ...]:
        """What the photographs give to a texture."""
        return tuple(map(look_of, self.sightings, self.fits))

    @property
    def stuffs(self) -> Float64[np.ndarray, "N 3"]:
        """Middle colours of skin and of what is worn and seen, CIELAB."""
        found = self.resemblance
        worn = [found.colors.get(name) for name in found.outfit.pieces if name != SKIN]
        return np.stack([found.skin, *(color for color in worn if color is not None)])

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
        sightings = self.seen(pictures, seconds, mask, progress)
        return self.resembling(sightings, traits, seconds, progress)

    def seen(
        self,
        pictures: Sequence[Picture],
        seconds: dict[str, float],
        mask: Path | None = None,
        progress: Progress = silent,
    ) -> tuple[Sighting, ...]:
        """Whole people, one in each picture. Raises InputError as `find`."""
        progress("see", 0.0)
        with self.timed(seconds, "see"):
            sightings = [see(picture, self.eyes) for picture in pictures]
        for sighting in sightings:
            check_whole(sighting)
        if mask is not None:
            sightings = [replace(sightings[0], mask=read_mask(mask, pictures[0]))]
        return tuple(sightings)

    def resembling(
        self,
        sightings: Sequence[Sighting],
        traits: Traits,
        seconds: dict[str, float],
        progress: Progress = silent,
    ) -> FoundPerson:
        """Fit and dress the person who was seen. `traits` may tell gender, age and height; `seconds` are
        added to by stage."""
        *_, last = self.stages(sightings, traits, seconds, progress)
        return self.person(sightings, last, traits, seconds)

    def person(
        self, sightings: Sequence[Sighting], stage: Stage, traits: Traits, seconds: dict[str, float]
    ) -> FoundPerson:
        """The generator's person who is most like what a stage knows."""
        found = stage.resemblance
        assert found is not None, "no clothes were tried on yet"
        person = attributes_of(self.sampler, found, traits.age or AGE)
        return FoundPerson(
            sightings=tuple(sightings),
            fits=stage.fits,
            resemblance=found,
            avatar=avatar_of(self.sampler, person, stage.fits[0]),
            gender_told=traits.gender is not None,
            seconds=seconds,
        )

    def stages(
        self,
        sightings: Sequence[Sighting],
        traits: Traits,
        seconds: dict[str, float],
        progress: Progress = silent,
    ) -> Iterator[Stage]:
        """What is known after each stage, the last one's the most."""
        sampler, fitter, wardrobe = self.sampler, self.fitter, self.wardrobe
        progress("fit", SHARES["fit"])
        with self.timed(seconds, "fit"):
            problems = fitter.begun(sightings, traits.height, traits.gender)
            fits = tuple(problem.found(traits.height is not None) for problem in problems)
        yield Stage(name="landmarks", fits=fits)
        with self.timed(seconds, "fit"):
            fits = fitter.solved(problems, traits.height is not None)
        yield Stage(name="fit", fits=fits)
        sexes = GENDERS if traits.gender is None else (traits.gender,)
        progress("resemble", SHARES["resemble"])
        with self.timed(seconds, "resemble"):
            found = [resemble(sampler, wardrobe, sightings, fits, sex) for sex in sexes]
            best = min(found, key=lambda each: each.miss)
        yield Stage(name="resemble", fits=fits, resemblance=best)
        progress("refine", SHARES["refine"])
        with self.timed(seconds, "refine"):
            fits = fitter.refine(sightings, fits, best.sex, wardrobe.clothes(best.outfit, fitter.figure))
        yield Stage(name="refine", fits=fits, resemblance=best)
        with self.timed(seconds, "resemble"):
            best = resemble(sampler, wardrobe, sightings, fits, best.sex)
        with self.timed(seconds, "refine"):  # to the clothes that were found now
            fits = fitter.refine(sightings, fits, best.sex, wardrobe.clothes(best.outfit, fitter.figure))
        yield Stage(name="again", fits=fits, resemblance=best)

    @contextmanager
    def timed(self, seconds: dict[str, float], name: str) -> Iterator[None]:
        """Adds what is done to the seconds of a stage."""
        started = self.clock()
        yield
        seconds[name] = seconds.get(name, 0.0) + self.clock() - started

    def painted(self, asset: PlainAsset, found: FoundPerson) -> PlainAsset:
        """The asset in the photographs' pixels; one without a texture as it is."""
        if not isinstance(asset, TexturedAsset):
            return asset
        return painted(asset, self.sampler.body, found.looks, found.stuffs, self.eyes.face)


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
        return for_joints(self.found.fits[0].rotations, self.body.joint_names, joint_names)

    def painted(self, asset: PlainAsset) -> PlainAsset:
        """The asset in the photographs' pixels; one without a texture as it is."""
        return self.finder.painted(asset, self.found)


def for_joints(
    rotations: Float64[np.ndarray, "J 3"], names: tuple[str, ...], wanted: tuple[str, ...]
) -> Float64[np.ndarray, "K 3"]:
    """Rotations of the joints that a skeleton has."""
    return rotations[[names.index(DRIVER.get(name, name)) for name in wanted]]
