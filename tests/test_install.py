"""Installed as a user installs it, as a wheel and in place, and used from folders of the user's own: empty
ones, and a game's, which has an `assets` of its own.

What the project needs comes from the environment that runs the tests; the files of the project must not.
"""

import os
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from dataclasses import dataclass
from pathlib import Path

import pygltflib
import pytest
import trimesh

from avatargen import __version__

PROJECT = Path(__file__).parents[1]
PACKAGES = ("avatargen", "assets", "exporters")
SHIPPED = ("pyproject.toml", "README.md", "LICENSE", "LICENSE-CC0")
SMALL = ("--resolution", "64", "--faces", "500", "--texture", "64")
PIP = (sys.executable, "-m", "pip", "--disable-pip-version-check")
OFFLINE = ("-q", "--no-index", "--no-deps", "--no-build-isolation")


@dataclass(frozen=True)
class Installed:
    """An environment with the project in it."""

    python: Path
    packages: Path  # the folder that ours are imported from

    def run(self, folder: Path, *words: str | Path, fails: bool = False) -> str:
        """What a program prints: both streams together. The first word is a file of the environment's bin."""
        outside = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
        command = [str(self.python.parent / words[0]), *map(str, words[1:])]
        done = subprocess.run(command, cwd=folder, env=outside, stdout=-1, stderr=-2, text=True, timeout=300)
        assert (done.returncode != 0) == fails, done.stdout
        return done.stdout

    def script(self, folder: Path, text: str, fails: bool = False) -> str:
        (folder / "play.py").write_text(text)
        return self.run(folder, "python", folder / "play.py", fails=fails)


def environment(folder: Path) -> Path:
    """The Python of a new environment in which everything but our packages is at hand. A .pth file among the
    packages of the tests' own environment, as that of an install in place, is not read from there."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True)
    python = folder / "bin" / "python"
    ask = [str(python), "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"]
    packages = Path(subprocess.run(ask, capture_output=True, text=True, check=True).stdout.strip())
    (packages / "what_is_needed.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return python


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    source = tmp_path_factory.mktemp("source")
    for name in SHIPPED:
        shutil.copy(PROJECT / name, source)
    for name in PACKAGES:
        shutil.copytree(PROJECT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    subprocess.run([*PIP, "wheel", *OFFLINE, "-w", str(source / "dist"), str(source)], check=True)
    (made,) = (source / "dist").iterdir()
    return made


@pytest.fixture(scope="module")
def as_wheel(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Installed:
    python = environment(tmp_path_factory.mktemp("as_wheel"))
    install = [*PIP, "--python", str(python), "install", *OFFLINE, "--ignore-installed", str(wheel)]
    subprocess.run(install, check=True)
    (packages,) = python.parents[1].glob("lib/python*/site-packages")
    take_machine_code(packages)
    return Installed(python=python, packages=packages)


@pytest.fixture(scope="module")
def in_place(tmp_path_factory: pytest.TempPathFactory) -> Installed:
    """Of a folder whose packages are links, so that nothing is written into this one."""
    python, source = environment(tmp_path_factory.mktemp("in_place")), tmp_path_factory.mktemp("checkout")
    for name in SHIPPED:
        shutil.copy(PROJECT / name, source)
    for name in PACKAGES:
        (source / name).symlink_to(PROJECT / name, target_is_directory=True)
    install = [*PIP, "--python", str(python), "install", *OFFLINE, "--ignore-installed", "-e", str(source)]
    subprocess.run(install, check=True)
    return Installed(python=python, packages=source)


def take_machine_code(packages: Path) -> None:
    """What numba has compiled of the same lines here, where it has: it would take another half a minute. By
    the files' times it is taken for theirs."""
    for name in PACKAGES:
        for path in (PROJECT / name).rglob("*.nb[ic]"):
            there = packages / path.relative_to(PROJECT).parent
            there.mkdir(exist_ok=True)
            shutil.copy2(path, there)
        for path in (PROJECT / name).rglob("*.py"):
            shutil.copystat(path, packages / path.relative_to(PROJECT))


