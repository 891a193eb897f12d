"""What a worker process of `export_many` runs. Nothing heavy is imported before it can be ended in peace."""

import signal
import sys
from multiprocessing.connection import Connection
from typing import NoReturn

from avatargen.errors import AvatarGenError


def work(pipe: Connection) -> None:
    """Hear the request, load once, say None, then answer each seed with its row until the pipe ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent is interrupted too, and ends its workers
    signal.signal(signal.SIGTERM, leave)
    try:
        request = pipe.recv()
    except EOFError:  # the parent is gone
        return
    from avatargen.export.seed import SeedExporter

    try:
        exporter = SeedExporter(request)
    except AvatarGenError as error:
        pipe.send(str(error))
        return
    pipe.send(None)
    while True:
        try:
            pipe.send(exporter.export(pipe.recv()))
        except (EOFError, OSError):  # the parent is gone
            return


def leave(signum: int, frame: object) -> NoReturn:
    """Through every `finally`, so that no part file stays behind."""
    sys.exit(128 + signum)
