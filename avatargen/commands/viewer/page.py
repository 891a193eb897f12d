"""What one tab of a browser shows, and what its controls do.

viser calls back from threads of its own; those calls only note what is wanted, and `step` does it.
"""

from collections.abc import Callable
from dataclasses import replace
from threading import Event
from typing import Any

import numpy as np
import viser
from jaxtyping import Float64

from assets.asset.asset import Asset, TexturedAsset, part_names
from assets.asset.parts import keep
from assets.asset.posed import posed
from assets.asset.shaped import has_face, shaped, with_played_morphs
from assets.picture.paint import PLAIN, joint_weights, painted
from avatargen.body.stance import FINGER_LIMBS, LIMBS, STANCES, Limb, limb_rotations
from avatargen.commands.viewer.camera import place, room_of
from avatargen.commands.viewer.download import file_of, play
from avatargen.commands.viewer.face import STILL, FaceControls
from avatargen.commands.viewer.people import People, Person, Wish
from avatargen.commands.viewer.photo import PhotoControls
from avatargen.errors import AvatarGenError, InputError
from avatargen.export.motions import what_is_said
from avatargen.motion.clips import CLIPS
from avatargen.motion.motion import Motion
from exporters import FORMATS, glb

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
WORDS_HINT = "as: an old man in a grey suit; Enter shows who fits, another person another one"


class Superseded(Exception):
    """Somebody else is wanted by now, or nobody looks any more."""


