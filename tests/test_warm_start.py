"""The warm start: endless seeded people, exact resuming, errors that stop it, finer planes that start
silent.
"""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
import torch

from avatargen.avatar import shipped
from avatargen.body.load import load_body
from avatargen.body.model import CanonicalBody, canonical_body
from avatargen.errors import InputError, TrainingError
from avatargen.generator.checkpoint import load_checkpoint
from avatargen.generator.config import DEBUG, GeneratorConfig, for_body
from avatargen.generator.generator import AvatarGenerator
from avatargen.training.pool import NUMBERS, cached_pool
from avatargen.training.warm_start import (
    Stream,
    WarmStartConfig,
    held_out,
    learning_rate,
    near_surface,
    new_state,
    step_once,
    train,
)
from avatargen.wardrobe import garments
from avatargen.wardrobe.attributes import LATENT_SIZE
from avatargen.wardrobe.chart import Places

TINY = WarmStartConfig(
    trait_steps=2,
    steps=8,
    people=4,
    points=128,
    pool=20_000,
    save_every=4,
    report_every=100,
    warm_up=2,
    held_out_batches=1,
)


@pytest.fixture(scope="module")
def body() -> CanonicalBody:
    return canonical_body(load_body(shipped("body.npz")))


@pytest.fixture(scope="module")
def config(body: CanonicalBody) -> GeneratorConfig:
    return replace(for_body(DEBUG, body), mapping=replace(DEBUG.mapping, z_size=LATENT_SIZE))


