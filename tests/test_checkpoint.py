"""Checkpoints: what is saved is read back; damaged files end in one clear error."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file

from avatargen.errors import InputError
from avatargen.generator.checkpoint import load_checkpoint, save_checkpoint, weights_hash
from avatargen.generator.config import PRESETS, GeneratorConfig, SynthesisConfig, for_body
from avatargen.generator.generator import AvatarGenerator
from tests.generators import capsule_canonical, random_generator


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    save_checkpoint(random_generator(), tmp_path / "g.safetensors", {"licence": "CC0-1.0"})
    return tmp_path / "g.safetensors"


def write_as(saved: Path, tensors: dict | None = None, metadata: dict | None = None) -> Path:
    """A copy of a checkpoint with other tensors or metadata."""
    from avatargen.generator.checkpoint import read_tensors

    old_tensors, old_metadata = read_tensors(saved)
    path = saved.with_name("changed.safetensors")
    save_file(old_tensors | (tensors or {}), path, old_metadata | (metadata or {}))
    return path


def test_what_is_saved_is_read_back(saved: Path):
    generator, checkpoint = random_generator(), load_checkpoint(saved)
    assert checkpoint.generator.config == generator.config
    assert checkpoint.notes == {"licence": "CC0-1.0"}
    assert not checkpoint.generator.training
    state = checkpoint.generator.state_dict()
    assert all(torch.equal(state[name], tensor) for name, tensor in generator.state_dict().items())
    assert (
        checkpoint.weights_hash
        == weights_hash(dict(generator.state_dict()))
        == save_checkpoint(generator, saved)
    )


def test_half_precision_halves_the_file_and_is_read_as_single(saved: Path, tmp_path: Path):
    generator = random_generator()
    save_checkpoint(generator, tmp_path / "half.safetensors", half=True)
    assert (tmp_path / "half.safetensors").stat().st_size < 0.55 * saved.stat().st_size
    state = load_checkpoint(tmp_path / "half.safetensors").generator.state_dict()
    for name, tensor in generator.state_dict().items():
        assert state[name].dtype == tensor.dtype
        assert torch.allclose(state[name], tensor, rtol=2**-11, atol=1e-7)


@pytest.mark.parametrize("preset", PRESETS)
def test_every_preset_survives_json(preset: str):
    from dataclasses import asdict

    from avatargen.generator.checkpoint import from_json

    for config in (PRESETS[preset], for_body(PRESETS[preset], capsule_canonical())):
        assert from_json(GeneratorConfig, json.loads(json.dumps(asdict(config)))) == config


def test_same_weights_same_bytes_and_hash_tells_weights_apart(tmp_path: Path):
    first = save_checkpoint(random_generator(0), tmp_path / "a.safetensors")
    again = save_checkpoint(random_generator(0), tmp_path / "b.safetensors")
    other = save_checkpoint(random_generator(1), tmp_path / "c.safetensors")
    assert first == again != other
    assert (tmp_path / "a.safetensors").read_bytes() == (tmp_path / "b.safetensors").read_bytes()


def test_loading_leaves_the_random_state_alone(saved: Path):
    torch.manual_seed(0)
    expected = torch.rand(1)
    torch.manual_seed(0)
    load_checkpoint(saved)
    assert torch.equal(torch.rand(1), expected)


def test_missing_cut_and_foreign_files_are_refused(saved: Path):
    whole = saved.read_bytes()
    for name, content in {
        "empty": b"",
        "cut": whole[:-100],
        "cut in the header": whole[:100],
        "text": b"a" * 5000,
    }.items():
        path = saved.with_name(name)
        path.write_bytes(content)
        with pytest.raises(InputError, match="no whole safetensors file"):
            load_checkpoint(path)
    with pytest.raises(InputError, match="no file"):
        load_checkpoint(saved.with_name("none"))
    with pytest.raises(InputError, match="no file"):
        load_checkpoint(saved.parent)


def test_weights_that_do_not_fit_are_refused(saved: Path):
    constant = random_generator().synthesis.constant.detach()
    cases = {
        "NaN": {"synthesis.constant": constant * torch.nan},
        "is needed": {"synthesis.constant": constant[:-1].clone()},
        "unknown tensors": {"other": torch.zeros(1)},
        "float64": {"synthesis.constant": constant.double()},
    }
    for message, tensors in cases.items():
        with pytest.raises(InputError, match=message):
            load_checkpoint(write_as(saved, tensors))
    deeper = replace(random_generator().config.mapping, layers=3)
    config = json.dumps({"mapping": {"layers": deeper.layers}})
    with pytest.raises(InputError, match=r"lacks|is needed|for_body"):
        load_checkpoint(write_as(saved, metadata={"config": config}))


DAMAGED = (
    "",
    "[]",
    "null",
    "{",
    '{"mapping": 3}',
    '{"unknown": 1}',
    '{"vertex_count": "many"}',
    "[" * 100000,
)
OUT_OF_RANGE = (
    '{"synthesis": {"blocks": [[4]]}}',
    '{"vertex_count": 99999999999}',
    '{"mapping": {"width": -1}}',
    '{"decoder": {"width": 1e30}}',
)


@pytest.mark.parametrize("config", [*DAMAGED, *OUT_OF_RANGE])
def test_damaged_configurations_are_refused(saved: Path, config: str):
    with pytest.raises(InputError, match="config"):
        load_checkpoint(write_as(saved, metadata={"config": config}))


def test_other_formats_are_refused(saved: Path):
    with pytest.raises(InputError, match="format"):
        load_checkpoint(write_as(saved, metadata={"format": "other"}))


def test_weights_that_are_not_finite_are_not_saved(tmp_path: Path):
    generator = random_generator()
    generator.synthesis.constant.data[0] = torch.inf
    with pytest.raises(InputError, match=r"synthesis\.constant"):
        save_checkpoint(generator, tmp_path / "g.safetensors")
    assert list(tmp_path.iterdir()) == []


def test_settings_that_make_no_generator_are_refused():
    with pytest.raises(InputError, match="double"):
        replace(PRESETS["debug"], synthesis=SynthesisConfig(blocks=((4, 8), (12, 8))))
    with pytest.raises(InputError, match="activation"):
        replace(PRESETS["debug"], decoder=replace(PRESETS["debug"].decoder, activation="sine"))
    with pytest.raises(InputError, match="power of two"):
        replace(PRESETS["debug"], render=replace(PRESETS["debug"].render, image_size=24))
    with pytest.raises(InputError, match="nearest"):
        replace(PRESETS["debug"], render=replace(PRESETS["debug"].render, nearest=5))
    assert AvatarGenerator(for_body(PRESETS["debug"], capsule_canonical())).config.vertex_count > 0
