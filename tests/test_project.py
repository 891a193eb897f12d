"""The project as a whole: imports point one way, dependencies are declared, used and pinned."""

import ast
import itertools
import re
import subprocess
import sys
import tomllib
from functools import cache
from importlib import import_module
from pathlib import Path

import pytest

PROJECT = Path(__file__).parents[1]
PACKAGES = ("avatargen", "assets", "exporters")
# by install name
MODULE_OF = {"pillow": "PIL", "libigl": "igl", "scikit-image": "skimage", "usd-core": "pxr"}
# what each package may import of ours; only the commands and the room of exports see everything
ALLOWED = {"avatargen": {"avatargen"}, "assets": {"assets", "avatargen"}, "exporters": set(PACKAGES)}
LEARNED = ("avatargen.generator", "avatargen.training", "avatargen.wardrobe")
RUN = PROJECT / "avatargen" / "__main__.py"  # python -m avatargen
EXPORT, COMMANDS = PROJECT / "avatargen" / "export", PROJECT / "avatargen" / "commands"
FRONT = (
    PROJECT / "avatargen" / "__init__.py"
)  # names what the room of exports offers, and loads it when asked


# The rooms of a package, a folder or a file at its top, from the ground up: a room imports from floors below,
# and neither from its own floor nor from above. An import of the package itself is of its front door.
FLOORS = {
    "assets": (
        "errors",
        "content field",
        "mesh scenes",
        "isosurface simplify skin",
        "texture",
        "asset",
        "build_config face picture",
        "charting choose poke",
        "draft",
        "assemble plan stages",
        "pipeline",
        "separate",
    ),
    "avatargen": (
        "errors shadow",
        "atomic avatar_info compiled eight_bits shipped smoothstep threads",
        "extras mesh ranges run_folder",
        "body",
        "motion wardrobe",
        "generator",
        "avatar",
        "artist_wardrobe dressed_avatar",
        "loading",
        "data photo text",
        "training",
        "baselines",
        "metrics",
        "comparison",
        "export",
        "commands",
        "__main__",
    ),
    "avatargen.commands": (
        "near progress",
        "line",
        "seeds",
        "export",
        "bench learn viewer",
        "look stress",
        "main",
        "completion",
    ),
}
WITH_TORCH = {"triton"}  # comes with torch where it is made for GPUs, and is imported there alone
LONGEST_FUNCTION, LONGEST_FILE = 60, 456  # lines; they may only become less


