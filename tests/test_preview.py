from dataclasses import replace

import numpy as np
import pytest
from tube import tube

from assets.asset.names import NAME_PRESETS, rename_joints
from assets.picture.camera import orbit, view_camera
from assets.picture.preview import OVERSAMPLING, PreviewConfig, nearest_faces, render, turntable
from avatargen.errors import InputError

CONFIG = PreviewConfig(height=96)


def one_colour(color):
    asset = tube(rings=24, sides=32)
    return replace(
        asset, texture=np.broadcast_to(np.array(color, dtype=np.uint8), asset.texture.shape).copy()
    )


def front_of(asset):
    """The front without background, and the pixels that the asset covers wholly."""
    picture = render(asset, replace(CONFIG, views=("front",), transparent=True))
    return picture[..., :3], picture[..., 3] == 255


def test_views_stand_side_by_side_at_the_height_asked_for():
    front = render(tube(), replace(CONFIG, views=("front",)))
    both = render(tube(), replace(CONFIG, views=("quarter", "front")))
    assert both.dtype == np.uint8
    assert both.shape[0] == 96
    assert np.array_equal(both[:, -front.shape[1] :], front)


def test_the_figure_fills_its_frame_and_stands_in_the_middle():
    _, seen = front_of(tube())
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    assert np.ptp(rows) / 96 == pytest.approx(1 / 1.1, abs=0.05)
    assert columns[0] + columns[-1] + 1 == pytest.approx(seen.shape[1], abs=2)


def test_colours_are_those_of_the_texture():
    picture, seen = front_of(one_colour((200, 40, 40)))
    red, green, blue = picture[seen].mean(axis=0)
    assert red > 2.5 * green
    assert green == pytest.approx(blue, abs=3)
    dark, seen = front_of(one_colour((0, 0, 0)))
    assert dark[seen].max() == 0


def test_what_is_transparent_is_what_lies_beside_the_figure_and_its_shadow():
    asset = one_colour((200, 40, 40))
    clear = render(asset, replace(CONFIG, views=("front",), transparent=True))
    solid = render(asset, replace(CONFIG, views=("front",)))
    covered = clear[..., 3] == 255
    assert np.array_equal(clear[covered][:, :3], solid[covered])
    shadow = (clear[..., 3] > 10) & ~covered
    assert shadow[70:].any() and not shadow[:20, :3].any()
    assert (solid[:4].astype(int).min(axis=(1, 2)) > 220).all()  # background where nothing is


def test_a_turn_shows_every_side_at_one_size():
    asset = tube(rings=24, sides=32, size=64)
    left_red = asset.texture.copy()
    left_red[:, :32], left_red[:, 32:] = (255, 0, 0), (0, 0, 255)  # u < 1/2 is the side of -z
    frames = turntable(replace(asset, texture=left_red), 4, replace(CONFIG, transparent=True))
    assert len({frame.shape for frame in frames}) == 1
    middle = [frame[48, frame.shape[1] // 2] for frame in frames]
    assert middle[0][2] > 100 > middle[0][0]
    assert middle[2][0] > 100 > middle[2][2]
    for camera in orbit(asset.vertices, 4):  # all of the figure is inside each picture
        seen = np.abs(camera.see(asset.vertices))
        assert (seen[:, 0] < camera.width / 2).all() and (seen[:, 1] < camera.height / 2).all()


def test_nearer_faces_hide_farther_ones_whatever_their_order():
    near = np.array([[[1.0, 9.0], [9.0, 9.0], [5.0, 1.0]]])
    triangles = np.concatenate([near, near])
    for depths in ([1.0, 2.0], [2.0, 1.0]):
        depth = np.repeat(np.array(depths)[:, None], 3, axis=1)
        face, _, front = nearest_faces(triangles, depth, 10, 10)
        assert set(face) == {-1, int(np.argmax(depths))}
        assert front.max() == 2
    assert (nearest_faces(triangles[:, ::-1], np.zeros((2, 3)), 10, 10)[0] == -1).all()  # seen from behind


def test_wireframe_shows_edges():
    asset = one_colour((200, 200, 200))
    plain = render(asset, replace(CONFIG, views=("front",)))
    wire = render(asset, replace(CONFIG, views=("front",), wireframe=True))
    assert wire.shape == plain.shape
    assert wire.min() < 60 < plain.min()


def test_edges_of_the_figure_are_smooth():
    assert OVERSAMPLING >= 2
    picture = render(one_colour((0, 0, 0)), replace(CONFIG, views=("front",)))
    assert len(np.unique(picture[..., 0])) > 10


def test_face_view_is_centred_on_the_head():
    asset = tube(joint_count=2)
    named = replace(asset, skeleton=replace(asset.skeleton, joint_names=("pelvis", "head")))
    camera = view_camera(named, "face")
    assert camera.centre[1] > named.skeleton.joints[1, 1]
    assert camera.height < view_camera(named, "front").height


@pytest.mark.parametrize("preset", NAME_PRESETS)
def test_face_view_is_the_same_whatever_the_joints_are_called(preset):
    asset = tube(joint_count=2)
    named = replace(asset, skeleton=replace(asset.skeleton, joint_names=("pelvis", "head")))
    ours, theirs = view_camera(named, "face"), view_camera(rename_joints(named, preset), "face")
    assert np.array_equal(ours.centre, theirs.centre)
    assert ours.height == theirs.height


def test_face_view_of_who_has_no_head_is_the_top_of_the_figure():
    asset = tube(joint_count=2)
    picture = render(asset, replace(CONFIG, views=("face",), transparent=True))
    camera = view_camera(asset, "face")
    assert camera.centre[[0, 2]] == pytest.approx((asset.vertices.min(0) + asset.vertices.max(0))[[0, 2]] / 2)
    assert (picture[..., 3] == 255).mean() > 0.1


@pytest.mark.parametrize("values", [{"height": 5}, {"height": 10**5}, {"views": ("top",)}, {"views": ()}])
def test_settings_out_of_range(values):
    with pytest.raises(InputError, match="preview"):
        PreviewConfig(**values)
