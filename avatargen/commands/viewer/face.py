"""Controls of a face that moves: a slider for each shape, clips of the face, and words that it says without a
sound."""

from collections.abc import Callable, Sequence
from typing import Any

import viser

from assets.face.names import ARKIT, VISEMES
from avatargen.motion.names import FACE_CLIPS, SAID

GROUPS = {  # by how the shapes' names begin
    "lids and gaze": ("eye",),
    "brows": ("brow",),
    "nose and cheeks": ("nose", "cheek"),
    "jaw and tongue": ("jaw", "tongue"),
    "mouth": ("mouth",),
    "visemes": ("viseme_",),
}
STILL = "none"  # the clip that is not played
SAY_HINT = "English words; Enter lets the mouth say them"


class FaceControls:
    """What is there for a person whose face moves, and gone for another one."""

    def __init__(self, gui: viser.GuiApi, order: float, draw_on_change: Callable[..., None]) -> None:
        """`order` is the place among the page's folders; `draw_on_change` is told of each control that
        changes the picture."""
        self.gui, self.order, self.draw_on_change = gui, order, draw_on_change
        self.folder: viser.GuiFolderHandle | None = None
        self.sliders: dict[str, viser.GuiInputHandle[float]] = {}

    def offer(self, there: bool) -> None:
        """Show the controls, or take them away."""
        if there == (self.folder is not None):
            return
        if self.folder is not None:
            self.folder.remove()  # and all that is in it
            self.folder, self.sliders = None, {}
            return
        self.folder = self.gui.add_folder("Face", order=self.order)
        with self.folder:
            self.said = self.gui.add_text(SAID, "", hint=SAY_HINT)
            self.clip = self.gui.add_dropdown(
                "clip of the face",
                (STILL, *FACE_CLIPS),
                initial_value=STILL,
                hint="goes with one of the body",
            )
            for title, starts in GROUPS.items():
                with self.gui.add_folder(title, expand_by_default=False):
                    self.add_sliders([name for name in (*ARKIT, *VISEMES) if name.startswith(starts)])
        self.draw_on_change(self.said, self.clip, *self.sliders.values())

    def add_sliders(self, names: Sequence[str]) -> None:
        for name in names:
            self.sliders[name] = self.gui.add_slider(name, min=0.0, max=1.0, step=0.01, initial_value=0.0)

    def weights(self) -> dict[str, float]:
        """Of the shapes, as the sliders stand."""
        return {name: float(slider.value) for name, slider in self.sliders.items()}

    @property
    def words(self) -> str:
        """What the mouth is to say."""
        return self.said.value.strip() if self.folder is not None else ""

    def playing(self) -> list[str]:
        """What the face does over time: its clip, and what it says."""
        if self.folder is None:
            return []
        chosen: list[Any] = [] if self.clip.value == STILL else [self.clip.value]
        return [*chosen, SAID] if self.words else chosen
