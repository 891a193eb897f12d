"""What to export, how and where: made once, from a command line or in Python, and read by all that follows.

    ExportRequest(seeds=3, out=Path("person.glb"))
    ExportRequest(seeds=range(1000), build=BuildConfig.for_scene("crowd"), out=Path("crowd"), jobs=4)
    ExportRequest(seeds=(3, 5, 8), out=Path("three"), sheet=Path("three.png"))

Every field is part of the request's fingerprint (`avatargen.export.fingerprint`) unless it says here why it
changes no byte of a file.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from assets.build_config import BuildConfig
from assets.content import CONTENTS, MOVING_FACE
from avatargen.avatar import LARGEST_SEED
from avatargen.errors import InputError
from avatargen.export.rules import (
    check_chosen,
    check_one_or_many,
    check_person,
    check_photos,
    check_sheet,
    check_source,
    check_speech,
    check_text,
    check_wear,
)
from avatargen.motion.names import of_a_face
from avatargen.wardrobe.choosing import Traits
from exporters import Format, find_format
from exporters.encoding import PLAIN, Encoding
from exporters.export import require_encoding

Source = Literal["generator", "wardrobe"]
Parts = Literal["merged", "separate"]
Hidden = Literal["drop", "keep"]
PartNames = Literal["own", "rpm"]
Names = Literal["smpl", "mixamo", "unity", "unreal", "rpm"]
TextureFrom = Literal["photo", "field"]
NO_BYTE = "changes no byte"  # a field's metadata: the reason why it is not in the fingerprint


def no_byte(reason: str) -> dict[str, str]:
    """Metadata of a field that changes no byte of an avatar's files."""
    return {NO_BYTE: reason}


