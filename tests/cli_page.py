"""python -m tests.cli_page: writes docs/cli.md, the options of avatar-export and the commands of avatargen.

The page is made from the parser and from the table of commands; a test fails when it differs from them.
"""

import re
from argparse import Action
from pathlib import Path

from avatargen.atomic import write_atomically
from avatargen.commands.export.options import DESCRIPTION, EXAMPLES, make_parser
from avatargen.commands.main import COMMANDS

PAGE = Path(__file__).parents[1] / "docs" / "cli.md"
DEFAULT = re.compile(r" ?\(default: ([^)]*)\)")
ABOUT = """\
<!-- Made by `python -m tests.cli_page` from the commands' own help; edit that. -->
# The commands"""
OTHERS = """\
`avatargen COMMAND --help` tells the options of each. Status 0: done and whole. 2: bad input, in one line on
standard error. 130 and 143: interrupted or terminated, with nothing half written."""


def page() -> str:
    """The page as Markdown."""
    examples = "\n".join(line.strip() for line in EXAMPLES.splitlines()[1:])
    parts = [ABOUT, "## avatar-export", DESCRIPTION, f"```\n{examples}\n```"]
    for group in make_parser()._action_groups:
        actions = group._group_actions
        if actions and group.title != "options":  # argparse's own: help
            parts.append(f"### {(group.title or '').capitalize()}")
            parts.append(table(("option", "meaning", "default"), [row(action) for action in actions]))
    commands = [(f"`avatargen {' '.join(each.words)}`", each.summary) for each in COMMANDS]
    parts += ["## avatargen", table(("command", "does"), commands), OTHERS]
    return "\n\n".join(parts) + "\n"


def row(action: Action) -> tuple[str, str, str]:
    """An option's line: how it is written, what it does, what holds without it."""
    value = str(action.metavar or "") or ",".join(map(str, action.choices or ())).join("{}")
    written = " ".join([*action.option_strings[-1:], *([] if action.nargs == 0 else [value])])
    return f"`{written}`", DEFAULT.sub("", help_of(action)), default_of(action)


def help_of(action: Action) -> str:
    return (action.help or "").replace("%%", "%")


def default_of(action: Action) -> str:
    """What the help says of it; nothing where nothing is done without the option."""
    found = DEFAULT.search(help_of(action))
    return found.group(1) if found else ""


def table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    lines = [head, ("---",) * len(head), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", r"\|") for cell in line) + " |" for line in lines)


if __name__ == "__main__":
    write_atomically(PAGE, page().encode())
