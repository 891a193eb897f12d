"""avatargen: the other commands, by name.

    avatargen body convert model.pkl body.npz

Each command imports what it needs when it is asked for, so `avatargen --help` answers at once.
"""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from itertools import takewhile
from typing import NoReturn

from avatargen import __version__
from avatargen.commands.line import complain, leave, open_streams
from avatargen.commands.near import did_you_mean
from avatargen.errors import InputError

PROGRAM = "avatargen"
OPTIONS = ("--help", "--version")


@dataclass(frozen=True, kw_only=True)
class Command:
    """One command: its words, a summary, and the function `module:name` that takes the rest."""

    words: tuple[str, ...]
    summary: str
    function: str

    def load(self) -> Callable[[Sequence[str]], int]:
        module, name = self.function.split(":")
        return getattr(import_module(module), name)


COMMANDS = (
    Command(
        words=("export",),
        summary="make people and write them to files: the same as avatar-export",
        function="avatargen.commands.export.avatar_export:main",
    ),
    Command(
        words=("edit",),
        summary="change a seed's person by a line of text: in a red shirt, taller, without the hat",
        function="avatargen.commands.export.avatar_export:edit",
    ),
    Command(
        words=("body", "convert"),
        summary="read an SMPL .pkl safely and save it as .npz",
        function="avatargen.commands.learn.body_convert:main",
    ),
    Command(
        words=("photo-models",),
        summary="get the networks that avatar-export --photo reads photographs with",
        function="avatargen.commands.learn.photo_models:main",
    ),
    Command(
        words=("data", "synth"),
        summary="pictures of the wardrobe's people with their labels; the same command resumes",
        function="avatargen.commands.learn.data_synth:main",
    ),
    Command(
        words=("data", "prepare"),
        summary="photographs with masks and SMPL estimates to a data set; the same command resumes",
        function="avatargen.commands.learn.data_prepare:main",
    ),
    Command(
        words=("data", "pack"),
        summary="a data set's pictures in one file, which training maps into memory",
        function="avatargen.commands.learn.data_pack:main",
    ),
    Command(
        words=("train", "warm-start"),
        summary="train a generator on the procedural wardrobe; the same command resumes",
        function="avatargen.commands.learn.train_warm_start:main",
    ),
    Command(
        words=("train", "people"),
        summary="learn dressed people from an artist-made wardrobe; the same command resumes",
        function="avatargen.commands.learn.train_people:main",
    ),
    Command(
        words=("render",),
        summary="draw a seed or a .glb file: pictures, poses, a turntable",
        function="avatargen.commands.look.render:main",
    ),
    Command(
        words=("train",),
        summary="learn people from pictures, adversarially; the same command resumes",
        function="avatargen.commands.learn.train:main",
    ),
    Command(
        words=("eval", "baselines"),
        summary="train and measure the methods of the paper's Table 1; the same command resumes",
        function="avatargen.commands.learn.tables:baselines",
    ),
    Command(
        words=("eval", "ablations"),
        summary="train and measure every choice of the paper's Table 2; the same command resumes",
        function="avatargen.commands.learn.tables:ablations",
    ),
    Command(
        words=("eval", "tables"),
        summary="both tables at once, in a given time, on one machine or two",
        function="avatargen.commands.learn.tables:tables",
    ),
    Command(
        words=("eval", "metrics"),
        summary="whether the metrics see blur, noise, shifted depth and swapped poses: a table",
        function="avatargen.commands.learn.validate_metrics:main",
    ),
    Command(
        words=("eval", "runs"),
        summary="the same metrics over the snapshots of training runs, with a plot",
        function="avatargen.commands.learn.evaluate_runs:main",
    ),
    Command(
        words=("eval", "likeness"),
        summary="measure a generator's people against the wardrobe's own of the same seeds",
        function="avatargen.commands.learn.likeness:main",
    ),
    Command(
        words=("eval", "reading"),
        summary="read off people's pictures what they wear, and compare with what their files say",
        function="avatargen.commands.learn.reading:main",
    ),
    Command(
        words=("eval", "photo"),
        summary="find people again in pictures of people whose pose, shape and surface are known",
        function="avatargen.commands.learn.photo:main",
    ),
    Command(
        words=("eval", "rays"),
        summary="picture error against time for 12 to 48 samples a ray",
        function="avatargen.commands.learn.rays:main",
    ),
    Command(
        words=("eval",),
        summary="measure a generator against held-out pictures: Frechet distance, depth, pose, warp",
        function="avatargen.commands.learn.evaluate:main",
    ),
    Command(
        words=("check",),
        summary="what independent validators say about a file, in plain words",
        function="avatargen.commands.look.check:main",
    ),
    Command(
        words=("view",),
        summary="look at people in the browser: seeds, poses, weights, error, downloads",
        function="avatargen.commands.look.view:main",
    ),
    Command(
        words=("traits",),
        summary="what one may choose of a person: hair, clothes, colours, height",
        function="avatargen.commands.look.traits:main",
    ),
    Command(
        words=("survey",),
        summary="build many seeds: table of errors, contact sheet, files",
        function="avatargen.commands.look.survey:main",
    ),
    Command(
        words=("bench",),
        summary="error against run time, beside the usual recipe: tables and a plot",
        function="avatargen.commands.bench.run:main",
    ),
    Command(
        words=("stress",),
        summary="stiff and extreme cases: what had to happen and what did",
        function="avatargen.commands.stress.run:main",
    ),
    Command(
        words=("completion",),
        summary="what makes bash, zsh or fish complete these commands with the Tab key",
        function="avatargen.commands.completion:main",
    ),
)


