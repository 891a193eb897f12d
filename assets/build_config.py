"""What an asset is to have, and what is needed of an avatar to build it."""

from dataclasses import dataclass, field
from typing import Any, Literal, Protocol, get_args, runtime_checkable

import numpy as np
import torch
from jaxtyping import Float

from assets.asset.bones import Bones
from assets.content import CONTENTS, FACES, Content, Face, Joints
from assets.isosurface.extract import ExtractConfig
from assets.scenes import find_scene
from assets.simplify.simplify import Simplifier, SimplifyConfig
from assets.texture.atlas import AtlasConfig
from assets.texture.bake import BakeConfig
from avatargen.body.model import CanonicalBody
from avatargen.errors import InputError

Mesher = Literal["adaptive", "marching-cubes"]
MESHERS: tuple[Mesher, ...] = get_args(Mesher)


@runtime_checkable
class AvatarFields(Protocol):
    """What is needed of an avatar: fields in the canonical space, the canonical body, and where it comes
    from."""

    @property
    def body(self) -> CanonicalBody: ...

    @property
    def betas(self) -> np.ndarray: ...

    @property
    def bounds(self) -> np.ndarray: ...

    @property
    def info(self) -> Any: ...

    def sdf(self, points: torch.Tensor) -> torch.Tensor: ...

    def color(self, points: torch.Tensor) -> torch.Tensor: ...


@dataclass(frozen=True, kw_only=True)
class BuildConfig:
    """What the asset is to have. Raises InputError for values out of range."""

    content: Content = "rigged"
    resolution: int = 512  # cells along the longest side of the avatar's box
    faces: int | None = 20_000  # None: all that the resolution gives, for a mesh alone
    mesher: Mesher = "adaptive"  # marching-cubes: scikit-image's, at the whole resolution
    simplifier: Simplifier = "adaptive"  # or others' collapses alone; pymeshlab's filters clean first
    texture: int = 1024  # texels along a side
    joints: Joints = "all"  # 24: no fingers; moving: those alone that move a vertex or carry one that does
    pose: str | Float[np.ndarray, "J 3"] = field(default="a", hash=False)  # rest pose: x, t, a or axis-angle
    head_detail: float = 2.0  # on the head for one on the body: texels along a line, faces over an area
    normal_map: int | None = None  # texels along a side of the field's own normals; None: none
    ambient_occlusion: int | None = None  # texels along a side of how open the surface lies; None: none
    bones: Bones = "along"  # joints' frames have +y along their bones; world: they are the world's
    ends: bool = False  # a joint that moves nothing where each last bone ends
    springs: bool = False  # bones along skirts and long hair, which sway
    twist: bool = False  # bones that share the roll of upper arms and hands
    morphs: bool = False  # a slider for each of the body's shape directions
    face: Face = "none"  # shapes: lips and lids open, and ARKit's shapes and visemes are sliders
    on_ground: bool = True  # soles at y = 0; otherwise the pelvis stays where the body model has it

    def __post_init__(self) -> None:
        ExtractConfig(resolution=self.resolution)
        if self.faces is not None:
            SimplifyConfig(target_faces=self.faces, simplifier=self.simplifier)
        BakeConfig(texture_size=self.texture)
        AtlasConfig(texture_size=self.texture, scales=((0, self.head_detail),))
        BakeConfig(texture_size=self.normal_map or self.texture)
        BakeConfig(texture_size=self.ambient_occlusion or self.texture)
        self.check_recipe()
        self.check_content()

    @classmethod
    def for_scene(cls, name: str) -> "BuildConfig":
        """What a scene needs: `hero`, `game`, `crowd`, `print`, `ar` or `still`.

        Raises:
            InputError: no scene has that name.
        """
        scene = find_scene(name)
        return cls(
            content=scene.content,
            resolution=scene.resolution,
            faces=scene.faces,
            texture=scene.texture,
            normal_map=scene.normal_map,
            joints=scene.joints,
            face=scene.face,
        )

    def check_recipe(self) -> None:
        """Raises InputError for a mesher there is not, or a simplifier that has nothing to do."""
        if self.mesher not in MESHERS:
            raise InputError(f"mesher: found {self.mesher!r}, wanted one of {', '.join(MESHERS)}")
        if self.faces is None and self.simplifier != "adaptive":
            raise InputError(
                f"found simplifier {self.simplifier} where every face is kept; give a number of faces, or "
                "leave it out"
            )

    def check_content(self) -> None:
        """Raises InputError for settings that do not go together."""
        if self.content not in CONTENTS:
            raise InputError(f"content: found {self.content!r}, wanted one of {', '.join(CONTENTS)}")
        if self.faces is None and self.content != "mesh":
            raise InputError(
                f"found content {self.content} without a number of faces, whose charts would take minutes; "
                "give one"
            )
        if self.face not in FACES:
            raise InputError(f"face: found {self.face!r}, wanted one of {', '.join(FACES)}")
        if self.face != "none" and self.content != "rigged":
            raise InputError(f"found a face of {self.face} on content {self.content}, which does not move")
        maps = {"a normal map": self.normal_map, "ambient occlusion": self.ambient_occlusion}
        wanted = [what for what, size in maps.items() if size is not None]
        if self.content == "mesh" and wanted:
            raise InputError(f"found {wanted[0]} on content mesh, which has no texture coordinates; drop one")
