"""Names of what can be played, for a command that reads its arguments before libraries load.

A clip is one of these, or several at once with commas between: `walk,talk` walks and talks. At most one of
them moves the body.
"""

from collections.abc import Sequence

from avatargen.errors import InputError

BODY_CLIPS = ("idle", "walk", "wave", "range")
FACE_CLIPS = ("blink", "talk", "smile")
SAID = "say"  # what a text or a file of phonemes says


def parts_of(clip: str) -> tuple[str, ...]:
    """What plays at once.

    Raises:
        InputError: there is no such clip, one is named twice, or two move the body.
    """
    parts, known = tuple(clip.split(",")), (*BODY_CLIPS, *FACE_CLIPS, SAID)
    unknown = [part for part in parts if part not in known]
    if unknown:
        raise InputError(
            f"found clip {unknown[0]!r}, wanted one of {', '.join(known)}, or several at once with commas "
            "between"
        )
    if len(set(parts)) < len(parts) or sum(part in BODY_CLIPS for part in parts) > 1:
        raise InputError(f"found clip {clip}; one of the body and each of the face once can play at once")
    return parts


def animation_name(clip: str) -> str:
    """What its animation is called in a file."""
    return clip.replace(",", "_")


def of_a_face(clips: Sequence[str]) -> list[str]:
    """Those of the clips that move a face."""
    return [clip for clip in clips if not set(clip.split(",")) <= set(BODY_CLIPS)]
