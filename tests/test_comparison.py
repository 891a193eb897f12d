"""Tables of runs: what stands in which row, runs in turns, pictures there and back, intervals."""

import multiprocessing
import zipfile
from ctypes import c_double, c_int64
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

from avatargen.comparison import conduct, training, worker
from avatargen.comparison.conduct import Conditions, Conductor, Places
from avatargen.comparison.measured import Held, measure_table
from avatargen.comparison.packed import (
    Result,
    decode,
    encode,
    pack,
    read_packed,
    read_shown,
    with_counts,
    write_shown,
)
from avatargen.comparison.plan import Plan, make_plan, table_of_ablations, table_of_baselines
from avatargen.comparison.sheet import sheet
from avatargen.comparison.tables import cell, markdown
from avatargen.comparison.worker import FAILED, SHOWN, Job, Shared, work
from avatargen.data.dataset import open_pictures
from avatargen.errors import InputError
from avatargen.metrics.joints import ridge_judge
from avatargen.metrics.judges import BUILT_IN, Judges
from avatargen.metrics.report import Number
from avatargen.metrics.shown import Shown, Views
from avatargen.training.adversarial import train
from avatargen.training.avatar_model import avatar_model
from tests.small_run import BODY, CONFIG, SIZE, accelerator, make_data

IMAGES = 3 * training.SLICE * CONFIG.batch
SETTINGS = replace(CONFIG, images=IMAGES, snapshot_every=IMAGES)


def plan_of(config=SETTINGS, rows=("as the paper", "density"), models=("avatargen",)) -> Plan:
    tables = [table_of_baselines(models, 20), table_of_ablations(config, rows, 20)]
    return make_plan(config, tables, [0])


def shared_of(plan: Plan, common: int) -> Shared:
    make, count = multiprocessing.get_context("spawn"), len(plan.runs)
    return Shared(
        images=make.RawArray(c_int64, count),
        stage=make.RawArray(c_int64, 1),
        active=make.RawArray(c_int64, [FAILED]),
        show_seconds=make.RawArray(c_double, 1),
        stop=make.RawValue(c_int64, 0),
        common=make.RawValue(c_int64, common),
        show_until=make.RawValue(c_double, 1e12),
    )


def job_of(plan: Plan, folder: Path) -> Job:
    return Job(
        worker=0,
        runs=dict(enumerate(plan.runs)),
        ends=tuple(run.config.images for run in plan.runs),
        data=folder / "data",
        held_out=folder / "data",
        out=folder / "out",
    )


@pytest.fixture
def data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    make_data(tmp_path / "data")
    monkeypatch.setattr(worker, "training_body", lambda: BODY)
    (tmp_path / "out").mkdir()
    return tmp_path


def test_rows_that_change_nothing_share_a_run():
    plan = make_plan(
        SETTINGS,
        [
            table_of_baselines(("avatargen", "eg3d"), 300),
            table_of_ablations(SETTINGS, ("as the paper", "K = 2", "6 ray steps"), 300),
        ],
        [0, 1],
    )
    assert [run.key for run in plan.runs] == [
        *("avatargen/seed0", "eg3d/seed0", "avatargen-K2/seed0"),
        *("avatargen/seed1", "eg3d/seed1", "avatargen-K2/seed1"),
    ]
    assert plan.runs[0].show.pictures == 300 and plan.runs[2].show.pictures == 120
    assert plan.runs[2].config == replace(SETTINGS, render=replace(SETTINGS.render, nearest=2))
    assert plan.runs[4].config.seed == 1 and plan.runs[4].model == "eg3d"
    same = replace(SETTINGS, render=replace(SETTINGS.render, samples=12))
    assert table_of_ablations(same, ("12 ray steps",), 20).rows == {"12 ray steps": "avatargen"}
    with pytest.raises(InputError, match="name each once"):
        make_plan(SETTINGS, plan.tables, [0, 0])


