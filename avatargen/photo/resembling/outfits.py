"""What can be worn together, as the wardrobe's people wear it: see `wardrobe.makehuman.choose.outfit`."""

from collections.abc import Mapping
from dataclasses import dataclass

from avatargen.wardrobe.makehuman.outfit import Item, outfit_of


@dataclass(frozen=True, kw_only=True)
class Choices:
    """Ways to dress a part of a person; each is a list of garments from the skin outward."""

    uppers: tuple[tuple[str, ...], ...]
    bottoms: tuple[str, ...]
    shoes: tuple[tuple[str, ...], ...]
    hair: tuple[str | None, ...]
    hats: tuple[str | None, ...]


def choices_for(items: Mapping[str, Item], sex: str) -> Choices:
    """What women or men can wear. Overalls take the place of bottoms."""
    wanted = "Female" if sex == "woman" else "Male"

    def of(kind: str) -> list[Item]:
        found = [item for item in items.values() if item.kind == kind]
        suited = {wanted, "Casual"} if sex == "woman" else {wanted}
        fit = [item for item in found if suited & set(item.tags) or not {"Male", "Female"} & set(item.tags)]
        return sorted(fit or found, key=lambda item: item.name)

    def beside(item: Item, kind: str) -> tuple[str, ...]:
        return tuple(g.name for g in items.values() if g.kind == kind and outfit_of(g) == outfit_of(item))

    over = {outfit_of(item) for item in items.values() if item.kind in ("outer", "overall")}
    uppers = [(item.name,) for item in of("top") if outfit_of(item) not in over]
    uppers += [(*beside(item, "top"), item.name) for item in (*of("outer"), *of("overall"))]
    styles = [item for item in items.values() if item.kind == "hair"]
    fitting = [item for item in styles if wanted in item.tags or not {"Male", "Female"} & set(item.tags)]
    return Choices(
        uppers=tuple(uppers),
        bottoms=tuple(item.name for item in of("bottom")),
        shoes=tuple((*beside(item, "socks"), item.name) for item in of("shoes")),
        hair=(None, *sorted(item.name for item in fitting)),
        hats=(None, *(item.name for item in of("hat"))),
    )


def has_overall(upper: tuple[str, ...], items: Mapping[str, Item]) -> bool:
    """Whether what is worn above covers the legs, too."""
    return any(items[name].kind == "overall" for name in upper)
