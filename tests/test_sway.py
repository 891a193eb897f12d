"""A skirt on springs: still at rest, swung by three-vrm off the legs, put by clips where cloth was."""

import json
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import igl
import numpy as np
import pygltflib
import pytest
import torch

from assets.asset.animate import animate
from assets.asset.asset import Asset
from assets.asset.bones import aim_bones
from assets.asset.chains import AROUND, LINKS
from assets.asset.root_bone import with_root
from assets.asset.spring import Spring
from assets.asset.sway import add_springs
from assets.errors import GeometryError
from assets.skin.skin import limit_influences
from avatargen.avatar import shipped
from avatargen.body.load import load_body
from avatargen.body.model import canonical_body
from exporters import export, vrm
from exporters.check_vrm import check_vrm
from tests.test_bones import body_asset
from tests.test_twist import motion
from tests.test_vrm import type_errors
from tests.verdicts import AGREE, ask_node, blender_verdict, khronos_issues, our_vertices, random_poses

ROWS, COLUMNS = 24, 48
BETAS = np.zeros(10)


@cache
def body():
    return canonical_body(load_body(shipped("body.npz")))


@cache
def body_on_ground() -> Asset:
    asset = aim_bones(body_asset(rest="t"))
    lift = np.array([0.0, -asset.vertices[:, 1].min(), 0.0])
    frames = asset.skeleton.T_world_joint.copy()
    frames[:, :3, 3] += lift
    skeleton = replace(asset.skeleton, T_world_joint=frames)
    return replace(asset, vertices=(asset.vertices + lift).astype(np.float32), skeleton=skeleton, welded=None)


def extended(
    asset: Asset, vertices: np.ndarray, faces: np.ndarray, joints: np.ndarray, weights: np.ndarray
) -> Asset:
    """The asset with more vertices, after its own."""
    W = len(asset.vertices)
    return replace(
        asset,
        vertices=np.concatenate([asset.vertices, vertices]).astype(np.float32),
        normals=np.tile(np.array([0, 1, 0], np.float32), (W + len(vertices), 1)),
        uv=np.zeros((W + len(vertices), 2), np.float32),
        faces=np.concatenate([asset.faces, faces + W]),
        joints=np.concatenate([asset.joints, joints]),
        weights=np.concatenate([asset.weights, weights]),
    )


@cache
def skirted(length: float = 0.5, flare: float = 0.35) -> Asset:
    """The default body in the T-pose, on the ground, and a cone from its hips down, the last vertices."""
    asset = body_on_ground()
    names, joints = asset.skeleton.joint_names, asset.skeleton.joints
    hips = joints[names.index("left_hip")]
    turn = np.linspace(0, 2 * np.pi, COLUMNS, endpoint=False)
    down = np.linspace(-0.02, length, ROWS)
    radius = 0.215 + flare * np.maximum(down, 0)
    cone = np.stack(
        [
            np.outer(radius, np.sin(turn)),
            np.repeat(hips[1] - down, COLUMNS).reshape(ROWS, -1),
            hips[2] - 0.01 + np.outer(0.85 * radius, np.cos(turn)),
        ],
        axis=-1,
    ).reshape(-1, 3)
    row, column = np.divmod(np.arange((ROWS - 1) * COLUMNS), COLUMNS)
    a, b = row * COLUMNS + column, row * COLUMNS + (column + 1) % COLUMNS
    faces = np.concatenate([np.stack([a, a + COLUMNS, b], 1), np.stack([b, a + COLUMNS, b + COLUMNS], 1)])
    weights = np.zeros((len(cone), len(names)))
    leg = np.clip(np.repeat(down, COLUMNS) / 0.1, 0, 1)
    left = np.clip(0.5 + cone[:, 0] / 0.3, 0, 1)
    weights[:, 0] = 1 - leg
    weights[:, [names.index("left_hip"), names.index("right_hip")]] = np.stack(
        [leg * left, leg * (1 - left)], 1
    )
    skin = limit_influences(weights)
    return extended(asset, cone, faces, skin.joints, skin.weights)


@cache
def swaying(length: float = 0.5) -> Asset:
    return add_springs(skirted(length), body(), BETAS, {})


def cone_of(asset: Asset) -> np.ndarray:
    return np.arange(len(asset.vertices) - ROWS * COLUMNS, len(asset.vertices))


