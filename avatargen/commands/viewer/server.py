"""The viewer's server: viser's with our lines in its page, closed to the outside and to other sites."""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import viser
from websockets.asyncio import server as sockets
from websockets.http11 import Request, Response

from avatargen.commands.viewer.head import HEAD

LOOPBACK = ("127.0.0.1", "localhost", "[::1]")
Answer = Callable[[sockets.ServerConnection, Request], Response | None]


class PrivateServer(viser.ViserServer):
    """A server that only its own page can talk to.

    A browser lets any site's page open a socket to this machine; the origin that it sends with it tells. And
    no visitor can make the server public: viser would open a tunnel to the outside on request.
    """

    def __init__(self, host: str, port: int) -> None:
        with own_page():
            super().__init__(host=host, port=port, verbose=False)

    def request_share_url(self, verbose: bool = True) -> str | None:
        return None


@contextmanager
def own_page() -> Iterator[None]:
    """While viser starts its server, which has no settings for it, hand the origins and the lines for the
    page to websockets."""
    serve = sockets.serve

    def guarded(
        handler: Any, host: str, port: int, process_request: Answer, **settings: Any
    ) -> sockets.serve:
        answer, origins = with_head(process_request), own_origins(host, port)
        return serve(handler, host, port, process_request=answer, origins=origins, **settings)

    sockets.serve = guarded  # pyright: ignore[reportAttributeAccessIssue]
    try:
        yield
    finally:
        sockets.serve = serve


def own_origins(host: str, port: int) -> list[Any]:
    """Origins of the page itself; None stands for programs, which send none.

    A server that is open to the network has more names than it knows: there the port alone is compared.
    """
    local = host in (*LOOPBACK, "::1")
    names = "|".join(re.escape(name) for name in LOOPBACK) if local else r"[^/:]+|\[[0-9a-fA-F:]+\]"
    return [None, re.compile(rf"https?://({names}):{port}")]


def with_head(answer: Answer) -> Answer:
    """The same answers, with `HEAD` first in the head of a page."""

    def answer_with_head(connection: sockets.ServerConnection, request: Request) -> Response | None:
        if "Accept-Encoding" in request.headers:
            del request.headers["Accept-Encoding"]  # so that the page comes as text
        response = answer(connection, request)
        if response is not None and response.headers.get("Content-Type", "").startswith("text/html"):
            response.body = response.body.replace(b"<head>", b"<head>" + HEAD.encode(), 1)
            del response.headers["Content-Length"]
            response.headers["Content-Length"] = str(len(response.body))
        return response

    return answer_with_head
