"""What README and the guides show holds: Python runs, commands are accepted, links lead on, pages load."""

import os
import re
import shlex
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from avatargen.body.joints import JOINT_NAMES
from avatargen.body.pose import load_pose
from avatargen.commands.export.options import make_request, parse, read
from avatargen.motion.amass import load_motion
from exporters import export
from tests import browser
from tests.figure import figure, in_motion
from tests.verdicts import JUDGES, PROJECT

GUIDES = PROJECT / "docs" / "guides"
PAGES = [PROJECT / "README.md", *sorted(GUIDES.glob("*.md"))]
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SHOWN = (
    "avatar-export --seed",
    "avatar-export 3",
    "avatar-export --text",
    "avatargen edit",
)  # with a person; others stand for the command itself
LINK = re.compile(r"\[[^\]]*\]\(([^)#\s]+)(?:#[^)]*)?\)")


def blocks(page: Path, language: str) -> list[str]:
    return [text for found, text in FENCE.findall(page.read_text()) if found == language]


def run_python(page: Path) -> None:
    names: dict[str, object] = {"__name__": page.name}
    for block in blocks(page, "python"):
        exec(compile(block, page.name, "exec"), names)  # noqa: S102  our own pages


@pytest.mark.parametrize(
    "name", ["README.md", "python.md", "own_data.md", "choosing.md", "clothes.md", "text.md"]
)
def test_python_examples_run(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (page,) = [page for page in PAGES if page.name == name and blocks(page, "python")]
    monkeypatch.chdir(tmp_path)
    run_python(page)
    if name == "python.md":
        assert {"person.glb", "person.usdz", "person.stl", "walking.glb", "person.png"} <= set(os.listdir())
    if name == "own_data.md":
        assert load_pose("pose.npz", JOINT_NAMES[24])[16, 2] == 1
        motion = load_motion("wave.npz")
        np.testing.assert_allclose(motion.rotations[0, 0], [0, 0, 0, 1], atol=1e-9)  # upright
        assert motion.seconds == pytest.approx(29 / 30)


def commands() -> list[list[str]]:
    """Every avatar-export that a page shows, as words."""
    found = set()
    for page in PAGES:
        text = page.read_text()
        lines = [line for _, block in FENCE.findall(text) for line in block.splitlines()]
        lines += re.findall(r"`([^`\n]+)`", FENCE.sub("", text))
        found |= {line.split("#")[0].strip() for line in lines if line.startswith(SHOWN)}
    return [shlex.split(line) for line in sorted(found)]


@pytest.mark.parametrize("words", commands(), ids=" ".join)
def test_commands_are_accepted(words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The files that they name are there; what these hold is not looked at."""
    monkeypatch.chdir(tmp_path)
    for word in words:
        if word.endswith((".npz", ".pkl", ".safetensors", "phonemes.json")):
            Path(word).parent.mkdir(parents=True, exist_ok=True)
            Path(word).touch()
    if words[0] == "avatargen":
        make_request(read(words[2:], change=True))
    else:
        parse(words[1:])


def test_links_lead_somewhere() -> None:
    for page in PAGES:
        for link in LINK.findall(page.read_text()):
            if "://" not in link:
                assert (page.parent / link).exists(), f"{page.name}: {link}"


def drawn(tab: browser.Browser, path: Path) -> bool:
    """Whether something stands before the grey of the page."""
    tab.picture(path)
    with Image.open(path) as picture:
        pixels = np.asarray(picture.convert("RGB")).astype(int)
    return 0.01 < (np.abs(pixels - pixels[2, 2]).max(axis=-1) > 12).mean() < 0.6


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, format: str, *args: object) -> None:
        """Says nothing."""


HEAR = """window.said = [];
for (const kind of ["warn", "error"]) console[kind] = (...all) => said.push(all.join(" "));"""
FILLED = """const canvas = document.querySelector("canvas").getBoundingClientRect();
return [canvas.left, canvas.top, canvas.width - innerWidth, canvas.height - innerHeight]"""


@pytest.mark.parametrize("number", [0, 1], ids=["three.js", "Babylon.js"])
def test_pages_show_the_person(number: int, tmp_path: Path) -> None:
    """In Chromium, on a phone and then on a desk: the page's title names the clips once the file is loaded,
    something is drawn, the canvas fills the page, and nothing is warned of."""
    if not browser.found() and not os.environ.get("SYSTEM_JUDGES"):
        pytest.skip("Chromium is not installed; it is Debian's chromium and chromium-driver")
    asset = in_motion(figure())
    walk = [clip for clip in asset.animations if clip.name != "mesh"]
    assert len(walk) == 1
    page = blocks(GUIDES / "web.md", "html")[number].replace('"walk"', f'"{walk[0].name}"')
    (tmp_path / "index.html").write_text(page)
    (tmp_path / "node_modules").symlink_to(JUDGES / "node_modules")
    export(asset, tmp_path / "person.glb")
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(tmp_path)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        with browser.browser(tmp_path, browser.PHONE) as tab:
            tab.tool("Page.addScriptToEvaluateOnNewDocument", source=HEAR)
            tab.open(f"http://127.0.0.1:{server.server_port}/index.html")
            browser.wait(lambda: tab.run("return document.title") == "mesh, walk it", "the page's title")
            for size in (browser.PHONE, browser.DESK):
                tab.resize(*size)
                browser.wait(lambda: tab.run(FILLED) == [0, 0, 0, 0], "a canvas that fills the page")
                browser.wait(lambda: drawn(tab, tmp_path / "page.png"), "the person")
            assert tab.run("return said") == []
    finally:
        server.shutdown()
        server.server_close()
