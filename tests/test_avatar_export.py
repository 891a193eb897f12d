"""The main job through the real command: on a small untrained model built here, and on the shipped weights.

The untrained generator's residual is zero, so its people are the naked body: enough for every stage.
"""

import json
import os
import resource
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib
import pytest
import trimesh

import exporters
from avatargen import __version__
from avatargen.body.joints import SMPLH_JOINT_NAMES
from avatargen.body.load import save_body
from avatargen.body.model import canonical_body
from avatargen.commands.export import avatar_export, options
from avatargen.errors import InputError
from avatargen.export import one
from avatargen.generator.checkpoint import save_checkpoint
from avatargen.generator.config import DEBUG, for_body
from avatargen.generator.generator import AvatarGenerator
from exporters.check_usd import check_usd
from tests.bodies import capsule_body
from tests.verdicts import khronos_issues

PROJECT = Path(__file__).parents[1]
SMALL = ["--resolution", "96", "--faces", "2000", "--texture", "128"]


@dataclass(frozen=True)
class Model:
    """An untrained generator on a capsule figure, as files."""

    weights: Path
    body: Path
    hash: str

    @property
    def options(self) -> list[str]:
        return ["--weights", str(self.weights), "--body", str(self.body), *SMALL]


@pytest.fixture(scope="session")
def model(tmp_path_factory: pytest.TempPathFactory) -> Model:
    folder = tmp_path_factory.mktemp("model")
    body = capsule_body()
    save_body(body, folder / "body.npz")
    generator = AvatarGenerator(for_body(DEBUG, canonical_body(body)))
    weights_hash = save_checkpoint(generator, folder / "debug.safetensors", {"licence": "CC0-1.0"})
    return Model(weights=folder / "debug.safetensors", body=folder / "body.npz", hash=weights_hash)


@pytest.fixture(autouse=True)
def in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    handler = signal.getsignal(signal.SIGTERM)
    yield
    signal.signal(signal.SIGTERM, handler)


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "avatargen.commands.export.avatar_export", *arguments]


def outside() -> dict[str, str]:
    return os.environ | {"PYTHONPATH": str(PROJECT)}


def check_file(path: Path, faces: int, texture: int) -> Any:
    """One closed, outward mesh of the size asked for, with its texture."""
    scene = trimesh.load_scene(path, process=False)
    meshes: list[Any] = scene.dump()
    assert len(meshes) == 1
    mesh = meshes[0]
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    assert mesh.is_volume
    assert mesh.body_count == 1
    assert abs(len(mesh.faces) - faces) <= 0.02 * faces
    assert mesh.visual.material.baseColorTexture.size == (texture, texture)
    return pygltflib.GLTF2.load_binary(path)


def test_seed_to_file_with_report_and_preview(model: Model, capsys: pytest.CaptureFixture[str]) -> None:
    extras = ["--report", "a.json", "--preview", "a.png"]
    assert avatar_export.main(["--seed", "3", "--out", "a.glb", *extras, *model.options]) == 0
    out, err = capsys.readouterr()
    assert out.splitlines()[-1] == "a.glb"
    assert err.count("\n") == 1  # no progress in a pipe: only the closing line
    assert err.startswith("a.glb: ")

    assert sorted(os.listdir()) == ["a.glb", "a.json", "a.png"]
    document = check_file(Path("a.glb"), faces=2000, texture=128)
    assert khronos_issues(Path("a.glb"))["messages"] == []
    report = json.loads(Path("a.json").read_text())
    assert document.asset.extras["seed"] == report["seed"] == 3
    assert document.asset.extras["weights_hash"] == report["weights_hash"] == model.hash
    assert document.asset.extras["version"] == report["version"] == __version__
    assert report["path"] == "a.glb"
    assert report["bytes"] == Path("a.glb").stat().st_size
    assert report["faces"] * 3 == document.accessors[document.meshes[0].primitives[0].indices].count
    seconds = report["seconds"]
    assert seconds["total"] >= max(seconds.values())
    assert sum(seconds.values()) - seconds["total"] <= seconds["total"] + 0.1
    assert 0 <= report["error_mm"]["mean"] <= report["error_mm"]["p99"] <= report["error_mm"]["max"] < 30
    assert 0 <= report["missed_mm"]["mean"] <= report["missed_mm"]["p99"] <= report["missed_mm"]["max"] < 30
    assert isinstance(report["left_out"], list)
    assert report["settings"]["resolution"] == 96
    assert Path("a.png").read_bytes()[:4] == b"\x89PNG"


