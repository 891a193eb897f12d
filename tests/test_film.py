"""Films: frames in order, at their speed, for ever; what is transparent stays so."""

import io

import numpy as np
import pytest
from PIL import Image

from exporters.film import FILMS


def frames(count: int = 5, channels: int = 3) -> list[np.ndarray]:
    """A bright square that walks to the right over a dark ground."""
    pictures = []
    for step in range(count):
        picture = np.full((24, 40, channels), 20, np.uint8)
        picture[..., 3:] = 0
        picture[8:16, 4 + 6 * step : 10 + 6 * step] = (240, 180, 60, 255)[:channels]
        pictures.append(picture)
    return pictures


@pytest.mark.parametrize("suffix", FILMS)
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
