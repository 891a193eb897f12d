"""What a training run shows on the way: a grid of pictures, and curves where TensorBoard is."""

import importlib.util
import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from jaxtyping import UInt8
from PIL import Image
from torch import Tensor

from avatargen.atomic import write_atomically
from avatargen.data.dataset import Pictures
from avatargen.training.picture_model import PictureModel, to_look_at

Board = Callable[[dict[str, float | int]], None]  # takes numbers by name, `images` among them
PEOPLE, LABELS = 4, 6  # rows and columns


@torch.no_grad()
def picture_grid(model: PictureModel, pictures: Pictures, device: torch.device, path: Path) -> None:
    """A row a person, always the same ones, each column in the camera, pose and shape of one picture."""
    random = torch.Generator().manual_seed(0)
    z = torch.randn(PEOPLE, model.z_size, generator=random)
    chosen = torch.randint(len(pictures), (LABELS,), generator=random)
    camera, pose, betas = (part.to(device) for part in pictures.row(chosen))
    rows = []
    for one in z:
        many = one.expand(LABELS, -1).to(device)
        asked = to_look_at(many, camera, camera, pose, betas)
        rows.append(model.generate(asked).picture.image)
    path.parent.mkdir(exist_ok=True)
    stream = io.BytesIO()
    Image.fromarray(np.concatenate([side_by_side(row) for row in rows])).save(stream, format="png")
    write_atomically(path, stream.getvalue())


def side_by_side(images: Tensor) -> UInt8[np.ndarray, "S W 3"]:
    """[N 3 S S] in 0..1 as one row of pixels."""
    pixels = (images.clamp(0, 1) * 255).round().byte().cpu().permute(2, 0, 3, 1)
    return pixels.flatten(1, 2).numpy()


def tensorboard(out: Path, images: int) -> Board | None:
    """A function that adds a line of the log to the curves; none where TensorBoard is not installed."""
    if importlib.util.find_spec("tensorboard") is None:
        return None
    from torch.utils.tensorboard import SummaryWriter

    writer = SummaryWriter(str(out / "tensorboard"), purge_step=images)

    def add(line: dict[str, float | int]) -> None:
        for name, value in line.items():
            writer.add_scalar(name, value, int(line["images"]))
        writer.flush()

    return add
