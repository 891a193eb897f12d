"""A small adversarial run on the capsule figure, for tests; as a script, one process of it.

python -m tests.small_run FOLDER STEPS [SECONDS]        waits that long after each step
"""

import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from PIL import Image

from avatargen.atomic import write_atomically
from avatargen.body.model import pose, shape
from avatargen.data.dataset import Pictures, open_pictures
from avatargen.data.labels import Labels, encode_labels
from avatargen.data.raycast import Light, shoot
from avatargen.generator.camera import Camera, front_camera
from avatargen.training.adversarial import train
from avatargen.training.adversarial_config import PRESETS, AdversarialConfig
from avatargen.training.avatar_model import avatar_model
from tests.bodies import capsule_body

if TYPE_CHECKING:
    from accelerate import Accelerator

BODY = capsule_body(0.06)
COUNT, SIZE = 8, 16
GREEN = (0.2, 0.7, 0.3)
CONFIG = replace(
    PRESETS["debug"],
    render=replace(PRESETS["debug"].render, raw_size=8, image_size=SIZE, samples=6),
    discriminator=replace(PRESETS["debug"].discriminator, group=1, channels=16),
    losses=replace(PRESETS["debug"].losses, points=8, r1_every=4),
    batch=2,
    images=12,
    snapshot_every=4,
    report_every=1,
)


def camera() -> Camera:
    """The front camera, at the height of the capsule figure's middle."""
    front = front_camera()
    cam2world = front.cam2world.clone()
    cam2world[:, 1, 3] = 0.8
    return replace(front, cam2world=cam2world)


def make_data(folder: Path) -> Pictures:
    """Green capsule figures from the front, arms at random heights."""
    rng = np.random.default_rng(0)
    names = tuple(f"images/{i}.png" for i in range(COUNT))
    turns = np.zeros((COUNT, 24, 3), dtype=np.float32)
    turns[:, 16, 2] = rng.uniform(-1, 0.3, COUNT)
    labels = Labels(
        names=names,
        camera=np.repeat(camera().vector.numpy(), COUNT, axis=0),
        pose=turns,
        betas=np.zeros((COUNT, 10), dtype=np.float32),
    )
    (folder / "images").mkdir(parents=True)
    for name, one in zip(names, turns, strict=True):
        Image.fromarray(green_figure(one)).save(folder / name)
    write_atomically(folder / "dataset.json", encode_labels(labels))
    return open_pictures(folder, SIZE)


def green_figure(turns: np.ndarray) -> np.ndarray:
    vertices = pose(BODY, shape(BODY, np.zeros(10)), turns).vertices
    color = np.tile(np.array(GREEN, dtype=np.float32), (len(vertices), 1))
    light = Light(ambient=1.0, direction=np.array([0.0, 1.0, 0.0]), strength=0.0)
    return shoot(vertices, BODY.faces, color, camera(), light, SIZE).image


def small_run(data: Path, out: Path, config: AdversarialConfig = CONFIG, wait: float = 0.0) -> None:
    """Train on the pictures in `data`, alone or as one of the processes that the environment tells of."""

    def report(line: str) -> None:
        time.sleep(wait)

    train(config, avatar_model(config, BODY), open_pictures(data, SIZE), BODY, out, accelerator(), report)


def accelerator() -> "Accelerator":
    from accelerate import Accelerator

    return Accelerator(cpu=True)


if __name__ == "__main__":
    torch.set_num_threads(1)  # as in the tests: sums depend on it in their last digit
    folder, images, wait = Path(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])
    small_run(folder / "data", Path(sys.argv[4]), replace(CONFIG, images=images), wait)