def test_chains_hang_on_their_thigh_and_nothing_else_changes() -> None:
    before, asset = skirted(), swaying()
    skeleton, names = asset.skeleton, asset.skeleton.joint_names
    assert len(asset.springs) == AROUND and all(2 <= len(s.joints) - 1 <= LINKS for s in asset.springs)
    for number, spring in enumerate(asset.springs):
        side = "left" if number < AROUND / 2 else "right"
        chain = [names[joint] for joint in spring.joints]
        assert names[skeleton.parents[spring.joints[0]]] == f"{side}_hip"
        assert chain == [f"skirt_{number + 1}_{n + 1}" for n in range(len(chain) - 1)] + [
            f"skirt_{number + 1}_end"
        ]
        assert (skeleton.parents[spring.joints[1:]] == spring.joints[:-1]).all()
        places = skeleton.joints[spring.joints]
        assert (np.diff(places[:, 1]) < -0.05).all() and (places[:, 0] > 0).all() == (side == "left")
        assert not (asset.weights[asset.joints == spring.joints[-1]] > 0).any()
    body_rows = np.arange(len(asset.vertices) - ROWS * COLUMNS)
    assert np.array_equal(asset.weights[body_rows], before.weights[body_rows])
    assert np.array_equal(asset.vertices, before.vertices)
    moved = (asset.weights * (asset.joints >= len(before.skeleton.parents))).sum(axis=1)[cone_of(asset)]
    hem = moved.reshape(ROWS, COLUMNS)[-8:]
    assert hem.min() > 0.99 and moved.reshape(ROWS, COLUMNS)[0].max() == 0


