"""The animations that a request asks for: built-in clips, what is said and motion files, as it wants them."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from assets import Asset
from assets.asset.animate import figure_of, retargeted
from avatargen.errors import InputError
from avatargen.export.request import ExportRequest
from avatargen.motion.amass import in_ranges, load_motion, motion_name
from avatargen.motion.motion import Motion, in_place, mirrored, retimed
from avatargen.motion.names import BODY_CLIPS, SAID, animation_name, parts_of
from avatargen.motion.together import together


@dataclass(frozen=True, kw_only=True)
class Loaded:
    """What is played that does not depend on the person: motion files as they are, and what is said."""

    files: tuple[Motion, ...] = ()
    said: Motion | None = None


def load_motions(request: ExportRequest) -> Loaded:
    """The motion files and what is said.

    Raises:
        InputError: a file is no motion or holds no phonemes, there is nothing to say in a text, or two
            animations would have one name.
    """
    names = [*map(animation_name, clips_of(request)), *map(motion_name, request.motions)]
    if len(set(names)) < len(names):
        raise InputError(f"found animations {', '.join(names)}; give each once, and files names of their own")
    files = tuple(load_motion(path, request.motion_up) for path in request.motions)
    return Loaded(files=files, said=what_is_said(request.say, request.phonemes))


def what_is_said(text: str | None, phonemes: Path | None) -> Motion | None:
    """A mouth that says a text or a file's phonemes; nothing where there is neither.

    Raises:
        InputError: there is nothing to say in the text, or the file holds no phonemes.
    """
    from avatargen.motion.expression import speech
    from avatargen.motion.speech.phoneme_file import read_phonemes
    from avatargen.motion.speech.timing import segments_of_text

    if text is not None:
        return speech(SAID, segments_of_text(text))
    return None if phonemes is None else speech(SAID, read_phonemes(phonemes))


def clips_of(request: ExportRequest) -> tuple[str, ...]:
    """The clips of a request; what is said is one of its own where no other clip has it."""
    silent = request.say is None and request.phonemes is None
    spoken = silent or any(SAID in parts_of(clip) for clip in request.clips)
    return request.clips if spoken else (*request.clips, SAID)


def finish_motions(request: ExportRequest, loaded: Loaded, asset: Asset) -> tuple[Motion, ...]:
    """Clips made for the asset's person, then the files' motions, all as the request wants them.

    Raises:
        InputError: the body lacks a joint that a clip moves, or a motion would have too many frames.
    """
    motions = [*make_clips(clips_of(request), loaded.said, asset), *loaded.files]
    if request.mirror:
        motions = [mirrored(motion) for motion in motions]
    motions = retargeted(asset, motions)  # while the way shows which feet stand
    if request.in_place:
        motions = [in_place(motion) for motion in motions]
    return tuple(retimed(motion, request.fps, request.speed) for motion in motions)


def make_clips(names: Sequence[str], said: Motion | None, asset: Asset) -> list[Motion]:
    """Built-in clips for the asset's person, alone or several at once.

    Raises:
        InputError: its body lacks a joint that a clip moves.
    """
    if not names:
        return []
    from avatargen.motion.clips import make_clip  # scipy's splines take .2 s to load
    from avatargen.motion.expression import make_face_clip

    figure = figure_of(asset)

    def made(name: str) -> Motion:
        if name in BODY_CLIPS:
            return make_clip(name, figure)
        if name == SAID:
            assert said is not None  # a request that plays it has it
            return said
        return make_face_clip(name)

    found = []
    for clip in names:
        motions = [made(name) for name in parts_of(clip)]
        found.append(motions[0] if len(motions) == 1 else together(animation_name(clip), motions))
    return found


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
