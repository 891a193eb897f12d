"""One asset in the making: what the stages have made of an avatar so far."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float, UInt8

from assets.asset.joints import body_on
from assets.build_config import AvatarFields, BuildConfig
from assets.charting import Charting
from assets.isosurface.extract import Extraction
from assets.mesh.clean import Cleaning
from assets.mesh.importance import Importance, by_looks
from assets.mesh.measure import SurfaceError
from assets.mesh.surface import Surface
from assets.skin.attach import Carrier
from assets.skin.rest import RestMesh
from assets.skin.skin import Skin
from assets.texture.atlas import Atlas
from assets.texture.bake import Texture
from assets.texture.normal_map import NormalMap
from avatargen.body.model import CanonicalBody
from avatargen.body.pose import named_pose
from avatargen.errors import InputError

# of a surface, its weights and attachment, and whether these are the weights from the T-pose on
Follow = Callable[[Surface, Skin, Carrier, bool], tuple[Skin, Carrier]]


@dataclass(kw_only=True)
class Draft:
    """What is given, then what each stage adds, in the order of `assets.stages.STAGES`. A stage reads what
    earlier ones have set; what a stage may leave out is None until then."""

    avatar: AvatarFields
    config: BuildConfig
    body: CanonicalBody  # on the joints that are wanted
    rotations: Float[np.ndarray, "J 3"]  # axis-angle, of the rest pose
    charting: Charting | None  # None: no charts are planned
    follow: Follow | None = None  # how what is hidden moves with what hides it; None: nothing does
    least_piece: float = 1.0  # share of the largest piece's volume from which others stay; 1: none does

    extraction: Extraction = field(init=False)
    cleaning: Cleaning = field(init=False)
    surface: Surface = field(init=False)  # canonical: cleaned, then simplified, then laid on the field
    attachment: Carrier = field(init=False)
    skin: Skin = field(init=False)  # to the T-pose
    moved: Skin = field(init=False)  # and from there on
    error: SurfaceError = field(init=False)
    missed: SurfaceError | None = None
    rest: RestMesh = field(init=False)
    atlas: Atlas | None = None
    texture: Texture | None = None
    normal_map: NormalMap | None = None
    occlusion: UInt8[np.ndarray, "K K"] | None = None

    @property
    def importance(self) -> Importance:
        """How much a part of the surface counts."""
        return by_looks(self.body, self.config.head_detail)

    @property
    def charted(self) -> Atlas:
        """The atlas, for the stages that need one."""
        assert self.atlas is not None, "planned without an atlas"
        return self.atlas


@contextmanager
def open_draft(
    avatar: AvatarFields, config: BuildConfig, charts: bool, least_piece: float = 1.0
) -> Iterator[Draft]:
    """Nothing made yet; with `charts`, the program that cuts them has been started.

    Raises:
        InputError: a pose that does not fit the body.
    """
    body = body_on(avatar.body, config.joints)
    rotations = find_pose(config.pose, body)
    with Charting() if charts else nullcontext() as charting:
        yield Draft(
            avatar=avatar,
            config=config,
            body=body,
            rotations=rotations,
            charting=charting,
            least_piece=least_piece,
        )


def find_pose(pose: str | Float[np.ndarray, "J 3"], body: CanonicalBody) -> Float[np.ndarray, "J 3"]:
    """Axis-angle rotations of a named pose, or those given.

    Raises:
        InputError: an unknown name, or rotations that do not fit the body.
    """
    if isinstance(pose, str):
        return named_pose(pose, body.joint_names)
    if pose.shape != (len(body.parents), 3) or not np.isfinite(pose).all():
        raise InputError(
            f"pose: rotations have shape {pose.shape}; finite [{len(body.parents)}, 3] are needed"
        )
    return pose