def test_left_and_right_are_alike() -> None:
    joints = [swaying().skeleton.joints[spring.joints] for spring in swaying().springs]
    for left, right in zip(joints[: AROUND // 2], joints[: AROUND // 2 - 1 : -1], strict=True):
        assert np.abs(left * [-1, 1, 1] - right).max() < 0.02


def test_without_a_skirt_there_are_none() -> None:
    """Of somebody bare, and of a skirt whose legs have other names."""
    bare = aim_bones(body_asset(rest="t"))
    assert add_springs(bare, body(), BETAS, {}) is bare
    names = tuple(f"joint_{number}" for number in range(len(bare.skeleton.parents)))
    nameless = replace(skirted(), skeleton=replace(skirted().skeleton, joint_names=names))
    assert add_springs(nameless, body(), BETAS, {}) is nameless


def test_colliders_keep_off_what_rests() -> None:
    asset = swaying()
    assert len(asset.colliders) == 17
    for each in asset.colliders:
        frame = asset.skeleton.T_world_joint[each.joint]
        start, stop = (frame[:3, :3] @ point + frame[:3, 3] for point in (each.offset, each.tail))
        assert 0.02 <= each.radius < 0.2
        for spring in asset.springs:
            for place in asset.skeleton.joints[spring.joints[1:]]:
                t = np.clip((place - start) @ (stop - start) / ((stop - start) @ (stop - start)), 0, 1)
                assert np.linalg.norm(place - start - t * (stop - start)) > each.radius + spring.radius - 1e-6


def test_vrm_holds_them_soundly(tmp_path: Path) -> None:
    asset = swaying()
    export(asset, tmp_path / "person.vrm")
    issues = khronos_issues(tmp_path / "person.vrm")
    assert (issues["numErrors"], issues["numWarnings"]) == (0, 0)
    assert check_vrm(tmp_path / "person.vrm") == []
    for rooted in (False, True):
        document: Any = pygltflib.GLTF2.load_from_bytes(vrm.encode(with_root(asset) if rooted else asset))
        assert document.extensionsUsed == ["VRMC_vrm", "VRMC_springBone"]
        found = document.extensions["VRMC_springBone"]
        assert len(found["springs"]) == AROUND and len(found["colliders"]) == 17
        chains = [[document.nodes[j["node"]].name for j in spring["joints"]] for spring in found["springs"]]
        assert chains[0][0] == "skirt_1_1" and chains[-1][-1] == "skirt_8_end"
        assert {document.nodes[each["node"]].name for each in found["colliders"]} == {
            *(f"{side}_{joint}" for side in ("left", "right") for joint in ("hip", "knee")),
            *("pelvis", "spine1", "spine2", "spine3", "neck"),
        }
    kind = ("VRMCSpringBone", "types-vrmc-springbone-1.0")
    assert type_errors(tmp_path, found, *kind) == ""


def swung(asset: Asset, frames: list[dict], folder: Path) -> np.ndarray:
    """The cone's places [T n 3] as three-vrm swings them, off the person's own place."""
    export(asset, folder / "person.vrm")
    (folder / "moves.json").write_text(json.dumps({"frames": frames, "vertices": cone_of(asset).tolist()}))
    found = ask_node("spring_check.mjs", "@pixiv/three-vrm", folder / "person.vrm", folder / "moves.json")
    assert len(found["joints"]) >= len(asset.springs)
    places = np.array(found["places"]).reshape(len(frames), -1, 3)
    return places - np.array([frame["place"] for frame in frames])[:, None]


@pytest.mark.parametrize("length", [0.35, 0.5, 0.75])
def test_three_vrm_lets_the_hem_lag_and_come_to_rest_off_the_legs(tmp_path: Path, length: float) -> None:
    """The person goes 1.2 m forward in a second, from a standstill to a standstill, and waits two more."""
    asset = swaying(length)
    time = np.arange(195) / 60
    way = 1.2 * np.clip(time - 0.25, 0, 1)
    found = swung(asset, [{"place": [0, 0, z], "turns": {}} for z in way.tolist()], tmp_path)
    rest = asset.vertices[cone_of(asset)]
    off = np.linalg.norm(found - rest, axis=2)
    hem = np.arange((ROWS - 1) * COLUMNS, ROWS * COLUMNS)
    assert off[10].max() < 0.006  # it stands still before
    assert off[:, hem].max() > 0.03 and np.median(found[60, hem, 2] - rest[hem, 2]) < -0.02  # it lags behind
    assert off[:, hem].max() < 0.2 * length + 0.05
    assert off[-1].max() < 0.006  # and comes to rest
    legs = asset.vertices[: -ROWS * COLUMNS].astype(np.float64)
    faces = asset.faces[(asset.faces < len(legs)).all(axis=1)]
    for frame in (40, 60, 75, 80, 90):
        depth: Any = igl.signed_distance(np.ascontiguousarray(found[frame]), legs, faces)
        assert depth[0].min() > -0.004, frame


def test_three_vrm_keeps_the_legs_inside_as_they_swing(tmp_path: Path) -> None:
    """Thighs swing by 25 degrees: no more cloth is in them than of cloth that has weights of the thighs."""
    asset = swaying()
    angles = np.radians(25) * np.sin(2 * np.pi * np.arange(90) / 60)
    quaternions = [[float(np.sin(x / 2)), 0.0, 0.0, float(np.cos(x / 2))] for x in angles]
    frames = [
        {"place": [0, 0, 0], "turns": {"leftUpperLeg": q, "rightUpperLeg": [-q[0], *q[1:]]}}
        for q in quaternions
    ]
    found = swung(asset, frames, tmp_path)
    before = skirted()
    turns = {"left_hip": np.outer(angles, [1, 0, 0]), "right_hip": np.outer(-angles, [1, 0, 0])}
    (clip,) = animate(before, [motion(before, turns)], on_ground=False).animations
    faces = before.faces[(before.faces < cone_of(before)[0]).all(axis=1)]
    for frame in (15, 45, 75):
        posed = our_vertices(before, clip.T_posed_rest(before.skeleton)[frame])
        legs = np.ascontiguousarray(posed[: -ROWS * COLUMNS])
        depth: Any = igl.signed_distance(np.ascontiguousarray(found[frame]), legs, faces)
        plain: Any = igl.signed_distance(np.ascontiguousarray(posed[-ROWS * COLUMNS :]), legs, faces)
        assert depth[0].min() > min(plain[0].min(), 0.0) - 0.005, frame


def test_clips_put_the_chains_where_cloth_without_them_would_be() -> None:
    before, asset = skirted(), swaying()
    turns = {
        "left_hip": np.outer(np.linspace(0, 0.6, 5), [-1.0, 0.2, 0.1]),
        "right_hip": np.outer(np.linspace(0, 0.3, 5), [1.0, 0.0, 0.0]),
        "pelvis": np.outer(np.linspace(0, 0.5, 5), [0.0, 1.0, 0.0]),
    }
    (plain,), (clip,) = (
        animate(each, [motion(each, turns)], on_ground=False).animations for each in (before, asset)
    )
    wanted = plain.T_posed_rest(before.skeleton)
    found = clip.T_posed_rest(asset.skeleton)
    still = np.abs(our_vertices(asset, found[0]) - asset.vertices).max()
    assert still < 0.002
    off = np.linalg.norm(our_vertices(asset, found[-1]) - our_vertices(before, wanted[-1]), axis=1)
    assert np.percentile(off[cone_of(asset)], 90) < 0.05 and off.max() < 0.12
    assert np.abs(off[: -ROWS * COLUMNS]).max() < 1e-6


@dataclass(frozen=True)
class Sheet:
    """A layer of hair: the plane that the strands lie in, metres."""

    z: float

    def sdf(self, points: torch.Tensor) -> torch.Tensor:
        return points[:, 2] - self.z


@cache
def haired() -> Asset:
    """The default body with a sheet of hair that hangs down its back, the last vertices."""
    asset = body_on_ground()
    names, joints = asset.skeleton.joint_names, asset.skeleton.joints
    skull = joints[names.index("head")]
    behind = float(asset.vertices[np.abs(asset.vertices[:, 1] - 1.2) < 0.15, 2].min()) - 0.02
    x, y = np.meshgrid(np.linspace(-0.09, 0.09, COLUMNS), np.linspace(0.02, -0.4, ROWS) + skull[1])
    sheet = np.stack([x, y, np.full_like(x, behind)], axis=-1).reshape(-1, 3)
    row, column = np.divmod(np.arange((ROWS - 1) * (COLUMNS - 1)), COLUMNS - 1)
    a = row * COLUMNS + column
    faces = np.concatenate(
        [np.stack([a, a + 1, a + COLUMNS], 1), np.stack([a + 1, a + COLUMNS + 1, a + COLUMNS], 1)]
    )
    on = np.zeros((len(sheet), 4), np.int64)
    on[:, 0] = names.index("spine3")
    whole = extended(asset, sheet, faces, on, np.tile(np.eye(4, dtype=np.float32)[0], (len(sheet), 1)))
    return add_springs(replace(whole, canonical=whole.vertices), body(), BETAS, {"hair": Sheet(behind)})


@pytest.mark.parametrize("way", [1.2, -1.2])
def test_hair_lags_and_comes_to_rest_off_the_back(tmp_path: Path, way: float) -> None:
    asset = haired()
    names, parents = asset.skeleton.joint_names, asset.skeleton.parents
    assert [spring.name for spring in asset.springs] == ["hair_1", "hair_2", "hair_3"]
    assert {names[parents[spring.joints[0]]] for spring in asset.springs} == {"spine3"}
    time = np.arange(195) / 60
    places = way * np.clip(time - 0.25, 0, 1)
    found = swung(asset, [{"place": [0, 0, z], "turns": {}} for z in places.tolist()], tmp_path)
    rest = asset.vertices[cone_of(asset)]
    off = np.linalg.norm(found - rest, axis=2)
    assert off[10].max() < 0.004 and off[-1].max() < 0.004
    assert 0.01 < off.max() < 0.08
    inner = asset.vertices[: -ROWS * COLUMNS].astype(np.float64)
    faces = asset.faces[(asset.faces < len(inner)).all(axis=1)]
    for frame in (20, 40, 60, 80):
        depth: Any = igl.signed_distance(np.ascontiguousarray(found[frame]), inner, faces)
        assert depth[0].min() > -0.006, frame


def test_blender_sways_them(tmp_path: Path) -> None:
    asset = swaying()
    poses = random_poses(asset, count=2, angle=0.3)
    verdict = blender_verdict(asset, poses, tmp_path)
    for posed, transforms in zip(verdict.posed, poses, strict=True):
        assert np.abs(posed - our_vertices(asset, transforms)).max() < AGREE


def test_a_chain_needs_two_joints_in_order() -> None:
    spring = swaying().springs[0]
    with pytest.raises(GeometryError, match="parents first"):
        Spring(**{**vars(spring), "joints": spring.joints[::-1].copy()})
