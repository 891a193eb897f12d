"""The viewer: what the controls do, what visitors can and cannot reach, and the page itself in a browser."""

import http.client
import io
import os
import signal
import socket
import subprocess
import sys
import threading
import time
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import numpy as np
import pytest
from PIL import Image
from pygltflib import GLTF2

from assets import Asset, BuildConfig, with_levels
from assets.asset.bones import aim_bones
from assets.asset.levels import level_error
from assets.errors import GeometryError
from assets.picture.paint import painted
from avatargen import load_generator
from avatargen.body.load import save_body
from avatargen.body.model import canonical_body
from avatargen.commands.look import view
from avatargen.generator.checkpoint import save_checkpoint
from avatargen.generator.config import DEBUG, for_body
from avatargen.generator.generator import AvatarGenerator
from avatargen.motion.clips import CLIPS
from exporters import FORMATS, export, glb
from exporters.read_glb import read_glb
from tests import browser
from tests.bodies import capsule_body
from tests.verdicts import require

try:
    import viser
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect
    from websockets.typing import Origin, Subprotocol

    from avatargen.commands.viewer.page import ERROR_LIMIT, LEVELS, STILL, Page
    from avatargen.commands.viewer.people import KEPT, People, Wish
    from avatargen.commands.viewer.server import PrivateServer, own_origins
except ModuleNotFoundError as error:
    require(False, f"the extra [view] ({error.name})")  # skips, or fails under CI
    pytest.skip("the extra [view] is not installed", allow_module_level=True)

PROJECT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """An untrained generator on a capsule figure, and that figure, as files."""
    folder, body = tmp_path_factory.mktemp("model"), capsule_body()
    save_body(body, folder / "body.npz")
    generator = AvatarGenerator(for_body(DEBUG, canonical_body(body)))
    save_checkpoint(generator, folder / "debug.safetensors")
    return folder / "debug.safetensors", folder / "body.npz"


