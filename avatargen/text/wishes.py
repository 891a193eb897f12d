"""Mentions to traits of a generator's people: which of what was said they have, and what is left out and why.

What is said outright wins over what another word implies: a grey suit has grey trousers unless others are
named. Of two things that cannot both be, the first said is taken.
"""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

from avatargen.text.colours import eye_word, hair_word, plain, skin_word, toned
from avatargen.text.phrases import Mention
from avatargen.wardrobe.choosing import ANY, HEIGHT, SHORTEST, TALLEST, shown

Value = str | float
ORDER = {  # of values that may be more or less
    "age": ("young", "middleage", "old"),
    "stature": ("short", "average", "tall"),
    "skin": ("light", "medium", "brown", "dark"),
}
TALLER = 0.08  # m
ANY_COLOUR = "any colour"  # among the values that are offered: names of colours, and #rrggbb
OF_A_PERSON = {"black", "white", "brown"}  # colours of a person that are said of the skin


@dataclass(frozen=True, kw_only=True)
class Wish:
    """A trait with its value and the words that said it; implied where another word brought it."""

    name: str
    value: Value
    words: str
    implied: bool = False


@dataclass
class Wishes:
    """Traits as they come in. `offered` are the values that the people have, by trait; `own` the facts of the
    person who is changed, none where one is described."""

    offered: Mapping[str, Collection[str]]
    own: Mapping[str, Value] | None
    found: dict[str, Wish] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)

    def add(self, name: str, value: Value, words: str, *, implied: bool = False) -> None:
        """Take a trait, unless these people do not have it or something else has been said of it."""
        before, have = self.found.get(name), self.offered.get(name, ())
        if name in ANY and value not in have and have:
            value = value if ANY_COLOUR in have else plain(str(value))
        if name != HEIGHT and value not in have and ANY_COLOUR not in have:
            these = ", ".join(sorted(have)) or "none"
            self.left_out.append(f"{words}: of {shown(name)} these people have {these}")
            return
        if before is not None and not before.implied:
            if before.value != value and not implied:
                self.left_out.append(f"{words}: {before.words} was said before")
            return
        self.found[name] = Wish(name=name, value=value, words=words, implied=implied)

    def mention(self, mention: Mention) -> None:
        """Take what a mention says."""
        takers = {
            "garment": self.garment,
            "person": self.person,
            "pronoun": self.pronoun,
            "part": self.part,
            "say": self.say,
        }
        takers[mention.kind](mention)

    def say(self, mention: Mention) -> None:
        """A trait by itself: in the first way in which these people have it."""
        ways, words = ways_of(mention.value), mention.words
        if mention.denied:
            for name, value in ways[0]:
                self.deny(name, value, words)
            return
        for way in ways:
            wanted = [self.stepped(name, value) for name, value in way]
            if all(name == HEIGHT or value in self.offered.get(name, ()) for name, value in wanted):
                for name, value in wanted:
                    self.add(name, value, words)
                if way != ways[0]:
                    self.tell_instead(words, way)
                return
        name, value = ways[0][0]
        self.left_out.append(f"{words}: these people have no {shown(name)} {value}")

    def person(self, mention: Mention) -> None:
        words = mention.words or "the person"
        for name, value in pairs_of(mention.value):
            self.add(name, value, words, implied=mention.guessed)
        for name, value in mention.said.items():
            if name in ORDER or name == "figure":
                self.add(*self.stepped(name, value), f"{value} {words}")
            elif name == "length" and value == "short":
                self.add("stature", "short", f"short {words}")
            elif name == "tone":
                self.add(*self.stepped("skin", value), f"{value} {words}")
        for colour in mention.colours:
            if colour in OF_A_PERSON:
                self.add("skin", skin_word(colour), f"{colour} {words}")
        self.clothes(mention.after, words)

    def pronoun(self, mention: Mention) -> None:
        """Whoever is spoken of has a sex; who is changed keeps it."""
        if self.own is None:
            for name, value in pairs_of(mention.value):
                self.add(name, value, mention.words, implied=True)

    def clothes(self, colours: Sequence[str], words: str) -> None:
        """Somebody in black."""
        if colours:
            for name in ("top_color", "bottom_color"):
                self.add(name, colours[0], f"{words} in {colours[0]}", implied=True)

    def part(self, mention: Mention) -> None:
        colours = [*mention.colours, *mention.after]
        if mention.value == "clothes":
            self.clothes(colours, mention.words)
        elif mention.value == "figure":
            self.person(Mention(kind="person", value="", words=mention.words, said=mention.said))
        elif mention.value == "hair":
            self.hair(mention, colours)
        elif mention.value == "eyes" and colours:
            self.add("eyes", eye_word(colours[0]), f"{colours[0]} eyes")
        elif mention.value == "skin":
            tone = mention.said.get("tone")
            if tone is not None:
                self.add(*self.stepped("skin", tone), f"{tone} skin")
            elif colours:
                self.add("skin", skin_word(colours[0]), f"{colours[0]} skin")

    def hair(self, mention: Mention, colours: Sequence[str]) -> None:
        if mention.denied:
            self.add("hair", "bald", f"no {mention.words}")
            return
        if (length := mention.said.get("length")) is not None:
            self.add("hair", length, f"{length} hair")
        tone = mention.said.get("tone")
        if colours:
            self.add("hair_color", hair_word(colours[0], tone), f"{colours[0]} hair")
        elif tone in ("dark", "light"):
            self.add("hair_color", {"dark": "black", "light": "blond"}[tone], f"{tone} hair")

    def garment(self, mention: Mention) -> None:
        """Something worn, in the first way in which these people have it. A guess is one where nothing else
        was said."""
        ways, words = ways_of(mention.value), mention.words
        way = next((way for way in ways if all(self.has(name, value) for name, value in way)), None)
        if way is None:
            self.left_out.append(f"{words}: there is none to wear")
        elif mention.denied:
            self.deny(*way[0], words)
        elif not mention.guessed:
            self.worn(mention, way)
        elif not any(name in self.found for name, _ in way):
            self.left_out.append(f"{words}: taken for {' '.join(ways[0][0])}")
            self.worn(mention, way)

    def worn(self, mention: Mention, way: Sequence[tuple[str, str]]) -> None:
        """Something worn, with its colours and its print."""
        first = ways_of(mention.value)[0]
        for place, (name, value) in enumerate(way):
            if value == "something" and name == "shoes" and mention.said.get("made") == "leather":
                value = "leather"
            if value != "something":
                self.add(name, value, mention.words, implied=place > 0 or mention.guessed)
            if place == 0 or name != "shoes":
                self.colour(name, mention, implied=place > 0)
        if way != first:
            self.tell_instead(mention.words, way)
            if first[0][1] == "dress":
                self.colour("top", mention, implied=True)
        if (pattern := mention.said.get("pattern")) is not None:
            self.print(way[0][0], pattern, mention)

    def has(self, name: str, value: str) -> bool:
        return name in self.offered and (value == "something" or value in self.offered[name])

    def colour(self, name: str, mention: Mention, *, implied: bool) -> None:
        colours = [*mention.colours, *mention.after]
        if not colours and mention.said.get("made") == "denim" and name != "bottom":
            colours = ["denim"]
        if colours:
            colour = toned(colours[0], mention.said.get("tone"))
            self.add(f"{name}_color", colour, f"{colours[0]} {mention.words}", implied=implied)
        elif (tone := mention.said.get("tone")) in ("dark", "light"):
            grey = {"dark": "charcoal", "light": "light grey"}[tone]
            self.add(f"{name}_color", grey, f"{tone} {mention.words}", implied=True)

    def print(self, name: str, pattern: str, mention: Mention) -> None:
        colours = [*mention.colours, *mention.after]
        if name not in ("top", "overall"):
            if pattern != "plain":
                self.left_out.append(f"{mention.words}: prints are worn on the upper body alone")
            return
        self.add("pattern", pattern, f"{pattern} {mention.words}")
        if len(colours) > 1 and pattern != "plain":
            self.add("pattern_color", colours[1], f"{colours[1]} {mention.words}")

    def deny(self, name: str, value: Value, words: str) -> None:
        """Without something."""
        if name in ("top", "bottom"):
            self.left_out.append(f"no {words}: nobody is made without")
        elif instead := {"none", "average"} & set(self.offered.get(name, ())):
            self.add(name, instead.pop(), f"no {words}")
        elif self.own is None or self.own.get(name) == value:
            self.left_out.append(f"no {words}: say what instead")

    def stepped(self, name: str, value: str) -> tuple[str, Value]:
        """A trait, or the next one in the order where it is more or less; somebody taller is so by metres."""
        if name == HEIGHT:
            return name, min(max(float(value), SHORTEST), TALLEST)
        if value not in ("more", "less"):
            return name, value
        order, step = ORDER[name], 1 if value == "more" else -1
        if self.own is None:
            return name, order[-1] if step > 0 else order[0]
        if name == "stature":
            return HEIGHT, min(max(float(self.own[HEIGHT]) + step * TALLER, SHORTEST), TALLEST)
        place = order.index(str(self.own[name])) + step
        return name, order[min(max(place, 0), len(order) - 1)]

    def tell_instead(self, words: str, way: Sequence[tuple[str, str]]) -> None:
        told = " and ".join(f"{shown(name)} {value}" for name, value in way)
        self.left_out.append(f"{words}: there is none; {told} in its place")


def ways_of(value: str) -> list[list[tuple[str, str]]]:
    """The ways in which a value of the vocabulary can be had, the nearest first."""
    return [pairs_of(way) for way in value.split(" > ")]


def pairs_of(value: str) -> list[tuple[str, str]]:
    """Traits and their values: `a:b + c:d e` is b, and `d e`."""
    parts = value.split(" + ") if "+" in value else re.split(r" (?=\w+:)", value)
    return [(name, word) for name, _, word in (part.partition(":") for part in parts) if word]
