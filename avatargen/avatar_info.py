"""Where an avatar comes from, and who it is."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable


@runtime_checkable
class Described(Protocol):
    """Attributes that can be told as names and values."""

    def facts(self) -> dict[str, str | int | float]: ...


@dataclass(frozen=True, kw_only=True)
class AvatarInfo:
    """Where an avatar comes from, and who it is where that is known."""

    seed: int
    weights_hash: str
    version: str
    licence: str
    height_m: float  # of the body, crown of the head to the soles
    attributes: Described | None = None
    said: tuple[tuple[str, str], ...] = ()  # a text that it was made from, and how that was understood

    @property
    def facts(self) -> tuple[tuple[str, str | int | float], ...]:
        """The attributes and what was said as names and values, as files hold them."""
        return (*(self.attributes.facts().items() if self.attributes else ()), *self.said)
