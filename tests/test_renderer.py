"""Volume rendering against analytic answers, and the geometry of cameras and rays."""

import itertools

import numpy as np
import pytest
import torch
from scipy.interpolate import CubicHermiteSpline
from torch import Tensor

from avatargen.generator.camera import Camera, camera_of_vector, front_camera, rays
from avatargen.generator.density import Density
from avatargen.generator.renderer import PIECES, Samples, box_interval, composite, stratify


class Itself(Density):
    """The density of rays whose numbers are densities already."""

    def between(self, first: Tensor, last: Tensor) -> Tensor:
        return (first + last) / 2


itself = Itself(1.0)


@pytest.mark.parametrize("count", [1, 7])
@pytest.mark.parametrize("sigma", [0.0, 0.3, 5.0, 4000.0])
def test_a_uniform_slab_lets_through_exp_of_its_optical_depth(sigma: float, count: int):
    near, far = torch.tensor([1.0]).double(), torch.tensor([3.0]).double()
    samples = stratify(near, far, count, torch.Generator().manual_seed(0))
    fog = torch.full((1, count), sigma, dtype=torch.float64)
    rendering = composite(fog, torch.ones(1, count, 2).double(), samples, far, itself)
    seen = 1 - np.exp(-sigma * 2.0)
    assert rendering.mask.item() == pytest.approx(seen, abs=1e-12)
    assert rendering.features[0].tolist() == pytest.approx([seen, seen], abs=1e-12)


def test_mean_depth_in_fog_converges_to_its_integral():
    near, far, sigma = torch.tensor([1.0]).double(), torch.tensor([3.0]).double(), 1.7
    samples = stratify(near, far, 500)
    fog = torch.full((1, 500), sigma, dtype=torch.float64)
    rendering = composite(fog, torch.zeros(1, 500, 1).double(), samples, far, itself)
    # integral of t sigma exp(-sigma (t - 1)) from 1 to 3, over that without t
    expected = 1 + 1 / sigma - 2 * np.exp(-2 * sigma) / (1 - np.exp(-2 * sigma))
    assert rendering.depth.item() == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize("alpha", [1e-4, 1e-3, 1e-2])
def test_a_surface_is_seen_at_its_place_however_few_samples_and_however_sharp(alpha: float):
    place = torch.linspace(0.3, 0.7, 401).double()
    near, far = torch.zeros(401).double(), torch.ones(401).double()
    samples = stratify(near, far, 12)
    density = Density(alpha).double()
    seen = composite(place[:, None] - samples.depth, samples.depth[..., None], samples, far, density)
    many = stratify(near, far, 2_000)
    exact = composite(place[:, None] - many.depth, many.depth[..., None], many, far, density)
    bin_width = 1 / 12
    assert (seen.depth - exact.depth).abs().max() < bin_width / PIECES
    assert (seen.depth - exact.depth).mean().abs() < bin_width / PIECES / 10  # no bias
    assert (seen.features[:, 0] - exact.features[:, 0]).abs().max() < bin_width / PIECES
    assert (seen.mask - exact.mask).abs().max() < 1e-6


@torch.no_grad()
def test_composite_matches_a_slow_float64_loop():
    draw = torch.Generator().manual_seed(0)
    near = torch.rand(5, generator=draw)
    far = near + torch.rand(5, generator=draw)
    samples = stratify(near, far, 12, draw)
    distance = torch.randn(5, 12, generator=draw) * 0.1 + 0.1
    features = torch.rand(5, 12, 4, generator=draw)
    density, many = Density(0.03).double(), (np.arange(2_000) + 0.5) / 2_000
    rendering = composite(distance, features, samples, far, Density(0.03))
    for ray in range(5):
        z, numbers = samples.depth[ray].double().numpy(), distance[ray].double().numpy()
        ends = np.concatenate([[float(near[ray])], z, [float(far[ray])]])
        spline = hermite(ends, np.concatenate([numbers[:1], numbers, numbers[-1:]]))
        passed, total, depth = 1.0, np.zeros(4), 0.0
        for start, end in itertools.pairwise(ends):
            for piece in range(PIECES):
                a, b = (start + (end - start) * (piece + k) / PIECES for k in (0, 1))
                straight = torch.from_numpy(spline(a) + many * (spline(b) - spline(a)))
                seen = passed * (1 - np.exp(-(b - a) * float(density(straight).mean())))
                color = [np.interp((a + b) / 2, z, f) for f in features[ray].double().numpy().T]
                total += seen * np.array(color)
                depth += seen * (a + b) / 2
                passed -= seen
        assert np.abs(rendering.features[ray].numpy() - total).max() < 1e-5
        assert rendering.mask[ray].item() == pytest.approx(1 - passed, abs=1e-5)
        assert rendering.depth[ray].item() == pytest.approx(depth / (1 - passed), abs=1e-5)