@cache
def imports_of(path: Path) -> frozenset[str]:
    """Every module a file imports, at the top or inside functions."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            modules = {name for name in inner if is_module(name)}
            found |= modules if modules == inner else modules | {node.module}
    return frozenset(found)


def is_module(name: str) -> bool:
    """Whether a module of ours has this name."""
    path = PROJECT.joinpath(*name.split("."))
    return path.is_dir() or path.with_suffix(".py").is_file()


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


def ours(path: Path) -> set[str]:
    return {module for module in imports_of(path) if module.split(".")[0] in PACKAGES}


@pytest.mark.parametrize("package", PACKAGES)
def test_imports_point_one_way(package: str) -> None:
    """exporters -> assets -> avatargen; then avatargen/export sees all three, and the commands see it."""
    for path in files_of(package):
        modules = ours(path)
        if path.is_relative_to(COMMANDS) or path == RUN:
            continue
        assert not [module for module in modules if module.startswith("avatargen.commands")], path
        if path.is_relative_to(EXPORT) or path == FRONT:
            continue
        assert not [module for module in modules if module.startswith("avatargen.export")], path
        assert {module.split(".")[0] for module in modules} <= ALLOWED[package], path
        if package != "avatargen":
            assert not [module for module in modules if module.startswith(LEARNED)], path


def test_mesh_tools_know_nothing_of_people() -> None:
    for path in files_of("avatargen/mesh"):
        ours = {module for module in imports_of(path) if module.split(".")[0] in PACKAGES}
        assert ours <= {"avatargen.compiled"}, path


def test_compiled_functions_are_marked_and_explained() -> None:
    """By a decorator and a docstring: annotations would not be checked in machine code."""
    marked = 0
    for path in files_of("avatargen", "assets", "exporters"):
        tree = ast.parse(path.read_text())
        for function in (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)):
            names = {getattr(getattr(mark, "func", mark), "id", "") for mark in function.decorator_list}
            if names & {"compiled", "inner"}:
                marked += 1
                assert ast.get_docstring(function), f"{path}: {function.name}"
                assert not any(each.annotation for each in function.args.args), f"{path}: {function.name}"
        calls = {
            node.value.func
            for node in ast.walk(tree)
            if isinstance(node, ast.Assign) and isinstance(node.value, ast.Call)
        }
        assert not [call for call in calls if getattr(call, "id", "") in ("compiled", "inner")], path
    assert marked > 50


def wrong_ways(package: str, floors: tuple[str, ...]) -> list[str]:
    """What is wrong with the imports among the rooms of a package, a line each."""
    floor_of = {room: floor for floor, rooms in enumerate(floors) for room in rooms.split()}
    found, folder = [], PROJECT.joinpath(*package.split("."))
    for path in sorted(folder.rglob("*.py")):
        here = path.relative_to(folder).with_suffix("").parts[0]
        if here == "__init__":
            continue
        if here not in floor_of:
            found.append(
                f"{package}.{here} is a new room: add it to FLOORS[{package!r}] in {Path(__file__).name}, "
                "above all that it imports"
            )
            continue
        inside = [name for name in imports_of(path) if name.startswith(f"{package}.")]
        rooms = {name.removeprefix(f"{package}.").split(".")[0] for name in inside} - {here}
        found += [
            f"{path.relative_to(PROJECT)} imports {package}.{there}, which is no floor below it"
            for there in rooms
            if floor_of.get(there, -1) >= floor_of[here]
        ]
    return sorted(set(found))


@pytest.mark.parametrize("package", FLOORS)
def test_rooms_import_from_floors_below(package: str) -> None:
    """So there is no circle among them."""
    assert wrong_ways(package, FLOORS[package]) == []


def test_an_import_back_up_and_a_new_room_are_named() -> None:
    floors = FLOORS["assets"]
    assert "assets/pipeline.py imports assets.plan, which is no floor below it" in wrong_ways(
        "assets", (*floors[:-3], " ".join(floors[-3:-1]), floors[-1])
    )
    turned = wrong_ways("assets", floors[::-1])
    assert "assets/texture/bake.py imports assets.mesh, which is no floor below it" in turned
    new = wrong_ways("assets", (*floors[:1], floors[1].replace("content", ""), *floors[2:]))
    assert new[0].startswith("assets.content is a new room: add it to FLOORS['assets'] in test_project.py")


def test_nothing_is_too_long_to_read() -> None:
    for path in files_of(*PACKAGES):
        text = path.read_text()
        assert len(text.splitlines()) <= LONGEST_FILE, path
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                assert (node.end_lineno or 0) - node.lineno + 1 <= LONGEST_FUNCTION, f"{path}: {node.name}"


def test_every_import_is_declared_and_every_dependency_used() -> None:
    run_time = third_party(files_of(*PACKAGES))
    extras = ("derive", "train", "bench", "view", "film", "ray", "photo", "metrics")
    assert run_time - declared(*extras) - WITH_TORCH == set(), "imported but not declared"
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

    exported = {"ExportRequest", "Traits", "export_avatar", "export_many"}
    assert {"load_generator", "Avatar", "__version__"} | exported == set(avatargen.__all__)
    assert {"FORMATS", "Format", "encode", "export", "files_of", "find_format"} == set(exporters.__all__)
    for package in (assets, avatargen, exporters):
        for name in package.__all__:
            assert getattr(package, name) is not None


def test_packages_are_light_and_their_names_load_what_they_need() -> None:
    """What a package says it has for a type checker is what it loads."""
    code = (
        "import sys, assets, avatargen; print(sorted({'torch', 'numpy', 'numba'} & set(sys.modules)));"
        "print([set(p.__all__) - {'__version__'} == set(p.MODULE_OF) for p in (assets, avatargen)])"
    )
    run = subprocess.run([sys.executable, "-c", code], cwd=PROJECT, capture_output=True, text=True)
    assert run.stdout.splitlines() == ["[]", "[True, True]"], run.stderr
    for package in ("assets", "avatargen"):
        tree = ast.parse((PROJECT / package / "__init__.py").read_text())
        typed = {
            alias.name: node.module
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith(package)
            for alias in node.names
        }
        loaded = {name: f"{package}.{module}" for name, module in import_module(package).MODULE_OF.items()}
        assert typed == loaded


def test_the_licences_travel_with_the_package() -> None:
    project = tomllib.loads((PROJECT / "pyproject.toml").read_text())["project"]
    for name in project["license-files"]:
        assert (PROJECT / name).stat().st_size > 5000
