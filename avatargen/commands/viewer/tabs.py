"""The tabs that are open: each has a page of its own, and one thread does all their work."""

import queue

import numpy as np
import viser

from avatargen.commands.viewer.page import Page
from avatargen.commands.viewer.people import People


class Tabs:
    """Gives every tab that opens a page, and does what the pages want, one after the other.

    Tabs open and close on the server's event loop, so no tab can be closed before it was opened.
    """

    def __init__(self, server: viser.ViserServer, people: People, seed: int) -> None:
        self.people, self.seed = people, seed
        self.pages: dict[int, Page] = {}  # by tab
        self.calls: queue.SimpleQueue[Page] = queue.SimpleQueue()
        set_scene(server)
        server.on_client_connect(self.open)
        server.on_client_disconnect(self.close)

    async def open(self, tab: viser.ClientHandle) -> None:
        self.pages[tab.client_id] = Page(tab, self.people, self.seed, self.calls.put)

    async def close(self, tab: viser.ClientHandle) -> None:
        page = self.pages.pop(tab.client_id, None)
        if page is not None:
            page.closed = True

    def run(self) -> None:
        """Do what is wanted, for ever."""
        while True:
            self.step()

    def step(self) -> None:
        """Wait until a page wants something, and do it."""
        self.calls.get().step()


def set_scene(server: viser.ViserServer) -> None:
    """What all tabs share: ground, light, and the panel's place and name."""
    server.gui.set_panel_label("avatargen")
    server.gui.configure_theme(show_share_button=False, show_logo=False)
    server.gui.main_panel.dock_right()
    server.scene.set_up_direction("+y")
    server.scene.add_grid("/ground", width=4, height=4, plane="xz", cell_size=0.25, section_size=1.0)
    light(server.scene)
    server.initial_camera.position = (0.95, 1.3, 3.5)
    server.initial_camera.look_at = (0.0, 0.88, 0.0)
    server.initial_camera.fov = float(np.radians(40))


def light(scene: viser.SceneApi) -> None:
    """An even sky and one lamp before the person: viser's own lights stand behind and burn pale faces out,
    and its environment shines on dark cloth."""
    scene.configure_default_lights(enabled=False)
    scene.configure_environment_map(None)
    scene.add_light_hemisphere("/sky", sky_color=(255, 250, 245), ground_color=(170, 160, 150), intensity=2.2)
    scene.add_light_directional("/lamp", intensity=1.0, position=(-0.6, 1.6, 1.4), cast_shadow=True)
