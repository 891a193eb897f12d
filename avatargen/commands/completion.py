"""avatargen completion: prints what makes a shell complete the commands with the Tab key.

    avatargen completion bash

At a Tab the shell calls `avatargen completion words` with the words of the line; the last is the one to
complete. What may stand there is printed, a candidate a line; nothing where any file may. Options and their
values are read from the help of their command, so there is no list of them here.
"""

import io
import re
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout, suppress
from pathlib import Path

from avatargen.commands.export import PROGRAM as EXPORT
from avatargen.commands.line import OneLineParser, run_command
from avatargen.commands.main import COMMANDS, Command, find_command
from avatargen.errors import InputError

PROGRAM = "avatargen completion"
DESCRIPTION = "Print what makes a shell complete avatargen and avatar-export with the Tab key."
EXAMPLES = """\
in ~/.bashrc:                     source <(avatargen completion bash)
in ~/.zshrc, after compinit:      source <(avatargen completion zsh)
in ~/.config/fish/config.fish:    avatargen completion fish | source
"""
WORDS = "words"
BASH = """\
_avatargen() {
    local IFS=$'\\n' ask=${COMP_WORDS[0]/%avatar-export/avatargen}
    COMPREPLY=($("$ask" completion words "${COMP_WORDS[@]:0:COMP_CWORD+1}" 2>/dev/null))
}
complete -o bashdefault -o default -F _avatargen avatargen avatar-export
"""
ZSH = """\
#compdef avatargen avatar-export
_avatargen() {
    local ask=${words[1]/%avatar-export/avatargen}
    local -a found=(${(f)"$("$ask" completion words "${(@)words[1,CURRENT]}" 2>/dev/null)"})
    if (( $#found )); then compadd -a found; else _files; fi
}
if [[ $zsh_eval_context[-1] == loadautofunc ]]; then
    _avatargen "$@"
else
    compdef _avatargen avatargen avatar-export
fi
"""
FISH = """\
function __avatargen_words
    set -l words (commandline -opc)
    set -l current (commandline -ct)
    set -l ask (string replace -r 'avatar-export$' avatargen -- $words[1])
    set -l found (command $ask completion words $words "$current" 2>/dev/null)
    if set -q found[1]
        printf '%s\\n' $found
    else
        __fish_complete_path "$current"
    end
end
complete -c avatargen -f -a '(__avatargen_words)'
complete -c avatar-export -f -a '(__avatargen_words)'
"""
SCRIPTS = {"bash": BASH, "zsh": ZSH, "fish": FISH}
# an option or a positional argument at the start of a line of help, and its values, with or without a frame
LINE = re.compile(r"^[ │]*(?:-\w, )?(--[a-z][\w.-]*)? ?(?:\{([^}\n]+)\})?", re.MULTILINE)


def main(arguments: Sequence[str] | None = None) -> int:
    def command() -> None:
        if arguments and arguments[0] == WORDS:
            for candidate in candidates(arguments[1:]):
                print(candidate)
            return
        parser = OneLineParser(PROGRAM, description=DESCRIPTION, examples=EXAMPLES)
        parser.add_argument("shell", choices=tuple(SCRIPTS), help="whose script")
        print(SCRIPTS[parser.parse_args(arguments).shell], end="")

    return run_command(PROGRAM, command)


def candidates(words: Sequence[str]) -> list[str]:
    """What may stand in the place of the last of a line's words, which may be begun."""
    if len(words) < 2:
        return []
    program, *before, current = words
    if Path(program).name == EXPORT:
        before = ["export", *before]
    return [each for each in offered(before, current) if each.startswith(current)]


def offered(before: list[str], current: str) -> list[str]:
    """Words that may follow those before: of a command's name, an option's values, or options."""
    more, option = following(before), current.startswith("-")
    if more and not option:
        return more
    try:
        values = values_by_option(find_command(before))
    except InputError:
        return []
    if option:
        return [name for name in values if name]
    return values.get(before[-1] if before[-1].startswith("-") else "", [])


def following(before: list[str]) -> list[str]:
    """Next words of the commands that begin with these."""
    count, begun = len(before), tuple(before)
    words = [command.words for command in COMMANDS]
    return list(dict.fromkeys(each[count] for each in words if each[:count] == begun and len(each) > count))


def values_by_option(command: Command) -> dict[str, list[str]]:
    """A command's options with the values that each can have, where they can be listed; "" is the argument
    that has no name."""
    said = io.StringIO()
    with redirect_stdout(said), redirect_stderr(said), suppress(SystemExit):
        command.load()(["--help"])
    found = {}
    for option, values in LINE.findall(said.getvalue()):
        if option or values:
            found.setdefault(option, values.split(",") if values else [])
    return found
