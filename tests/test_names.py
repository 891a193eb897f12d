"""Naming presets: whole, without doubles, and what the programs' own lists of needed bones ask for."""

from dataclasses import replace

import numpy as np
import pytest

from assets.asset.names import NAME_PRESETS, VRM_HUMAN_BONES, rename_joints
from avatargen.body.joints import JOINT_NAMES, SMPL_JOINT_NAMES, SMPLX_JOINT_NAMES, mirrored_name
from avatargen.errors import InputError
from tests.tube import tube

NEEDED_BY_VRM = {
    "hips", "spine", "head",
    "leftUpperLeg", "leftLowerLeg", "leftFoot", "rightUpperLeg", "rightLowerLeg", "rightFoot",
    "leftUpperArm", "leftLowerArm", "leftHand", "rightUpperArm", "rightLowerArm", "rightHand",
}  # fmt: skip


@pytest.mark.parametrize("names", JOINT_NAMES.values(), ids=len)
@pytest.mark.parametrize("preset", NAME_PRESETS)
def test_every_joint_of_every_body_gets_a_name_of_its_own(names: tuple[str, ...], preset: str) -> None:
    table = NAME_PRESETS[preset]
    renamed = [table.get(name, name) for name in names]
    assert len(set(renamed)) == len(names)
    assert preset == "smpl" or set(table) >= set(names)
    assert len({VRM_HUMAN_BONES[name] for name in names}) == len(names)


def test_the_bones_programs_look_for_are_there() -> None:
    assert {VRM_HUMAN_BONES[name] for name in SMPL_JOINT_NAMES} >= NEEDED_BY_VRM
    assert VRM_HUMAN_BONES["left_shoulder"] == "leftUpperArm"  # SMPL's collar is the shoulder of others
    assert VRM_HUMAN_BONES["right_thumb1"] == "rightThumbMetacarpal"
    assert NAME_PRESETS["unity"]["left_pinky2"] == "LeftLittleIntermediate"
    assert NAME_PRESETS["mixamo"]["right_knee"] == "mixamorig:RightLeg"
    assert NAME_PRESETS["unreal"]["left_collar"] == "clavicle_l"


@pytest.mark.parametrize("preset", ["mixamo", "unity", "unreal"])
def test_left_and_right_are_named_alike(preset: str) -> None:
    table = NAME_PRESETS[preset]
    for joint in SMPLX_JOINT_NAMES:
        swapped = {"mixamo": ("Left", "Right"), "unity": ("Left", "Right"), "unreal": ("_l", "_r")}[preset]
        assert table[joint].replace(*swapped) == table[mirrored_name(joint)].replace(*swapped)


def test_renaming_changes_names_alone() -> None:
    asset = tube(joint_count=2)
    renamed = rename_joints(asset, "unity")
    assert renamed.skeleton.joint_names == ("Hips", "Spine")
    assert np.array_equal(renamed.skeleton.T_world_joint, asset.skeleton.T_world_joint)
    assert rename_joints(asset, "smpl").skeleton.joint_names == asset.skeleton.joint_names


def test_unknown_presets_and_doubles_are_refused() -> None:
    asset = tube(joint_count=2)
    with pytest.raises(InputError, match="no preset is called 'maya'; use one of smpl, mixamo"):
        rename_joints(asset, "maya")
    doubled = replace(asset, skeleton=replace(asset.skeleton, joint_names=("pelvis", "Hips")))
    with pytest.raises(InputError, match="two joints alike"):
        rename_joints(doubled, "unity")
