"""What can be worn together, as the wardrobe's people wear it: see `wardrobe.makehuman.outfit`."""

from collections.abc import Mapping
from dataclasses import dataclass

from avatargen.wardrobe.makehuman.hairs import fits
from avatargen.wardrobe.makehuman.outfit import BARE, CLOSE, SKIRTED, TAILORED, Item, Wearable, word


@dataclass(frozen=True, kw_only=True)
class Clothing:
    """All but shoes, hair and hats: what is worn above, from the skin outward, and below. Where that above
    covers the legs too, there is no bottom; `shoes` are those that go with them, with their socks."""

    upper: tuple[str, ...]
    bottom: str | None
    shoes: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, kw_only=True)
class Choices:
    """Ways to dress a person; `rare` are styles of hair that the other sex or darker skins usually wear."""

    clothes: tuple[Clothing, ...]
    hair: tuple[str | None, ...]
    rare: tuple[str, ...]
    hats: tuple[str | None, ...]


def choices_for(items: Mapping[str, Item], sex: str, dark: float) -> Choices:
    """What women or men can wear, of some share of a dark skin."""
    woman = sex == "woman"
    wearable = Wearable(items, woman, borrows=woman)
    styles = [item for item in items.values() if item.kind == "hair"]
    usual, darker, crossed = (
        sorted(item.name for item in styles if fits(item.name, item.tags, woman, other, share))
        for other, share in ((False, dark), (False, 1.0), (True, dark))
    )
    return Choices(
        clothes=tuple(
            Clothing(
                upper=names(upper),
                bottom=None if bottom is None else bottom.name,
                shoes=footwear(wearable, upper, bottom),
            )
            for upper, bottom in clothes_of(wearable)
        ),
        hair=(None, *usual),
        rare=tuple(name for name in dict.fromkeys((*darker, *crossed)) if name not in usual),
        hats=(None, *names(wearable.of("hat"))),
    )


def clothes_of(wearable: Wearable) -> list[tuple[tuple[Item, ...], Item | None]]:
    """All pairs of what is worn above and below; coats go over what fits closely."""
    found: list[tuple[tuple[Item, ...], Item | None]] = []
    found += [((dress,), None) for dress in wearable.of("dress") if wearable.suits(dress)]
    coats = [item for item in wearable.of("outer") if TAILORED in item.tags and wearable.suits(item)]
    for upper in wearable.uppers:
        below = wearable.with_it("top", upper) if upper.kind in ("outer", "overall") else []
        worn = (*below, upper)
        if upper.kind == "overall":
            found.append((worn, None))
            continue
        for bottom in wearable.of("bottom"):
            if (word(upper), word(bottom)) == ("suit", "shorts"):
                continue
            found.append((worn, bottom))
            if all(item.name in CLOSE for item in (*worn, bottom)):
                found += [((*worn, coat), bottom) for coat in coats]
    return found


def footwear(wearable: Wearable, upper: tuple[Item, ...], bottom: Item | None) -> tuple[tuple[str, ...], ...]:
    """Shoes with their socks; on bare legs socks in sneakers alone."""
    words = {word(item) for item in (*upper, *([] if bottom is None else [bottom]))}
    found = []
    for shoes in wearable.of("shoes"):
        bare = bool(words & set(BARE)) and word(shoes) != "sneakers"
        if not (word(shoes) == "boots" and words & set(SKIRTED)):
            found.append(names([*([] if bare else wearable.with_it("socks", shoes)), shoes]))
    return tuple(found) or ((),)


def names(items: "list[Item] | tuple[Item, ...]") -> tuple[str, ...]:
    return tuple(item.name for item in items)
