"""What a page's download button gives: the person shown, as a file."""

import io
import zipfile
from dataclasses import replace
from pathlib import Path

from assets.asset.animate import animate
from assets.asset.asset import Asset
from assets.asset.bones import aim_bones
from assets.asset.posed import posed
from avatargen.body.pose import named_pose
from avatargen.export.motions import make_clips
from avatargen.motion.motion import Motion, in_place
from exporters import encode, find_format


def file_of(
    built: Asset, shown: Asset, suffix: str, clip: str | None, said: Motion | None
) -> tuple[str, bytes]:
    """Name and content of a file of somebody as built, or in the pose shown where neither the format has one
    of its own nor a clip plays; several files that belong together come in a .zip. `said` is what the clip
    `say` says.

    Raises:
        AvatarGenError: that format cannot hold this one.
    """
    name = f"avatar_{built.info.seed}.{suffix}"
    rest = find_format(name).rest_pose
    if rest is not None:
        asset = posed(built, named_pose(rest, built.skeleton.joint_names))
    elif clip is not None:
        asset = play(built, clip, said, on_the_spot=False)
    else:
        asset = shown
    files = encode(aim_bones(asset), name)
    return (name, files[0][1]) if len(files) == 1 else (f"{name}.zip", zipped(files))


def play(asset: Asset, clip: str, said: Motion | None, on_the_spot: bool) -> Asset:
    """The asset with a built-in clip alone, or with several at once that have commas between them.

    Raises:
        InputError: the skeleton lacks a joint that the clip moves.
    """
    (motion,) = make_clips([clip], said, asset)
    return animate(replace(asset, animations=()), [in_place(motion) if on_the_spot else motion])


def zipped(files: list[tuple[Path, bytes]]) -> bytes:
    """The files in one archive; same files, same bytes."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for path, data in files:
            archive.writestr(zipfile.ZipInfo(path.name), data, zipfile.ZIP_DEFLATED)
    return stream.getvalue()
