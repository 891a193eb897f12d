"""A headless Chromium driven over the WebDriver protocol: opens a page, clicks, types, takes pictures."""

import base64
import json
import shutil
import socket
import subprocess
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

# a page in WebGL on a machine without a GPU
FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
)
DESK, PHONE = (1280, 720), (390, 844)  # width and height of the page, pixels
PATIENCE = 180.0  # seconds


def found() -> bool:
    """Whether this machine has the browser and its driver."""
    return all(shutil.which(name) for name in ("chromium", "chromedriver"))


class Browser:
    """One tab."""

    def __init__(self, session: str) -> None:
        self.session = session

    def ask(self, verb: str, path: str, **body: Any) -> Any:
        return request(f"{self.session}{path}", verb, body)

    def open(self, address: str) -> None:
        self.ask("POST", "/url", url=address)

    def resize(self, width: int, height: int) -> None:
        """Let the page have so many pixels; one that is higher than wide is a phone's."""
        screen = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": height > width}
        self.tool("Emulation.setDeviceMetricsOverride", **screen)

    def tool(self, command: str, **parameters: Any) -> Any:
        """What a command of the browser's own tools returns."""
        return self.ask("POST", "/goog/cdp/execute", cmd=command, params=parameters)

    def run(self, script: str, *arguments: Any) -> Any:
        """What a piece of JavaScript returns."""
        return self.ask("POST", "/execute/sync", script=script, args=list(arguments))

    def press(self, *keys: str) -> None:
        """Type on the keyboard, one key after the other."""
        strokes = [{"type": kind, "value": key} for key in keys for kind in ("keyDown", "keyUp")]
        self.ask("POST", "/actions", actions=[{"type": "key", "id": "keyboard", "actions": strokes}])

    def click(self, text: str) -> None:
        """Click what bears this text, once it is there."""
        xpath = f"//body//*[normalize-space(text())='{text}']"
        element = wait(lambda: self.ask("POST", "/elements", using="xpath", value=xpath), f"{text!r}")[0]
        self.ask("POST", f"/element/{next(iter(element.values()))}/click")

    def text(self) -> str:
        return self.run("return document.body.innerText")

    def picture(self, path: Path) -> None:
        """The page as PNG."""
        path.write_bytes(base64.b64decode(self.ask("GET", "/screenshot")))


@contextmanager
def browser(downloads: Path, size: tuple[int, int] = DESK) -> Iterator[Browser]:
    """A tab in a browser and a driver of their own, both gone at the end; files go to `downloads`."""
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    command = ["chromedriver", f"--port={port}"]
    driver = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    address = f"http://127.0.0.1:{port}"
    try:
        wait(lambda: request(f"{address}/status", "GET", {})["ready"], "chromedriver")
        options = {
            "args": list(FLAGS),
            "prefs": {"download.default_directory": str(downloads), "download.prompt_for_download": False},
        }
        wanted = {"alwaysMatch": {"goog:chromeOptions": options}}
        session = request(f"{address}/session", "POST", {"capabilities": wanted})["sessionId"]
        try:
            tab = Browser(f"{address}/session/{session}")
            tab.resize(*size)
            yield tab
        finally:
            request(f"{address}/session/{session}", "DELETE", {})
    finally:
        driver.terminate()
        driver.wait(10)


def request(address: str, verb: str, body: dict[str, Any]) -> Any:
    data = json.dumps(body).encode() if verb == "POST" else None
    asked = urllib.request.Request(address, data, {"Content-Type": "application/json"}, method=verb)
    try:
        with urllib.request.urlopen(asked, timeout=PATIENCE) as answer:
            return json.load(answer)["value"]
    except urllib.error.HTTPError as error:
        error.add_note(error.read().decode(errors="replace")[:500])
        raise


def wait(look: Callable[[], Any], what: str) -> Any:
    """What `look` finds as soon as it finds something."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        try:
            if seen := look():
                return seen
        except (urllib.error.URLError, ConnectionError):
            pass
        time.sleep(0.1)
    raise TimeoutError(f"waited {PATIENCE:g} s for {what}")