@pytest.fixture(params=["as_wheel", "in_place"])
def installed(request: pytest.FixtureRequest) -> Installed:
    return request.getfixturevalue(request.param)


@pytest.fixture
def game(tmp_path: Path) -> Path:
    """A folder whose `assets` is a package of the game's."""
    (tmp_path / "assets").mkdir()
    (tmp_path / "assets" / "__init__.py").write_text("sprites = ['hero.png']\n")
    return tmp_path


def test_the_wheel_holds_the_packages_and_nothing_else(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    information = f"avatargen-{__version__}.dist-info"
    assert {name.split("/")[0] for name in names} == {*PACKAGES, information}
    ours = {
        str(path.relative_to(PROJECT))
        for name in PACKAGES
        for path in (PROJECT / name).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert {name for name in names if not name.startswith(information)} == ours
    assert {f"{name}/py.typed" for name in PACKAGES} <= names


def test_the_wheel_exports_from_an_empty_folder(as_wheel: Installed, tmp_path: Path) -> None:
    printed = as_wheel.run(tmp_path, "avatar-export", "--seed", "3", *SMALL, "--out", "person.glb")
    assert printed.splitlines()[-1] == "person.glb"
    gltf = pygltflib.GLTF2().load(str(tmp_path / "person.glb"))
    assert gltf is not None
    assert len(gltf.skins) == len(gltf.meshes) == len(gltf.images) == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["person.glb"]

    text = (
        "import assets, avatargen, exporters as e\nfor ours in (assets, avatargen, e): print(ours.__file__)"
    )
    for line in as_wheel.script(tmp_path, text).splitlines():
        assert Path(line).is_relative_to(as_wheel.packages)


@pytest.mark.parametrize(
    "words", [["avatar-export"], ["python", "-m", "avatargen.commands.export.avatar_export"]]
)
def test_workers_export_beside_another_assets(as_wheel: Installed, game: Path, words: list[str]) -> None:
    as_wheel.run(game, *words, "--seeds", "3:4", *SMALL, "--out", "crowd")
    assert (game / "crowd" / "avatar_3.glb").stat().st_size > 10_000


@pytest.mark.parametrize("words", [["avatargen"], ["python", "-m", "avatargen.commands.main"]])
def test_commands_run_beside_another_assets(installed: Installed, game: Path, words: list[str]) -> None:
    """Another `exporters` too, and one that is a file."""
    trimesh.creation.box().export(game / "box.stl")
    (game / "exporters.py").touch()
    assert installed.run(game, *words, "check", "box.stl").endswith("nothing to say\n")


def test_people_are_sampled_beside_another_assets(installed: Installed, game: Path) -> None:
    printed = installed.script(
        game,
        "import assets, avatargen, torch\n"
        "avatar = avatargen.load_generator().sample(seed=3)\n"
        "far = float(avatar.sdf(torch.tensor([[0.0, 3.0, 0.0]]))[0]) > 1\n"
        "print(assets.sprites, far, avatargen.__file__)\n",
    )
    theirs, far, ours = printed.split()
    assert (theirs, far) == ("['hero.png']", "True")
    assert Path(ours).is_relative_to(installed.packages)


@pytest.mark.parametrize("first", ["", "import assets\n"])
def test_what_needs_ours_says_what_is_in_the_way(installed: Installed, game: Path, first: str) -> None:
    printed = installed.script(game, f"{first}import exporters", fails=True).splitlines()
    assert printed[-1] == (
        f"ImportError: found {game / 'assets'} where avatargen needs its own package assets; rename that "
        "one, or start Python with -P and leave its folder out of PYTHONPATH"
    )
    assert installed.run(game, "python", "-P", "play.py") == ""


def test_a_folder_of_pictures_called_assets_is_in_nobodys_way(installed: Installed, tmp_path: Path) -> None:
    """Every game project has one, and most have no code in it."""
    (tmp_path / "assets").mkdir()
    (tmp_path / "assets" / "hero.png").touch()
    printed = installed.script(
        tmp_path, "import assets, exporters; print(assets.BuildConfig, assets.__file__)"
    )
    assert Path(printed.split()[-1]).is_relative_to(installed.packages)
