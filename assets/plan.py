"""Which stages a configuration needs, decided before anything is computed, and what the others leave out."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from assets.build_config import BuildConfig
from assets.content import LeftOut
from assets.draft import Draft

Reason = tuple[str, str]  # what is left out, and why


def always(config: BuildConfig) -> Reason | None:
    """No configuration does without the stage."""


@dataclass(frozen=True)
class Stage:
    """One step of the pipeline."""

    name: str
    run: Callable[[Draft], None]
    share: float  # of the work at the default settings
    unless: Callable[[BuildConfig], Reason | None] = always  # why a configuration does without it


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Stages in order, and what is left out."""

    stages: tuple[Stage, ...]
    left_out: tuple[LeftOut, ...]

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(stage.name for stage in self.stages)

    def share(self, done: int) -> float:
        """Of the planned work, that lies behind when so many stages are done."""
        shares = [stage.share for stage in self.stages]
        return sum(shares[:done]) / sum(shares)


def make_plan(stages: Iterable[Stage], config: BuildConfig) -> Plan:
    """Of these stages, those that the configuration needs."""
    kept: list[Stage] = []
    skipped: dict[Reason, tuple[str, ...]] = {}
    for stage in stages:
        reason = stage.unless(config)
        if reason is None:
            kept.append(stage)
        else:
            skipped[reason] = (*skipped.get(reason, ()), stage.name)
    left_out = [
        LeftOut(what="deformation network", why="in the canonical pose it has nothing to correct"),
        LeftOut(what="volume rendering and upsampling", why="a file holds a surface, not a picture"),
        *(LeftOut(what=what, why=why, stages=names) for (what, why), names in skipped.items()),
        *left_out_of_rig(config),
    ]
    return Plan(stages=tuple(kept), left_out=tuple(left_out))


def left_out_of_rig(config: BuildConfig) -> list[LeftOut]:
    """What is not stored of the skeleton; no stage is saved, as weights also pose the mesh."""
    if config.content != "rigged":
        why = "nothing will move it; weights served to pose it and are not stored"
        return [LeftOut(what="skeleton and weights", why=why)]
    if config.joints == "24":
        return [LeftOut(what="fingers' joints", why="SMPL's 24 are wanted; hands move them all")]
    if config.joints == "moving":
        return [LeftOut(what="idle joints", why="they move no vertex and carry no joint that does")]
    return []


def unless_simplified(config: BuildConfig) -> Reason | None:
    if config.faces is None:
        return "simplification", "every face of the extracted surface is wanted"
    return None


def unless_laid(config: BuildConfig) -> Reason | None:
    if config.faces is not None and config.simplifier != "adaptive":
        return "laying on the field", f"{config.simplifier} is wanted; vertices stay where it puts them"
    return unless_simplified(config)


def unless_charted(config: BuildConfig) -> Reason | None:
    return ("texture coordinates", "a mesh alone is wanted") if config.content == "mesh" else None


def unless_coloured(config: BuildConfig) -> Reason | None:
    return ("colours", "a mesh alone is wanted") if config.content == "mesh" else None


def unless_normal_map(config: BuildConfig) -> Reason | None:
    if config.normal_map is not None:
        return None
    alone = config.content == "mesh"
    return "normal map", "a mesh alone is wanted" if alone else "it shows only up close and was not wanted"


def unless_occlusion(config: BuildConfig) -> Reason | None:
    if config.ambient_occlusion is not None:
        return None
    alone = config.content == "mesh"
    why = "many viewers shade hollows by themselves, and it was not wanted"
    return "ambient occlusion", "a mesh alone is wanted" if alone else why
