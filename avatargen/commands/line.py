"""What every command shares: errors as one line on standard error, and exit statuses scripts can rely on.

Status 0: done and whole. 2: bad input, one line says what was found, what was wanted, what to do. 130, 143:
interrupted or terminated, nothing half written.
"""

import argparse
import atexit
import codecs
import contextlib
import errno
import io
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn, TypeVar

from avatargen.commands.near import check_option_names
from avatargen.errors import AvatarGenError, InputError
from avatargen.motion.names import parts_of

Parsed = TypeVar("Parsed")
RETRY = 0.05  # seconds until a signal that could not end the process comes again
LARGEST_SEED = 2**63 - 1
FEWEST_FACES, MOST_FACES = 100, 2_000_000
PER_METRE = {"mm": 1000, "cm": 100, "m": 1}  # longer names first, as the last letters are looked for


class OneLineParser(argparse.ArgumentParser):
    """An argument parser whose complaints are one line, not a page of usage, and whose options are written in
    full. With examples at the end, its help keeps its line breaks."""

    def __init__(self, program: str, description: str | None, examples: str | None = None) -> None:
        kept = argparse.RawDescriptionHelpFormatter if examples else argparse.HelpFormatter
        super().__init__(
            program, description=description, epilog=examples, formatter_class=kept, allow_abbrev=False
        )

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message}; see {self.prog} --help")

    def parse_known_args(self, args: Sequence[str] | None = None, namespace: Any = None) -> Any:
        words = sys.argv[1:] if args is None else args
        check_option_names(words, self._option_string_actions, self.prog)
        return super().parse_known_args(words, namespace)


def run_command(program: str, command: Callable[[], None]) -> int:
    """Run `command` and turn what it raises on purpose into one line and an exit status.

    Bugs keep their traceback. Warnings of libraries stay silent unless Python was asked for them with -W.
    """
    open_streams()
    if not sys.warnoptions:
        warnings.simplefilter("ignore")
    # Read when torch loads: threads that wait for work sleep; spinning, a busy machine made them four
    # times as slow.
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    received: list[int] = []

    def stop(signum: int, frame: FrameType | None) -> None:
        received.append(signum)
        if swallows(frame):
            again = threading.Timer(RETRY, signal.raise_signal, [signum])
            again.daemon = True
            again.start()
        else:
            terminate(signum, frame)

    signal.signal(signal.SIGTERM, stop)
    try:
        command()
        sys.stdout.flush()
    except (AvatarGenError, MemoryError) as error:
        lack = "out of memory; lower --resolution or --texture, or close programs"
        return complain(program, lack if isinstance(error, MemoryError) else str(error), status=2)
    except KeyboardInterrupt:
        return complain(program, "interrupted; nothing is half written", status=128 + signal.SIGINT)
    except BrokenPipeError:  # the reader of standard output has left; the work is done all the same
        discard_output()
    except Exception as error:
        if received:  # a library that is loading makes an error of its own out of the exit
            return 128 + received[-1]
        reason = output_error() if isinstance(error, OSError) else None
        if reason is None:
            raise
        discard_output()
        message = f"cannot print: {reason}; give the output room, or send it elsewhere"
        return complain(program, message, status=2)
    return 0


def parse_options(program: str, options: Callable[..., Parsed], words: Sequence[str] | None) -> Parsed:
    """What tyro makes of a command line, whose complaints become one line.

    Raises:
        InputError: words that are no options, or values that the options' own checks refuse.
    """
    import tyro

    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said):
            return tyro.cli(options, prog=program, args=words)
    except SystemExit as end:
        if not end.code:
            raise
        raise InputError(f"{complaint(said.getvalue())}; see {program} --help") from None


def complaint(box: str) -> str:
    """What stands between the first and the second rule of a box of text, without its border."""
    parts: list[list[str]] = [[]]
    for line in (line.strip("│ ") for line in box.splitlines()):
        if line.endswith(("───", "---", "╮")):  # hyphens where the terminal has nothing better
            parts.append([])
        else:
            parts[-1].append(line)
    text = " ".join(filter(None, parts[min(1, len(parts) - 1)]))
    return text.rstrip(".") or "the options cannot be read"


