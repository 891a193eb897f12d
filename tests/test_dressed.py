"""A generator of dressed people: what it learns of a small wardrobe is what that wardrobe's people are."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors import safe_open
from safetensors.torch import save_file

from avatargen import load_generator
from avatargen.artist_wardrobe import ArtistWardrobe
from avatargen.avatar import shipped
from avatargen.body.distance import BodyHit
from avatargen.body.load import load_body
from avatargen.body.model import canonical_body
from avatargen.commands import main
from avatargen.dressed_avatar import DressedSampler
from avatargen.errors import InputError
from avatargen.generator.dressed.checkpoint import load_dressed, packed, unpacked
from avatargen.generator.dressed.config import TableConfig
from avatargen.generator.dressed.lattice import at_points, lattice, node_places
from avatargen.generator.dressed.tables import Table
from avatargen.training.dressed.learn import LearningConfig
from avatargen.training.dressed.painting import fit_nodes
from avatargen.training.dressed.run import PeopleConfig, train
from avatargen.training.dressed.skin import SkinCut
from avatargen.wardrobe import dressed
from avatargen.wardrobe.choosing import SHOWN
from avatargen.wardrobe.dressed import (
    AHEAD,
    CATCH,
    EDGE_ZONE,
    FAR,
    GAP,
    HEM,
    HEM_SHADE,
    LOOSE,
    SEAM,
    asked,
    lay_garments,
)
from avatargen.wardrobe.makehuman.choose import Draw, draw_latent
from avatargen.wardrobe.makehuman.hm08 import load_hm08
from tests.small_wardrobe import write_skins, write_tube

CONFIG = PeopleConfig(
    learning=LearningConfig(cloth=0.008, small=0.006),
    skin=SkinCut(patterns=6, body=1, hands=1, head=2),
)


@pytest.fixture(scope="module")
def body():
    return canonical_body(load_body(shipped("body.npz")))


@pytest.fixture(scope="module")
def wardrobe(body, tmp_path_factory) -> ArtistWardrobe:
    folder = tmp_path_factory.mktemp("wardrobe")
    return ArtistWardrobe(write_skins(write_tube(folder, load_hm08())), body, patterns={})


@pytest.fixture(scope="module")
def run(wardrobe, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("run")
    assert train(wardrobe, CONFIG, out, None, lambda line: None, {"licence": "CC0-1.0"})
    return out


@pytest.fixture(scope="module")
def sampler(run) -> DressedSampler:
    found = load_generator(run / "generator.safetensors")
    assert isinstance(found, DressedSampler)
    return found


def around(avatar, count: int, spread: float) -> torch.Tensor:
    """Points about a person's surface."""
    rng = np.random.default_rng(3)
    vertices = avatar.body.vertices
    near = vertices[rng.integers(len(vertices), size=count)] + rng.normal(size=(count, 3)) * spread
    return torch.from_numpy(near.astype(np.float32))


@pytest.mark.parametrize("seed", [1, 6])
def test_a_seed_is_the_same_person_as_in_the_wardrobe(wardrobe, sampler, seed):
    learned, truth = sampler.sample(seed), wardrobe.sample(seed)
    assert learned.info.facts == truth.info.facts and np.array_equal(learned.betas, truth.betas)
    points = around(truth, 6000, 0.01)
    sdf, found = truth.sdf(points), learned.sdf(points)
    near = sdf.abs() < 0.006
    assert float((sdf - found)[near].abs().mean()) < 0.001 and int(near.sum()) > 500  # m
    on_surface = sdf.abs() < 0.001
    apart = (truth.color(points[on_surface]) - learned.color(points[on_surface])).abs()
    assert float(apart.mean()) < 0.03


