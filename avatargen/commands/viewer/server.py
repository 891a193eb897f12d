"""The viewer's server: viser's, closed to the outside and to pages of other sites."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import viser
from websockets.asyncio import server as sockets

LOOPBACK = ("127.0.0.1", "localhost", "[::1]")


class PrivateServer(viser.ViserServer):
    """A server that only its own page can talk to.

    A browser lets any site's page open a socket to this machine; the origin that it sends with it tells. And
    no visitor can make the server public: viser would open a tunnel to the outside on request.
    """

    def __init__(self, host: str, port: int) -> None:
        with own_pages_alone():
            super().__init__(host=host, port=port, verbose=False)

    def request_share_url(self, verbose: bool = True) -> str | None:
        return None


@contextmanager
def own_pages_alone() -> Iterator[None]:
    """While viser starts its server, which has no setting for it, hand the origins to websockets."""
    serve = sockets.serve

    def guarded(handler: Any, host: str, port: int, **settings: Any) -> sockets.serve:
        return serve(handler, host, port, origins=own_origins(host, port), **settings)

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
