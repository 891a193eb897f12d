"""One avatar: load, sample, build, animate, encode, write."""

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import torch

from assets.asset.animate import animate
from assets.asset.asset import Asset
from assets.asset.joints import body_on
from assets.asset.levels import with_levels
from assets.asset.names import rename_joints
from assets.asset.part_names import rename_parts
from assets.asset.root_bone import with_root
from assets.build_config import AvatarFields, BuildConfig
from assets.pipeline import Progress, build_content
from avatargen.atomic import check_writable, different_targets, write_together
from avatargen.body.pose import load_pose
from avatargen.errors import InputError
from avatargen.export.fitting import build_fitted
from avatargen.export.motions import Loaded, finish_motions, load_motions
from avatargen.export.people import People, Photographed, open_people
from avatargen.export.report import Made, make_report
from avatargen.export.request import ExportRequest
from exporters import encode, files_of
from exporters.png import encode_png

# of the work, that lies behind when a stage begins
SHARES = {
    "load": 0.15,
    "sample": 0.2,
    "build": 0.25,
    "paint": 0.92,
    "levels": 0.93,
    "animate": 0.94,
    "encode": 0.95,
    "preview": 0.97,
    "write": 0.99,
}


@dataclass
class Stopwatch:
    """Seconds by stage, in the order the stages ran; says on the way what is being done."""

    progress: Progress
    elapsed: float = 0.0  # seconds that were spent before
    seconds: dict[str, float] = field(default_factory=dict)
    started: float = field(default_factory=time.perf_counter)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        self.progress(name, SHARES[name])
        started = time.perf_counter()
        yield
        self.seconds[name] = time.perf_counter() - started

    def show_build(self, stage: str, share: float | int) -> None:
        """Progress inside the build, as progress of the whole."""
        self.progress(stage, SHARES["build"] + share * (SHARES["animate"] - SHARES["build"]))

    def total(self) -> float:
        return self.elapsed + time.perf_counter() - self.started


@dataclass(frozen=True, kw_only=True)
class Workshop:
    """What many avatars share: settings, weights and motion files, loaded once."""

    request: ExportRequest
    settings: BuildConfig
    people: People
    motions: Loaded


@dataclass(frozen=True, kw_only=True)
class Exported:
    """One avatar that was written."""

    path: Path
    made: Made
    bytes: int  # with the files beside `path`
    seconds: float


def silent(stage: str, share: float | int) -> None:
    """Progress that nobody watches."""


def export_avatar(request: ExportRequest, progress: Progress = silent, elapsed: float = 0.0) -> Exported:
    """Make the avatar of one seed and write it, its report and its preview: all or none.

    `elapsed` seconds were spent before, as a command does until its libraries are loaded; they count in the
    report and in a budget.

    Raises:
        AvatarGenError: a file or the seed's field is bad, or the body lacks what is asked for; then nothing
            is written.
    """
    if not isinstance(request.seeds, int) or request.dry_run:
        raise InputError("export_avatar: found many seeds or a dry run, wanted one seed; see export_many")
    watch = Stopwatch(progress, elapsed, {"import": elapsed})
    path = request.path_of(request.seeds)
    check_outputs(request, path)
    with watch.stage("load"):
        workshop = open_workshop(request)
    made = make_avatar(workshop, request.seeds, watch)
    with watch.stage("encode"):
        files = encode(made.asset, path, request.encoding)
    size = sum(len(data) for _, data in files)
    written = [file for file, _ in reversed(files)]
    if request.preview is not None:
        with watch.stage("preview"):
            from assets.picture.preview import render

            files.append((request.preview, encode_png(render(made.asset))))
    progress("write", SHARES["write"])
    total = watch.total()
    if request.save_person is not None:
        from avatargen.export.person_file import encode_person
        from avatargen.export.saved_people import saved  # most people are not kept

        kept = saved(made.avatar, made.found, pixels=request.texture_from == "photo")
        files.append((request.save_person, encode_person(kept)))
    if request.report is not None:
        report = make_report(request, written, made, size, watch.seconds | {"total": total})
        files.append((request.report, json.dumps(report, indent=2).encode() + b"\n"))
    write_together(files)
    return Exported(path=path, made=made, bytes=size, seconds=total)


