"""The work of avatar-export once its arguments make sense: load, sample, build, encode, write."""

import dataclasses
import json
import os
import time
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import torch

import avatargen
from assets import Asset, BuildConfig, animate, build_content, with_levels
from assets.asset.joints import body_on
from assets.asset.names import rename_joints
from assets.plan import CONTENTS, Content
from avatargen.atomic import check_writable, write_together
from avatargen.avatar import AvatarSampler
from avatargen.body.pose import load_pose
from avatargen.commands.export.fitting import build_fitted, describe, wish_of
from avatargen.commands.export.motions import finish_motions, load_motions, tell_of_bad_frames
from avatargen.commands.export.report import Made, make_report
from avatargen.commands.export.scenes import SCENES
from avatargen.commands.progress import Show
from avatargen.errors import InputError
from avatargen.motion.motion import Motion
from exporters import Format, encode, files_of, find_format
from exporters.encoding import Encoding
from exporters.png import encode_png

STARTED = time.perf_counter()
DEFAULT_FACES = 20_000  # of a scene that keeps all, where charts are wanted after all
NAMED_POSES = ("x", "t", "a")
# of the work, that lies behind when a stage begins
SHARES = {
    "load": 0.15,
    "sample": 0.2,
    "build": 0.25,
    "levels": 0.93,
    "animate": 0.94,
    "encode": 0.95,
    "preview": 0.97,
    "write": 0.99,
}


@dataclass
class Clock:
    """Seconds by stage, in the order the stages ran; says on the way what is being done."""

    show: Show
    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        self.show(name, SHARES[name])
        started = time.perf_counter()
        yield
        self.seconds[name] = time.perf_counter() - started

    def show_build(self, stage: str, share: float | int) -> None:
        """Progress inside the build, as progress of the whole."""
        self.show(stage, SHARES["build"] + share * (SHARES["animate"] - SHARES["build"]))


@dataclass(frozen=True, kw_only=True)
class Workshop:
    """What many avatars share: settings, weights and motion files, loaded once."""

    given: Namespace
    settings: BuildConfig
    generator: AvatarSampler
    motions: tuple[Motion, ...]  # of files


def run(given: Namespace, path: Path, show: Show) -> str:
    """Make the asset and write it, its report and its preview; returns the closing lines.

    Raises:
        AvatarGenError: an argument, file or field is bad; then nothing is written.
    """
    encoding = encoding_of(given)
    for beside in files_of(path, encoding)[1:]:
        check_writable(beside)
    wanted = find_format(path)
    if given.dry_run:
        return describe(build_settings(given, wanted), wish_of(given), path.name)
    clock = Clock(show, {"import": process_seconds()})
    with clock.stage("load"):
        workshop = open_workshop(given, wanted)
    made = make_avatar(workshop, given.seed, clock)
    with clock.stage("encode"):
        files = encode(made.asset, path, encoding)
    size = sum(len(data) for _, data in files)
    if given.preview is not None:
        with clock.stage("preview"):
            from assets.picture.preview import render

            files.append((given.preview, encode_png(render(made.asset))))
    show("write", SHARES["write"])
    total = process_seconds()
    if given.report is not None:
        seconds = clock.seconds | {"total": total}
        written = [file for file, _ in reversed(files) if file != given.preview]
        facts = make_report(given, written, made, size, seconds)
        files.append((given.report, json.dumps(facts, indent=2).encode() + b"\n"))
    write_together(files)
    error = made.report.error
    closing = (
        f"{path}: {size / 1e6:.1f} MB, {len(made.asset.faces):,} faces, {total:.1f} s, "
        f"error {error.mean_mm:.3f} mm mean, {error.p99_mm:.2f} mm p99"
        + (f", in the {wanted.rest_pose.upper()}-pose that {path.suffix} wants" if wanted.rest_pose else "")
    )
    return "\n".join([*tell_of_bad_frames(made.motions), closing])


def encoding_of(given: Namespace) -> Encoding:
    """How compact the files are to be."""
    return Encoding(pictures=given.texture_format, quantize=given.compress == "quantize")


def open_workshop(given: Namespace, wanted: Format) -> Workshop:
    """Check and load everything that does not depend on the seed.

    Raises:
        AvatarGenError: an argument or file is bad, or the format cannot hold what was asked for.
    """
    settings = build_settings(given, wanted)
    require_device(given.device)
    motions = load_motions(given)
    generator = avatargen.load_generator(given.weights, body=given.body, device=given.device)
    settings = with_pose(settings, given.pose, body_on(generator.body, settings.joints).joint_names)
    return Workshop(given=given, settings=settings, generator=generator, motions=motions)


