"""Charts of a texture, cut in a process of their own while other stages run."""

from concurrent.futures import Future, ThreadPoolExecutor

from assets.build_config import BuildConfig
from assets.mesh.surface import Surface
from assets.skin.attach import attach
from assets.skin.skin import SkinConfig, parts_of_faces, skin_attached
from assets.texture.atlas import Atlas, AtlasConfig, ChartProgram, unwrap
from avatargen.body.fingers import hand_of_joint
from avatargen.body.model import CanonicalBody

DETAILED_JOINT = "head"  # whose part of the texture is finer: people look at faces


class Charting:
    """One atlas on its way. xatlas starts with it, which takes a tenth of a second; leaving the context ends
    it."""

    def __init__(self) -> None:
        self.program, self.beside = ChartProgram(), ThreadPoolExecutor(1)
        self.atlas: Future[Atlas] | None = None

    def __enter__(self) -> "Charting":
        return self

    def __exit__(self, *error: object) -> None:
        with self.program:
            self.beside.shutdown()

    def begin(self, surface: Surface, body: CanonicalBody, config: BuildConfig) -> None:
        """Cut this surface, whose vertices may still move a little, from now on."""
        self.atlas = self.beside.submit(cut_charts, surface, body, config, self.program)

    def result(self) -> Atlas:
        """The atlas, when it is done. Raises what cutting it raised."""
        assert self.atlas is not None, "nothing was begun"
        return self.atlas.result()


def cut_charts(surface: Surface, body: CanonicalBody, config: BuildConfig, program: ChartProgram) -> Atlas:
    """Charts of a surface, cut where other joints move it."""
    skin = skin_attached(attach(surface, body), body, SkinConfig())
    parts = parts_of_faces(surface, skin, hand_of_joint(body.joint_names))
    return unwrap(surface, parts, atlas_config(body, config), program)


def atlas_config(body: CanonicalBody, config: BuildConfig) -> AtlasConfig:
    """Charts for the texture's size, finer on the head of a body that has one."""
    scales: tuple[tuple[int, float], ...] = ()
    if DETAILED_JOINT in body.joint_names:
        scales = ((body.joint_names.index(DETAILED_JOINT), config.head_detail),)
    return AtlasConfig(texture_size=config.texture, scales=scales)
