"""The viewer's page: what one sees and what the controls do. One thread does the drawing, one at a time.

viser calls back from threads of its own; those calls only note what is wanted, and `run` does it.
"""

import io
import queue
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import viser

from assets.asset.animate import animate, figure_of
from assets.asset.asset import Asset, TexturedAsset
from assets.asset.bones import aim_bones
from assets.asset.posed import posed
from assets.picture.paint import PLAIN, joint_weights, painted
from avatargen.body.pose import named_pose
from avatargen.body.stance import FINGER_LIMBS, LIMBS, STANCES, Limb, limb_rotations
from avatargen.commands.viewer.people import People, Person, Wish
from avatargen.errors import AvatarGenError, InputError
from avatargen.motion.clips import CLIPS, make_clip
from avatargen.motion.motion import in_place
from exporters import FORMATS, encode, find_format, glb

LARGEST_SEED = 2**53 - 1  # whole numbers that a browser keeps exactly
FACES = ("2000", "8000", "20000", "40000")
LEVELS = ("finest", "1/2", "1/4", "1/8")  # of the triangles, each half of the one before
SHOWN = ("texture", "shape", "skin weights", "error")
ERROR_LIMIT = 1.0  # millimetres at the end of the scale
LINES = (30, 40, 60)  # colour of the wireframe
GROUPS = {
    "trunk and head": ("bend", "turn", "nod", "look"),
    "arms": ("left arm", "right arm", "left elbow", "right elbow"),
    "legs": ("left leg", "right leg", "left knee", "right knee", "left foot", "right foot"),
    "left hand": tuple(name for name in FINGER_LIMBS if name.startswith("left")),
    "right hand": tuple(name for name in FINGER_LIMBS if name.startswith("right")),
}
STILL = "none"  # the clip that is not played