def test_quiet_says_the_path_and_what_went_wrong(model: Model, capsys: pytest.CaptureFixture[str]) -> None:
    assert avatar_export.main(["3", "--quiet", *model.options]) == 0
    assert capsys.readouterr() == ("avatar_3.glb\n", "")
    assert avatar_export.main(["3", "--quiet", *model.options, "--pose", "none"]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)


def test_a_drawn_seed_is_said_and_makes_the_same_person_again(
    model: Model, capsys: pytest.CaptureFixture[str]
) -> None:
    assert avatar_export.main(["random", "--out", "a.glb", *model.options]) == 0
    drawn = capsys.readouterr().err.splitlines()[0]
    assert (drawn.split()[0], drawn.split()[2:]) == ("seed", ["was", "drawn"])
    assert avatar_export.main(["--seed", drawn.split()[1], "--out", "b.glb", *model.options]) == 0
    assert Path("a.glb").read_bytes() == Path("b.glb").read_bytes()


def test_every_format_from_the_command(model: Model, capsys: pytest.CaptureFixture[str]) -> None:
    """The command knows what `exporters` writes; the report names every file, the last line one."""
    assert {f".{name}" for name in options.FORMATS} == set(exporters.FORMATS)
    arguments = ["--seed", "3", "--format", "USDA", "--report", "r.json", "--preview", "avatar_3.png"]
    assert avatar_export.main([*arguments, *model.options]) == 0
    assert capsys.readouterr().out == "avatar_3.usda\n"
    written = {"avatar_3.usda", "avatar_3_base_color.png"}
    assert set(os.listdir()) == {*written, "r.json", "avatar_3.png"}
    report = json.loads(Path("r.json").read_text())
    assert set(report["files"]) == written
    assert report["bytes"] == sum(Path(name).stat().st_size for name in written)
    assert check_usd(Path("avatar_3.usda")) == []


