"""avatar-export: from a seed to a rigged, textured file. Reads the arguments, makes the request and prints.

Libraries load once the arguments are known to make sense.
"""

import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from avatargen.commands.export import PROGRAM
from avatargen.commands.line import leave, run_command
from avatargen.commands.progress import Show, progress_line
from avatargen.errors import AvatarGenError

if TYPE_CHECKING:
    from avatargen.export.manifest import Row
    from avatargen.export.one import Exported
    from avatargen.export.report import Made
    from avatargen.export.request import ExportRequest

FEW_FACES = 0.98  # of those wanted: fewer are told of
STARTED = time.perf_counter()


def main(arguments: Sequence[str] | None = None) -> int:
    return run_command(PROGRAM, lambda: export(arguments))


def edit(arguments: Sequence[str] | None = None) -> int:
    """The command `avatargen edit`."""
    return run_command("avatargen edit", lambda: export(arguments, change=True))


def export(arguments: Sequence[str] | None, *, change: bool = False) -> None:
    """Do what the arguments ask for: one avatar, many, or a dry run; with `change`, people changed by a text.

    Raises:
        AvatarGenError: an argument, file or field is bad; then nothing is written. Of many, some have failed;
            the others' files are there.
    """
    from avatargen.commands.export.options import make_request, read  # need our `assets`: see `program`

    given = read(arguments, change=change)
    if given.drawn and not given.quiet:
        print(f"seed {given.seed} was drawn", file=sys.stderr)
    with progress_line(quiet=given.quiet, in_pipes=given.seeds is not None) as show:
        show("loading libraries", 0.0)
        request = make_request(given)
        if request.many:
            closing, path = export_range(request, show)
        elif request.dry_run:
            closing, path = plan_of(request), None
        else:
            closing, path = export_seed(request, show)
    if path is None:
        print(closing)
        return
    if not given.quiet:
        print(closing, file=sys.stderr)
    print(path)


def plan_of(request: "ExportRequest") -> str:
    """What would be done."""
    from avatargen.export.dry_run import describe

    return describe(request)


def export_seed(request: "ExportRequest", show: Show) -> tuple[str, Path]:
    """One avatar: the closing lines and its path."""
    import avatargen
    from avatargen.export.motions import tell_of_bad_frames

    exported = avatargen.export_avatar(request, show, elapsed=process_seconds())
    made = exported.made
    lines = [*tell_of_text(made), *(made.found.lines() if made.found else [])]
    lines += [*tell_of_bad_frames(made.motions), *tell_of_few_faces(made), closing_line(request, exported)]
    return "\n".join(lines), exported.path


def tell_of_text(made: "Made") -> list[str]:
    """A line with what was understood of a text, and one with what was left out."""
    facts = dict(made.asset.info.facts)
    return [
        f"{name.replace('_', ' ')}: {facts[name]}" for name in ("understood", "left_out") if name in facts
    ]


def tell_of_few_faces(made: "Made") -> list[str]:
    """A line where the surface has not as many faces as were wanted."""
    wanted, found = made.settings.faces, len(made.asset.faces)
    if wanted is None or found >= FEW_FACES * wanted:
        return []
    resolution = made.settings.resolution
    return [
        f"found {found:,} faces at resolution {resolution}, wanted {wanted:,}; raise --resolution for more"
    ]


def closing_line(request: "ExportRequest", exported: "Exported") -> str:
    """Sizes, seconds and error."""
    made, path = exported.made, exported.path
    error, rest_pose = made.report.error, request.file_format.rest_pose
    return (
        f"{path}: {exported.bytes / 1e6:.1f} MB, {len(made.asset.faces):,} faces, {exported.seconds:.1f} s, "
        f"error {error.mean_mm:.3f} mm mean, {error.p99_mm:.2f} mm p99"
        + (" in the worst part" if request.parts == "separate" else "")
        + (f", in the {rest_pose.upper()}-pose that {path.suffix} wants" if rest_pose else "")
        + (f", in {request.encoding.axes}, as slicers take it" if request.encoding.for_slicers else "")
    )


def export_range(request: "ExportRequest", show: Show) -> tuple[str, Path]:
    """Many avatars: the closing line and the manifest's path; failures are printed as they come.

    Raises:
        AvatarGenError: some seeds have failed.
    """
    import avatargen

    show("starting", 0.0)
    batch = avatargen.export_many(request, show, each=tell_of_failure)
    if batch.failed:
        seeds = [str(row.seed) for row in batch.failed]
        first = ", ".join(seeds[:5]) + (", ..." if len(seeds) > 5 else "")
        raise AvatarGenError(
            f"{len(seeds)} of {len(batch.rows)} seeds failed ({first}); {batch.manifest} says why, and the "
            "same command tries them again"
        )
    rate = f", {60 * batch.made / batch.seconds:.1f} a minute" if batch.made else ""
    sheet = f"; all of them in {request.sheet}" if request.sheet else ""
    closing = f"{request.out}: {len(batch.rows)} avatars, {batch.made} of them made now{rate}{sheet}"
    return closing, batch.manifest


def tell_of_failure(row: "Row") -> None:
    if row.error is not None:
        print(f"seed {row.seed}: {row.error}", file=sys.stderr)


def process_seconds() -> float:
    """Seconds since this process started, where the system tells; elsewhere since this module's import."""
    try:
        fields = Path("/proc/self/stat").read_text().rsplit(")", 1)[1].split()
        started = int(fields[19]) / os.sysconf("SC_CLK_TCK")  # seconds after boot
        return float(Path("/proc/uptime").read_text().split()[0]) - started
    except (OSError, ValueError, IndexError):
        return time.perf_counter() - STARTED


def program() -> NoReturn:
    """The installed command."""
    leave(main())


if __name__ == "__main__":
    program()
