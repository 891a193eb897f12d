"""TalkingHead's page, served to a browser from this machine."""

import functools
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import unquote, urlsplit

from tests.verdicts import JUDGES

PACKAGE = JUDGES / "node_modules" / "@met4citizen" / "talkinghead"


class Handler(SimpleHTTPRequestHandler):
    """Gives the page, the person, and the two packages that the page imports."""

    def __init__(self, *arguments: object, person: Path, package: Path) -> None:
        own = package / "node_modules" / "three"  # where another judge has another version
        self.places = {
            "three": own if own.is_dir() else package.parents[1] / "three",
            "talkinghead": package,
        }
        self.person = person
        self.extensions_map = {**self.extensions_map, ".mjs": "text/javascript", ".js": "text/javascript"}
        super().__init__(*arguments)  # pyright: ignore[reportArgumentType]

    def translate_path(self, path: str) -> str:
        first, _, rest = unquote(urlsplit(path).path).lstrip("/").partition("/")
        if first == "person.glb":
            return str(self.person)
        place = self.places.get(first)
        return str(JUDGES / "talking_head.html" if place is None else place / rest)

    def log_message(self, format: str, *arguments: object) -> None:
        """Nothing is said of what is asked for."""


@contextmanager
def served(person: Path, package: Path) -> Iterator[str]:
    """The page's address while it is served."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Handler, person=person, package=package))
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}/"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
