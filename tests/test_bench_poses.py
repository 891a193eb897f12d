"""Posed errors and stretch of skinned meshes: small on the body itself, large where weights bleed."""

from dataclasses import replace

import numpy as np
from test_pipeline import stranger
from test_skin import on_body, person

from assets.skin.attach import attach
from assets.skin.skin import Skin, SkinConfig, skin_attached
from avatargen.commands.bench.poses import PosedError, posed_error


def measured(change) -> PosedError:
    """The body's own mesh, its joints after a change."""
    surface = on_body()
    attachment = attach(surface, person())
    skin = skin_attached(attachment, person(), SkinConfig())
    changed = Skin(joints=change(skin.joints.copy()), weights=skin.weights)
    plain = replace(stranger(), betas=np.zeros(10, dtype=np.float32))
    return posed_error(surface, changed, attachment, plain)


def bleed(joints):
    """A few vertices of the left knee go with the right one."""
    left, right = (person().joint_names.index(name) for name in ("left_knee", "right_knee"))
    rows = np.flatnonzero(joints[:, 0] == left)[:5]
    joints[rows, 0] = right
    return joints


def test_weights_that_bleed_are_seen_and_the_bodys_own_are_good():
    good, bad = measured(lambda joints: joints), measured(bleed)
    assert good.median_mm < 1.0
    assert 1 < good.stretch_p999 <= good.stretch_max < 12
    assert bad.stretch_max > 2 * good.stretch_max
    assert bad.mean_mm > good.mean_mm + 0.5