@dataclass(frozen=True, kw_only=True)
class ExportRequest:
    """One avatar into a file, or many into a folder. Raises InputError for what does not go together."""

    # what: the avatars
    seeds: int | Sequence[int] = field(  # one, or many: a range stays one, others become a tuple
        metadata=no_byte("says which files there are; each depends on its own seed")
    )
    source: Source = "generator"  # wardrobe: the people that the generator learns from
    wardrobe: Path | None = None  # of the wardrobe's people: a folder of MakeHuman's assets that they wear
    weights: Path | None = None  # of another generator than the shipped one
    body: Path | None = None  # in SMPL's format: .npz or .pkl
    traits: Traits = field(default_factory=Traits)  # what was chosen of the people
    text: str | None = None  # a line that says what the people are like; traits beside it win
    change: bool = False  # the text says what is to be otherwise of each seed's own person
    wear: tuple[tuple[str, int], ...] = ()  # garments borrowed: what, and the seed that lends it
    photos: tuple[Path, ...] = ()  # of one person, who takes the place of the seed's
    mask: Path | None = None  # of the one photograph, the user's own: white where the person is
    texture_from: TextureFrom = "photo"  # field: the photograph gives its colours alone, not its pixels
    person: Path | None = None  # a file that `save_person` wrote, of somebody in the place of the seed's
    # what: the asset
    build: BuildConfig = field(default_factory=BuildConfig)
    scene: str | None = field(default=None, metadata=no_byte("what it sets is in build and format"))
    parts: Parts = "merged"  # separate: body, garments and hair are meshes of their own
    hidden: Hidden = "drop"  # what clothes hide of a separate body
    part_names: PartNames = "own"  # rpm: as pages made for Ready Player Me's avatars look for
    pose_file: Path | None = None  # rotations that take the place of `build.pose`, .npz
    photo_pose: bool = False  # the first photograph's pose takes its place
    tolerance_mm: float | None = None  # resolution and faces that keep 99 % of the surface within it
    budget_s: float | None = None  # resolution and faces that take so many seconds of the process
    levels: tuple[int, ...] = ()  # triangles of the coarser levels of detail, falling
    # what: the rig
    names: Names = "smpl"  # whose names the joints get
    root: bool = False  # a bone on the ground carries the animations' way
    clips: tuple[str, ...] = ()  # see avatargen.motion.names; several at once have commas between them
    motions: tuple[Path, ...] = ()  # AMASS-style files, .npz
    say: str | None = None  # an English text that the mouth says
    phonemes: Path | None = None  # sounds and their times that it says, .json
    fps: float = 30.0  # of the animations
    speed: float = 1.0  # of the animations: 2 plays them in half the time
    motion_up: Literal["y", "z"] | None = None  # the upward axis of the files; None: what each one tells
    mirror: bool = False  # left and right of the animations
    in_place: bool = False  # animations over one spot
    # what: the file
    format: str = ""  # a suffix without its dot; "": that of `out`, else glb
    encoding: Encoding = PLAIN
    # how
    device: str = "cpu"  # of torch; another one adds numbers up in another order
    jobs: int | None = field(default=None, metadata=no_byte("processes make the files, each one alone"))
    ray: str | None = field(default=None, metadata=no_byte("a cluster's address; workers there do the same"))
    # where
    out: Path | None = field(default=None, metadata=no_byte("where the bytes go"))  # None: avatar_SEED here
    report: Path | None = field(default=None, metadata=no_byte("a file of its own"))
    preview: Path | None = field(default=None, metadata=no_byte("a picture of its own"))
    save_person: Path | None = field(default=None, metadata=no_byte("a file of its own"))
    sheet: Path | None = field(default=None, metadata=no_byte("a picture of many, beside their files"))
    dry_run: bool = field(default=False, metadata=no_byte("nothing is written"))

    def __post_init__(self) -> None:
        if not isinstance(self.seeds, int | range):
            object.__setattr__(self, "seeds", tuple(self.seeds))
        check_seeds(self.seeds)
        check_source(
            source=self.source,
            wardrobe=self.wardrobe,
            weights=self.weights,
            chosen=bool(self.traits.given()) or self.text is not None,
        )
        check_text(self.text, change=self.change)
        check_speech(self.clips, self.say, self.phonemes)
        check_wear(dict(self.wear), self.source, self.wardrobe, len(self.wear))
        check_photos(
            photos=self.photos,
            mask=self.mask,
            texture_from=self.texture_from,
            posed=self.photo_pose,
            many=self.many,
            seeds_people=self.source != "generator"
            or bool(self.wear)
            or self.chosen
            or self.text is not None,
            traits=self.traits.given(),
            person=self.person,
        )
        said = {"from": self.source != "generator", "photo": self.photos, "text": self.text is not None}
        said |= {"wear": self.wear} | dict.fromkeys(self.traits.given(), True)
        check_person(
            person=self.person,
            kept=self.save_person,
            many=self.many,
            source=self.source,
            others=[name.replace("_", "-") for name, given in said.items() if given],
        )
        check_one_or_many(
            many=self.many,
            jobs=self.jobs,
            ray=self.ray,
            out=self.out,
            report=self.report,
            preview=self.preview,
            dry_run=self.dry_run,
            budget_s=self.budget_s,
            sheet=self.sheet,
        )
        check_sheet(self.sheet, 1 if isinstance(self.seeds, int) else len(self.seeds))
        check_chosen(
            tolerance_mm=self.tolerance_mm, budget_s=self.budget_s, fixed=("lods",) * any(self.levels)
        )
        if not self.format:  # so that nobody reads it before it is known
            suffix = self.out.suffix if self.out is not None and not self.many else ""
            object.__setattr__(self, "format", suffix.removeprefix(".").lower() or "glb")
        if self.out is not None and not self.many and self.out.suffix.lower() != f".{self.format}":
            raise InputError(
                f"found --out {self.out} with --format {self.format}; give a name that ends in .{self.format}"
            )
        require_encoding(f"avatar.{self.format}", self.encoding)
        check_held(self, self.file_format)
        check_parts(self, self.file_format)

    @property
    def many(self) -> bool:
        """Many go into a folder."""
        return not isinstance(self.seeds, int)

    @property
    def file_format(self) -> Format:
        """What the format of the files holds."""
        return find_format(f"avatar.{self.format}")

    @property
    def chosen(self) -> bool:
        """Measured curves choose resolution and faces."""
        return self.tolerance_mm is not None or self.budget_s is not None

    def path_of(self, seed: int) -> Path:
        """Where the avatar of a seed goes."""
        files = (*self.photos, *([] if self.person is None else [self.person]))
        name = f"{files[0].stem if files else f'avatar_{seed}'}.{self.format}"
        if self.out is None:
            return Path(name)
        return self.out / name if self.many else self.out