def make_avatar(workshop: Workshop, seed: int, clock: Clock) -> Made:
    """One person, built, and animated and named where it has a skeleton.

    Raises:
        AvatarGenError: the seed's field is bad, or the body lacks what the options ask for.
    """
    given, settings = workshop.given, workshop.settings
    with clock.stage("sample"):
        avatar = workshop.generator.sample(seed)
    fit, wish = None, wish_of(given)
    if wish:
        fit = build_fitted(avatar, settings, wish, process_seconds(), clock.show_build)
    settings = fit.settings if fit else settings
    asset = fit.asset if fit else build_content(avatar, settings, progress=clock.show_build)
    report, motions = asset.report, ()
    assert report is not None  # only assets that were not built have none
    clock.seconds.update(report.seconds)
    if given.lods is not None:
        with clock.stage("levels"):
            asset = with_levels(asset, given.lods[1:])
    if isinstance(asset, Asset):
        with clock.stage("animate"):
            motions = finish_motions(given, workshop.motions, asset)
            asset = rename_joints(animate(asset, motions, settings.on_ground), given.names)
    return Made(asset=asset, report=report, settings=settings, motions=motions, avatar=avatar, fit=fit)


def require_device(name: str) -> None:
    """Raises InputError where torch cannot compute on the device of that name."""
    try:
        torch.empty(0, device=name)
    except (RuntimeError, AssertionError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"found --device {name}, which does not work here ({reason}); use cpu") from error


def build_settings(given: Namespace, wanted: Format) -> BuildConfig:
    """The options given, over the scene's; a pose file follows when the body is known.

    Only what the format can hold is built, in the rest pose that it must have.
    """
    scene = SCENES[given.scene]
    held = CONTENTS.index(wanted.content) >= CONTENTS.index(scene.content)
    content: Content = given.content or (scene.content if held else wanted.content)
    if CONTENTS.index(content) > CONTENTS.index(wanted.content):
        raise InputError(f"found --content {content}, but this format holds at most {wanted.content}")
    options = {name: getattr(given, name) for name in ("faces", "texture", "resolution", "joints")}
    named = given.pose.lower() if given.pose is not None and given.pose.lower() in NAMED_POSES else None
    if given.pose is not None and named is None and not Path(given.pose).is_file():
        raise InputError(
            f"found --pose {given.pose}, wanted one of {', '.join(NAMED_POSES)} or an .npz file that exists"
        )
    if wanted.rest_pose is not None and given.pose is not None and named != wanted.rest_pose:
        raise InputError(
            f"found --pose {given.pose}, but this format rests in pose {wanted.rest_pose}; leave --pose out"
        )
    if given.lods is not None:
        if not wanted.levels:
            raise InputError("found --lods, but this format holds one level of detail; choose glb or gltf")
        options["faces"] = given.lods[0]
    options["pose"] = wanted.rest_pose or named
    options |= {"morphs": given.morphs, "bones": given.bones, "ends": given.ends}
    of_rig = given.clip or given.motion or given.morphs or given.ends or given.names != "smpl"
    if content != "rigged" and of_rig:
        raise InputError(
            f"found options of the rig, but what is made holds no skeleton ({content}); leave out --clip, "
            "--motion, --morphs, --ends and --names, or choose glb, vrm or usdz and a scene that moves"
        )
    maps = () if content == "mesh" else wanted.maps
    for option, size, kind in (
        ("--normal-map", given.normal_map, "normal"),
        ("--ambient-occlusion", given.ambient_occlusion, "occlusion"),
    ):
        if size and kind not in maps:
            raise InputError(
                f"found {option} {size}, but what is made holds none; leave it out, or choose glb"
            )
    normal_map = scene.normal_map if given.normal_map is None else given.normal_map or None
    base = BuildConfig(
        content=content,
        resolution=scene.resolution,
        faces=scene.faces if content == "mesh" else scene.faces or DEFAULT_FACES,
        texture=scene.texture,
        normal_map=normal_map if "normal" in maps else None,
        ambient_occlusion=given.ambient_occlusion or None,
        joints=scene.joints,
    )
    return dataclasses.replace(base, **{name: value for name, value in options.items() if value is not None})


def with_pose(config: BuildConfig, pose: str | None, joint_names: tuple[str, ...]) -> BuildConfig:
    """The settings with the pose file's rotations, where --pose names a file."""
    if pose is None or pose.lower() in NAMED_POSES:
        return config
    return dataclasses.replace(config, pose=load_pose(pose, joint_names))


def process_seconds() -> float:
    """Seconds since this process started, where the system tells; elsewhere since this module's import."""
    try:
        fields = Path("/proc/self/stat").read_text().rsplit(")", 1)[1].split()
        started = int(fields[19]) / os.sysconf("SC_CLK_TCK")  # seconds after boot
        return float(Path("/proc/uptime").read_text().split()[0]) - started
    except (OSError, ValueError, IndexError):
        return time.perf_counter() - STARTED
