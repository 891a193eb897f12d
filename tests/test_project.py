"""The project as a whole: imports point one way, dependencies are declared, used and pinned."""

import ast
import itertools
import re
import sys
import tomllib
from functools import cache
from pathlib import Path

import pytest

PROJECT = Path(__file__).parents[1]
PACKAGES = ("avatargen", "assets", "exporters")
# by install name
MODULE_OF = {"pillow": "PIL", "libigl": "igl", "scikit-image": "skimage", "usd-core": "pxr"}
# what each package may import of ours; only the commands see everything
ALLOWED = {"avatargen": {"avatargen"}, "assets": {"assets", "avatargen"}, "exporters": set(PACKAGES)}
LEARNED = ("avatargen.generator", "avatargen.training", "avatargen.wardrobe", "avatargen.commands")


@cache
def imports_of(path: Path) -> frozenset[str]:
    """Every module a file imports, at the top or inside functions."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found.add(node.module)
    return frozenset(found)


def files_of(*folders: str) -> list[Path]:
    return sorted(path for folder in folders for path in (PROJECT / folder).rglob("*.py"))


def declared(*extras: str) -> set[str]:
    """Names of modules that pyproject.toml declares for run time and the given extras."""
    project = tomllib.loads((PROJECT / "pyproject.toml").read_text())["project"]
    lines = list(project["dependencies"])
    for extra in extras:
        lines += project["optional-dependencies"][extra]
    names = {re.split(r"[<>=!~\[; ]", line)[0].lower() for line in lines}
    return {MODULE_OF.get(name, name.replace("-", "_")) for name in names}


def third_party(files: list[Path]) -> set[str]:
    tops = {module.split(".")[0] for path in files for module in imports_of(path)}
    return tops - set(PACKAGES) - set(sys.stdlib_module_names)


@pytest.mark.parametrize("package", PACKAGES)
def test_imports_point_one_way(package: str) -> None:
    for path in files_of(package):
        if path.is_relative_to(PROJECT / "avatargen" / "commands"):
            continue
        ours = {module for module in imports_of(path) if module.split(".")[0] in PACKAGES}
        assert {module.split(".")[0] for module in ours} <= ALLOWED[package], path
        if package != "avatargen":
            assert not [module for module in ours if module.startswith(LEARNED)], path


def test_every_import_is_declared_and_every_dependency_used() -> None:
    run_time = third_party(files_of(*PACKAGES))
    extras = ("derive", "train", "bench", "view", "film", "ray")
    assert run_time - declared(*extras) == set(), "imported but not declared"
    assert declared() - run_time == set(), "declared but not imported"


def test_every_dependency_is_pinned() -> None:
    project = tomllib.loads((PROJECT / "pyproject.toml").read_text())["project"]
    lines = [*project["dependencies"], *itertools.chain(*project["optional-dependencies"].values())]
    pins = dict(
        line.split("==") for line in (PROJECT / "constraints.txt").read_text().splitlines() if "==" in line
    )
    for line in lines:
        assert re.split(r"[<>=!~\[; ]", line)[0].lower() in pins, line
    assert pins["torch"] == "2.13.0"


def test_public_names() -> None:
    import assets
    import avatargen
    import exporters

    assert {"load_generator", "Avatar", "__version__"} <= set(avatargen.__all__)
    assert {"FORMATS", "Format", "encode", "export", "files_of", "find_format"} == set(exporters.__all__)
    for package in (assets, avatargen, exporters):
        for name in package.__all__:
            assert getattr(package, name) is not None


def test_the_licences_travel_with_the_package() -> None:
    project = tomllib.loads((PROJECT / "pyproject.toml").read_text())["project"]
    for name in project["license-files"]:
        assert (PROJECT / name).stat().st_size > 5000