def check_seeds(seeds: int | Sequence[int]) -> None:
    """Raises InputError where a seed is none or there twice, or there are none."""
    numbers = (seeds,) if isinstance(seeds, int) else seeds
    if isinstance(numbers, range) and numbers:  # its ends tell of all
        numbers = tuple(dict.fromkeys((numbers[0], numbers[-1])))
    wrong = [number for number in numbers if not 0 <= number <= LARGEST_SEED]
    if wrong or not numbers:
        found = wrong[0] if wrong else seeds
        raise InputError(f"seeds: found {found!r}, wanted whole numbers from 0 to 2^63 - 1")
    if len(set(numbers)) < len(numbers):
        twice = next(number for i, number in enumerate(numbers) if number in numbers[:i])
        raise InputError(f"seeds: found {twice} twice, wanted each seed once")


def check_held(request: ExportRequest, wanted: Format) -> None:
    """Raises InputError where the format of the files does not hold what is wanted."""
    build = request.build
    if CONTENTS.index(build.content) > CONTENTS.index(wanted.content):
        raise InputError(f"found --content {build.content}, but this format holds at most {wanted.content}")
    pose: Any = "photo" if request.photo_pose else request.pose_file or build.pose
    if wanted.rest_pose is not None and not (isinstance(pose, str) and pose == wanted.rest_pose):
        raise InputError(
            f"found --pose {pose}, but this format rests in pose {wanted.rest_pose}; leave --pose out"
        )
    if request.levels and not wanted.levels:
        raise InputError("found --lods, but this format holds one level of detail; choose glb or gltf")
    if request.motion_up is not None and not request.motions:
        raise InputError("found --motion-up without a motion; give --motion too")
    played = request.fps != 30.0 or request.speed != 1.0 or request.mirror or request.in_place
    speaks = request.say is not None or request.phonemes is not None
    if played and not (request.clips or request.motions or speaks):
        raise InputError(
            "found --fps, --speed, --mirror or --in-place without an animation; give --clip or --motion too"
        )
    extra = build.morphs or build.ends or build.twist or build.springs or request.root
    moves = request.clips or request.motions or extra or request.names != "smpl"
    if build.content != "rigged" and moves:
        raise InputError(
            f"found options of the rig, but what is made holds no skeleton ({build.content}); leave out "
            "--clip, --motion, --morphs, --ends, --root, --twist, --springs and --names, or choose glb, vrm "
            "or usdz and a scene that moves"
        )
    check_moving_face(build, of_a_face(request.clips), speaks)
    for option, size, kind in (
        ("--normal-map", build.normal_map, "normal"),
        ("--ambient-occlusion", build.ambient_occlusion, "occlusion"),
    ):
        require_map(option, size, kind in wanted.maps)


def check_moving_face(build: BuildConfig, clips: list[str], speaks: bool) -> None:
    """Raises InputError where a face is to move that is made without shapes."""
    if build.face == "none" and (clips or speaks):
        found = f"--clip {clips[0]}" if clips else "--say or --phonemes"
        raise InputError(f"found {found} on a face that does not move; give --face {MOVING_FACE} too")


def check_parts(request: ExportRequest, wanted: Format) -> None:
    """Raises InputError where parts are not held, or something is asked for that is of one mesh."""
    if request.parts == "merged":
        if request.hidden != "drop":
            raise InputError(
                f"found --hidden {request.hidden} without --parts separate; one mesh hides nothing, so give "
                "both or none"
            )
        if request.part_names != "own":
            raise InputError(
                f"found --part-names {request.part_names} without --parts separate; give both or none"
            )
        return
    if request.build.content != "rigged" or not wanted.parts:
        raise InputError(
            "found --parts separate, but what is made holds no rigged parts; choose glb, vrm or usdz, and a "
            "scene that moves"
        )
    if request.build.face != "none":
        raise InputError(
            "found --parts separate with --face shapes, which cuts lips and lids in one mesh; leave one out"
        )
    if request.levels or request.chosen:
        raise InputError(
            "found --parts separate with --lods, --tolerance or --budget, which are of one mesh; leave those "
            "out"
        )


def require_map(option: str, size: int | None, held: bool) -> None:
    """Raises InputError where a picture is wanted that what is made does not hold."""
    if size and not held:
        raise InputError(f"found {option} {size}, but what is made holds none; leave it out, or choose glb")
