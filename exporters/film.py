"""Pictures that follow each other: GIF or WebP that play for ever, or MP4. Same pictures, same bytes."""

import io
from collections.abc import Callable, Sequence
from fractions import Fraction

import numpy as np
from jaxtyping import UInt8
from PIL import Image

from avatargen.errors import InputError
from avatargen.extras import require_extra

PALETTE = 255  # colours of a GIF; the one left over is for what is transparent
SAMPLE = 8  # frames whose colours choose the palette
OPAQUE = 128  # coverage from which a GIF, which knows no half, shows a pixel
WEBP_QUALITY = 85
MP4_QUALITY = "18"  # x264's rate factor: 0 is lossless, 23 usual

Frames = Sequence[UInt8[np.ndarray, "H W C"]]


def encode_gif(frames: Frames, seconds: float) -> bytes:
    """One palette for all frames, so that colours do not flicker. `seconds` are those of the whole."""
    pictures = [Image.fromarray(frame[..., :3]) for frame in frames]
    chosen = np.concatenate([frame[..., :3] for frame in frames[:: max(1, len(frames) // SAMPLE)]])
    palette = Image.fromarray(chosen).quantize(PALETTE, dither=Image.Dither.NONE)
    indexed = [picture.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG) for picture in pictures]
    settings: dict[str, object] = {}
    if frames[0].shape[2] == 4:
        indexed = [cut_out(picture, frame[..., 3]) for picture, frame in zip(indexed, frames, strict=True)]
        settings = {"transparency": PALETTE, "disposal": 2}
    return encode(indexed, seconds, "GIF", settings | {"optimize": False})


def cut_out(picture: Image.Image, coverage: UInt8[np.ndarray, "H W"]) -> Image.Image:
    """The picture with its colour left over wherever less than half is covered."""
    numbers = np.where(coverage < OPAQUE, PALETTE, np.asarray(picture)).astype(np.uint8)
    cut = Image.fromarray(numbers, mode="P")
    cut.putpalette(picture.getpalette() or [])
    return cut


def encode_webp(frames: Frames, seconds: float) -> bytes:
    """Full colour and soft edges; a third of a GIF's size."""
    pictures = [Image.fromarray(frame) for frame in frames]
    return encode(pictures, seconds, "WEBP", {"quality": WEBP_QUALITY, "method": 4})


def encode(pictures: list[Image.Image], seconds: float, kind: str, settings: dict[str, object]) -> bytes:
    stream = io.BytesIO()
    duration = round(1000 * seconds / len(pictures))
    pictures[0].save(
        stream, format=kind, save_all=True, append_images=pictures[1:], duration=duration, loop=0, **settings
    )
    return stream.getvalue()


def encode_mp4(frames: Frames, seconds: float) -> bytes:
    """H.264 in half-size colours, which every player and site takes; odd sizes grow by a row or column.

    Raises:
        InputError: PyAV is not installed, or the pictures are transparent, which MP4 does not know.
    """
    require_extra("av")
    if frames[0].shape[2] != 3:
        raise InputError("an .mp4 holds no transparency; leave --transparent out, or write .webp")
    import av

    stream = io.BytesIO()
    with av.open(stream, "w", format="mp4", options={"fflags": "+bitexact"}) as film:
        video = film.add_stream("libx264", rate=Fraction(len(frames) / seconds).limit_denominator(1000))
        video.height, video.width = (size + size % 2 for size in frames[0].shape[:2])
        video.pix_fmt = "yuv420p"
        video.options = {"crf": MP4_QUALITY, "threads": "1"}  # one thread: same bytes on any machine
        for picture in frames:
            odd = [(0, size % 2) for size in picture.shape[:2]]
            padded = np.pad(picture, (*odd, (0, 0)), "edge")
            film.mux(video.encode(av.VideoFrame.from_ndarray(padded, format="rgb24")))
        film.mux(video.encode())
    return stream.getvalue()


FILMS: dict[str, Callable[[Frames, float], bytes]] = {
    ".gif": encode_gif,
    ".webp": encode_webp,
    ".mp4": encode_mp4,
}
