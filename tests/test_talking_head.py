"""An open talking-head page takes our file as it is, and speaks with it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from assets.asset.asset import Asset
from assets.asset.bones import aim_bones
from assets.asset.names import rename_joints
from assets.asset.root_bone import with_root
from assets.face.names import ARKIT, VISEMES
from exporters import export
from tests import browser
from tests.talking_page import PACKAGE, served
from tests.test_bones import body_asset
from tests.test_face_files import with_shapes
from tests.verdicts import require

MIXED = {"mouthOpen", "mouthSmile", "eyesClosed", "eyesLookUp", "eyesLookDown"}  # that the page makes of ours


def person() -> Asset:
    """The default body with eyes in its skeleton, rigged as Ready Player Me's people, and every shape."""
    asset = with_eyes(body_asset(rest="t"))
    return with_root(rename_joints(aim_bones(with_shapes(asset), "mixamo"), "rpm"))


def with_eyes(asset: Asset) -> Asset:
    """The asset with a joint for each eye, where it has none."""
    skeleton = asset.skeleton
    if "left_eye" in skeleton.joint_names:
        return asset
    head = skeleton.joint_names.index("head")
    places = np.tile(skeleton.T_world_joint[head], (2, 1, 1))
    places[:, :3, 3] += [[0.03, 0.06, 0.08], [-0.03, 0.06, 0.08]]
    turned = skeleton.rest_rotations
    return replace(
        asset,
        skeleton=replace(
            skeleton,
            joint_names=(*skeleton.joint_names, "left_eye", "right_eye"),
            parents=np.concatenate([skeleton.parents, [head, head]]),
            T_world_joint=np.concatenate([skeleton.T_world_joint, places]),
            rest_rotations=None if turned is None else np.concatenate([turned, turned[[head, head]]]),
        ),
    )


def test_a_talking_head_page_speaks_with_our_file(tmp_path: Path) -> None:
    """It refuses files without an Armature, a joint of Mixamo's or shapes; its own words move the visemes."""
    require(PACKAGE.is_dir(), "TalkingHead")
    if not browser.found():
        pytest.skip("Chromium and its driver are not installed; Debian's are chromium and chromium-driver")
    export(person(), tmp_path / "person.glb")
    with served(tmp_path / "person.glb", PACKAGE) as address, browser.browser(tmp_path, (520, 560)) as tab:
        tab.open(address)
        state = "return window.told?.state"
        said = browser.wait(lambda: (found := tab.run(state)) != "loading" and found, "the person")
        assert said == "ready"
        browser.wait(lambda: tab.run("return window.told.now.viseme_PP") == 0, "a first picture")
        assert set(tab.run("return Object.keys(window.told.now)")) == {*ARKIT, *VISEMES, *MIXED}
        tab.click("speak")
        browser.wait(lambda: max(spoken(tab, "most").values()) > 0, "a first sound")
        browser.wait(lambda: not tab.run("return window.head.isSpeaking"), "its end")
        most = spoken(tab, "most")
        assert most["viseme_PP"] > 0.2  # .9 on a machine that draws every frame
        assert sum(weight > 0 for weight in most.values()) >= 5
        browser.wait(lambda: max(spoken(tab, "now").values()) < 0.05, "a closed mouth")


def spoken(tab: browser.Browser, when: str) -> dict[str, float]:
    """Weights of the visemes."""
    found = tab.run(f"return window.told.{when}")
    return {name: found.get(name) or 0.0 for name in VISEMES}
