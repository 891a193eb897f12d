"""Films: frames in order, at their speed, for ever; what is transparent stays so."""

import io
from importlib.util import find_spec

import numpy as np
import pytest
from PIL import Image

from avatargen.errors import InputError
from exporters.film import FILMS
from tests.verdicts import require


def frames(count: int = 5, channels: int = 3) -> list[np.ndarray]:
    """A bright square that walks to the right over a dark ground."""
    pictures = []
    for step in range(count):
        picture = np.full((24, 40, channels), 20, np.uint8)
        picture[..., 3:] = 0
        picture[8:16, 4 + 6 * step : 10 + 6 * step] = (240, 180, 60, 255)[:channels]
        pictures.append(picture)
    return pictures


@pytest.mark.parametrize("suffix", [".gif", ".webp"])
@pytest.mark.parametrize("channels", [3, 4])
def test_a_film_plays_what_was_put_in(suffix: str, channels: int):
    made = FILMS[suffix](frames(channels=channels), 2.0)
    film = Image.open(io.BytesIO(made))
    assert (film.n_frames, film.info["loop"]) == (5, 0)  # pyright: ignore[reportAttributeAccessIssue]
    total = 0
    for number, frame in enumerate(frames(channels=channels)):
        film.seek(number)
        film.load()
        total += film.info["duration"]
        seen = np.asarray(film.convert("RGBA")).astype(int)
        bright = frame[..., 0] == 240
        assert (seen[..., 3] == np.where(bright | (channels == 3), 255, 0)).all()
        assert np.abs(seen[bright][:, :3] - (240, 180, 60)).mean() < 12
    assert total == pytest.approx(2000, abs=50)
    assert FILMS[suffix](frames(channels=channels), 2.0) == made


@pytest.mark.parametrize("size", [(24, 40), (25, 41)])
def test_an_mp4_plays_what_was_put_in(size: tuple[int, int]):
    require(find_spec("av") is not None, "the extra [film] (av)")
    import av

    given = [np.full((*size, 3), 20, np.uint8) for _ in range(5)]
    for step, picture in enumerate(given):
        picture[8:16, 4 + 6 * step : 12 + 6 * step] = (240, 180, 60)
    made = FILMS[".mp4"](given, 2.0)
    with av.open(io.BytesIO(made), "r") as film:
        video = film.streams.video[0]
        assert (video.codec_context.name, video.pix_fmt) == ("h264", "yuv420p")
        decoded = list(film.decode(video))
    assert [float(frame.time) for frame in decoded] == pytest.approx([0.0, 0.4, 0.8, 1.2, 1.6])
    for frame, picture in zip(decoded, given, strict=True):
        found = frame.to_ndarray(format="rgb24").astype(int)
        assert found.shape == (24 + 2 * (size[0] % 2), 40 + 2 * (size[1] % 2), 3)
        assert np.abs(found[: size[0], : size[1]] - picture).mean() < 6
    assert FILMS[".mp4"](given, 2.0) == made


def test_mp4_says_what_it_cannot_do(monkeypatch: pytest.MonkeyPatch):
    with pytest.raises(InputError, match="no transparency"):
        FILMS[".mp4"](frames(channels=4), 1.0)
    monkeypatch.setattr("avatargen.extras.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"avatargen\[film\]"):
        FILMS[".mp4"](frames(), 1.0)
