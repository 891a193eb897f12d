"""Animations and sliders in GLB files: they read back, Khronos is silent and Blender plays them as we do."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from assets.asset.animate import animate, figure_of
from assets.asset.asset import Asset
from assets.asset.names import rename_joints
from assets.asset.rig import Animation, Morph
from avatargen.motion.clips import CLIPS, make_clip
from avatargen.motion.motion import mirrored, retimed
from exporters import export, glb
from tests.figures import random_motion
from tests.test_glb import load, read
from tests.tube import tube
from tests.verdicts import AGREE, blender_motion, khronos_issues, our_vertices
from tests.walker import walker


def swinging_tube(tilt: float = 0.3) -> Asset:
    """A tube that swings, holds still and swings again, and has two sliders."""
    asset = tube(rings=24, joint_count=4, tilt=tilt)
    motion = random_motion(30, names=asset.skeleton.joint_names, angle=0.3)
    rotations = motion.rotations.copy()
    rotations[10:20] = rotations[10]
    rotations[:, 2] = rotations[0, 2]  # one joint holds a turn all the time
    asset = animate(asset, [replace(motion, rotations=rotations)])
    rng = np.random.default_rng(0)
    sliders = tuple(
        Morph(
            name=f"beta_{index}",
            vertices=rng.normal(size=asset.vertices.shape).astype(np.float32) * np.float32(0.01),
            joints=np.zeros((4, 3)),
        )
        for index in range(2)
    )
    return replace(asset, morphs=sliders)


def sampled(document: Any, animation: Any, asset: Asset, times: np.ndarray) -> Animation:
    """The animation as a viewer samples it: keys joined by straight lines, other nodes at rest."""
    rest = asset.skeleton.T_parent_joint
    rotations = np.tile(Rotation.from_matrix(rest[:, :3, :3]).as_quat(), (len(times), 1, 1))
    root = np.tile(rest[0, :3, 3], (len(times), 1))
    for channel in animation.channels:
        sampler = animation.samplers[channel.sampler]
        keys, values = read(document, sampler.input), read(document, sampler.output)
        assert document.accessors[sampler.input].min == [keys[0]]
        assert document.accessors[sampler.input].max == [keys[-1]]
        columns = [np.interp(times, keys, values[:, c]) for c in range(values.shape[1])]
        if channel.target.path == "translation":
            assert channel.target.node == 0
            root = np.stack(columns, axis=1)
        else:
            turned = np.stack(columns, axis=1)
            rotations[:, channel.target.node] = turned / np.linalg.norm(turned, axis=1, keepdims=True)
    return Animation(name=animation.name, times=times, rotations=rotations, root=root)


@pytest.mark.parametrize("tilt", [0.0, 0.3])
def test_animations_read_back(tilt: float) -> None:
    asset = swinging_tube(tilt)
    document = load(glb.encode(asset))
    assert [animation.name for animation in document.animations] == ["random"]
    for encoded, ours in zip(document.animations, asset.animations, strict=True):
        found = sampled(document, encoded, asset, ours.times)
        theirs, wanted = found.T_world_joint(asset.skeleton), ours.T_world_joint(asset.skeleton)
        np.testing.assert_allclose(theirs, wanted, atol=1e-5)
        inputs = {sampler.input for sampler in encoded.samplers}
        assert len(inputs) == 3  # the root's way moves throughout; turns stand still; one joint always does


def test_an_animation_that_stays_at_rest_has_one_channel() -> None:
    asset = tube(joint_count=2)
    still = np.tile([0.0, 0.0, 0.0, 1.0], (5, 2, 1))
    motion = replace(
        random_motion(5, names=("pelvis", "spine1")), rotations=still, translation=np.zeros((5, 3))
    )
    document = load(glb.encode(animate(asset, [motion], on_ground=False)))
    assert len(document.animations[0].channels) == 1


def test_sliders_read_back_with_their_names() -> None:
    asset = swinging_tube()
    document = load(glb.encode(asset))
    mesh = document.meshes[0]
    assert mesh.weights == [0, 0]
    assert mesh.extras["targetNames"] == ["beta_0", "beta_1"]
    assert np.shape(mesh.extras["targetJointOffsets"]) == (2, 4, 3)
    for target, morph in zip(mesh.primitives[0].targets, asset.morphs, strict=True):
        index = target["POSITION"] if isinstance(target, dict) else target.POSITION
        np.testing.assert_array_equal(read(document, index), morph.vertices)


def test_files_without_motion_have_no_word_of_it() -> None:
    document = load(glb.encode(tube()))
    assert (document.animations, document.meshes[0].weights, document.meshes[0].extras) == ([], [], {})


@pytest.mark.parametrize(
    "asset", [swinging_tube(), swinging_tube(0.0)], ids=["turned joints", "plain joints"]
)
def test_khronos_has_nothing_to_say(tmp_path: Path, asset: Asset) -> None:
    export(asset, tmp_path / "tube.glb")
    assert khronos_issues(tmp_path / "tube.glb")["messages"] == []


def morphed(asset: Asset, weights: np.ndarray) -> Asset:
    """The asset with its sliders at these weights, by addition."""
    moved = asset.vertices.astype(np.float64)
    for morph, weight in zip(asset.morphs, weights, strict=True):
        moved = moved + weight * morph.vertices
    return replace(asset, vertices=moved.astype(np.float32))


def check_in_blender(asset: Asset, folder: Path, moments: int) -> None:
    """Vertices at random frames of every animation, at random slider weights, within AGREE of ours."""
    export(asset, folder / "asset.glb")
    rng = np.random.default_rng(0)
    chosen = [
        (animation, int(frame))
        for animation in asset.animations
        for frame in rng.choice(len(animation.times), size=moments, replace=False)
    ]
    weights = rng.uniform(-1.5, 1.5, (len(chosen), len(asset.morphs)))
    found = blender_motion(
        folder / "asset.glb",
        [animation.name for animation, _ in chosen],
        [float(animation.times[frame]) for animation, frame in chosen],
        [morph.name for morph in asset.morphs],
        weights,
    )
    for (animation, frame), row, theirs, length in zip(
        chosen, weights, found["vertices"], found["lengths"], strict=True
    ):
        T_posed_rest = animation.T_posed_rest(asset.skeleton)[frame]
        ours = our_vertices(morphed(asset, row), T_posed_rest)
        np.testing.assert_allclose(theirs, ours, atol=AGREE, err_msg=f"{animation.name} frame {frame}")
        assert length == pytest.approx(animation.times[-1], abs=1e-4)


def test_blender_plays_a_tube_as_we_do(tmp_path: Path) -> None:
    check_in_blender(swinging_tube(), tmp_path, moments=4)


def test_blender_plays_every_clip_on_a_person_with_sliders(tmp_path: Path) -> None:
    person = walker()
    figure = figure_of(person)
    motions = [make_clip(name, figure) for name in CLIPS]
    motions.append(retimed(mirrored(replace(random_motion(90), name="mirrored")), 30.0, speed=2.0))
    person = rename_joints(animate(person, motions), "mixamo")
    check_in_blender(person, tmp_path, moments=3)
    assert khronos_issues(tmp_path / "asset.glb")["messages"] == []


def with_a_face(asset: Asset) -> Asset:
    """The asset with shapes of a part of its mesh that say how its normals turn, the last of which does
    nothing."""
    rng = np.random.default_rng(1)
    part = np.arange(len(asset.vertices))[:, None] % 5 == 0
    shapes = [
        Morph(
            name=name,
            vertices=(part * rng.normal(size=asset.vertices.shape) * 0.01 * share).astype(np.float32),
            normals=(part * rng.normal(size=asset.vertices.shape) * 0.1 * share).astype(np.float32),
            joints=np.zeros((len(asset.skeleton.parents), 3)),
        )
        for name, share in (("jawOpen", 1), ("viseme_sil", 0))
    ]
    return replace(asset, morphs=tuple(shapes))


def test_shapes_of_a_part_are_stored_sparsely(tmp_path: Path) -> None:
    asset = with_a_face(swinging_tube())
    export(asset, tmp_path / "tube.glb")
    document = load((tmp_path / "tube.glb").read_bytes())
    mesh = document.meshes[0]

    assert khronos_issues(tmp_path / "tube.glb")["messages"] == []
    assert mesh.extras == {"targetNames": ["jawOpen", "viseme_sil"]}
    counts = []
    for target in mesh.primitives[0].targets:
        named = target if isinstance(target, dict) else vars(target)
        for kind in ("POSITION", "NORMAL"):
            accessor = document.accessors[named[kind]]
            assert accessor.bufferView is None
            counts.append(0 if accessor.sparse is None else accessor.sparse.count)
    moved = int(asset.morphs[0].vertices.any(axis=1).sum())
    assert counts == [moved, moved, 0, 0]
    assert moved < 0.3 * len(asset.vertices)


def test_blender_has_sparse_shapes_as_we_do(tmp_path: Path) -> None:
    check_in_blender(with_a_face(swinging_tube()), tmp_path, moments=2)
