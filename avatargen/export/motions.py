"""The animations that a request asks for: built-in clips and motion files, retimed and mirrored."""

from collections.abc import Sequence

from assets import Asset
from assets.asset.animate import figure_of, retargeted
from avatargen.errors import InputError
from avatargen.export.request import ExportRequest
from avatargen.motion.amass import in_ranges, load_motion, motion_name
from avatargen.motion.motion import Motion, in_place, mirrored, retimed


def load_motions(request: ExportRequest) -> tuple[Motion, ...]:
    """The motion files, as they are.

    Raises:
        InputError: a file is no motion, or two animations would have one name.
    """
    names = [*request.clips, *map(motion_name, request.motions)]
    if len(set(names)) < len(names):
        raise InputError(f"found animations {', '.join(names)}; give each once, and files names of their own")
    if not request.motions:
        return ()
    return tuple(load_motion(path, request.motion_up) for path in request.motions)


def finish_motions(request: ExportRequest, files: Sequence[Motion], asset: Asset) -> tuple[Motion, ...]:
    """Clips made for the asset's person, then the files' motions, all as the request wants them.

    Raises:
        InputError: the body lacks a joint that a clip moves, or a motion would have too many frames.
    """
    motions = [*make_clips(request.clips, asset), *files]
    if request.mirror:
        motions = [mirrored(motion) for motion in motions]
    motions = retargeted(asset, motions)  # while the way shows which feet stand
    if request.in_place:
        motions = [in_place(motion) for motion in motions]
    return tuple(retimed(motion, request.fps, request.speed) for motion in motions)


def make_clips(names: Sequence[str], asset: Asset) -> list[Motion]:
    """Built-in clips for the asset's person. Raises InputError where its body lacks a joint they move."""
    if not names:
        return []
    from avatargen.motion.clips import make_clip  # scipy's splines take .2 s to load

    figure = figure_of(asset)
    return [make_clip(name, figure) for name in names]


def tell_of_bad_frames(motions: Sequence[Motion]) -> list[str]:
    """A line for each file in which frames were bad and have been filled."""
    bad = [motion for motion in motions if motion.bad_frames]
    if not bad:
        return []
    return [
        f"{motion.name}: {len(motion.bad_frames)} bad frames, filled from their neighbours: "
        f"{in_ranges(motion.bad_frames)}"
        for motion in bad
    ]


def motion_facts(motion: Motion) -> dict[str, object]:
    """What a report says of an animation."""
    return {
        "name": motion.name,
        "frames": len(motion.times),
        "seconds": round(motion.seconds, 4),
        "bad_frames": list(motion.bad_frames),
    }