class Page:
    """One page, shared by everyone who opens it."""

    def __init__(self, server: viser.ViserServer, people: People, seed: int) -> None:
        self.server, self.people = server, people
        self.wanted: queue.SimpleQueue[viser.ClientHandle | None] = queue.SimpleQueue()  # None: draw
        self.asset: Asset | None = None  # as it was built
        self.shape: Asset | None = None  # in the pose of the sliders
        set_scene(server)
        self.add_person_controls(seed)
        self.add_pose_controls()
        self.add_view_controls()
        self.add_download_controls()
        self.want()

    def add_person_controls(self, seed: int) -> None:
        gui = self.server.gui
        with gui.add_folder("Person"):
            self.seed = gui.add_number("seed", initial_value=seed, min=0, max=LARGEST_SEED, step=1)
            another = gui.add_button("another person", icon=viser.Icon.DICE)
            self.truncation = gui.add_slider(
                "variety", min=0.0, max=1.0, step=0.05, initial_value=1.0, hint="0: the mean person"
            )
            self.faces = gui.add_dropdown("triangles", FACES, initial_value="20000")
            self.progress = gui.add_progress_bar(0.0, visible=False)
            self.status = gui.add_markdown("")
        rng = np.random.default_rng()
        another.on_click(lambda event: setattr(self.seed, "value", int(rng.integers(1_000_000))))
        self.draw_on_change(self.seed, self.truncation, self.faces)

    def add_pose_controls(self) -> None:
        gui = self.server.gui
        self.angles: dict[str, viser.GuiInputHandle[float]] = {}
        with gui.add_folder("Pose"):
            self.clip = gui.add_dropdown(
                "clip", (STILL, *CLIPS), initial_value=STILL, hint="played on the spot; the pose waits"
            )
            self.stance = gui.add_dropdown("pose", tuple(STANCES), initial_value="a")
            for title, starts in GROUPS.items():
                names = [name for name in LIMBS if name.startswith(starts) and self.can_turn(LIMBS[name])]
                if not names:
                    continue
                with gui.add_folder(title, expand_by_default=False):
                    for name in names:
                        limb = LIMBS[name]
                        self.angles[name] = gui.add_slider(
                            name, min=limb.low, max=limb.high, step=1, initial_value=0
                        )
        self.take_stance()
        self.stance.on_update(lambda event: self.take_stance())
        self.draw_on_change(self.clip, *self.angles.values())

    def can_turn(self, limb: Limb) -> bool:
        return any(joint in self.people.joint_names for joint, _ in limb.axes)

    def add_view_controls(self) -> None:
        gui = self.server.gui
        names = self.people.joint_names
        with gui.add_folder("Show"):
            self.shown = gui.add_dropdown("surface", SHOWN, initial_value="texture")
            self.joint = gui.add_dropdown("joint", names, initial_value=names[0], visible=False)
            self.level = gui.add_dropdown(
                "level of detail", LEVELS, initial_value=LEVELS[0], hint="shown and downloaded"
            )
            self.wireframe = gui.add_checkbox("wireframe", False)
            self.scale = gui.add_markdown("", visible=False)
        self.draw_on_change(self.shown, self.joint, self.level, self.wireframe)

    def add_download_controls(self) -> None:
        gui = self.server.gui
        with gui.add_folder("Download"):
            self.format = gui.add_dropdown(
                "format", tuple(suffix[1:] for suffix in FORMATS), initial_value="glb"
            )
            self.as_posed = gui.add_checkbox("rest in this pose", False)
            button = gui.add_button("download", icon=viser.Icon.DOWNLOAD)
        button.on_click(lambda event: self.wanted.put(event.client))

    def draw_on_change(self, *controls: Any) -> None:
        for control in controls:
            control.on_update(lambda event: self.want())

    def want(self) -> None:
        """Note that the picture is out of date."""
        self.wanted.put(None)

    def take_stance(self) -> None:
        """Set the sliders to the pose that was chosen."""
        for name, control in self.angles.items():
            control.value = round(STANCES[self.stance.value].get(name, 0.0))

    def run(self) -> None:
        """Do what is wanted, for ever."""
        while True:
            self.step()

    def step(self) -> None:
        """Wait until something is wanted; then draw once, however often that was asked for, and download."""
        clients = {self.wanted.get()}
        while not self.wanted.empty():
            clients.add(self.wanted.get())
        try:
            if None in clients:
                self.draw()
            for client in clients:
                if client is not None:
                    client.send_file_download(*self.file(), save_immediately=True)
        except AvatarGenError as error:
            self.status.content = f"**{error}**"
        finally:
            self.progress.visible = False

    def draw(self) -> None:
        """Bring the picture up to date.

        Raises:
            AvatarGenError: there is no such person.
        """
        wish = Wish(
            seed=int(self.seed.value), truncation=float(self.truncation.value), faces=int(self.faces.value)
        )
        person = self.people.get(wish, self.show_progress).at(LEVELS.index(self.level.value))
        angles = {name: float(control.value) for name, control in self.angles.items()}
        playing = self.clip.value != STILL
        self.asset = person.asset
        if playing:
            self.shape = play(person.asset, self.clip.value, on_the_spot=True)
        else:
            self.shape = posed(person.asset, limb_rotations(angles, person.asset.skeleton.joint_names))
        self.status.content = describe(person)
        self.joint.visible = self.shown.value == "skin weights"
        self.scale.visible = self.shown.value == "error"
        self.wireframe.disabled = playing  # its lines would stand still
        self.server.scene.add_glb("/person", glb.encode(self.colored(self.shape, person)))
        self.show_edges(self.shape)

    def colored(self, shape: Asset, person: Person) -> TexturedAsset:
        """The person as posed, in the colours asked for."""
        if self.shown.value == "shape":
            return painted(shape, np.zeros(len(shape.vertices)), PLAIN)
        if self.shown.value == "skin weights":
            return painted(shape, joint_weights(shape, self.joint.value))
        if self.shown.value == "error":
            errors = person.errors()
            largest = f"largest {errors.max():.2f} mm"
            self.scale.content = f"Mesh to field: blue 0 mm, red {ERROR_LIMIT:g} mm and more; {largest}."
            return painted(shape, errors / ERROR_LIMIT)
        return shape

    def show_edges(self, shape: Asset) -> None:
        """The wireframe, where it is wanted."""
        scene = self.server.scene
        if self.wireframe.value and self.clip.value == STILL:
            scene.add_mesh_simple("/edges", shape.vertices, shape.faces, wireframe=True, color=LINES)
        else:
            scene.remove_by_name("/edges")

    def show_progress(self, stage: str, share: float) -> None:
        self.progress.visible = True
        self.progress.value = 100 * share
        self.status.content = f"Seed {int(self.seed.value)}: {stage} ..."

    def file(self) -> tuple[str, bytes]:
        """Name and content of the file asked for, with the clip that plays; several files that belong
        together come in a .zip.

        Raises:
            AvatarGenError: there is no person yet, or that format cannot hold this one.
        """
        if self.asset is None or self.shape is None:
            raise InputError("there is no person to download yet; choose another seed")
        name = f"avatar_{self.asset.info.seed}.{self.format.value}"
        rest = find_format(name).rest_pose
        if rest is not None:
            asset = posed(self.asset, named_pose(rest, self.asset.skeleton.joint_names))
        elif self.clip.value != STILL:
            asset = play(self.asset, self.clip.value, on_the_spot=False)
        else:
            asset = self.shape if self.as_posed.value else self.asset
        asset = aim_bones(asset)
        files = encode(asset, name)
        return (name, files[0][1]) if len(files) == 1 else (f"{name}.zip", zipped(files))


def play(asset: Asset, clip: str, on_the_spot: bool) -> Asset:
    """The asset with a built-in clip alone.

    Raises:
        InputError: the skeleton lacks a joint that the clip moves.
    """
    motion = make_clip(clip, figure_of(asset))
    return animate(replace(asset, animations=()), [in_place(motion) if on_the_spot else motion])


def zipped(files: list[tuple[Path, bytes]]) -> bytes:
    """The files in one archive; same files, same bytes."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for path, data in files:
            archive.writestr(zipfile.ZipInfo(path.name), data, zipfile.ZIP_DEFLATED)
    return stream.getvalue()


def set_scene(server: viser.ViserServer) -> None:
    """Ground, light and where one stands."""
    server.gui.configure_theme(show_share_button=False, show_logo=False)
    server.scene.set_up_direction("+y")
    server.scene.add_grid("/ground", width=4, height=4, plane="xz", cell_size=0.25, section_size=1.0)
    server.scene.configure_environment_map("studio", environment_intensity=0.25)
    server.initial_camera.position = (1.2, 1.3, 3.5)
    server.initial_camera.look_at = (0.25, 0.88, 0.0)  # the panel covers the right of the page
    server.initial_camera.fov = float(np.radians(40))


def describe(person: Person) -> str:
    """What there is to say about a person, in one line."""
    asset, report = person.asset, person.asset.report
    assert report is not None  # every built asset has one
    return (
        f"Seed {asset.info.seed}: {len(asset.faces):,} triangles, error {report.error.mean_mm:.2f} mm mean, "
        f"{report.error.p99_mm:.2f} mm at 99 %, built in {report.total_seconds:.1f} s"
    )
