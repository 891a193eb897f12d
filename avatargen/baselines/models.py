"""The models of pictures by name: made anew for a run, or read from a file, whichever it is of."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from avatargen.baselines import eg3d, giraffe_hd, stylenerf, stylesdf
from avatargen.baselines.baseline import Baseline
from avatargen.baselines.checkpoint import FORMAT
from avatargen.baselines.config import BaselineConfig, for_body
from avatargen.body.model import Body, canonical_body
from avatargen.errors import InputError
from avatargen.generator.checkpoint import (
    ROOM,
    SLACK,
    Allowance,
    format_of,
    from_json,
    load_checkpoint,
    read_tensors,
    require_finite,
    require_fit,
)
from avatargen.generator.config import body_hash
from avatargen.generator.picture import CanonicalSurface
from avatargen.training.adversarial_config import AdversarialConfig, LossConfig
from avatargen.training.avatar_model import AvatarModel
from avatargen.training.picture_model import PictureModel


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A method: its networks, their configuration, and its sizes by the names of AvatarGen's."""

    networks: type[Any]
    config: type[BaselineConfig]
    sizes: dict[str, Any]


BASELINES = {
    "eg3d": Kind(networks=eg3d.EG3D, config=eg3d.EG3DConfig, sizes=eg3d.SIZES),
    "stylesdf": Kind(networks=stylesdf.StyleSDF, config=stylesdf.StyleSDFConfig, sizes=stylesdf.SIZES),
    "stylenerf": Kind(networks=stylenerf.StyleNeRF, config=stylenerf.StyleNeRFConfig, sizes=stylenerf.SIZES),
    "giraffe-hd": Kind(
        networks=giraffe_hd.GiraffeHD, config=giraffe_hd.GiraffeHDConfig, sizes=giraffe_hd.SIZES
    ),
}


def new_baseline(name: str, config: AdversarialConfig, body: Body) -> Baseline:
    """A baseline with random weights by the run's seed, of the size of the run's networks."""
    kind = BASELINES[name]
    networks = for_body(kind.sizes[config.networks], canonical_body(body), config.render)
    torch.manual_seed(config.seed)
    return kind.networks(networks)


def load_model(path: str | Path, body: Body) -> PictureModel:
    """Read any model of pictures, AvatarGen's or a baseline, for a body.

    Raises:
        InputError: no whole checkpoint of either, or one that was trained on another body.
    """
    path = Path(path)
    if format_of(path) == FORMAT:
        model = load_baseline(path)
        trained_on = model.config.body_hash
    else:
        generator = load_checkpoint(path).generator
        model = AvatarModel(generator, CanonicalSurface(body), LossConfig())
        trained_on = generator.config.body_hash
    if trained_on != body_hash(canonical_body(body)):
        raise InputError(f"weights: {path} is of another body than the one given; name its body")
    return model


def load_baseline(path: str | Path) -> Baseline:
    """Read a baseline; every weight is checked to be there, of the right shape, and finite.

    Raises:
        InputError: the file is missing, cut off, damaged, of another format, or its weights do not fit or are
        NaN.
    """
    tensors, metadata = read_tensors(Path(path))
    if metadata.get("format") != FORMAT or metadata.get("model") not in BASELINES:
        raise InputError(
            f"weights: {path} has format {metadata.get('format')!r} of {metadata.get('model')!r}; "
            f"{FORMAT!r} of {', '.join(BASELINES)} is read"
        )
    kind = BASELINES[metadata["model"]]
    try:
        config = from_json(kind.config, json.loads(metadata["config"]))
        require_finite(tensors, str(path))
        stored = sum(tensor.numel() for tensor in tensors.values())
        with torch.random.fork_rng(devices=[]), Allowance(SLACK * stored + ROOM):
            model = kind.networks(config)
        require_fit(tensors, model.state_dict(), str(path))
    except InputError:
        raise
    except (KeyError, TypeError, ValueError, RecursionError, OverflowError, RuntimeError) as error:
        raise InputError(
            f"weights: the configuration in {path} is damaged ({str(error)[:200]}); train it anew"
        ) from error
    model.load_state_dict(tensors)
    return model.eval()