def open_streams() -> None:
    """Open the standard streams that the process was started without, as services are, on nothing: else the
    next file opened would take their place. Names of files are printed as the bytes that they are."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if not is_open(number):
            nothing = os.open(os.devnull, os.O_RDWR)
            os.dup2(nothing, number)
            if nothing > 2:
                os.close(nothing)
            os.set_inheritable(number, True)
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, "w" if number else "r", closefd=False))
    codecs.register_error("filename", bytes_of_names)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="filename")


def is_open(number: int) -> bool:
    """Whether there is a stream of that number; one that is only read from is none to write to."""
    try:
        os.write(number, b"") if number else os.fstat(number)
    except OSError as error:
        return error.errno != errno.EBADF  # one without room is there
    return True


def bytes_of_names(error: UnicodeError) -> tuple[bytes | str, int]:
    """What a stream cannot encode, as it stands in the name of a file; what can be in none, escaped."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    try:
        return os.fsencode(error.object[error.start : error.end]), error.end
    except UnicodeEncodeError:
        return codecs.backslashreplace_errors(error)


def output_error() -> str | None:
    """Why standard output or standard error takes no more, or None where both do."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
            os.write(stream.fileno(), b"\n")
        except OSError as error:
            return error.strerror or str(error)
    return None


def discard_output() -> None:
    """Send what is still to be printed nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def swallows(frame: FrameType | None) -> bool:
    """Whether what is raised here is reported and forgotten: in a destructor, or in a function that a weak
    reference or compiled code calls back."""
    while frame is not None:
        code = frame.f_code
        if code.co_name == "__del__" or Path(code.co_filename).name == "weakref.py":
            return True
        if "llvmlite" in code.co_filename:
            return True
        frame = frame.f_back
    return False


def leave(status: int) -> NoReturn:
    """End the process once its work is done. What libraries loaded is not taken down piece by piece, which
    takes most of a second after torch; the system takes it all at once."""
    atexit._run_exitfuncs()
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        os._exit(status)


def terminate(signum: int, frame: object) -> NoReturn:
    """Leave through every `finally`, so that no part file stays behind."""
    sys.exit(128 + signum)


def complain(program: str, message: str, status: int) -> int:
    with contextlib.suppress(OSError):  # where standard error takes no more, the status tells
        print(f"{program}: {' '.join(message.split())}", file=sys.stderr)
    return status


def positive_number(most: float) -> Callable[[str], float]:
    """An argument type: a number above 0, up to `most`."""

    def parse(text: str) -> float:
        try:
            value = float(text) if text.isascii() and "_" not in text else -1.0
        except ValueError:
            value = -1.0
        if not 0 < value <= most:  # also catches NaN
            raise argparse.ArgumentTypeError(f"found {text!r}, wanted a number above 0, up to {most:g}")
        return value

    return parse


def whole_number(low: int, high: int) -> Callable[[str], int]:
    """An argument type: plain decimal digits within a range."""

    def parse(text: str) -> int:
        plain = text.isascii() and text.isdigit() and len(text) <= 30
        if not (plain and low <= int(text) <= high):
            raise argparse.ArgumentTypeError(f"found {text!r}, wanted a whole number from {low} to {high}")
        return int(text)

    return parse


def quantity(unit: str, example: str) -> Callable[[str], float]:
    """An argument type: a positive number, with or without its unit; a length may have another's unit."""
    known = PER_METRE if unit in PER_METRE else {unit: 1}

    def read(text: str) -> float:
        number = text.strip()
        behind = next((each for each in known if number.endswith(each)), "")
        try:
            value = float(number.removesuffix(behind)) * known[unit] / known[behind or unit]
        except ValueError:
            value = 0.0
        if not 0 < value < 1e6:
            raise argparse.ArgumentTypeError(f"found {text!r}, wanted a positive number such as {example}")
        return value

    return read


def clip_name(text: str) -> str:
    """An argument type: a clip, or several at once."""
    try:
        parts_of(text)
    except InputError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return text


def falling_numbers(text: str) -> tuple[int, ...]:
    """An argument type: whole numbers of 100 or more, each less than the one before."""
    parts = text.replace(" ", "").split(",")
    plain = all(part.isascii() and part.isdigit() and len(part) < 8 for part in parts)
    sizes = tuple(int(part) for part in parts) if plain else (0,)
    falling = all(a > b for a, b in pairwise(sizes))
    if not falling or sizes[-1] < FEWEST_FACES or sizes[0] > MOST_FACES:
        raise argparse.ArgumentTypeError(
            f"found {text!r}, wanted falling numbers of {FEWEST_FACES} to {MOST_FACES}, as in 20000,5000,1000"
        )
    return sizes
