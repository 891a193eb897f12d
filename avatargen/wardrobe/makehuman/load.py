"""Loading a folder of MakeHuman assets: every garment in it, fitted to the canonical body.

    DIR/clothes/NAME/NAME.mhclo   DIR/hair/...

A folder of that layout is what MakeHuman itself keeps for its users, so downloaded clothes work by path.
"""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from jaxtyping import Float, Float32, Int64, UInt8
from PIL import Image, UnidentifiedImageError
from scipy.spatial import KDTree

from avatargen.eight_bits import eight_bits
from avatargen.errors import InputError
from avatargen.wardrobe.makehuman.emblems import paint_out
from avatargen.wardrobe.makehuman.fit import at_rest, fit
from avatargen.wardrobe.makehuman.hm08 import Hm08, load_hm08
from avatargen.wardrobe.makehuman.pieces import kind_of, pieces_of
from avatargen.wardrobe.makehuman.read import Binding, Mesh, read_binding, read_material, read_mesh

FOLDERS = {"clothes": "", "hair": "hair"}
TORN = ("male_casualsuit03-top", "female_elegantsuit01-bottom")  # hems like saws: tailored ones are worn
MAX_PIXELS = 8192**2
LEAST_SHARE = 0.18  # of the faces of the largest piece of its kind, to be a garment by itself


@dataclass(frozen=True, kw_only=True)
class FittedGarment:
    """One garment on the canonical body (X-pose, betas 0): an open or closed surface with its texture.

    `kind` is top, bottom, dress, outer, tie, overall, shoes, socks, hat or hair. uv runs from the top left of
    the texture, one row a face corner.
    """

    name: str
    kind: str
    tags: tuple[str, ...]
    vertices: Float32[np.ndarray, "V 3"]  # m
    faces: Int64[np.ndarray, "F 3"]
    uv: Float32[np.ndarray, "F 3 2"]
    texture: UInt8[np.ndarray, "H W 4"]  # sRGB and alpha
    z_depth: int  # higher lies further out
    hidden: Int64[np.ndarray, " N"]  # vertices of the body that it hides

    def __post_init__(self) -> None:
        if len(self.faces) == 0 or not np.isfinite(self.vertices).all():
            raise InputError(f"wardrobe: {self.name} has no faces or is not finite; check its files")

    @property
    def own_color(self) -> tuple[float, float, float]:
        """The median of its texture at its faces' middles, sRGB 0..1."""
        height, width = self.texture.shape[:2]
        at = (self.uv.mean(axis=1) * (width, height)).astype(np.int64).clip(0, (width - 1, height - 1))
        r, g, b = (np.median(self.texture[at[:, 1], at[:, 0], :3], axis=0) / 255).tolist()
        return (r, g, b)


def read_texture(path: Path) -> UInt8[np.ndarray, "H W 4"]:
    """A texture, sRGB and alpha.

    Raises:
        InputError: the file is missing, no picture, or larger than 8192 x 8192.
    """
    try:
        with Image.open(path) as picture:
            if picture.width * picture.height > MAX_PIXELS:
                raise InputError(f"wardrobe: {path} has {picture.size} texels; at most 8192 x 8192 are read")
            return np.array(eight_bits(picture).convert("RGBA"))
    except (OSError, UnidentifiedImageError, ValueError) as error:
        raise InputError(f"wardrobe: cannot read the picture {path}: {error}; check it") from error


def plain_texture() -> UInt8[np.ndarray, "H W 4"]:
    """For garments without a texture: light grey."""
    return np.tile(np.array([200, 200, 200, 255], dtype=np.uint8), (8, 8, 1))


