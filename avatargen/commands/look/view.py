"""avatargen view: look at people in the browser, pose them and download them.

Only what bad arguments need is imported at the top.
"""

import sys
from argparse import Namespace
from collections.abc import Sequence
from contextlib import redirect_stdout
from pathlib import Path

from avatargen.commands.line import OneLineParser, run_command, whole_number
from avatargen.errors import InputError
from avatargen.extras import require_extra

PROGRAM = "avatargen view"
LOOPBACK = ("127.0.0.1", "::1", "localhost")
EXAMPLES = """\
examples:
  avatargen view                      # then open the address that is printed
  avatargen view --seed 8 --port 9000
"""


def main(arguments: Sequence[str] | None = None) -> int:
    return run_command(PROGRAM, lambda: run(parse(arguments)))


def parse(arguments: Sequence[str] | None) -> Namespace:
    parser = OneLineParser(
        PROGRAM,
        description="Look at people in the browser: seeds, poses, clips, skin weights, error; download them.",
        examples=EXAMPLES,
    )
    add = parser.add_argument
    add("--seed", type=whole_number(0, 2**53 - 1), default=3, metavar="N", help="first person (default: 3)")
    add(
        "--port",
        type=whole_number(1, 65535),
        default=8080,
        metavar="N",
        help="default: 8080, or the next free one",
    )
    add(
        "--host",
        default=LOOPBACK[0],
        metavar="ADDRESS",
        help="who can open the page (default: 127.0.0.1, this machine alone; 0.0.0.0: the whole network)",
    )
    add("--resolution", type=whole_number(32, 2048), default=512, metavar="N", help="default: 512")
    add("--texture", type=whole_number(16, 8192), default=1024, metavar="N", help="default: 1024")
    add("--weights", type=Path, metavar="FILE", help="other weights than the shipped ones")
    add("--body", type=Path, metavar="FILE", help="another body in SMPL's format, .npz or .pkl")
    return parser.parse_args(arguments)


def run(given: Namespace) -> None:
    """Serve the page until interrupted.

    Raises:
        AvatarGenError: viser is not installed, the address cannot be used, or a file is bad.
    """
    require_extra("viser", "websockets")
    for source in (given.weights, given.body):
        if source is not None and not source.is_file():
            raise InputError(f"found no file {source}; check the path")
    check_address(given.host)
    from assets import BuildConfig
    from avatargen import load_generator
    from avatargen.commands.viewer.people import People
    from avatargen.commands.viewer.server import PrivateServer
    from avatargen.commands.viewer.tabs import Tabs

    sampler = load_generator(given.weights, body=given.body)
    people = People(
        sampler, lambda faces: BuildConfig(faces=faces, resolution=given.resolution, texture=given.texture)
    )
    with redirect_stdout(sys.stderr):  # it says hello
        server = PrivateServer(host=given.host, port=given.port)
    if given.host not in LOOPBACK:
        print(f"{PROGRAM}: everyone who reaches {given.host} can open this page", file=sys.stderr)
    print(f"http://{given.host}:{server.get_port()}", flush=True)
    with redirect_stdout(sys.stderr):
        try:
            Tabs(server, people, given.seed).run()
        finally:
            server.stop()


def check_address(host: str) -> None:
    """Raises InputError where this machine has no such address."""
    import socket

    try:
        with socket.create_server((host, 0)):
            return
    except OSError as error:
        raise InputError(
            f"found --host {host}, where nothing can be served ({error.strerror or error}); use 127.0.0.1"
        ) from error