def test_what_is_covered_is_not_asked_and_nothing_is_lost_by_it(wardrobe, monkeypatch):
    """Pruned and whole, the layers give one field."""
    avatar = next(a for a in map(wardrobe.sample, range(30)) if a.field.garments)
    points = around(avatar, 4000, 0.012).numpy()
    sdf, color = avatar.field.sdf(points), avatar.field.color(points)
    monkeypatch.setattr(dressed, "covers", lambda cloth: np.zeros(len(cloth.rim), dtype=bool))
    assert np.abs(sdf - avatar.field.sdf(points)).max() < 1e-6
    on_surface = np.abs(sdf) < 0.001
    assert on_surface.sum() > 100
    assert np.abs(color - avatar.field.color(points))[on_surface].max() < 0.02


def test_a_layer_is_asked_only_where_it_is_wanted_and_can_be_near(wardrobe):
    garment = wardrobe.sample(1).field.garments[0]
    points = np.array([[0, 0.3, 0.3], [0, 0.3, 5.0], [0, 0.3, 0.2]], np.float32)
    hit = wardrobe.body.distance.query(points)
    cloth = asked(garment, points, hit, np.array([True, True, False]), coloured=True)
    assert cloth.distance[1] == pytest.approx(garment.least(points)[1]) and cloth.distance[1] > 4
    assert cloth.distance[2] == FAR


def test_layers_are_laid_as_their_formulas_say():
    """Over all points at once, in double precision."""
    rng = np.random.default_rng(5)
    outer = rng.uniform(-0.02, 0.04, size=(3, 500)).astype(np.float32)
    rim = rng.uniform(0, 2 * EDGE_ZONE, size=(3, 500)).astype(np.float32)
    dye, bare = rng.random((3, 500, 3), np.float32), rng.random(500, np.float32)
    rim[:, ::7] = HEM / 2
    distance, colour = rng.uniform(-0.02, 0.04, size=500), rng.random((500, 3))
    found, painted = distance.copy(), colour.copy()
    lay_garments(found, painted, bare, outer, rim, dye, True)

    def kept(beneath, over, free):
        return np.maximum(beneath, over + GAP - LOOSE * free - 4 * np.maximum(over - CATCH, 0))

    free = 1 - np.clip(rim / EDGE_ZONE, 0, 1)
    for k in range(3):
        distance = kept(distance, outer[k], np.maximum(bare, free[k]))
    for k in range(3):
        layer = outer[k].astype(np.float64)
        for over in range(k + 1, 3):
            layer = kept(layer, outer[over], free[over])
        within = rim[k] > HEM
        seen = 1 / (1 + np.exp(np.clip((layer - distance - AHEAD * within) / SEAM, -30, 30)))
        shaded = dye[k] * np.where(within, 1, HEM_SHADE)[:, None]
        colour, distance = colour + (shaded - colour) * seen[:, None], np.minimum(distance, layer)
    assert np.abs(found - distance).max() < 1e-7
    assert np.abs(painted - colour).max() < 1e-3  # 1e-7 m of distance through the seam's softness


def test_a_table_keeps_numbers_to_half_a_step(body):
    rng = np.random.default_rng(0)
    covered = np.zeros(len(body.faces), bool)
    covered[:4000] = True
    nodes = lattice(body.faces, covered, 3)
    table = Table(TableConfig(segments=3, numbers=2, nodes=nodes.count))
    values = torch.from_numpy(rng.normal(size=(nodes.count, 2)).astype(np.float32))
    values[0] = 0
    table.set(values)
    surface = table.read(body.faces, covered)
    assert (np.abs(surface.values - values.numpy()) <= 0.5001 * table.scale.numpy()).all()
    face = rng.integers(len(body.faces), size=500)
    at = rng.dirichlet((1, 1, 1), size=500).astype(np.float32)
    read = surface.at(BodyHit(distance=np.zeros(500, np.float32), face=face, barycentric=at))
    index, weights = at_points(
        torch.from_numpy(nodes.face_nodes), 3, torch.from_numpy(face), torch.from_numpy(at)
    )
    slow = (surface.values[index.numpy()] * weights.numpy()[..., None]).sum(axis=1)
    assert np.abs(read - slow).max() < 1e-5