def test_a_format_gets_what_it_can_hold_in_the_pose_it_wants(
    model: Model, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, content, pose in (("person.vrm", "rigged", "t"), ("person.stl", "mesh", "a")):
        assert avatar_export.main(["--seed", "3", "--out", name, "--report", "r.json", *model.options]) == 0
        settings = json.loads(Path("r.json").read_text())["settings"]
        assert (settings["content"], settings["pose"]) == (content, pose)
        assert ("in the T-pose that .vrm wants" in capsys.readouterr().err) == (name == "person.vrm")
    codes = {message["code"] for message in khronos_issues(Path("person.vrm"))["messages"]}
    assert codes == {"UNSUPPORTED_EXTENSION"}  # VRM's own
    assert trimesh.load_mesh("person.stl").is_volume


def test_a_file_beside_that_cannot_be_written_stops_it_all(
    model: Model, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("avatar_3_base_color.png").mkdir()
    assert avatar_export.main(["--seed", "3", "--format", "usdc", *model.options]) == 2
    assert "cannot write avatar_3_base_color.png: it is a folder" in capsys.readouterr().err
    assert os.listdir() == ["avatar_3_base_color.png"]


def test_default_name_same_bytes_and_poses(model: Model, capsys: pytest.CaptureFixture[str]) -> None:
    np.savez("zeros.npz", pose=np.zeros((24, 3), np.float32))
    assert avatar_export.main(["--seed", "7", *model.options]) == 0
    assert capsys.readouterr().out == "avatar_7.glb\n"
    for name, pose in (("again", "a"), ("t", "t"), ("zeros", "zeros.npz"), ("x", "x")):
        assert (
            avatar_export.main(["--seed", "7", "--pose", pose, "--out", f"{name}.glb", *model.options]) == 0
        )
    files = {name: Path(f"{name}.glb").read_bytes() for name in ("avatar_7", "again", "t", "zeros", "x")}

    assert files["avatar_7"] == files["again"]
    assert files["t"] == files["zeros"]
    assert len({files["again"], files["t"], files["x"]}) == 3


def test_python_does_what_the_command_does(model: Model) -> None:
    import assets
    import avatargen

    assert avatar_export.main(["--seed", "5", "--out", "command.glb", *model.options]) == 0
    avatar = avatargen.load_generator(model.weights, body=model.body).sample(seed=5)
    asset = assets.build(avatar, assets.BuildConfig(resolution=96, faces=2000, texture=128))
    exporters.export(asset, "python.glb")
    assert Path("python.glb").read_bytes() == Path("command.glb").read_bytes()

    build = assets.BuildConfig(resolution=96, faces=2000, texture=128)
    request = avatargen.ExportRequest(
        seeds=5, weights=model.weights, body=model.body, build=build, out=Path("request.glb")
    )
    exported = avatargen.export_avatar(request)
    assert exported.path.read_bytes() == Path("command.glb").read_bytes()
    assert exported.bytes == Path("request.glb").stat().st_size
    before = sorted(os.listdir())
    for other in (replace(request, dry_run=True), replace(request, seeds=range(2), out=Path("many"))):
        with pytest.raises(InputError, match="wanted one seed"):
            avatargen.export_avatar(other)
    with pytest.raises(InputError, match="wanted many"):
        avatargen.export_many(request)
    assert sorted(os.listdir()) == before


def test_levels_of_detail_in_one_flawless_file(model: Model, capsys: pytest.CaptureFixture[str]) -> None:
    path, report = Path("levels.glb"), Path("levels.json")
    options = [option for option in model.options if option not in ("--faces", "2000")]
    arguments = ["--seed", "3", *options, "--lods", "2000,800,300", "--morphs", "--out", str(path)]
    assert avatar_export.main([*arguments, "--report", str(report)]) == 0
    capsys.readouterr()
    document = pygltflib.GLTF2().load(str(path))
    assert document is not None
    indices = [mesh.primitives[0].indices for mesh in document.meshes]
    counts = [document.accessors[index].count // 3 for index in indices if index is not None]

    assert counts == pytest.approx([2000, 800, 300], rel=0.02)
    facts = json.loads(report.read_text())
    assert [level["faces"] for level in facts["levels"]] == counts[1:]
    means = [facts["error_mm"]["mean"], *(level["error_mm"]["mean"] for level in facts["levels"])]
    assert means == sorted(means)
    issues = khronos_issues(path)
    assert (issues["numErrors"], issues["numWarnings"]) == (0, 0)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--lods", "300,2000"], "falling numbers"),
        (["--lods", "2000,50"], "falling numbers"),
        (["--lods", "2000,x"], "falling numbers"),
        (["--lods", "2000,300"], "leave out --faces"),
        (["--lods", "2000,300", "--format", "usdz"], "one level of detail"),
    ],
)
def test_levels_that_cannot_be(
    model: Model, capsys: pytest.CaptureFixture[str], options: list[str], said: str
) -> None:
    kept = ("--weights", "--body") if said != "leave out --faces" else ("--weights", "--body", "--faces")
    pairs = zip(model.options[::2], model.options[1::2], strict=True)
    given = [part for name, value in pairs if name in kept for part in (name, value)]
    assert avatar_export.main(["--seed", "3", *given, *options]) == 2
    assert said in capsys.readouterr().err
    assert not list(Path().glob("avatar_3*"))


def test_clips_motion_files_names_and_sliders(model: Model, capsys: pytest.CaptureFixture[str]) -> None:
    poses = np.zeros((40, 156))
    poses[:, 0] = np.pi / 2
    poses[7:9] = np.nan
    np.savez("take.npz", poses=poses, trans=np.zeros((40, 3)), mocap_framerate=np.array(60.0))
    moves = ["--clip", "walk", "--clip", "idle", "--motion", "take.npz", "--mirror", "--in-place"]
    rig = ["--speed", "2", "--names", "unity", "--morphs", "--report", "a.json", "--out", "a.glb"]
    assert avatar_export.main(["--seed", "3", *moves, *rig, *model.options]) == 0

    err = capsys.readouterr().err.splitlines()
    assert err[0] == "take: 2 bad frames, filled from their neighbours: 7-8"
    document = check_file(Path("a.glb"), faces=2000, texture=128)
    assert khronos_issues(Path("a.glb"))["messages"] == []
    assert [animation.name for animation in document.animations] == ["walk", "idle", "take"]
    assert {"Hips", "LeftUpperLeg"} <= {node.name for node in document.nodes}
    assert document.meshes[0].extras["targetNames"] == [f"beta_{index}" for index in range(10)]
    told = json.loads(Path("a.json").read_text())["animations"]
    assert [row["name"] for row in told] == ["walk", "idle", "take"]
    assert [row["bad_frames"] for row in told] == [[], [], [7, 8]]
    assert [row["seconds"] for row in told] == [pytest.approx(s, abs=1e-3) for s in (16 / 30, 2.0, 39 / 120)]


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["--clip", "walk", "--clip", "walk"], "found animations walk, walk; give each once"),
        (["--format", "stl", "--bones", "world"], "found --bones world, but what is made holds no skeleton"),
        (["--format", "obj", "--joints", "moving"], "found --joints moving, but what is made holds no"),
        (["--format", "ply", "--joints", "24"], "found --joints 24, but what is made holds no skeleton"),
        (["--mirror"], "--mirror or --in-place without an animation; give --clip or --motion too"),
        (["--fps", "24"], "found --fps, --speed"),
        (["--motion-up", "y"], "found --motion-up without a motion"),
        (["--out", "x.gltf", "--report", "x.bin"], "two are the same file"),
        (["--out", "x.vrm", "--preview", "x.png", "--report", "x.vrma"], "two are the same file"),
        (["--format", "stl", "--clip", "walk"], "what is made holds no skeleton (mesh); leave out --clip"),
        (["--motion", "noise.npz"], "motion: noise.npz is no whole .npz file"),
        (["--format", "fbx"], "--format: found 'fbx', wanted one of glb"),
        (["--format", "../x"], "--format: found '../x', wanted one of glb"),
        (["--out", "a.fbx"], "found --out a.fbx, wanted a name that ends in one of .glb"),
        (["--out", "a.usda", "--format", "glb"], "give a name that ends in .glb"),
        (["--pose", "handstand"], "found --pose handstand, wanted one of x, t, a or an .npz file"),
        (["--pose", "noise"], "noise"),
        (["--format", "vrm", "--pose", "a"], "found --pose a, but this format rests in pose t"),
        (["--weights", "noise"], "noise is no whole safetensors file"),
        (["--weights", "cut"], "cut"),
        (["--weights", "wild"], "NaN or infinite"),
        (["--body", "noise.npz"], "noise.npz"),
        (["--device", "quantum"], "found --device quantum, which does not work here"),
        (["--device", "cuda:99"], "found --device cuda:99, which does not work here"),
    ],
)
def test_bad_input_is_one_line_and_no_file(
    model: Model, arguments: list[str], line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("noise").write_bytes(np.random.default_rng(0).bytes(4000))
    Path("noise.npz").write_bytes(np.random.default_rng(0).bytes(4000))
    Path("cut").write_bytes(model.weights.read_bytes()[:-1000])
    if "wild" in arguments:
        write_wild_weights(model)
    Path("avatar_3.glb").write_bytes(b"mine")
    before = sorted(os.listdir())

    assert avatar_export.main(["--seed", "3", "--report", "r.json", *model.options, *arguments]) == 2

    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert err.startswith("avatar-export: ")
    assert line in err
    assert sorted(os.listdir()) == before
    assert Path("avatar_3.glb").read_bytes() == b"mine"


def write_wild_weights(model: Model) -> None:
    """Finite weights whose field is not: the residual's row overflows."""
    from avatargen.generator.checkpoint import load_checkpoint

    generator = load_checkpoint(model.weights).generator
    for parameter in generator.decoder.parameters():
        parameter.data.fill_(3e38)
    save_checkpoint(generator, "wild")


@pytest.mark.parametrize("stage", ["build_content", "write_together"])
def test_interruption_leaves_what_was_there(
    model: Model, stage: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(one, stage, interrupt)
    Path("avatar_3.glb").write_bytes(b"mine")
    assert avatar_export.main(["--seed", "3", "--report", "r.json", *model.options]) == 130
    assert capsys.readouterr() == ("", "avatar-export: interrupted; nothing is half written\n")
    assert os.listdir() == ["avatar_3.glb"]
    assert Path("avatar_3.glb").read_bytes() == b"mine"


def test_full_disk_leaves_what_was_there(model: Model) -> None:
    """A real process whose files may not grow beyond 20 kB."""
    Path("avatar_3.glb").write_bytes(b"mine")

    def fill_disk() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))

    run = subprocess.run(
        command("--seed", "3", "--report", "r.json", *model.options),
        env=outside(),
        preexec_fn=fill_disk,
        capture_output=True,
        text=True,
    )
    assert run.returncode == 2
    assert run.stderr.startswith("avatar-export: cannot write avatar_3.glb: File too large")
    assert run.stderr.count("\n") == 1
    assert os.listdir() == ["avatar_3.glb"]
    assert Path("avatar_3.glb").read_bytes() == b"mine"


