"""A face that moves over time in files: glTF's weights, USD's, VRM's expressions; several clips at once."""

# pyright: reportAttributeAccessIssue=false

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib
import pytest
from pxr import Usd, UsdSkel

from assets.asset.animate import animate, figure_of, morphed_points
from assets.asset.asset import Asset
from assets.asset.levels import with_levels
from assets.asset.rig import Animation
from assets.errors import GeometryError
from assets.face.names import ARKIT, EXPRESSIONS, VISEMES
from avatargen.errors import InputError
from avatargen.export.motions import make_clips
from avatargen.motion.clips import CLIPS, make_clip
from avatargen.motion.expression import make_face_clip, speech
from avatargen.motion.motion import Motion, retimed
from avatargen.motion.names import BODY_CLIPS, FACE_CLIPS, parts_of
from avatargen.motion.speech.timing import segments_of_text
from avatargen.motion.together import together
from exporters import export, glb
from exporters.check_usd import check_usd
from exporters.usd_motion import FRAMES_PER_SECOND
from exporters.vrma import as_expressions
from tests.figure import figure
from tests.test_face_files import with_shapes
from tests.test_glb import load, read
from tests.test_glb_motion import morphed
from tests.test_vrm import type_errors
from tests.verdicts import AGREE, ask_node, blender_motion, khronos_issues, our_vertices

NAMES = [*ARKIT, *VISEMES]
PLAYED = ("talk", "walk", "walk,talk,smile")


@pytest.fixture(scope="module")
def person() -> Asset:
    """Walks, talks, and does both at once."""
    still = with_shapes(figure())
    motions = [retimed(motion, 10.0) for motion in make_clips(PLAYED, None, still)]
    return animate(still, motions)


def played(animation: Animation, time: float) -> np.ndarray:
    """The weights of all morphs at a time."""
    if animation.weights is None:
        return np.zeros(len(NAMES))
    return np.array([np.interp(time, animation.times, column) for column in animation.weights.T])


def test_the_clips_are_those_that_commands_know() -> None:
    assert tuple(CLIPS) == BODY_CLIPS
    for name in FACE_CLIPS:
        motion = make_face_clip(name)
        assert motion.name == name and motion.joint_names == () and motion.weights is not None
        assert set(motion.shapes) <= set(NAMES)
        assert not motion.weights[[0, -1]].any() and motion.weights.max() > 0.8
    with pytest.raises(InputError, match="no clip of a face is called 'walk'"):
        make_face_clip("walk")


