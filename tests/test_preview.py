from dataclasses import replace

import numpy as np
import pytest
from tube import tube

from assets.preview import OVERSAMPLING, PreviewConfig, frame, nearest_faces, render
from avatargen.errors import InputError

CONFIG = PreviewConfig(height=96)


def one_colour(color):
    asset = tube(rings=24, sides=32)
    return replace(
        asset, texture=np.broadcast_to(np.array(color, dtype=np.uint8), asset.texture.shape).copy()
    )


def on_asset(picture):
    """Pixels that differ from the backdrop, which is the same along each row."""
    return (np.abs(picture.astype(int) - picture[:, :1]) > 3).any(axis=2)


def test_views_stand_side_by_side_at_the_height_asked_for():
    picture = render(tube(), CONFIG)
    alone = [render(tube(), replace(CONFIG, views=(view,))) for view in ("front", "back", "face")]
    assert picture.dtype == np.uint8
    assert picture.shape[0] == 96
    assert np.array_equal(picture, np.concatenate(alone, axis=1))


def test_the_figure_fills_its_frame_and_stands_in_the_middle():
    seen = on_asset(render(tube(), replace(CONFIG, views=("front",))))
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    assert np.ptp(rows) / 96 == pytest.approx(1 / 1.1, abs=0.05)
    assert columns[0] + columns[-1] + 1 == pytest.approx(seen.shape[1], abs=2)


def test_colours_are_those_of_the_texture():
    picture = render(one_colour((200, 40, 40)), replace(CONFIG, views=("front",)))
    red, green, blue = picture[on_asset(picture)].mean(axis=0)
    assert red > 2.5 * green
    assert green == pytest.approx(blue, abs=3)
    dark = render(one_colour((0, 0, 0)), replace(CONFIG, views=("front",)))
    assert np.quantile(dark[on_asset(dark)], 0.7) < 5


def test_back_and_front_see_opposite_sides():
    asset = tube(rings=24, sides=32, size=64)
    left_red = asset.texture.copy()
    left_red[:, :32], left_red[:, 32:] = (255, 0, 0), (0, 0, 255)  # u < 1/2 is the side of -z
    asset = replace(asset, texture=left_red)
    front, back = (render(asset, replace(CONFIG, views=(view,))) for view in ("front", "back"))
    assert front[48, front.shape[1] // 2, 2] > 100 > front[48, front.shape[1] // 2, 0]
    assert back[48, back.shape[1] // 2, 0] > 100 > back[48, back.shape[1] // 2, 2]


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
    plain = render(tube(), replace(CONFIG, views=("front",)))
    wire = render(tube(), replace(CONFIG, views=("front",), wireframe=True))
    assert wire.shape == plain.shape
    assert wire[on_asset(wire)].min() < 100


def test_edges_of_the_figure_are_smooth():
    assert OVERSAMPLING >= 2
    picture = render(one_colour((0, 0, 0)), replace(CONFIG, views=("front",)))
    assert len(np.unique(picture[..., 0])) > 10


def test_face_view_is_centred_on_the_head():
    asset = tube(joint_count=2)
    named = replace(asset, skeleton=replace(asset.skeleton, joint_names=("pelvis", "head")))
    camera = frame(named, "face")
    assert camera.centre[1] > named.skeleton.joints[1, 1]
    assert camera.height < frame(named, "front").height


@pytest.mark.parametrize("values", [{"height": 5}, {"height": 10**5}, {"views": ("top",)}, {"views": ()}])
def test_settings_out_of_range(values):
    with pytest.raises(InputError, match="preview"):
        PreviewConfig(**values)