def hermite(places: np.ndarray, numbers: np.ndarray) -> CubicHermiteSpline:
    """With the slopes of parabolas through three neighbours, and none at the ends."""
    slopes = np.zeros(len(places))
    for i in range(1, len(places) - 1):
        three = slice(i - 1, i + 2)
        slopes[i] = np.polyval(np.polyder(np.polyfit(places[three] - places[i], numbers[three], 2)), 0)
    return CubicHermiteSpline(places, numbers, slopes)


def test_a_ray_that_grazes_a_limb_sees_it_between_its_samples():
    """A cylinder of 5 cm whose surface lies 1 mm before the ray, by few samples and by many."""
    near, far, density = torch.zeros(1).double(), torch.ones(1).double(), Density(0.003).double()
    masks = []
    for count in (12, 2_000):
        samples = stratify(near, far, count)
        away = torch.hypot(samples.depth - 0.5, torch.tensor(0.049).double()) - 0.05
        masks.append(composite(away, away[..., None], samples, far, density).mask.item())
    assert masks[1] > 0.9
    assert masks[0] > 0.8 * masks[1]  # with straight lines between the samples it is not seen at all


def test_an_opaque_wall_hides_what_is_behind():
    depth, length = torch.tensor([[1.0, 2.0, 3.0]]), torch.tensor([[0.5, 1.0, 1.0, 0.5]])
    samples = Samples(depth=depth, length=length)
    distance, features = torch.tensor([[1.0, -1.0, -1.0]]), torch.eye(3)[None]
    rendering = composite(distance, features, samples, torch.tensor([3.5]), Density(1e-4))
    assert rendering.features[0, 2] == 0
    assert rendering.depth.item() == pytest.approx(1.5, abs=0.5 / PIECES)


def test_rays_that_miss_see_nothing_and_get_no_samples():
    box = torch.tensor([[-1.0, -1, -1], [1, 1, 1]])
    origin = torch.tensor([[0.0, 0, 5], [0, 3, 5], [0, 0, 5], [0, 0, 0]])
    direction = torch.tensor([[0.0, 0, -1], [0, 0, -1], [0, 0, 1], [0, 0, 1]])
    near, far = box_interval(origin, direction, box)
    assert near.tolist()[0] == 4
    assert far.tolist()[0] == 6
    assert (far - near)[1:3].tolist() == [0, 0]  # beside, and behind
    assert (near[3], far[3]) == (0, 1)  # from within
    samples = stratify(near, far, 3)
    rendering = composite(torch.full((4, 3), 1e6), torch.ones(4, 3, 1), samples, far, itself)
    assert rendering.mask.tolist() == [1, 0, 0, 1]
    assert torch.equal(rendering.depth[1:3], far[1:3])


def test_stratified_samples_stay_in_their_bins():
    near, far = torch.zeros(1000), torch.ones(1000) * 2
    samples = stratify(near, far, 4, torch.Generator().manual_seed(0))
    bins = (samples.depth / 0.5).floor()
    assert torch.equal(bins, torch.arange(4.0).expand(1000, 4))
    assert (samples.depth.mean(dim=0) - torch.tensor([0.25, 0.75, 1.25, 1.75])).abs().max() < 0.02


def test_camera_vectors_keep_eg3d_order_and_rays_follow_opencv():
    vector = torch.arange(25.0)[None]
    camera = camera_of_vector(vector)
    assert camera.cam2world[0, 0, 3] == 3
    assert camera.intrinsics[0, 2, 2] == 24
    assert torch.equal(camera.vector, vector)

    front = front_camera(2)
    origin, direction = rays(front, 4)
    assert direction.shape == (2, 16, 3)
    assert torch.allclose(direction.norm(dim=-1), torch.ones(2, 16))
    assert (direction[0, :, 2] < 0).all()  # the camera looks back along -z
    assert direction[0, 0, 1] > 0  # the first row is the top
    assert direction[0, 0, 0] < 0  # its first pixel is at x < 0: the person's right is on the left
    center = rays(front, 1)[1][0, 0]
    assert torch.allclose(center, torch.tensor([0.0, 0, -1]))
    assert torch.equal(origin[0, 0], front.cam2world[0, :3, 3])


def test_a_point_projects_back_to_its_pixel():
    draw = torch.Generator().manual_seed(0)
    rotation = torch.linalg.qr(torch.randn(3, 3, generator=draw))[0]
    cam2world = torch.eye(4)
    cam2world[:3, :3], cam2world[:3, 3] = rotation, torch.tensor([1.0, 2, 3])
    intrinsics = torch.tensor([[1.3, 0, 0.45], [0, 1.6, 0.55], [0, 0, 1]])
    origin, direction = rays(Camera(cam2world=cam2world[None], intrinsics=intrinsics[None]), 5)
    points = origin + direction * torch.rand(1, 25, 1, generator=draw) * 4
    local = (points[0] - cam2world[:3, 3]) @ rotation
    pixels = (local / local[:, 2:]) @ intrinsics.T
    v, u = torch.meshgrid((torch.arange(5) + 0.5) / 5, (torch.arange(5) + 0.5) / 5, indexing="ij")
    assert torch.allclose(pixels[:, 0], u.flatten(), atol=1e-4)
    assert torch.allclose(pixels[:, 1], v.flatten(), atol=1e-4)
