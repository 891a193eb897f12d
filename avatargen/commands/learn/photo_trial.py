"""One person photographed, found in the photograph, and compared.

Letters: J joints, H L pixels.
"""

import time
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float64, UInt8
from PIL import Image

from assets import BuildConfig, build
from assets.asset.asset import PlainAsset, TexturedAsset
from assets.asset.posed import posed
from avatargen.avatar import Avatar, Sampler
from avatargen.body.model import forward_kinematics, shape
from avatargen.body.pose import axis_angle_to_matrix
from avatargen.errors import InputError
from avatargen.export.photographs import Finder
from avatargen.metrics.likeness import picture_likeness
from avatargen.metrics.photo_error import (
    SECONDS,
    PhotoError,
    Similarity,
    joints_mm,
    overlap,
    pelvis_on_pelvis,
    procrustes,
    right_words,
    surface_mm,
)
from avatargen.metrics.photo_studio import (
    Figure,
    before_wall,
    draw,
    lamp_on,
    put_camera,
    stand,
    turned,
)
from avatargen.photo.camera import Pinhole
from avatargen.photo.picture import USUAL_FOCAL, Picture
from avatargen.photo.problem import Fit
from avatargen.photo.resembling.pieces import Dresser
from avatargen.photo.seeing.see import Eyes
from avatargen.wardrobe.choosing import Traits

BUILT = BuildConfig(resolution=256)  # some tenths of a millimetre, of errors of many
JOINTS = 22  # SMPL's without hands, the pelvis first
OTHER_VIEWS = (72, 144, 216, 288)  # degrees around the person
ON_SHEET = (0, 2)  # of them
TALL = 224  # pixels of a person on the sheet
GREY = 128


@dataclass(frozen=True, kw_only=True, eq=False)
class Shot:
    """A photograph, and the truth about it in the camera's space."""

    photograph: UInt8[np.ndarray, "H L 3"]
    figure: Figure
    camera: Pinhole
    joints: Float64[np.ndarray, "J 3"]
    middle: Float64[np.ndarray, "3"]  # about which the other views turn
    views: tuple[UInt8[np.ndarray, "H L 4"], ...]  # in the figure's own colours, the photograph's first