class Page:
    """One tab of a browser, and the person in it."""

    def __init__(
        self, tab: viser.ClientHandle, people: People, seed: int, call: Callable[["Page"], None]
    ) -> None:
        """`call` asks for a `step`."""
        self.tab, self.people, self.call = tab, people, call
        self.undrawn, self.unsent = Event(), Event()  # the picture is out of date; a download is wanted
        self.closed = False
        self.seed = seed  # the last good one
        self.refused = ""  # why what was asked for last is not shown
        self.wish: Wish | None = None  # who is shown
        self.asset: Asset | None = None  # as it was built
        self.shape: Asset | None = None  # in the pose of the sliders
        self.box: Float64[np.ndarray, "2 3"] | None = None  # around this person in all poses so far
        self.stood: Float64[np.ndarray, " 3"] | None = None  # where the camera was put
        self.add_person_controls()
        self.add_download_controls()
        self.add_pose_controls()
        self.add_view_controls()
        self.face = FaceControls(tab.gui, self.pose_folder.order - 0.5, self.draw_on_change)
        tab.camera.on_update(lambda camera: self.fit())  # the page may have another size
        self.want()

    def add_person_controls(self) -> None:
        gui = self.tab.gui
        with gui.add_folder("Person") as folder:
            self.typed = gui.add_text("seed", str(self.seed), hint="a whole number; Enter shows the person")
            self.words = gui.add_text("in words", "", hint=WORDS_HINT)
            self.photo = PhotoControls(gui, self.take_photo)
            another = gui.add_button("another person", icon=viser.Icon.DICE)
            self.truncation = gui.add_slider(
                "variety", min=0.0, max=1.0, step=0.05, initial_value=1.0, hint="0: the mean person"
            )
            self.faces = gui.add_dropdown("triangles", FACES, initial_value="20000")
            self.in_parts = gui.add_checkbox(
                "clothes come off", False, hint="body, garments and hair as meshes of their own: takes longer"
            )
            self.moving_face = gui.add_checkbox(
                "face that moves", False, hint="lips and lids that open, 67 shapes and speech"
            )
            self.parts: dict[str, viser.GuiInputHandle[bool]] = {}
            self.progress = gui.add_progress_bar(0.0, visible=False)
            self.status = gui.add_markdown(f"Seed {self.seed} ...")
        rng = np.random.default_rng()
        another.on_click(lambda event: self.take_another(str(rng.integers(1_000_000))))
        self.typed.on_update(self.take_seed)
        self.words.on_update(self.leave_photo)
        self.person_folder = folder
        self.draw_on_change(self.words, self.truncation, self.faces, self.in_parts, self.moving_face)

    def add_pose_controls(self) -> None:
        gui = self.tab.gui
        self.angles: dict[str, viser.GuiInputHandle[float]] = {}
        with gui.add_folder("Pose") as self.pose_folder:
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
        gui = self.tab.gui
        names = self.people.joint_names
        with gui.add_folder("Show"):
            self.shown = gui.add_dropdown("surface", SHOWN, initial_value="texture")
            self.joint = gui.add_dropdown("joint", names, initial_value=names[0], visible=False)
            self.level = gui.add_dropdown(
                "level of detail", LEVELS, initial_value=LEVELS[0], hint="shown and downloaded"
            )
            self.wireframe = gui.add_checkbox("wireframe", False)
            self.scale = gui.add_markdown("", visible=False)
            whole = gui.add_button("whole person", icon=viser.Icon.ARROWS_MAXIMIZE)
        whole.on_click(lambda event: self.fit(always=True))
        self.draw_on_change(self.shown, self.joint, self.level, self.wireframe)

    def add_download_controls(self) -> None:
        gui = self.tab.gui
        with gui.add_folder("Download"):
            self.format = gui.add_dropdown(
                "format", tuple(suffix[1:] for suffix in FORMATS), initial_value="glb"
            )
            self.as_posed = gui.add_checkbox("rest in this pose", False)
            button = gui.add_button("download", icon=viser.Icon.DOWNLOAD)
        button.on_click(lambda event: self.want(self.unsent))

    def draw_on_change(self, *controls: Any) -> None:
        for control in controls:
            control.on_update(self.changed)

    def changed(self, event: viser.GuiEvent[Any]) -> None:
        """A control has another value, from the tab or from here."""
        if event.client is not None:
            self.refused = ""
        self.want()

    def want(self, what: Event | None = None) -> None:
        """Note that the picture is out of date, or that a file is wanted."""
        (what or self.undrawn).set()
        self.call(self)

    def take_photo(self) -> None:
        """A photograph was given or taken away."""
        self.refused = ""
        self.want()

    def leave_photo(self, event: viser.GuiEvent[Any]) -> None:
        """Whoever types asks for somebody else than the photograph's person."""
        if event.client is not None:
            self.photo.photo = None

    def take_another(self, seed: str) -> None:
        """Somebody else."""
        self.photo.photo = None
        self.typed.value = seed

    def take_seed(self, event: viser.GuiEvent[Any]) -> None:
        """Take the seed that was typed; if it is none, say so and put the last good one back."""
        typed = self.typed.value.strip()
        self.leave_photo(event)
        if typed.isascii() and typed.isdecimal() and len(typed) <= 16 and int(typed) <= LARGEST_SEED:
            self.seed = int(typed)
            self.changed(event)
        else:
            self.refused = f"found {quoted(typed)}; a seed is a whole number from 0 to {LARGEST_SEED}"
            self.typed.value = str(self.seed)

    def take_stance(self) -> None:
        """Set the sliders to the pose that was chosen."""
        for name, control in self.angles.items():
            control.value = round(STANCES[self.stance.value].get(name, 0.0))

    def wanted(self) -> Wish:
        """Whom the controls ask for."""
        return Wish(
            seed=self.seed,
            text="" if self.photo.photo else self.words.value.strip(),
            photo=self.photo.photo,
            truncation=float(self.truncation.value),
            faces=int(self.faces.value),
            parts=bool(self.in_parts.value),
            face=bool(self.moving_face.value),
        )

    def step(self) -> None:
        """Draw and send what is wanted, once, however often that was asked for."""
        if self.closed:
            return
        try:
            if self.undrawn.is_set():
                self.undrawn.clear()
                self.draw()
            if self.unsent.is_set():
                self.unsent.clear()
                self.tab.send_file_download(*self.file(), save_immediately=True)
        except Superseded:
            return
        except AvatarGenError as error:
            self.refused = str(error)
            self.status.content = f"**{self.refused}**"
        if not self.closed:
            self.progress.visible = False

    def draw(self) -> None:
        """Bring the picture up to date.

        Raises:
            AvatarGenError: there is no such person; the controls are back at the one who is shown.
            Superseded: another person is wanted.
        """
        wish = self.wanted()
        try:
            whole = self.people.get(wish, lambda stage, share: self.show_progress(wish, stage, share))
            person = whole.at(0 if wish.parts else LEVELS.index(self.level.value))
        except AvatarGenError:
            if self.wish is not None and self.wish != wish and self.wanted() == wish:
                self.put_back(self.wish)
            raise
        if self.closed or self.wanted() != wish:
            raise Superseded
        if self.wish is None or self.wish.who != wish.who:
            self.box = None
        self.wish = wish
        self.photo.show(wish.photo)
        self.offer_parts(part_names(person.asset))
        self.asset = self.worn(person.asset)
        self.face.offer(has_face(self.asset))
        playing = self.playing() is not None
        self.shape = self.moment(self.asset)
        self.status.content = (self.refused and f"**{self.refused}**\n\n") + describe(wish, person)
        self.joint.visible = self.shown.value == "skin weights"
        self.scale.visible = self.shown.value == "error"
        self.wireframe.disabled = playing  # its lines would stand still
        self.level.disabled = wish.parts
        self.tab.scene.add_glb("/person", glb.encode(self.colored(self.shape, person)))
        self.show_edges(self.shape)
        box = room_of(self.shape)
        if self.box is not None:
            box = np.stack([np.minimum(box[0], self.box[0]), np.maximum(box[1], self.box[1])])
        self.box = box
        self.fit()

    def moment(self, asset: Asset) -> Asset:
        """The person as the sliders and clips have them; the body's pose waits while its clip plays.

        Raises:
            InputError: what the mouth is to say has no word.
        """
        clip = self.playing()
        still = self.clip.value == STILL
        asset = self.standing(asset) if still else shaped(asset, self.face.weights())
        if clip is None:
            return replace(asset, morphs=())
        return with_played_morphs(play(asset, clip, self.said(), on_the_spot=True))

    def standing(self, asset: Asset) -> Asset:
        """The person as the sliders of pose and face have them."""
        angles = {name: float(control.value) for name, control in self.angles.items()}
        rotations = limb_rotations(angles, asset.skeleton.joint_names)
        return posed(shaped(asset, self.face.weights()), rotations)

    def playing(self) -> str | None:
        """What plays at once, of the body and of the face; None where nothing does."""
        body = [] if self.clip.value == STILL else [self.clip.value]
        return ",".join([*body, *self.face.playing()]) or None

    def said(self) -> Motion | None:
        """What the mouth says. Raises InputError where that is no word."""
        return what_is_said(self.face.words or None, None)

    def offer_parts(self, names: tuple[str, ...]) -> None:
        """A switch for each part of the person."""
        if tuple(self.parts) == names:
            return
        for switch in self.parts.values():
            switch.remove()
        with self.person_folder:
            self.parts = {name: self.tab.gui.add_checkbox(name, True) for name in names}
        self.draw_on_change(*self.parts.values())

    def worn(self, asset: Asset) -> Asset:
        """The person with the parts that are switched on; all of them where none is."""
        on = [name for name, switch in self.parts.items() if switch.value]
        return keep(asset, on) if 0 < len(on) < len(self.parts) else asset

    def put_back(self, wish: Wish) -> None:
        """Let the controls ask for somebody again."""
        self.photo.photo = wish.photo
        self.seed, self.typed.value = wish.seed, str(wish.seed)
        if wish.photo is None:
            self.words.value = wish.text
        self.truncation.value, self.in_parts.value = wish.truncation, wish.parts
        self.moving_face.value = wish.face
        self.faces.value = next(faces for faces in FACES if int(faces) == wish.faces)
        self.want()  # a photograph is no control whose change asks for it

    def fit(self, always: bool = False) -> None:
        """Put the camera where it sees the whole person, unless somebody has moved it."""
        camera = self.tab.camera
        moved = self.stood is not None and not np.allclose(camera.position, self.stood, atol=1e-3)
        if self.box is None or min(camera.image_height, camera.image_width) == 0 or (moved and not always):
            return
        self.stood, middle = place(self.box, camera.fov, camera.aspect)
        with self.tab.atomic():
            camera.position, camera.look_at = self.stood, middle

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
        scene = self.tab.scene
        if self.wireframe.value and self.playing() is None:
            scene.add_mesh_simple("/edges", shape.vertices, shape.faces, wireframe=True, color=LINES)
        else:
            scene.remove_by_name("/edges")

    def show_progress(self, wish: Wish, stage: str, share: float) -> None:
        """Say how far the person is.

        Raises:
            Superseded: another one is wanted.
        """
        if self.closed or self.wanted() != wish:
            raise Superseded
        self.progress.visible = True
        self.progress.value = 100 * share
        self.status.content = f"{called(wish)}: {stage} ..."

    def file(self) -> tuple[str, bytes]:
        """Name and content of the file asked for, with the clip that plays; several files that belong
        together come in a .zip.

        Raises:
            AvatarGenError: there is no person yet, or that format cannot hold this one.
        """
        if self.asset is None or self.shape is None:
            raise InputError("there is no person to download yet; choose another seed")
        return file_of(
            self.asset,
            self.standing(self.asset) if self.as_posed.value else self.asset,
            self.format.value,
            self.playing(),
            self.said(),
        )


def quoted(typed: str) -> str:
    """What was typed, as text that Markdown takes as it is."""
    return plain(typed[:20]) if typed else "nothing"


def plain(words: str) -> str:
    """Words that Markdown takes as they are."""
    return "`" + words.replace("`", "'") + "`"


def called(wish: Wish) -> str:
    """Who it is, as Markdown takes it."""
    return f"Seed {wish.seed}" if wish.photo is None else plain(wish.photo.name)


def describe(wish: Wish, person: Person) -> str:
    """What there is to say about a person: one line, and one for each thing that was read out of a text or
    that a photograph does not tell."""
    told = dict(person.asset.info.facts)
    lines = [f"{name.replace('_', ' ')}: {told[name]}" for name in ("understood", "left_out") if name in told]
    return "\n\n".join([measures(wish, person), *map(plain, [*lines, *person.lines])])


def measures(wish: Wish, person: Person) -> str:
    """The person in numbers."""
    asset, report = person.asset, person.asset.report
    assert report is not None  # every built asset has one
    return (
        f"{called(wish)}: {len(asset.faces):,} triangles, error {report.error.mean_mm:.2f} mm mean, "
        f"{report.error.p99_mm:.2f} mm at 99 %, built in {report.total_seconds:.1f} s"
    )
