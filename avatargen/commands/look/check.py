"""avatargen check: what independent judges say about a file, in plain words.

    avatargen check person.vrm

Exit status 0: nothing is wrong. 1: something is, a line says what. 2: the file could not be judged.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

from avatargen.commands.line import OneLineParser, run_command
from avatargen.errors import InputError

PROGRAM = "avatargen check"
# each gives its findings, or None where it is not installed
Judge = Callable[[Path], list[str] | None]
INSTALL_KHRONOS = "not installed; `npm install -g gltf-validator` adds it"


def main(arguments: Sequence[str] | None = None) -> int:
    sound: list[bool] = []

    def command() -> None:
        parser = OneLineParser(PROGRAM, description=__doc__)
        parser.add_argument("file", type=Path, help="a file of any format that avatar-export writes")
        sound.append(check(parser.parse_args(arguments).file))

    return run_command(PROGRAM, command) or int(not all(sound))


def check(path: Path) -> bool:
    """Ask every judge of the file's format and print their verdicts; whether all are content.

    Raises:
        InputError: there is no such file, no judge knows its format, or none is installed.
    """
    if not path.is_file():
        raise InputError(f"found no file {path}; check the path")
    verdicts = {name: judge(path) for name, judge in judges_of(path).items()}
    if all(findings is None for findings in verdicts.values()):
        raise InputError(f"no judge of {path.suffix} is installed; run `npm install -g gltf-validator`")
    for name, findings in verdicts.items():
        for line in [INSTALL_KHRONOS] if findings is None else findings or ["nothing to say"]:
            print(f"{name}: {line}")
    return not any(verdicts.values())


def judges_of(path: Path) -> dict[str, Judge]:
    """The judges of a format by name; what they stand on is loaded here, for that format alone.

    Raises:
        InputError: no judge knows the format.
    """
    suffix = path.suffix.lower()
    if suffix in (".glb", ".gltf", ".vrm", ".vrma"):
        from exporters.check_gltf import check_gltf
        from exporters.check_vrm import check_vrm

        khronos: dict[str, Judge] = {"Khronos' glTF validator": check_gltf}
        return khronos | {"VRM 1.0's rules": check_vrm} if suffix == ".vrm" else khronos
    if suffix in (".usda", ".usdc", ".usdz", ".usd"):
        from exporters.check_usd import check_usd

        return {"UsdValidation, and what it overlooks": check_usd}
    if suffix in (".obj", ".ply", ".stl"):
        from exporters.check_mesh import check_mesh
        from exporters.check_trimesh import check_trimesh

        return {"closed surface, read by PyMeshLab": check_mesh, "trimesh": check_trimesh}
    raise InputError(f"found {path.name!r}, wanted a file of a format that avatar-export writes")