@pytest.fixture(scope="module")
def pool_file(body: CanonicalBody, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pool") / "pool.npz"
    cached_pool(path, body, TINY.pool, TINY.seed)
    return path


@pytest.fixture
def stream(body: CanonicalBody, pool_file: Path) -> Stream:
    return Stream(cached_pool(pool_file, body, TINY.pool, TINY.seed), TINY, body)


def test_a_pool_is_read_at_its_own_size_and_no_larger(body: CanonicalBody, pool_file: Path, tmp_path: Path):
    pool = cached_pool(pool_file, body, TINY.pool, TINY.seed)
    channels = {f.name: getattr(pool, f.name) for f in fields(Places)}
    assert sum(channel.numel() for channel in channels.values()) == NUMBERS * len(pool.p)
    assert sum(channel.nbytes for channel in channels.values()) <= 8 * NUMBERS * len(pool.p)
    with pytest.raises(InputError, match="at most"):
        cached_pool(pool_file, body, TINY.pool // 4, TINY.seed)
    with np.load(pool_file) as file:
        kept = {name: file[name] for name in file.files if name != "leg"}
    np.savez(tmp_path / "cut.npz", **kept)
    with pytest.raises(InputError, match="lacks a channel"):
        cached_pool(tmp_path / "cut.npz", body, TINY.pool, TINY.seed)


def run(
    folder: Path, pool_file: Path, config: GeneratorConfig, training: WarmStartConfig, body: CanonicalBody
):
    folder.mkdir(exist_ok=True)
    (folder / "pool.npz").write_bytes(pool_file.read_bytes())
    return train(config, training, body, folder, report=[].append)


def test_a_step_draws_the_same_people_again_and_others_the_next(stream: Stream):
    first, again, other = stream.batch(3, 4), stream.batch(3, 4), stream.batch(4, 4)

    assert torch.equal(first.target.sdf, again.target.sdf) and torch.equal(first.places.p, again.places.p)
    assert not torch.equal(first.people.z, other.people.z)
    assert first.betas.abs().max() <= 3  # 2.8 before a body is brought to its stature


def test_kept_points_are_distinct_and_near_the_surface():
    sdf = torch.linspace(-0.2, 0.2, 1000).repeat(3, 1)
    kept = near_surface(sdf, 300, torch.Generator().manual_seed(0))

    assert all(len(set(row.tolist())) == 300 for row in kept)
    assert sdf.gather(1, kept).abs().mean() < 0.7 * sdf.abs().mean()


def test_cloth_off_the_body_gets_points_of_its_wearers(stream: Stream):
    """A twentieth of the pool is near a given skirt's surface at most; of a wearer's points, a third."""
    batch = stream.batch(0, 24, skirts=0.5)
    wearers = (garments.has_skirt(batch.people) + garments.has_coat(batch.people))[:, 0] > 0
    near = garments.free_cloth(batch.places.p, batch.people).abs() < 0.02

    assert garments.has_skirt(batch.people)[:12].all()
    assert near[wearers].float().mean() > 0.3
    assert not near[~wearers].any()
    plain = stream.batch(0, 24)
    assert torch.equal(plain.people.z[12:], batch.people.z[12:])
    assert torch.equal(plain.people.z.abs(), batch.people.z.abs())


def test_training_lowers_both_errors(config: GeneratorConfig, stream: Stream, body: CanonicalBody):
    training = replace(TINY, steps=40, learning_rate=4e-3)
    state = new_state(config, training, body)
    errors = [step_once(state, stream.batch(i, 4), training) for i in range(training.steps)]
    first, last = errors[:10], errors[-10:]

    assert np.mean([e.distance_mm for e in last]) < 0.8 * np.mean([e.distance_mm for e in first])
    assert np.mean([e.colour for e in last]) < 0.97 * np.mean([e.colour for e in first])


def test_a_stopped_run_continues_with_the_same_numbers(
    tmp_path: Path, pool_file: Path, config: GeneratorConfig, body: CanonicalBody
):
    """Stopped after step 5 and continued from what was saved at 4: the same weights as never stopped."""
    whole = run(tmp_path / "whole", pool_file, config, TINY, body)

    def stop(line: str) -> None:
        raise KeyboardInterrupt

    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "pool.npz").write_bytes(pool_file.read_bytes())
    with pytest.raises(KeyboardInterrupt):
        train(config, replace(TINY, report_every=5), body, tmp_path / "parts", report=stop)
    resumed = run(tmp_path / "parts", pool_file, config, TINY, body)
    a, b = (load_checkpoint(tmp_path / n / "generator.safetensors") for n in ("whole", "parts"))

    logs = [(tmp_path / n / "log.jsonl").read_text() for n in ("whole", "parts")]

    assert resumed == whole and logs[0] == logs[1] and logs[0].count("\n") == 2
    assert a.weights_hash == b.weights_hash


def test_a_loss_that_is_no_number_stops_the_run(config: GeneratorConfig, stream: Stream, body: CanonicalBody):
    state = new_state(config, TINY, body)
    with torch.no_grad():
        state.generator.synthesis.constant.fill_(float("nan"))

    with pytest.raises(TrainingError, match="learning-rate"):
        step_once(state, stream.batch(0, 4), TINY)


def test_a_damaged_state_is_named_and_left_alone(
    tmp_path: Path, pool_file: Path, config: GeneratorConfig, body: CanonicalBody
):
    run(tmp_path, pool_file, config, replace(TINY, steps=4), body)
    for damage in (b"damaged", b"", (tmp_path / "state.pt").read_bytes()[:1000]):
        (tmp_path / "state.pt").write_bytes(damage)
        with pytest.raises(TrainingError, match="cannot be continued"):
            run(tmp_path, pool_file, config, replace(TINY, steps=8), body)
        assert (tmp_path / "state.pt").read_bytes() == damage


def test_a_run_of_other_networks_is_not_continued(
    tmp_path: Path, pool_file: Path, config: GeneratorConfig, body: CanonicalBody
):
    run(tmp_path, pool_file, config, replace(TINY, steps=4), body)
    wider = replace(config, decoder=replace(config.decoder, width=24))

    before = (tmp_path / "config.json").read_bytes()
    for name, value in (("seed", 1), ("pool", 10_000), ("learning_rate", 1e-3)):
        with pytest.raises(InputError, match=rf"training\.{name} .*; name another folder"):
            run(tmp_path, pool_file, config, replace(TINY, **{name: value}), body)
    assert (tmp_path / "config.json").read_bytes() == before
    with pytest.raises(InputError, match=r"20000 points, seed 0.* wanted 20000 points, seed 1"):
        cached_pool(pool_file, body, TINY.pool, 1)
    with pytest.raises(InputError, match=r"generator.decoder.width \d+, now 24; name another folder"):
        run(tmp_path, pool_file, wider, TINY, body)


def test_finer_planes_start_silent(config: GeneratorConfig, body: CanonicalBody):
    finer = replace(config, synthesis=replace(config.synthesis, blocks=((4, 16), (8, 16), (16, 16), (32, 8))))
    torch.manual_seed(0)
    coarse = AvatarGenerator(config)
    fine = new_state(finer, TINY, body, coarser=coarse.state_dict()).generator
    w = torch.randn(2, config.mapping.w_size, generator=torch.Generator().manual_seed(0))
    a, b = coarse.planes(w), fine.planes(w)

    # the finer planes are the coarse ones upsampled: equal in the mean of every 2 x 2 texels, but for the
    # filter's blur
    pooled = torch.nn.functional.avg_pool2d(b.flatten(0, 1), 2).view_as(a)
    assert (pooled - a).abs().mean() < 0.35 * a.abs().mean()
    with pytest.raises(TrainingError, match="plane resolutions"):
        new_state(config, TINY, body, coarser=fine.state_dict() | {"odd": w})


def test_the_learning_rate_warms_up_and_comes_down():
    rates = [learning_rate(step, WarmStartConfig(steps=1000)) for step in range(1000)]

    assert rates[0] < rates[39] and max(rates) == pytest.approx(2.5e-3, rel=0.02)
    assert rates[-1] == pytest.approx(0.02 * 2.5e-3, rel=0.1) and all(np.diff(rates[101:]) < 0)


def test_the_shipped_weights_know_people_no_step_has_drawn(body: CanonicalBody, pool_file: Path):
    """The model card's claim, on fewer people and points."""
    training = replace(TINY, people=24, points=1024, held_out_batches=1)
    stream = Stream(cached_pool(pool_file, body, TINY.pool, TINY.seed), training, body)
    errors = held_out(load_checkpoint(shipped("generator.safetensors")).generator, stream, training)

    assert errors.distance_mm < 1.1
    assert errors.colour < 0.045