@pytest.fixture(scope="module")
def people(model: tuple[Path, Path]) -> People:
    sampler = load_generator(model[0], body=model[1])
    return People(sampler, lambda faces: BuildConfig(resolution=64, faces=faces // 20, texture=64))


@pytest.fixture(scope="module")
def server() -> Iterator[PrivateServer]:
    server = PrivateServer(host="127.0.0.1", port=8710)
    yield server
    server.stop()


@pytest.fixture
def page(server: PrivateServer, people: People) -> Page:
    server.gui.reset()
    server.scene.reset()
    page = Page(server, people, 3)
    page.step()
    return page


def settle(page: Page) -> None:
    """Do what the controls asked for."""
    page.want()
    page.step()


def test_the_page_shows_the_person_in_the_pose_chosen(page: Page) -> None:
    assert page.status.content.startswith("Seed 3: 1,000 triangles, error ")
    assert not page.progress.visible
    assert page.asset is not None
    assert page.shape is not None
    assert page.shape.vertices == pytest.approx(page.asset.vertices, abs=2e-3)  # sliders are whole degrees
    width = np.ptp(page.shape.vertices[:, 0])
    page.stance.value = "t"
    page.take_stance()
    settle(page)
    assert np.ptp(page.shape.vertices[:, 0]) > 1.2 * width
    page.angles["left arm up"].value = 80
    settle(page)
    assert page.shape.vertices[:, 1].max() > page.asset.vertices[:, 1].max() + 0.1


@pytest.mark.parametrize("clip", CLIPS)
def test_a_clip_plays_on_the_spot_in_any_colours(page: Page, clip: str) -> None:
    page.wireframe.value = True
    page.clip.value, page.shown.value = clip, "skin weights"
    settle(page)
    assert page.shape is not None and page.asset is not None
    (animation,) = page.shape.animations
    assert animation.name == clip
    assert np.abs(animation.root[:, [0, 2]] - animation.root[0, [0, 2]]).max() < 1e-9
    assert page.wireframe.disabled
    person = page.people.get(Wish(3), page.show_progress)
    seen = page.colored(page.shape, person)
    assert isinstance(seen, Asset) and seen.animations == page.shape.animations
    name, data = page.file()
    document = GLTF2.load_from_bytes(data)
    assert document is not None
    (told,) = document.animations
    assert (name, told.name) == ("avatar_3.glb", clip)
    page.clip.value = STILL
    settle(page)
    assert page.shape is not None and page.shape.animations == () and not page.wireframe.disabled


def test_every_surface_is_a_file_with_its_own_colours(page: Page) -> None:
    person, shape = page.people.get(Wish(3), page.show_progress), page.shape
    assert shape is not None
    found = {}
    for shown in ("texture", "shape", "skin weights", "error"):
        page.shown.value = shown
        settle(page)
        found[shown] = page.colored(shape, person)
        assert page.joint.visible == (shown == "skin weights")
        assert page.scale.visible == (shown == "error")
    assert found["texture"] is shape
    errors = person.errors()
    assert person.asset.report is not None
    assert errors.max() < 1.5 * person.asset.report.error.max_mm
    assert f"{errors.max():.2f} mm" in page.scale.content
    assert np.array_equal(found["error"].uv, painted(shape, errors / ERROR_LIMIT).uv)
    assert len({glb.encode(asset) for asset in found.values()}) == 4


@pytest.mark.parametrize("level", [1, 3])
def test_a_coarser_level_is_shown_measured_and_downloaded(page: Page, level: int) -> None:
    finest = page.asset
    assert finest is not None and finest.report is not None
    page.level.value, page.wireframe.value = LEVELS[level], True
    settle(page)
    assert page.asset is not None and page.shape is not None and page.asset.report is not None
    wanted = with_levels(finest, (len(finest.faces) >> level,))
    coarse = wanted.levels[0]
    assert page.status.content.startswith(f"Seed 3: {len(coarse):,} triangles, error ")
    assert np.array_equal(page.asset.vertices[page.asset.faces], wanted.vertices[coarse])
    sdf = page.people.get(Wish(3), page.show_progress).avatar.sdf
    assert page.asset.report.error == level_error(wanted, coarse, sdf)
    drawn_glb: Any = page.server.scene.get_handle_by_name("/person")
    edges: Any = page.server.scene.get_handle_by_name("/edges")
    assert drawn_glb.glb_data == glb.encode(page.shape)
    assert np.array_equal(edges.faces, page.shape.faces)
    assert page.file() == ("avatar_3.glb", glb.encode(aim_bones(page.asset)))
    page.level.value = LEVELS[0]
    settle(page)
    assert page.asset is finest


def test_a_level_is_made_once(page: Page) -> None:
    person = page.people.get(Wish(3), page.show_progress)
    assert person.at(0) is person
    assert person.at(2) is person.at(2)


def test_a_person_is_built_once_and_the_last_few_are_kept(
    page: Page, monkeypatch: pytest.MonkeyPatch
) -> None:
    built: list[tuple[int, int]] = []

    def build(avatar: Any, config: BuildConfig, progress: object) -> Asset | None:
        assert config.faces is not None
        built.append((avatar.seed, config.faces))
        return page.asset

    monkeypatch.setattr("avatargen.commands.viewer.people.build", build)
    own = People(page.people.sampler, page.people.settings)
    for seed in (0, 1, 2, 3, 0, 4, 0, 1):
        person = own.get(Wish(seed, faces=4000), page.show_progress)
        assert person.avatar.seed == seed
    assert built == [(seed, 200) for seed in (0, 1, 2, 3, 4, 1)]  # 1 had made room for 4
    assert len(own.kept) == KEPT


def test_wishes_that_pile_up_are_drawn_once(page: Page, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[int] = []
    monkeypatch.setattr(page, "draw", lambda: drawn.append(1))
    for _ in range(5):
        page.want()
    page.step()
    assert drawn == [1]
    assert page.wanted.empty()


def test_an_error_is_told_and_the_page_goes_on(page: Page, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(wish: Wish, progress: object) -> None:
        raise GeometryError("no surface here")

    with monkeypatch.context() as patched:
        patched.setattr(page.people, "get", fail)
        settle(page)
        assert page.status.content == "**no surface here**"
    settle(page)
    assert page.status.content.startswith("Seed 3")


def test_a_download_is_the_file_that_the_command_writes(page: Page) -> None:
    assert page.asset is not None
    assert page.shape is not None
    assert page.file() == ("avatar_3.glb", glb.encode(aim_bones(page.asset)))
    page.as_posed.value = True
    assert page.file() == ("avatar_3.glb", glb.encode(aim_bones(page.shape)))


@pytest.mark.parametrize("suffix", FORMATS)
def test_every_format_can_be_downloaded(page: Page, suffix: str, tmp_path: Path) -> None:
    assert page.asset is not None
    page.format.value = suffix[1:]
    name, data = page.file()
    if name.endswith(".zip"):
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            files = {name: archive.read(name) for name in archive.namelist()}
        assert page.file() == (name, data)
    else:
        files = {name: data}
    assert f"avatar_3{suffix}" in files
    if FORMATS[suffix].rest_pose is None:
        export(aim_bones(page.asset), tmp_path / f"avatar_3{suffix}")
        assert files == {path.name: path.read_bytes() for path in tmp_path.iterdir()}


def test_only_this_machine_can_connect(server: PrivateServer) -> None:
    with socket.create_connection(("127.0.0.1", server.get_port()), timeout=5):
        pass
    with pytest.raises(ConnectionRefusedError):  # another address of the same machine, as from outside
        socket.create_connection(("127.0.0.2", server.get_port()), timeout=5)


@pytest.mark.parametrize(
    "path",
    [
        "/../../../../../../../../etc/passwd",
        "/%2e%2e/%2e%2e/%2e%2e/%2e%2e/%2e%2e/%2e%2e/%2e%2e/%2e%2e/etc/passwd",
        "//etc/passwd",
        "/..%2f..%2f..%2f..%2f..%2f..%2f..%2f..%2fetc/passwd",
        "/..\\..\\..\\..\\..\\..\\etc\\passwd",
        "/../../_viser.py",
        "/./../build/../../_viser.py",
        "/~/.ssh/id_rsa",
    ],
)
def test_nothing_but_the_page_is_served(server: PrivateServer, path: str) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", server.get_port(), timeout=5)
    connection.putrequest("GET", path, skip_host=False)
    connection.endheaders()
    assert connection.getresponse().status == 404
    connection.close()


@pytest.mark.parametrize(
    ("origin", "let_in"),
    [
        ("http://127.0.0.1:{port}", True),
        ("http://localhost:{port}", True),
        (None, True),
        ("http://evil.example", False),
        ("http://evil.example:{port}", False),
        ("http://127.0.0.1:{other}", False),
        ("http://127.0.0.1.evil.example:{port}", False),
        ("null", False),
    ],
)
def test_pages_of_other_sites_cannot_talk_to_it(
    server: PrivateServer, origin: str | None, let_in: bool
) -> None:
    port = server.get_port()
    origin = origin and origin.format(port=port, other=port + 1)
    protocol = Subprotocol(f"viser-v{viser.__version__}")
    address = f"ws://127.0.0.1:{port}"
    if let_in:
        with connect(address, origin=Origin(origin) if origin else None, subprotocols=[protocol]) as socket:
            assert socket.recv(timeout=10)
    else:
        with pytest.raises(InvalidStatus, match="403"):
            connect(address, origin=Origin(str(origin)), subprotocols=[protocol])


def test_an_open_server_still_compares_ports() -> None:
    _, pattern = own_origins("0.0.0.0", 8080)
    assert pattern.fullmatch("http://mine.local:8080") and pattern.fullmatch("http://[fe80::1]:8080")
    assert not pattern.fullmatch("http://mine.local:80") and not pattern.fullmatch("https://evil.example")


def test_no_visitor_can_open_a_tunnel(server: PrivateServer, monkeypatch: pytest.MonkeyPatch) -> None:
    import viser._viser

    opened: list[object] = []
    monkeypatch.setattr(viser._viser, "ViserTunnel", lambda *arguments: opened.append(arguments))
    assert server.request_share_url() is None
    assert opened == []


def test_the_page_in_a_browser(page: Page, tmp_path: Path) -> None:
    if not browser.found() and not os.environ.get("SYSTEM_JUDGES"):
        pytest.skip(
            "Chromium and its driver are not installed; they are Debian's chromium and chromium-driver"
        )

    closed = threading.Event()

    def work() -> None:
        while not closed.is_set():
            page.step()

    worker = threading.Thread(target=work, daemon=True)
    worker.start()
    try:
        with browser.browser(tmp_path) as tab:
            tab.open(f"http://127.0.0.1:{page.server.get_port()}")
            browser.wait(lambda: "Seed 3: 1,000 triangles" in tab.text(), "the person")
            browser.wait(lambda: figure(tab, tmp_path), "a picture of the person")
            page.shown.value = "skin weights"
            browser.wait(lambda: all_blue(tab, tmp_path), "the person in blue")
            tab.click("download")
            browser.wait((tmp_path / "avatar_3.glb").exists, "the file")
    finally:
        closed.set()
        page.want()
        worker.join()
    again = read_glb(tmp_path / "avatar_3.glb")
    assert page.asset is not None
    assert np.array_equal(again.vertices, page.asset.vertices)


def pixels(tab: browser.Browser, folder: Path) -> np.ndarray:
    """The part of the page where the person stands."""
    tab.picture(folder / "page.png")
    return np.asarray(Image.open(folder / "page.png").convert("RGB")).astype(int)[:, 330:900]


def figure(tab: browser.Browser, folder: Path) -> float:
    """Share of the picture that is neither paper nor the ground; 0 if hardly any is."""
    seen = pixels(tab, folder)
    return drawn((np.ptp(seen, axis=2) > 12) | (seen.max(axis=2) < 120))


def all_blue(tab: browser.Browser, folder: Path) -> bool:
    """Whether there is a figure, and most of it is blue."""
    seen = pixels(tab, folder)
    return drawn(seen[..., 2] > seen[..., 0] + 25) > 0.5 * figure(tab, folder) > 0


def drawn(there: np.ndarray) -> float:
    return float(there.mean()) if there.mean() > 0.03 else 0.0


def test_the_command_serves_until_it_is_stopped(model: tuple[Path, Path]) -> None:
    options = ["--weights", str(model[0]), "--body", str(model[1]), "--resolution", "64", "--port", "8790"]
    code = "from avatargen.commands.main import main; import sys; sys.exit(main(sys.argv[1:]))"
    command = [sys.executable, "-c", code, "view", *options]
    pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL, "text": True}
    with subprocess.Popen(command, cwd=PROJECT, **pipes) as run:
        assert run.stdout is not None
        address = run.stdout.readline().strip()
        assert address.startswith("http://127.0.0.1:87")
        with urlopen(address, timeout=20) as answer:
            assert b"<html" in answer.read()
        time.sleep(0.2)
        run.send_signal(signal.SIGTERM)
        assert run.wait(30) == 128 + signal.SIGTERM
        assert run.stdout.read() == ""


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["--seed", "-3"], "--seed: found '-3'"),
        (["--port", "0"], "--port: found '0'"),
        (["--host", "203.0.113.7"], "found --host 203.0.113.7, where nothing can be served"),
        (["--weights", "none.safetensors"], "found no file none.safetensors"),
    ],
)
def test_bad_arguments_end_in_one_line(
    arguments: list[str], line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    handler = signal.getsignal(signal.SIGTERM)
    assert view.main(arguments) == 2
    signal.signal(signal.SIGTERM, handler)
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert line in err


def test_without_the_extra_one_line_says_how_to_get_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("avatargen.extras.find_spec", lambda name: None)
    handler = signal.getsignal(signal.SIGTERM)
    assert view.main([]) == 2
    signal.signal(signal.SIGTERM, handler)
    assert "pip install 'avatargen[view]'" in capsys.readouterr().err