def main(arguments: Sequence[str] | None = None) -> int:
    open_streams()
    words = list(sys.argv[1:] if arguments is None else arguments)
    if words[:1] in (["-h"], ["--help"]):
        print(help_text())
        return 0
    if words == ["--version"]:
        print(f"{PROGRAM} {__version__}")
        return 0
    try:
        command = find_command(words)
    except InputError as error:
        return complain(PROGRAM, str(error), status=2)
    return command.load()(words[len(command.words) :])


def find_command(words: Sequence[str]) -> Command:
    """The command whose words the line starts with. Raises InputError where there is none."""
    for command in COMMANDS:
        if tuple(words[: len(command.words)]) == command.words and not misspelt(command, words):
            return command
    known = [" ".join(command.words) for command in COMMANDS]
    named = list(takewhile(lambda word: not word.startswith("-"), words))
    if not words:
        raise InputError(f"found no command, wanted one of: {', '.join(known)}; see {PROGRAM} --help")
    found = " ".join(named[:2] or words[:1])
    near = did_you_mean(found, [*known, *OPTIONS]) or did_you_mean(found.split()[0], known)
    wanted = f", which is no command{near}" if near else f", wanted one of: {', '.join(known)};"
    raise InputError(f"found {found!r}{wanted} see {PROGRAM} --help")


def misspelt(command: Command, words: Sequence[str]) -> bool:
    """Whether the word after a command would have to be another command's: `train`, which takes options
    alone, begins `train warm-start` too."""
    count = len(command.words)
    longer = [each for each in COMMANDS if each is not command and each.words[:count] == command.words]
    return bool(longer) and len(words) > count and not words[count].startswith("-")


def help_text() -> str:
    """The table of commands."""
    width = max(len(" ".join(command.words)) for command in COMMANDS)
    lines = [f"  {' '.join(command.words):{width}}  {command.summary}" for command in COMMANDS]
    return "\n".join(
        [
            f"usage: {PROGRAM} COMMAND [OPTIONS]",
            "",
            *lines,
            "",
            f"{PROGRAM} COMMAND --help tells more",
        ]
    )


def program() -> NoReturn:
    """The installed command."""
    leave(main())


if __name__ == "__main__":
    program()