def load_asset(path: Path, hm08: Hm08) -> list[FittedGarment]:
    """The garments of one `.mhclo` file, fitted; an outfit gives several.

    Raises:
        InputError: a file of the asset is missing or is not what its format asks for.
    """
    binding = read_binding(path)
    mesh = read_mesh(binding.mesh)
    if len(binding.indices) != len(mesh.vertices):
        raise InputError(
            f"wardrobe: {path} binds {len(binding.indices)} vertices of {len(mesh.vertices)} in "
            f"{binding.mesh.name}; the two files must belong together"
        )
    diffuse = read_material(binding.material) if binding.material else None
    texture = paint_out(read_texture(diffuse), diffuse.stem) if diffuse else plain_texture()
    vertices = fit(hm08, binding, mesh.faces)
    family = FOLDERS.get(path.parent.parent.name, "")
    if family:
        parts, kinds = [np.arange(len(mesh.faces))], [family]
    else:
        parts, kinds = sort_pieces(hm08, binding, mesh)
    hidden = hidden_by(hm08, binding, vertices, mesh, parts)
    garments = []
    for part, kind, hides in zip(parts, kinds, hidden, strict=True):
        used, faces = np.unique(mesh.faces[part], return_inverse=True)
        uv = mesh.uv[mesh.corners[part]] * (1, -1) + (0, 1)
        garments.append(
            FittedGarment(
                name=f"{path.stem}-{kind}" if len(parts) > 1 else path.stem,
                kind=kind,
                tags=binding.tags,
                vertices=vertices[used].astype(np.float32),
                faces=faces.reshape(-1, 3),
                uv=uv.astype(np.float32),
                texture=texture,
                z_depth=binding.z_depth,
                hidden=hides,
            )
        )
    return garments


def sort_pieces(hm08: Hm08, binding: Binding, mesh: Mesh) -> tuple[list[np.ndarray], list[str]]:
    """The faces of each garment of an outfit, and what it is.

    Shoes and socks are pairs. What is small beside another piece of its kind is part of that (lapels, belts);
    otherwise the largest of several tops is worn over them.
    """
    floor, tall = hm08.rest[:, 1].min(), np.ptp(hm08.rest[:, 1])
    height = (at_rest(hm08, binding)[:, 1] - floor) / tall
    found: dict[str, list[np.ndarray]] = {}
    for part in pieces_of(mesh.vertices, mesh.faces):
        found.setdefault(kind_of(height[np.unique(mesh.faces[part])]), []).append(part)
    parts, kinds = [], []
    for kind, pieces in found.items():
        apart = [p for p in pieces if len(p) >= LEAST_SHARE * len(pieces[0])] if kind == "top" else pieces[:1]
        whole = [p for p in pieces if not any(p is q for q in apart)]
        parts += [np.concatenate([apart[0], *whole]), *apart[1:]]
        kinds += ["outer" if len(apart) > 1 else kind] + [kind] * (len(apart) - 1)
    return parts, kinds


def hidden_by(
    hm08: Hm08,
    binding: Binding,
    vertices: Float[np.ndarray, "V 3"],
    mesh: Mesh,
    parts: list[np.ndarray],
) -> list[np.ndarray]:
    """The body's vertices that each piece hides: those of the outfit that lie nearest to it."""
    hidden = hm08.hidden_body(binding.hidden)
    at = hm08.body_at_rest[hidden]
    rest = at_rest(hm08, binding)
    distances = [KDTree(rest[np.unique(mesh.faces[part])]).query(at)[0] for part in parts]
    nearest = np.argmin(distances, axis=0)
    return [hidden[nearest == index] for index in range(len(parts))]


@lru_cache(maxsize=4)
def load_folder(folder: Path) -> tuple[FittedGarment, ...]:
    """All garments of a folder, by name.

    Raises:
        InputError: the folder holds none, or one of its files is not what its format asks for.
    """
    paths = sorted(path for name in FOLDERS for path in folder.glob(f"{name}/*/*.mhclo"))
    if not paths:
        raise InputError(
            f"wardrobe: {folder} holds no clothes/NAME/NAME.mhclo; give a folder of MakeHuman's assets"
        )
    hm08 = load_hm08()
    found = (garment for path in paths for garment in load_asset(path, hm08))
    return tuple(garment for garment in found if garment.name not in TORN)