def test_terminated_process_leaves_nothing(model: Model) -> None:
    with subprocess.Popen(command("--seed", "3", *model.options), env=outside(), stderr=-1, stdout=-1) as run:
        time.sleep(1.0)  # in the middle of loading or building
        run.send_signal(signal.SIGTERM)
        out, _ = run.communicate()
    assert run.returncode in (143, -signal.SIGTERM)
    assert out == b""
    assert os.listdir() == []


def test_shipped_weights_from_seed_to_flawless_file() -> None:
    """The README's own command, defaults throughout, twice."""
    runs = []
    for name in ("first", "second"):
        arguments = ["--seed", "3", "--format", "glb", "--out", f"{name}.glb", "--report", f"{name}.json"]
        run = subprocess.run(command(*arguments), env=outside(), capture_output=True, text=True)
        assert run.returncode == 0, run.stderr
        assert run.stdout.splitlines()[-1] == f"{name}.glb"
        runs.append(Path(f"{name}.glb").read_bytes())
    report = json.loads(Path("first.json").read_text())

    assert runs[0] == runs[1]
    document = check_file(Path("first.glb"), faces=20000, texture=1024)
    assert khronos_issues(Path("first.glb"))["messages"] == []
    assert [document.nodes[joint].name for joint in document.skins[0].joints] == list(SMPLH_JOINT_NAMES)
    assert report["error_mm"]["mean"] <= 0.2
    assert report["error_mm"]["p99"] <= 1.0
    low, high = trimesh.load_scene(Path("first.glb")).bounds[:, 1]
    assert 1.2 < high - low < 2.3