def test_nodes_are_fitted_by_least_squares(body):
    """A linear function of place comes back exactly; nodes without points take their neighbour's."""
    rng = np.random.default_rng(2)
    covered = np.zeros(len(body.faces), bool)
    covered[:3000] = True
    nodes = lattice(body.faces, covered, 2)
    face = rng.integers(3000, size=60_000)
    at = rng.dirichlet((1, 1, 1), size=60_000)
    index, weights = at_points(
        torch.from_numpy(nodes.face_nodes), 2, torch.from_numpy(face), torch.from_numpy(at)
    )
    places = node_places(body.vertices, body.faces, nodes)
    inner = (index > 0).all(dim=1).numpy()
    index, weights, face, at = index.numpy()[inner], weights.numpy()[inner], face[inner], at[inner]
    points = np.einsum("nk,nka->na", at, body.vertices[body.faces[face]])
    values = points @ np.array([[1.0, -2.0], [0.5, 1.0], [0.3, 0.2]]) + 0.4
    found = fit_nodes(index, weights, np.ones(len(points)), values, places)
    again = (found[index] * weights[..., None]).sum(axis=1)
    assert np.abs(again - values).max() < 2e-3 and (found[0] == 0).all()


def test_what_is_there_is_not_learned_again(wardrobe, run):
    before = {path: path.stat().st_mtime_ns for path in run.rglob("*.safetensors")}
    said: list[str] = []
    assert train(wardrobe, CONFIG, run, None, said.append, {"licence": "CC0-1.0"})
    assert not said
    changed = [path.name for path, time in before.items() if path.stat().st_mtime_ns != time]
    assert changed == ["generator.safetensors"]
    with pytest.raises(InputError, match="found trousers, wanted some of tube"):
        train(wardrobe, CONFIG, run, ["trousers"], said.append, {})


def test_traits_are_had_and_the_rest_stays(sampler):
    plain = sampler.sample(5)
    facts = dict(plain.info.facts)
    other = {"woman": "man", "man": "woman"}[str(facts["gender"])]
    chosen = dict(sampler.sample(5, traits={"gender": other, "height": 1.7}).info.facts)
    assert chosen["gender"] == other and chosen["skin"] == facts["skin"]
    assert sampler.sample(5, traits={"height": 1.7}).height == pytest.approx(1.7, abs=1e-3)
    with pytest.raises(InputError, match="bottom jeans: these weights have none at all"):
        sampler.sample(5, traits={"bottom": "jeans"})
    with pytest.raises(InputError, match="sleeves long: these weights do not say"):
        sampler.sample(5, traits={"sleeves": "long"})


def test_truncation_draws_people_to_the_middle_one(sampler):
    first, second = sampler.sample(1, truncation=0.0), sampler.sample(2, truncation=0.0)
    assert first.info.facts == second.info.facts
    with pytest.raises(InputError, match="truncation"):
        sampler.sample(1, truncation=1.5)
    for seed in (-1, True, 2**63):
        with pytest.raises(InputError, match="a seed is a whole number"):
            sampler.sample(seed)


def test_another_body_wears_the_same(run):
    """The own body moved by a centimetre is another one, and wears the same at the same places."""
    source = load_body(shipped("body.npz"))
    own = load_generator(run / "generator.safetensors")
    moved = replace(source, v_template=source.v_template + np.array([0.0, 0.01, 0.0], np.float32))
    other = load_generator(run / "generator.safetensors", body=moved)
    shift = other.body.joints[0] - own.body.joints[0]
    first, second = own.sample(1), other.sample(1)
    points = around(first, 2000, 0.01)
    there = points + torch.from_numpy(shift.astype(np.float32))
    assert float((first.sdf(points) - second.sdf(there)).abs().quantile(0.99)) < 2e-4
    with pytest.raises(InputError, match="leave --device meta out"):
        load_generator(run / "generator.safetensors", device="meta")


