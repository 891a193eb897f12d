"""One run, trained a few steps at a time, so that several can take turns and stop at the same picture.

FOLDER/config.json      settings; a folder never holds two runs
FOLDER/state.pt         to continue from
FOLDER/log.jsonl        a line every few steps
FOLDER/weights.safetensors   averaged weights, written with the pictures that the run is judged by
"""

from collections import OrderedDict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor

from avatargen.baselines.models import new_baseline
from avatargen.body.model import Body
from avatargen.comparison.plan import OURS, Run
from avatargen.data.dataset import Pictures
from avatargen.run_folder import claim, cut_log
from avatargen.training import adversarial
from avatargen.training.adversarial_state import MAY_CHANGE, describe, new_state, restore, save_state
from avatargen.training.avatar_model import avatar_model
from avatargen.training.batches import batches, to_device
from avatargen.training.picture_model import PictureModel

if TYPE_CHECKING:
    from accelerate import Accelerator

SLICE = 8  # steps of a turn
KEPT = 4  # averages of the last turns, to go back to


class TrainingRun:
    """The networks of a run, the averages after each of its last turns, and its folder."""

    def __init__(
        self, run: Run, pictures: Pictures, body: Body, folder: Path, accelerator: "Accelerator"
    ) -> None:
        self.run, self.folder, self.pictures, self.device = run, folder, pictures, accelerator.device
        model = (
            avatar_model(run.config, body) if run.model == OURS else new_baseline(run.model, run.config, body)
        )
        settings = describe(run.config, model, pictures, body, "random weights")
        claim(folder, "config.json", settings, "eval", made=["state.pt"], free=MAY_CHANGE)
        self.state = new_state(run.config, model, pictures.labels.rows().shape[1], accelerator.device)
        if (folder / "state.pt").exists():
            restore(self.state, folder / "state.pt")
        cut_log(folder / "log.jsonl", "images", self.state.images, "eval")
        self.once = adversarial.Run(config=run.config, accelerator=accelerator)
        room = model.survey(pictures.row(torch.arange(len(pictures))))
        self.coming = batches(pictures, run.config, model, self.step, slice(None), room)
        self.averages: OrderedDict[int, dict[str, Tensor]] = OrderedDict()
        self.last: dict[str, Any] = {}
        self.keep()

    @property
    def images(self) -> int:
        """Pictures shown."""
        return self.state.images

    @property
    def step(self) -> int:
        return self.state.images // self.run.config.batch

    def turn(self) -> None:
        """The next steps, to the next multiple of SLICE or the end.

        Raises:
            TrainingError: gradients are not finite or explode.
        """
        config, steps = self.run.config, []
        while self.images < config.images:
            batch = to_device(next(self.coming), self.device)
            steps.append(adversarial.step_once(self.state, self.once, batch, self.step))
            if self.step % SLICE == 0:
                break
        if steps:
            self.last = adversarial.look(steps, self.state, config)[-1]
            adversarial.write_line(self.last, self.folder, None)
        self.keep()

    def keep(self) -> None:
        """Remember the averaged weights as they are now."""
        weights = {name: value.clone() for name, value in self.state.average.state_dict().items()}
        self.averages[self.images] = weights
        while len(self.averages) > KEPT:
            self.averages.popitem(last=False)

    def save(self) -> None:
        """What to continue from."""
        save_state(self.state, self.folder / "state.pt")

    @torch.no_grad()
    def averaged_at(self, images: int) -> tuple[PictureModel, int]:
        """The model with averaged weights at so many pictures or, where those are gone, at the nearest number
        that is remembered; and that number."""
        nearest = min(self.averages, key=lambda known: abs(known - images))
        average = self.state.average
        average.load_state_dict(self.averages[nearest])
        random = torch.Generator().manual_seed(0)
        z = torch.randn(1024, average.z_size, generator=random)
        camera = self.pictures.row(torch.randint(len(self.pictures), (1024,), generator=random))[0]
        average.settle(z.to(self.device), camera.to(self.device))
        return average, nearest

    def restore_average(self) -> None:
        """Undo `averaged_at`, before training goes on."""
        self.state.average.load_state_dict(self.averages[self.images])

    def close(self) -> None:
        self.coming.close()