def test_what_plays_at_once_is_all_of_it(person: Asset) -> None:
    walk = make_clip("walk", figure_of(person))
    talk, smile, blink = (make_face_clip(name) for name in ("talk", "smile", "blink"))
    both = together("both", [walk, talk, smile])
    rounds = both.seconds / walk.seconds
    assert rounds == pytest.approx(np.ceil(talk.seconds / walk.seconds))
    way = walk.translation[-1] - walk.translation[0]
    np.testing.assert_allclose(both.translation[-1] - both.translation[0], rounds * way, atol=1e-6)
    assert np.abs(np.diff(both.translation, axis=0)).max() < 0.05  # no jump between rounds
    assert both.weights is not None and talk.weights is not None
    for shape in talk.shapes:
        if shape.startswith("viseme"):
            column = both.weights[:, both.shapes.index(shape)]
            spoken = np.interp(both.times, talk.times, talk.weights[:, talk.shapes.index(shape)], right=0)
            np.testing.assert_allclose(column, spoken, atol=0.15)  # sampled at other times
            assert column.max() == pytest.approx(spoken.max(), abs=0.05)
    smiles = both.weights[:, both.shapes.index("mouthSmileLeft")] > 0.8
    assert int((np.diff(smiles.astype(int)) == 1).sum()) == int(both.seconds // smile.seconds)
    assert not both.weights[-1].any()
    lids = together("faces", [smile, blink])
    assert lids.seconds == blink.seconds and lids.joint_names == ()
    assert lids.weights is not None and lids.weights.max() == 1.0


def test_names_of_what_plays_at_once() -> None:
    assert parts_of("walk,talk") == ("walk", "talk")
    for wrong in ("", "walk,", "fly", "walk,idle", "talk,talk", "walk+talk"):
        with pytest.raises(InputError, match="found clip"):
            parts_of(wrong)


def test_a_face_without_the_shapes_is_refused() -> None:
    with pytest.raises(InputError, match="the face has no shape viseme_PP; make one that moves"):
        animate(figure(), [make_face_clip("talk")])
    blink = make_face_clip("blink")
    assert blink.weights is not None
    with pytest.raises(InputError, match="not within 0 and 1"):
        replace(blink, weights=2 * blink.weights)
    with pytest.raises(InputError, match=r"2 shapes have weights \(0, 0\)"):
        replace(blink, weights=None)


def test_weights_of_other_morphs_are_refused(person: Asset) -> None:
    with pytest.raises(GeometryError, match="is not of its 1 morphs"):
        replace(person, morphs=person.morphs[:1])


def test_gltf_weights_read_back_on_every_mesh() -> None:
    asset = with_levels(with_shapes(figure()), (300,))
    asset = animate(asset, [retimed(motion, 30.0) for motion in make_clips(PLAYED, None, asset)])
    document = load(glb.encode(asset))
    meshes = {number for number, node in enumerate(document.nodes) if node.mesh is not None}
    assert len(meshes) == 2
    for encoded, ours in zip(document.animations, asset.animations, strict=True):
        channels = [one for one in encoded.channels if one.target.path == "weights"]
        assert {one.target.node for one in channels} == (set() if ours.weights is None else meshes)
        joints = [one for one in encoded.channels if one.target.path != "weights"]
        assert bool(joints) == (encoded.name != "talk")  # it can be played over a walk
        if ours.weights is None:
            continue
        (number,) = {one.sampler for one in channels}
        sampler = encoded.samplers[number]
        times, values = read(document, sampler.input), read(document, sampler.output)
        found = values.reshape(len(times), len(NAMES))
        for column, wanted in zip(found.T, ours.weights.T, strict=True):
            np.testing.assert_allclose(np.interp(ours.times, times, column), wanted, atol=1e-5)


def test_khronos_has_nothing_to_say(tmp_path: Path, person: Asset) -> None:
    export(person, tmp_path / "person.glb")
    assert khronos_issues(tmp_path / "person.glb")["messages"] == []


def test_three_moves_the_face_as_we_do(tmp_path: Path, person: Asset) -> None:
    export(person, tmp_path / "person.glb")
    (tmp_path / "poses.json").write_text(json.dumps({"names": [], "T_posed_rest": []}))
    found = ask_node("three_check.mjs", "three", tmp_path / "person.glb", tmp_path / "poses.json")
    clips = {clip.name: clip for clip in person.animations}
    assert found["clips"].keys() == clips.keys()
    for name, shown in found["clips"].items():
        frames = [int(np.argmin(np.abs(clips[name].times - time))) for time in shown["times"]]
        for frame, vertices in list(zip(frames, shown["vertices"], strict=True))[::7]:
            ours = vertices_of(person, clips[name], frame)
            np.testing.assert_allclose(np.reshape(vertices, (-1, 3)), ours, atol=AGREE)


def test_blender_moves_the_face_as_we_do(tmp_path: Path, person: Asset) -> None:
    export(person, tmp_path / "person.glb")
    chosen = [(clip, frame) for clip in person.animations for frame in (3, 7, 11)]
    names = [clip.name for clip, _ in chosen]
    times = [float(clip.times[frame]) for clip, frame in chosen]
    found = blender_motion(tmp_path / "person.glb", names, times, [], np.zeros((len(chosen), 0)))
    for (clip, frame), theirs in zip(chosen, found["vertices"], strict=True):
        np.testing.assert_allclose(theirs, vertices_of(person, clip, frame), atol=AGREE, err_msg=clip.name)


def vertices_of(asset: Asset, animation: Animation, frame: int) -> np.ndarray:
    """Morphed, then skinned."""
    weights = played(animation, animation.times[frame])
    return our_vertices(morphed(asset, weights), animation.T_posed_rest(asset.skeleton)[frame])


def test_blender_has_shapes_by_their_names(tmp_path: Path, person: Asset) -> None:
    """Ten shapes at chosen weights, while the person walks: within a tenth of a millimetre."""
    export(person, tmp_path / "person.glb")
    walk = person.animations[1]
    rng = np.random.default_rng(0)
    shapes = [str(name) for name in rng.choice(NAMES, 10, replace=False)]
    weights = np.eye(len(shapes))
    frames = rng.integers(0, len(walk.times), len(shapes))
    found = blender_motion(
        tmp_path / "person.glb", ["walk"] * len(shapes), walk.times[frames].tolist(), shapes, weights
    )
    for name, frame, theirs in zip(shapes, frames, found["vertices"], strict=True):
        full = np.array([float(each == name) for each in NAMES])
        ours = our_vertices(morphed(person, full), walk.T_posed_rest(person.skeleton)[frame])
        np.testing.assert_allclose(theirs, ours, atol=AGREE, err_msg=name)


@pytest.mark.parametrize("suffix", [".usda", ".usdz"])
def test_usd_moves_the_shapes_within_its_extents(tmp_path: Path, person: Asset, suffix: str) -> None:
    export(person, tmp_path / f"person{suffix}")
    assert check_usd(tmp_path / f"person{suffix}") == []
    stage = Usd.Stage.Open(str(tmp_path / f"person{suffix}"))
    cache, root = UsdSkel.Cache(), UsdSkel.Root(stage.GetPrimAtPath("/avatar"))
    cache.Populate(root, Usd.PrimDefaultPredicate)
    (binding,) = cache.ComputeSkelBindings(root, Usd.PrimDefaultPredicate)
    query = cache.GetSkelQuery(binding.GetSkeleton()).GetAnimQuery()
    (target,) = binding.GetSkinningTargets()
    talk = person.animations[0]
    order = list(target.GetBlendShapeOrder())
    assert order == NAMES
    for time in talk.times[::9]:
        weights = query.ComputeBlendShapeWeights(Usd.TimeCode(float(time) * FRAMES_PER_SECOND))
        found = np.array(target.GetBlendShapeMapper().Remap(weights))
        np.testing.assert_allclose(found, played(talk, time), atol=1e-6)


def test_boxes_hold_what_shapes_move(person: Asset) -> None:
    talk = person.animations[0]
    assert talk.weights is not None
    moved = list(morphed_points(person, talk, talk.T_posed_rest(person.skeleton)))
    frame = int(talk.weights.sum(axis=1).argmax())
    ours = vertices_of(person, talk, frame)
    far = np.abs(ours - person.vertices).max(axis=1) > 1e-4
    assert far.any()
    for point in ours[far][:20]:
        assert np.abs(moved[frame] - point).max(axis=1).min() < 1e-6


def test_vrm_expressions_add_up_to_the_shapes(person: Asset) -> None:
    for animation in person.animations:
        shown = as_expressions(NAMES, animation)
        if animation.weights is None:
            assert shown == {}
            continue
        total = np.zeros_like(animation.weights)
        for name, weights in shown.items():
            assert weights.min() >= 0 and weights.max() <= 1
            for shape, share in EXPRESSIONS.get(name, {name: 1.0}).items():
                total[:, NAMES.index(shape)] += share * weights
        np.testing.assert_allclose(total, animation.weights, atol=1e-3)
    assert {"blink", "aa", "ih", "ou", "ee", "oh", "happy", "viseme_PP"} <= shown.keys()
    assert not {"blinkLeft", "eyeBlinkLeft", "mouthSmileLeft", "viseme_aa"} & shown.keys()


def test_three_vrm_plays_the_expressions_on_the_person(tmp_path: Path, person: Asset) -> None:
    still = replace(person, animations=person.animations[2:])
    export(still, tmp_path / "person.vrm")
    document: Any = pygltflib.GLTF2.load_from_bytes((tmp_path / "person.vrma").read_bytes())
    found = document.extensions["VRMC_vrm_animation"]
    assert {"blink", "aa", "happy"} <= set(found["expressions"]["preset"])
    assert type_errors(tmp_path, found, "VRMCVRMAnimation", "types-vrmc-vrm-animation-1.0") == ""
    messages = khronos_issues(tmp_path / "person.vrma")["messages"]
    assert {message["code"] for message in messages} <= {"UNSUPPORTED_EXTENSION", "NODE_EMPTY"}
    clip = still.animations[0]
    paths = [tmp_path / name for name in ("person.vrm", "person.vrma")]
    frames = np.linspace(0, len(clip.times) - 1, 8).astype(int)
    times = json.dumps([clip.times[frames].tolist()])
    seen = ask_node("vrma_check.mjs", "@pixiv/three-vrm-animation", *paths, times)
    for frame, vertices in zip(frames, seen["vertices"][0], strict=True):
        ours = vertices_of(still, clip, frame)
        np.testing.assert_allclose(np.reshape(vertices, (-1, 3)), ours, atol=AGREE)


def test_speech_is_a_clip_like_others(person: Asset) -> None:
    said = speech("say", segments_of_text("Bye for now"))
    alone, both = make_clips(["say", "idle,say"], said, person)
    assert alone is said and both.name == "idle_say"
    assert both.seconds >= said.seconds and both.joint_names
    assert isinstance(both, Motion) and both.shapes == said.shapes
