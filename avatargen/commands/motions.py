"""The animations that avatar-export was asked for: built-in clips and motion files, retimed and mirrored."""

from argparse import Namespace
from collections.abc import Sequence

from assets import Asset
from assets.animate import figure_of
from avatargen.errors import InputError
from avatargen.motion.amass import in_ranges, load_motion
from avatargen.motion.clips import make_clip
from avatargen.motion.motion import Motion, in_place, mirrored, retimed


def load_motions(given: Namespace) -> tuple[Motion, ...]:
    """The motion files, as they are.

    Raises:
        InputError: a file is no motion, or two animations would have one name.
    """
    names = [*given.clip, *(path.stem for path in given.motion)]
    if len(set(names)) < len(names):
        raise InputError(f"found animations {', '.join(names)}; give each once, and files names of their own")
    return tuple(load_motion(path) for path in given.motion)


def finish_motions(given: Namespace, files: Sequence[Motion], asset: Asset) -> tuple[Motion, ...]:
    """Clips made for the asset's person, then the files' motions, all as the options want them.

    Raises:
        InputError: the body lacks a joint that a clip moves, or a motion would have too many frames.
    """
    figure = figure_of(asset) if given.clip else None
    motions = [make_clip(name, figure) for name in given.clip if figure is not None]
    motions += files
    if given.mirror:
        motions = [mirrored(motion) for motion in motions]
    if given.in_place:
        motions = [in_place(motion) for motion in motions]
    return tuple(retimed(motion, given.fps, given.speed) for motion in motions)


def tell_of_bad_frames(motions: Sequence[Motion]) -> list[str]:
    """A line for each file in which frames were bad and have been filled."""
    return [
        f"{motion.name}: {len(motion.bad_frames)} bad frames, filled from their neighbours: "
        f"{in_ranges(motion.bad_frames)}"
        for motion in motions
        if motion.bad_frames
    ]


def motion_facts(motion: Motion) -> dict[str, object]:
    """What a report says of an animation."""
    return {
        "name": motion.name,
        "frames": len(motion.times),
        "seconds": round(motion.seconds, 4),
        "bad_frames": list(motion.bad_frames),
    }