def test_turns_change_nothing_and_all_are_judged_at_the_same_picture(data: Path):
    """A run in turns with another ends with the weights of one alone; what is shown is as agreed."""
    plan, common = plan_of(), IMAGES - training.SLICE * CONFIG.batch
    shared = shared_of(plan, common)
    work(job_of(plan, data), shared)
    assert list(shared.images) == [IMAGES, IMAGES] and list(shared.stage) == [SHOWN]
    pictures = open_pictures(data / "data", SIZE)
    model = avatar_model(SETTINGS, BODY)
    alone = train(SETTINGS, model, pictures, BODY, data / "alone", accelerator(), lambda line: None)
    state = torch.load(data / "out" / "runs" / "avatargen" / "seed0" / "state.pt", weights_only=True)
    for name, value in alone.networks.named_parameters():  # pyright: ignore[reportAttributeAccessIssue]
        assert torch.equal(state["average"][f"networks.{name}"], value), name
    results = [read_shown(data / "out" / "runs" / run.key) for run in plan.runs]
    assert [result.facts["images"] for result in results if result] == [common, common]
    assert all(len(result.shown) == 8 and len(result.shown.turned) == 6 for result in results if result)
    assert np.array_equal(results[0].shown.chosen, results[1].shown.chosen)  # pyright: ignore


def test_a_run_that_fails_leaves_the_others(data: Path):
    plan = plan_of()
    bad = replace(plan.runs[1].config, optimizer=replace(SETTINGS.optimizer, largest_gradient=1e-9))
    plan = replace(plan, runs=(plan.runs[0], replace(plan.runs[1], config=bad)))
    shared = shared_of(plan, IMAGES)
    work(job_of(plan, data), shared)
    assert list(shared.images) == [IMAGES, FAILED]
    assert read_shown(data / "out" / "runs" / plan.runs[0].key) is not None
    assert read_shown(data / "out" / "runs" / plan.runs[1].key) is None
    assert "avatargen-density/seed0 failed: train: the" in (data / "out" / "log.txt").read_text()


