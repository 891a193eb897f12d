"""python -m tests.formats_table [--seed 3] [--out FILE.md]: one avatar in every format before every judge.

Writes a table: what a format's files weigh, what encoding takes, and each judge's verdict. Engines bend the
avatar in random poses; their verdict is the largest distance of a vertex from our own skinning. Ends with an
error, and writes nothing, unless every verdict is good.
"""

import argparse
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import trimesh

import assets
import avatargen
from assets.asset.asset import Asset
from avatargen.atomic import write_atomically
from exporters import FORMATS, encode, export
from exporters.check_usd import check_usd
from tests.system_judges import ask_godot, assimp_scene
from tests.test_mesh_files import in_blender
from tests.usdskel import usdskel_vertices
from tests.verdicts import (
    AGREE,
    PROJECT,
    ask_engine,
    blender_verdict,
    check_blender,
    khronos_issues,
    our_vertices,
    random_poses,
)

GLTF, USD = (".glb", ".gltf", ".vrm"), (".usda", ".usdc", ".usdz")
VRM_UNKNOWN = "UNSUPPORTED_EXTENSION"  # Khronos' validator leaves VRM to VRM's own judges
TITLE = "# Formats before their judges"
ABOUT = """\
Micrometres are the largest distance of any vertex from our own skinning, in three random poses; for
formats without a skeleton, from the vertices that were written. With `.vrm`, three.js stands for three-vrm
too. Godot (version 3) and assimp come with the system: `.ci/run` installs them, and elsewhere they may be
missing. Seconds are the processor's, for one encoding. Made by `make formats`, which fails unless every
judge is content."""


@dataclass(frozen=True)
class Case:
    """An avatar in a file, and poses [P J 4 4] to bend it to."""

    asset: Asset
    poses: np.ndarray
    path: Path

    def distance(self, posed: np.ndarray) -> str:
        """Micrometres between posed vertices [P W 3] and ours.

        Raises:
            ValueError: they are beyond the limit.
        """
        ours = np.array([our_vertices(self.asset, transforms) for transforms in self.poses])
        return distance(posed, ours)


def distance(found: np.ndarray, ours: np.ndarray) -> str:
    largest = float(np.linalg.norm(found - ours, axis=-1).max())
    if not largest < AGREE:  # also catches NaN
        raise ValueError(f"a vertex is {1e6 * largest:.0f} µm off, limit {1e6 * AGREE:.0f} µm")
    return f"{1e6 * largest:.2f} µm"


def khronos(case: Case) -> str:
    issues = khronos_issues(case.path)
    left = [message for message in issues["messages"] if message["code"] != VRM_UNKNOWN]
    if left:
        raise ValueError(f"{case.path.name}: {left}")
    return "nothing to say"


def usd_validation(case: Case) -> str:
    if findings := check_usd(case.path):
        raise ValueError(f"{case.path.name}: {findings}")
    return "nothing to say"


def three(case: Case) -> str:
    found = ask_engine("three_check.mjs", "three", case.path, case.asset, case.poses)
    if (found["vrm"] is not None) != (case.path.suffix == ".vrm"):
        raise ValueError(f"{case.path.name}: three-vrm found {found['vrm']}")
    return case.distance(found["posed"])


def babylon(case: Case) -> str:
    return case.distance(
        ask_engine("babylon_check.cjs", "babylonjs", case.path, case.asset, case.poses)["posed"]
    )


def usdskel(case: Case) -> str:
    return case.distance(usdskel_vertices(case.path, case.poses))


def blender(case: Case) -> str:
    verdict = blender_verdict(case.asset, case.poses, case.path.parent, case.path.name)
    check_blender(verdict, case.asset, case.poses)
    return case.distance(verdict.posed)


def blender_shape(case: Case) -> str:
    found = in_blender(case.asset, case.path)
    up = found["vertices"][found["faces"]]
    if case.path.suffix == ".obj":  # Blender turns its y up to z
        up = np.stack([up[..., 0], up[..., 2], -up[..., 1]], axis=-1)
    return distance(up, case.asset.vertices[case.asset.faces].astype(np.float64))


def trimesh_shape(case: Case) -> str:
    mesh = trimesh.load_mesh(case.path, process=False, maintain_order=True)
    return distance(mesh.vertices[mesh.faces], case.asset.vertices[case.asset.faces])


def godot(case: Case) -> str:
    return case.distance(ask_godot(case.path, case.asset, case.poses).posed)


def assimp(case: Case) -> str:
    scene, names = assimp_scene(case.path), case.asset.skeleton.joint_names
    poses = [dict(zip(names, transforms, strict=True)) for transforms in case.poses]
    return case.distance(np.array([scene.posed(transforms) for transforms in poses]))


def assimp_shape(case: Case) -> str:
    scene = assimp_scene(case.path)
    return distance(scene.vertices[scene.faces], case.asset.vertices[case.asset.faces])


JUDGES: list[tuple[str, tuple[str, ...], Callable[[Case], str]]] = [
    ("Khronos' validator", GLTF, khronos),
    ("three.js", GLTF, three),
    ("Babylon.js", (".glb", ".gltf"), babylon),
    ("UsdValidation and more", USD, usd_validation),
    ("UsdSkel", USD, usdskel),
    ("Blender", (*GLTF, *USD), blender),
    ("Blender", (".obj", ".ply", ".stl"), blender_shape),
    ("Godot", (".glb",), godot),
    ("assimp", (".glb", ".gltf"), assimp),
    ("assimp", (".obj", ".ply", ".stl"), assimp_shape),
    ("trimesh", (".obj", ".ply", ".stl"), trimesh_shape),
]


def row(suffix: str, asset: Asset, poses: np.ndarray, folder: Path) -> list[str]:
    """One format's cells: files, size, seconds, verdicts by judge."""
    path = folder / f"avatar{suffix}"
    started = time.process_time()  # a busy machine does not change it
    count = len(encode(asset, path))
    seconds = time.process_time() - started
    size = export(asset, path)
    verdicts = dict.fromkeys((name for name, _, _ in JUDGES), "")
    for name, suffixes, judge in JUDGES:
        if suffix in suffixes:
            try:
                verdicts[name] = judge(Case(asset, poses, path))
            except pytest.skip.Exception:
                verdicts[name] = "not installed"
    cells = [f"`{suffix}`", str(count), f"{size / 1e6:.2f}", f"{seconds:.2f}"]
    return [*cells, *verdicts.values()]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--out", type=Path, default=PROJECT / "docs" / "formats.md")
    given = parser.parse_args()
    avatar = avatargen.load_generator().sample(given.seed)
    asset = assets.build(avatar, assets.BuildConfig(pose="t"))
    poses = random_poses(asset, count=3, angle=0.5)
    heads = ["format", "files", "MB", "seconds", *dict.fromkeys(name for name, _, _ in JUDGES)]
    rows = [heads, ["---"] * len(heads)]
    for suffix in FORMATS:
        with tempfile.TemporaryDirectory() as folder:
            rows.append(row(suffix, asset, poses, Path(folder)))
        print(rows[-1], flush=True)
    table = "\n".join(f"| {' | '.join(cells)} |" for cells in rows)
    facts = (
        f"Seed {given.seed}, {len(asset.faces):,} faces, a texture of {len(asset.texture)} texels, "
        f"{len(asset.skeleton.parents)} joints, in the T-pose."
    )
    write_atomically(given.out, f"{TITLE}\n\n{facts}\n{ABOUT}\n\n{table}\n".encode())
    print(given.out)


if __name__ == "__main__":
    main()
