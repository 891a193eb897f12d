"""The photograph or saved person of a page: where the file is dropped, how a photograph is shown beside its
person, and how it goes away."""

from collections.abc import Callable

import numpy as np
import viser
from PIL import Image

from avatargen.commands.viewer.people import Photo

LARGEST = 480  # pixels of a side, of what the page shows
HINT = (
    "a photograph of one whole person, or a file of --save-person; it stays in this machine's memory, and "
    "nothing of it is stored"
)
KINDS = "image/*,.safetensors"


class PhotoControls:
    """The controls; `changed` is called when a visitor gives a photograph or takes it away."""

    def __init__(self, gui: viser.GuiApi, changed: Callable[[], None]) -> None:
        self.gui, self.changed = gui, changed
        self.photo: Photo | None = None  # that is wanted
        self.upload = gui.add_upload_button(
            "a photograph or saved person", icon=viser.Icon.PHOTO_UP, mime_type=KINDS, hint=HINT
        )
        self.picture = gui.add_image(np.zeros((1, 1, 3), np.uint8), format="jpeg", visible=False)
        self.leave = gui.add_button("without it", icon=viser.Icon.PHOTO_OFF, visible=False)
        self.upload.on_upload(lambda event: self.take(event.target.value))
        self.leave.on_click(lambda event: self.drop())

    def take(self, file: viser.UploadedFile) -> None:
        """Want the person of a file."""
        self.photo = Photo(file.name, file.content)
        self.changed()

    def drop(self) -> None:
        """Want the person of the other controls."""
        self.photo = None
        self.changed()

    def show(self, photo: Photo | None) -> None:
        """The photograph of the person who is shown, or none."""
        self.leave.visible = photo is not None
        self.picture.visible = photo is not None and not photo.saved
        if photo is not None and not photo.saved:
            image = Image.fromarray(photo.picture.pixels)
            image.thumbnail((LARGEST, LARGEST))
            self.picture.image = np.asarray(image)
