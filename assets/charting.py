"""Charts of a texture, cut beside other stages, in a thread of their own."""

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace

from assets.build_config import BuildConfig
from assets.errors import GeometryError
from assets.mesh.surface import Surface
from assets.skin.attach import attach
from assets.skin.skin import SkinConfig, parts_of_faces, skin_attached
from assets.texture.atlas import Atlas, AtlasConfig, unwrap
from assets.texture.guided import guided_atlas
from assets.texture.pattern import find_pattern
from avatargen.body.fingers import hand_of_joint
from avatargen.body.model import CanonicalBody

DETAILED_JOINT = "head"  # whose part of the texture is finer: people look at faces


class Charting:
    """One atlas on its way; leaving the context waits for it."""

    def __init__(self) -> None:
        self.beside = ThreadPoolExecutor(1)
        self.atlas: Future[Atlas] | None = None

    def __enter__(self) -> "Charting":
        return self

    def __exit__(self, *error: object) -> None:
        self.beside.shutdown(cancel_futures=True)

    def begin(self, surface: Surface, body: CanonicalBody, config: BuildConfig) -> None:
        """Cut this surface, whose vertices may still move a little, from now on."""
        self.atlas = self.beside.submit(cut_charts, surface, body, config)

    def result(self) -> Atlas:
        """The atlas, when it is done. Raises what cutting it raised."""
        assert self.atlas is not None, "nothing was begun"
        return self.atlas.result()


def cut_charts(surface: Surface, body: CanonicalBody, config: BuildConfig) -> Atlas:
    """Charts along the seams of clothes, or xatlas's own where that cannot be."""
    try:
        return cut_along_seams(surface, body, config)
    except GeometryError as error:
        return replace(cut_at_joints(surface, body, config), unguided=str(error))


def cut_along_seams(surface: Surface, body: CanonicalBody, config: BuildConfig) -> Atlas:
    """Charts from a sewing pattern.

    Raises:
        GeometryError: the body lacks joints that the pattern takes, or a panel does not lie flat.
    """
    pattern = find_pattern(surface, body)
    return guided_atlas(surface, pattern, AtlasConfig(texture_size=config.texture), config.head_detail)


def cut_at_joints(surface: Surface, body: CanonicalBody, config: BuildConfig) -> Atlas:
    """xatlas's charts, cut where other joints move the surface."""
    skin = skin_attached(attach(surface, body), body, SkinConfig())
    parts = parts_of_faces(surface, skin, hand_of_joint(body.joint_names))
    return unwrap(surface, parts, atlas_config(body, config))


def atlas_config(body: CanonicalBody, config: BuildConfig) -> AtlasConfig:
    """Charts for the texture's size, finer on the head of a body that has one."""
    scales: tuple[tuple[int, float], ...] = ()
    if DETAILED_JOINT in body.joint_names:
        scales = ((body.joint_names.index(DETAILED_JOINT), config.head_detail),)
    return AtlasConfig(texture_size=config.texture, scales=scales)
