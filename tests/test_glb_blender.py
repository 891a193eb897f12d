"""Blender imports our files whole and bends them as our own linear blend skinning does."""

from pathlib import Path

import pytest

import assets
import avatargen
from avatargen.body.joints import SMPLH_JOINT_NAMES
from avatargen.body.load import load_body
from avatargen.body.model import canonical_body
from avatargen.generator.checkpoint import save_checkpoint
from avatargen.generator.config import DEBUG, for_body
from avatargen.generator.generator import AvatarGenerator
from tests.tube import tube
from tests.verdicts import PROJECT, blender_verdict, check_blender, random_poses

PRETRAINED = PROJECT / "avatargen" / "pretrained"


@pytest.mark.parametrize("tilt", [0.0, 0.3])
def test_tube_bends_as_ours_does(tmp_path: Path, tilt: float) -> None:
    asset = tube(rings=24, joint_count=4, tilt=tilt)
    poses = random_poses(asset, count=3, angle=0.6)
    check_blender(blender_verdict(asset, poses, tmp_path), asset, poses)


@pytest.mark.parametrize("weights", ["untrained", "shipped"])
def test_person_bends_as_ours_does(tmp_path: Path, weights: str) -> None:
    """A whole person on the default body: every joint of SMPL-H, posed at random."""
    if weights == "untrained":
        path = tmp_path / "untrained.safetensors"
        body = load_body(PRETRAINED / "body.npz")
        save_checkpoint(AvatarGenerator(for_body(DEBUG, canonical_body(body))), path)
    else:
        path = PRETRAINED / "people.safetensors"
    avatar = avatargen.load_generator(path).sample(seed=3)
    config = assets.BuildConfig(resolution=160, faces=6000, texture=256)
    asset = assets.build(avatar, config)
    poses = random_poses(asset, count=3, angle=0.5)
    verdict = blender_verdict(asset, poses, tmp_path)

    check_blender(verdict, asset, poses)
    assert set(verdict.found["bones"]) == set(SMPLH_JOINT_NAMES)