class Trial:
    """People of a generator, photographed and found. Seconds are the processor's, so a busy machine counts
    none."""

    def __init__(self, sampler: Sampler, eyes: Eyes) -> None:
        self.sampler, self.finder = sampler, Finder(sampler, eyes, time.process_time)
        self.dresser = Dresser(sampler.body)
        self.names = sampler.body.joint_names[:JOINTS]

    def of(self, seed: int) -> tuple[PhotoError, UInt8[np.ndarray, "H L 3"] | None]:
        """The person of a seed: how far off after each stage, and pictures of both."""
        person, finder = self.sampler.sample(seed), self.finder
        shot = self.photograph(person, np.random.default_rng([seed, 1]))
        picture = Picture(
            name=f"the picture of seed {seed}",
            pixels=shot.photograph,
            focal=USUAL_FOCAL * max(shot.photograph.shape),
        )
        seconds: dict[str, float] = {}
        try:
            sightings = finder.seen([picture], seconds)
        except InputError as error:
            return PhotoError(seed=seed, refused=str(error), stages={}, right={}, seconds={}), None
        stages: dict[str, dict[str, float]] = {}
        building: dict[str, float] = {}
        asset, worn = self.usual, None
        for stage in finder.stages(sightings, Traits(), seconds):
            until = sum(seconds.values())
            if stage.resemblance is not worn:
                worn, found = stage.resemblance, finder.person(sightings, stage, Traits(), seconds)
                building = {}
                with finder.timed(building, "build"):
                    asset = textured(build(found.avatar, BUILT))
            numbers, _ = self.compare(shot, stage.fits[0], asset)
            stages[stage.name] = {SECONDS: until} | numbers
        found = finder.person(sightings, stage, Traits(), seconds)
        with finder.timed(seconds, "paint"):
            asset = textured(finder.painted(asset, found))
        numbers, strip = self.compare(shot, found.fits[0], asset)
        stages["paint"] = {SECONDS: sum(seconds.values())} | numbers
        right = right_words(dict(found.avatar.info.facts), dict(person.info.facts))
        return PhotoError(seed=seed, stages=stages, right=right, seconds=seconds | building), strip

    @cached_property
    def usual(self) -> TexturedAsset:
        """The mean person, for stages that know no clothes yet."""
        return textured(build(self.sampler.sample(0, truncation=0.0), BUILT))

    def photograph(self, person: Avatar, rng: np.random.Generator) -> Shot:
        """Somebody in a pose, before a camera."""
        asset = build(person, BUILT)
        standing = posed(asset, stand(asset.skeleton.joint_names, rng), on_ground=False)
        camera, move = put_camera(standing.vertices, rng)
        figure = figure_of(standing, standing.vertices + move)
        lit = draw(figure, camera, lamp_on(standing.normals, rng))
        rows = [standing.skeleton.joint_names.index(name) for name in self.names]
        middle = (figure.vertices.min(axis=0) + figure.vertices.max(axis=0)) / 2
        return Shot(
            photograph=before_wall(lit, rng),
            figure=figure,
            camera=camera,
            joints=standing.skeleton.joints[rows] + move,
            middle=middle,
            views=(draw(figure, camera), *around(figure, middle, camera)),
        )

    def joints(self, fit: Fit) -> Float64[np.ndarray, "J 3"]:
        """Where the found person's joints are."""
        source = self.sampler.body.source
        shaped = shape(source, fit.betas)
        T_world = forward_kinematics(shaped.joints, axis_angle_to_matrix(fit.rotations), source.parents)
        return T_world[:JOINTS, :3, 3] + fit.move

    def compare(
        self, shot: Shot, fit: Fit, asset: TexturedAsset
    ) -> tuple[dict[str, float], UInt8[np.ndarray, "H L 3"]]:
        """Numbers, and pictures: the photograph, the person found, and from other sides both."""
        assert asset.canonical is not None
        figure = figure_of(asset, self.dresser.move(asset.canonical, fit))
        joints, true = self.joints(fit), shot.figure
        ways: dict[str, Similarity] = {
            "": pelvis_on_pelvis(joints, shot.joints),
            "_aligned": procrustes(joints, shot.joints),
        }
        numbers: dict[str, float] = {}
        for name, way in ways.items():
            numbers[f"joints{name}_mm"] = joints_mm(way(joints), shot.joints)
            numbers[f"surface{name}_mm"] = surface_mm(way(figure.vertices), figure.faces, true.vertices)
        pictures = draw(figure, fit.camera), shot.views[0]
        numbers["silhouette_iou"] = overlap(*((picture[..., 3] > 127) for picture in pictures))
        seen = picture_likeness("seen", *pictures)
        aligned = figure_of(asset, ways["_aligned"](figure.vertices))
        sides = list(zip(around(aligned, shot.middle, shot.camera), shot.views[1:], strict=True))
        others = [picture_likeness("unseen", *pair) for pair in sides]
        numbers |= {"psnr_seen_db": seen.psnr_db, "ssim_seen": seen.ssim}
        numbers["psnr_unseen_db"] = float(np.mean([each.psnr_db for each in others]))
        numbers["ssim_unseen"] = float(np.mean([each.ssim for each in others]))
        shown = [pictures[0], *(picture for i in ON_SHEET for picture in sides[i][::-1])]
        return numbers, np.concatenate([small(shot.photograph), *(small(on_grey(p)) for p in shown)], axis=1)


def textured(asset: PlainAsset) -> TexturedAsset:
    """The asset, which has colours as all that is built here."""
    assert isinstance(asset, TexturedAsset)
    return asset


def around(
    figure: Figure, middle: Float64[np.ndarray, "3"], camera: Pinhole
) -> list[UInt8[np.ndarray, "H L 4"]]:
    """Pictures of somebody from the other sides."""
    return [draw(turned(figure, middle, np.radians(angle)), camera) for angle in OTHER_VIEWS]


def figure_of(asset: TexturedAsset, vertices: np.ndarray) -> Figure:
    """An asset's surface where its vertices are."""
    return Figure(vertices=vertices.astype(np.float64), faces=asset.faces, uv=asset.uv, texture=asset.texture)


def on_grey(picture: UInt8[np.ndarray, "H L 4"]) -> UInt8[np.ndarray, "H L 3"]:
    """The figure before grey."""
    cover = picture[..., 3:] / 255
    return np.rint(picture[..., :3] * cover + GREY * (1 - cover)).astype(np.uint8)


def small(picture: UInt8[np.ndarray, "H L 3"]) -> UInt8[np.ndarray, "h l 3"]:
    """A picture for the sheet."""
    height, width = picture.shape[:2]
    size = (round(width * TALL / height), TALL)
    return np.asarray(Image.fromarray(picture).resize(size, Image.Resampling.BOX))