def test_of_a_worker_that_dies_one_run_is_lost(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    class Dead:
        exitcode = -9

        def is_alive(self) -> bool:
            return False

    started = []
    monkeypatch.setattr(Conductor, "start", lambda self, number, places: started.append((number, places)))
    plan, places = plan_of(), Places(data=tmp_path, held_out=tmp_path, out=tmp_path)
    one = Conductor(plan, places, Conditions(jobs=1, minutes=None, megabytes=1))
    one.workers, one.shares[0] = {0: Dead()}, [0, 1]
    one.shared.active[0] = 1
    lines: list[str] = []
    one.replace_dead(lines.append)
    assert list(one.shared.images) == [0, FAILED] and started == [(0, [0])] and not one.at_end()
    assert "avatargen-density/seed0 is lost" in lines[0]
    one.shared.active[0] = FAILED
    for _ in range(conduct.LIVES):
        one.replace_dead(lines.append)
    assert list(one.shared.images) == [FAILED, FAILED] and one.all_at(SHOWN) and one.at_end()


def result(count: int, turned: int, seed: int, name: str = "avatargen") -> Result:
    random = np.random.default_rng(seed)

    def views(n: int) -> Views:
        return Views(
            image=random.integers(0, 256, (n, SIZE, SIZE, 3)).astype(np.uint8),
            depth=random.integers(1, 65536, (n, 8, 8)).astype(np.uint16),
            mask=np.where(random.random((n, 8, 8)) < 0.5, 255, 0).astype(np.uint8),
        )

    shown = Shown(chosen=np.arange(count), first=views(count), turned=views(turned), reposed=views(0))
    facts = {"name": name, "seed": seed, "images": 100, "device": "CPU"}
    return Result(facts=facts, shown=shown)


def test_pictures_come_back_as_they_were(tmp_path: Path):
    one = with_counts(result(20, 7, 0))
    back = decode(encode(one))
    assert back.facts == one.facts and len(back.shown.reposed) == 0
    for kind in ("first", "turned"):
        old, new = getattr(one.shown, kind), getattr(back.shown, kind)
        assert np.array_equal(old.image, new.image) and np.array_equal(old.mask, new.mask)
        assert np.array_equal(np.where(old.mask > 0, old.depth, 0), new.depth)
    write_shown(tmp_path, one)
    again = read_shown(tmp_path)
    assert again is not None and np.array_equal(again.shown.first.image, one.shown.first.image)
    (tmp_path / "shown" / "first-depth").write_bytes(b"nothing")
    with pytest.raises(InputError, match="damaged"):
        read_shown(tmp_path)


def test_packs_keep_to_their_limit_and_every_run_the_same_share(tmp_path: Path):
    results = {f"run{i}/seed0": encode(with_counts(result(60, 20, i))) for i in range(5)}
    whole = sum(path.stat().st_size for path in pack(results, tmp_path, 64 << 20))
    limit = whole * 2 // 3
    parts = pack(results, tmp_path, limit)
    assert sum(path.stat().st_size for path in parts) <= limit and len(parts) <= 8
    back = dict(read_packed(tmp_path))
    assert set(back) == set(results)
    assert len({len(each.shown) for each in back.values()}) == 1 and 20 < len(back["run0/seed0"].shown) < 60
    with pytest.raises(InputError, match="do not fit"):
        pack(results, tmp_path, 1000)


def test_what_fits_is_packed_as_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Encoding hundreds of pictures a run takes longer than a deadline leaves."""
    results = {f"run{i}/seed0": encode(with_counts(result(6, 2, i))) for i in range(3)}
    monkeypatch.setattr("avatargen.comparison.packed.encode", None)
    monkeypatch.setattr("avatargen.comparison.packed.decode", None)
    parts = pack(results, tmp_path, 64 << 20)
    found = {}
    for part in parts:
        with zipfile.ZipFile(part) as archive:
            found |= {name: archive.read(name) for name in archive.namelist()}
    assert found == {f"{key}/{name}": data for key, own in results.items() for name, data in own.items()}


def test_intervals_are_over_seeds_and_people():
    alone = cell([Number(value=2.0, low=1.5, high=2.5, count=10)])
    assert (alone.low, alone.high) == (1.5, 2.5)
    values = np.array([1.0, 2.0, 4.5])
    three = cell([Number(value=v, low=v, high=v, count=10) for v in values])
    half = 4.302653 * values.std(ddof=1) / np.sqrt(3)
    assert three.high - three.value == pytest.approx(half, rel=1e-5) and three.value == values.mean()
    both = cell([Number(value=v, low=v - 3, high=v + 3, count=10) for v in values])
    assert both.high - both.value == pytest.approx(np.hypot(half, 3), rel=1e-5)


def test_a_table_is_measured_once_and_tells_who_leads(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    pictures = make_data(tmp_path / "data")
    image = np.stack([np.asarray(Image.open(tmp_path / "data" / name)) for name in pictures.labels.names])
    some = result(8, 0, 0)
    good = replace(some, shown=replace(some.shown, first=replace(some.shown.first, image=image)))
    plan = plan_of(models=("avatargen", "eg3d"))
    results = {"avatargen/seed0": good, "eg3d/seed0": result(8, 0, 1, "eg3d")}
    judges = Judges(features=(BUILT_IN,), joints=ridge_judge(pictures, BODY, 100))
    held = Held(data=pictures, reference=pictures, body=BODY, judges=judges)
    found = measure_table(plan.tables[0], plan, results, held, tmp_path, lambda line: None)
    text = markdown(found)
    assert "| AvatarGen | **" in text and found.pictures == 8
    assert "| frechet distance |" in text and "| EG3D | 100 % | 40 % |" in text
    monkeypatch.setattr("avatargen.comparison.measured.measure", None)  # nothing is measured again
    assert markdown(measure_table(plan.tables[0], plan, results, held, tmp_path, lambda line: None)) == text
    assert sheet({"AvatarGen": good}, pictures).startswith(b"\x89PNG")