def check_outputs(request: ExportRequest, path: Path) -> None:
    """Raises InputError where a file cannot be written, or is another one of them or one that is read."""
    outputs = [*files_of(path, request.encoding), request.report, request.preview, request.save_person]
    outputs = [output for output in outputs if output is not None]
    for output in outputs:
        check_writable(output)
    targets = different_targets(outputs)
    read = (request.weights, request.body, request.pose_file, *request.motions, *request.photos)
    for source in (*read, request.mask, request.person, request.phonemes):
        if source is not None and source.resolve() in targets:
            raise InputError(f"cannot write {source}: it is read as well; give another --out or --report")


def open_workshop(request: ExportRequest) -> Workshop:
    """Check and load everything that does not depend on the seed.

    Raises:
        AvatarGenError: a file or the device is bad.
    """
    require_device(request.device)
    motions = load_motions(request)
    people = open_people(request)
    settings = request.build
    if request.pose_file is not None:
        joint_names = body_on(people.body, settings.joints).joint_names
        settings = replace(settings, pose=load_pose(request.pose_file, joint_names))
    return Workshop(request=request, settings=settings, people=people, motions=motions)


def make_avatar(workshop: Workshop, seed: int, watch: Stopwatch) -> Made:
    """One person, built, and animated and named where it has a skeleton.

    Raises:
        AvatarGenError: the seed's field is bad, or the body lacks what is asked for.
    """
    request, settings, people = workshop.request, workshop.settings, workshop.people
    with watch.stage("sample"):
        avatar = people.sample(seed)
    photographed = people if isinstance(people, Photographed) else None
    if photographed is not None and request.photo_pose:
        settings = replace(
            settings, pose=photographed.pose(body_on(people.body, settings.joints).joint_names)
        )
    fit = None
    if request.chosen:
        fit = build_fitted(avatar, settings, request, watch.total(), watch.show_build)
    settings = fit.settings if fit else settings
    if request.parts == "separate":
        asset = build_separate(avatar, request, settings, watch.show_build)
    else:
        asset = fit.asset if fit else build_content(avatar, settings, progress=watch.show_build)
    report, motions = asset.report, ()
    assert report is not None  # only assets that were not built have none
    watch.seconds.update(report.seconds)
    if photographed is not None and request.texture_from == "photo":
        with watch.stage("paint"):
            asset = photographed.painted(asset)
    if request.levels:
        with watch.stage("levels"):
            asset = with_levels(asset, request.levels)
    if isinstance(asset, Asset):
        with watch.stage("animate"):
            motions = finish_motions(request, workshop.motions, asset)
            asset = animate(asset, motions, settings.on_ground)
            asset = rename_parts(asset) if request.part_names == "rpm" else asset
            asset = rename_joints(with_root(asset) if request.root else asset, request.names)
    return Made(
        asset=asset,
        report=report,
        settings=settings,
        motions=motions,
        avatar=avatar,
        fit=fit,
        found=None if photographed is None else photographed.found,
    )


def build_separate(
    avatar: AvatarFields, request: ExportRequest, settings: BuildConfig, progress: Progress
) -> Asset:
    """The person in parts. Raises InputError for a person who is one field."""
    from assets.separate import LayeredFields, build_parts  # most people are made whole

    if not isinstance(avatar, LayeredFields):
        raise InputError("found --parts separate of people who are one field; leave --from and --weights out")
    return build_parts(avatar, settings, request.hidden, progress)


def require_device(name: str) -> None:
    """Raises InputError where torch cannot compute on the device of that name."""
    try:
        torch.empty(0, device=name)
    except (RuntimeError, AssertionError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"found --device {name}, which does not work here ({reason}); use cpu") from error
