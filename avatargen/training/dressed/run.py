"""A run: every garment of a wardrobe learned and kept in a file of its own, then all of them and the skins in
one generator. What is there is not learned again, so several processes may share a run.

    RUN/garments/NAME.safetensors   RUN/skin.safetensors   RUN/generator.safetensors
"""

import json
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Bool
from safetensors.torch import save

from avatargen.atomic import write_atomically
from avatargen.body.model import CanonicalBody
from avatargen.errors import InputError
from avatargen.generator.checkpoint import from_json, read_tensors
from avatargen.generator.config import body_hash
from avatargen.generator.dressed.checkpoint import GARMENT, SKIN, save_dressed
from avatargen.generator.dressed.config import DressedConfig, GarmentConfig, SkinConfig, TableConfig
from avatargen.generator.dressed.generator import (
    LearnedGarment,
    LearnedSkin,
)
from avatargen.generator.dressed.tables import Table
from avatargen.training.dressed.learn import Learned, LearningConfig, Named, learn, told
from avatargen.training.dressed.skin import LearnedSkins, SkinCut, learn_skins
from avatargen.wardrobe.makehuman.load import FittedGarment
from avatargen.wardrobe.makehuman.person import ArtistGarment, Wardrobe
from avatargen.wardrobe.makehuman.strands import Strands
from avatargen.wardrobe.makehuman.truth import ClothTruth, HairTruth, Truth

SKIN_FILE = "skin.safetensors"
LEAST_TABLE = TableConfig(segments=1, numbers=1, nodes=1)
NO_SKIN = SkinConfig(  # of a garment by itself
    skins=("none",),
    irises=("none",),
    tables=(LEAST_TABLE,),
    iris_side=1,
)


@dataclass(frozen=True, kw_only=True)
class PeopleConfig:
    """Settings of a run."""

    learning: LearningConfig = field(default_factory=LearningConfig)
    skin: SkinCut = field(default_factory=SkinCut)


def train(
    wardrobe: Wardrobe,
    config: PeopleConfig,
    out: Path,
    names: Iterable[str] | None,
    show: Callable[[str], None],
    notes: dict[str, str],
) -> bool:
    """Learn what is not there yet; with all of it there, write the generator and return True.

    Raises:
        InputError: a name is no garment's, or a file of the run is damaged.
    """
    layers = wardrobe.garments
    wanted = list(layers) if names is None else list(names)
    if unknown := sorted(set(wanted) - set(layers)):
        raise InputError(f"garments: found {unknown[0]}, wanted some of {', '.join(layers)}")
    (out / "garments").mkdir(parents=True, exist_ok=True)
    for name in wanted:
        path = garment_file(out, name)
        if not path.is_file():
            save_garment(learn_garment(wardrobe, wardrobe.fitted(name), config.learning, show), path)
    if not (out / SKIN_FILE).is_file():
        save_skins(learn_skins(wardrobe, config.skin, show), wardrobe.body, out / SKIN_FILE)
    if not all(garment_file(out, name).is_file() for name in layers):
        return False
    assemble(wardrobe, out, list(layers), notes)
    return True


def garment_file(out: Path, name: str) -> Path:
    return out / "garments" / f"{name}.safetensors"


@dataclass(frozen=True, kw_only=True, eq=False)
class Placed:
    """A learned garment with the vertices that it hides."""

    learned: Learned
    hidden: Bool[np.ndarray, " V"]
    body: CanonicalBody


def learn_garment(
    wardrobe: Wardrobe, garment: FittedGarment, learning: LearningConfig, show: Callable[[str], None]
) -> Placed:
    """Learn one garment."""
    body, made = wardrobe.body, wardrobe.made(garment.name)
    middle, hidden = (50.0, 0.0, 0.0), np.zeros(len(body.vertices), dtype=bool)
    truth: Truth
    if garment.kind == "hair":
        truth = HairTruth(strands=Strands(garment=garment, body=body.distance))
    else:
        truth, middle, hidden = ClothTruth(made=made), made.middle, made.hidden
    named = Named(name=garment.name, kind=garment.kind, tags=garment.tags, middle=middle)
    return Placed(learned=learn(named, truth, body, learning, show), hidden=hidden, body=body)


def save_garment(placed: Placed, path: Path) -> None:
    """Write a garment's weights as the generator holds them."""
    found, body = placed.learned, placed.body
    module = LearnedGarment(found.config, whole_of(body, (found.config,), NO_SKIN))
    module.volume.load_state_dict(found.volume.state_dict())
    module.places.set(found.places)
    module.covered.copy_(torch.from_numpy(found.covered).to(torch.uint8))
    module.hidden.copy_(torch.from_numpy(placed.hidden).to(torch.uint8))
    notes = {"config": json.dumps(asdict(found.config)), "errors": told(found.errors)}
    write_atomically(path, save({k: v.contiguous() for k, v in module.state_dict().items()}, notes))


def save_skins(found: LearnedSkins, body: CanonicalBody, path: Path) -> None:
    """Write the skins as the generator holds them."""
    module = LearnedSkin(found.config, whole_of(body, (), found.config))
    for table, values in zip(module.tables, found.tables, strict=True):
        assert isinstance(table, Table)
        table.set(torch.from_numpy(np.asarray(values, dtype=np.float32)))
    module.covered.copy_(torch.from_numpy(np.stack(found.covered)).to(torch.uint8))
    module.mixing.copy_(torch.from_numpy(found.mixing))
    module.middle.copy_(torch.from_numpy(found.middle))
    module.irises.copy_(torch.from_numpy(found.irises))
    tensors = {k: v.contiguous() for k, v in module.state_dict().items()}
    write_atomically(path, save(tensors, {"config": json.dumps(asdict(found.config))}))


def opening_of(garment: ArtistGarment) -> tuple[float, ...] | None:
    """The plane of a hat's edge as settings hold it."""
    if garment.opening is None:
        return None
    return tuple(float(x) for x in (*garment.opening.at, *garment.opening.up))


def assemble(wardrobe: Wardrobe, out: Path, names: list[str], notes: dict[str, str]) -> None:
    """Write the generator of a run's garments and skins."""
    parts = [read_tensors(garment_file(out, name)) for name in names]
    garments = tuple(
        replace(
            from_json(GarmentConfig, json.loads(metadata["config"])),
            opening=opening_of(wardrobe.made(name)),
        )
        for name, (_, metadata) in zip(names, parts, strict=True)
    )
    body = wardrobe.body
    skin, metadata = read_tensors(out / SKIN_FILE)
    whole = whole_of(body, garments, from_json(SkinConfig, json.loads(metadata["config"])))
    kept = {f"{GARMENT}{name}": tensors for name, (tensors, _) in zip(names, parts, strict=True)}
    save_dressed(whole, {SKIN: skin} | kept, out / "generator.safetensors", notes)


def whole_of(body: CanonicalBody, garments: tuple[GarmentConfig, ...], skin: SkinConfig) -> DressedConfig:
    """The whole generator's settings on a body."""
    return DressedConfig(
        garments=garments,
        skin=skin,
        body_hash=body_hash(body),
        vertex_count=len(body.vertices),
        face_count=len(body.faces),
    )