def changed(run: Path, out: Path, change) -> Path:
    """The generator's file with the tube's tensors or the settings changed."""
    with safe_open(run / "generator.safetensors", framework="pt") as file:
        parts = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - it is no dictionary
        metadata = dict(file.metadata())
    settings, tube = json.loads(metadata["config"]), unpacked(parts["garments.tube"], "it")
    change(tube, settings)
    parts["garments.tube"] = packed(tube)
    save_file(parts, out, metadata | {"config": json.dumps(settings)})
    return out


def test_bytes_that_are_no_weights_end_in_one_sentence(run, tmp_path):
    with safe_open(run / "generator.safetensors", framework="pt") as file:
        tube, skin, metadata = file.get_tensor("garments.tube"), file.get_tensor("skin"), file.metadata()
    for bad, message in ((tube[: len(tube) // 2].clone(), "cut off"), (torch.zeros(64).byte(), "is damaged")):
        save_file({"garments.tube": bad, "skin": skin}, tmp_path / "w.safetensors", metadata)
        with pytest.raises(InputError, match=message):
            load_dressed(tmp_path / "w.safetensors").garment("tube")
    blank = unpacked(skin, "it")
    blank["mixing"].fill_(float("nan"))
    save_file({"garments.tube": tube, "skin": packed(blank)}, tmp_path / "w.safetensors", metadata)
    with pytest.raises(InputError, match="NaN"):
        load_dressed(tmp_path / "w.safetensors").skin()
    save_file({"garments.tube": tube}, tmp_path / "w.safetensors", metadata)
    with pytest.raises(InputError, match="lacks 1 parts, first skin"):
        load_dressed(tmp_path / "w.safetensors")
    assert len(tube) < 0.4 * sum(t.numel() for t in unpacked(tube, "it").values())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t, s: t.pop("hidden"), "lacks 1 tensors, first hidden"),
        (lambda t, s: s["garments"][0]["volume"].update(cell=0.0), "is out of range"),
        (lambda t, s: s["garments"][0]["volume"].update(blocks=[10**9] * 3), "is out of range"),
        (lambda t, s: s["garments"][0]["volume"].update(colors=2), "of 2 colours is out of range"),
        (lambda t, s: s["garments"].append(s["garments"][0]), "not of different names"),
        (lambda t, s: s["skin"].update(skins=[]), "out of range"),
        (lambda t, s: s.update(colour=1), "unknown settings"),
    ],
)
def test_damaged_weights_end_in_one_sentence(run, tmp_path, change, message):
    with pytest.raises(InputError, match=message):
        load_dressed(changed(run, tmp_path / "w.safetensors", change)).garment("tube")


def test_the_command_learns_and_says_where(wardrobe, run, tmp_path, capsys):
    words = ["train", "people", "--wardrobe", str(wardrobe.folder), "--folder-alone"]
    assert main.main([*words, "--out", str(run)]) == 0
    assert str(run / "generator.safetensors") in capsys.readouterr().out
    assert main.main([*words, "--out", str(tmp_path / "run"), "--garments", "hat"]) == 2
    assert "found hat, wanted some of tube" in capsys.readouterr().err


def test_draws_are_read_the_same_everywhere(sampler, wardrobe):
    for seed in range(40):
        assert sampler.choose(Draw(draw_latent(seed))).facts() == wardrobe.attributes(seed).facts()


@pytest.fixture(scope="module")
def people() -> DressedSampler:
    """The people that come with the package."""
    found = load_generator()
    assert isinstance(found, DressedSampler)
    return found


@pytest.mark.parametrize("name", SHOWN)
def test_the_people_have_every_trait_that_is_said_to_be_shown(people, name):
    for value in SHOWN[name]:
        assert dict(people.sample(3, traits={name: value}).info.facts)[name] == value


def test_everything_there_is_to_wear_is_worn_by_somebody(people):
    facts = [people.choose(Draw(draw_latent(seed))) for seed in range(600)]
    worn = {name for person in facts for name in (*person.garments, person.hair)}
    assert worn - {None} == {each.name for each in people.config.garments}
