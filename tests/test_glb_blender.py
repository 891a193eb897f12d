"""Blender imports our files whole and bends them as our own linear blend skinning does."""

from pathlib import Path

import pytest

from tests.tube import tube
from tests.verdicts import blender_verdict, check_blender, random_poses


@pytest.mark.parametrize("tilt", [0.0, 0.3])
def test_tube_bends_as_ours_does(tmp_path: Path, tilt: float) -> None:
    asset = tube(rings=24, joint_count=4, tilt=tilt)
    poses = random_poses(asset, count=3, angle=0.6)
    check_blender(blender_verdict(asset, poses, tmp_path), asset, poses)
