"""Items to mentions: which adjective belongs to which noun, and what is denied.

    a lady in a red skirt, her hair is long and grey, no hat
    -> lady; skirt: red; hair: long, grey; hat: denied

An adjective waits for the next noun: `blue and white striped shirt`. After `is`, `in` or `of` it belongs to
the noun before, unless a noun follows: `a shirt in red`, but `a lady in red trousers`. What is said of
somebody and of no garment, as `tall`, waits only until the phrase ends.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

from avatargen.text.items import Item

ENDS = (".", ";", "!", "?")
OF_A_BODY = ("age", "figure", "stature")  # traits that are said of a person, or of a build
KEEPS_DENYING = ("or", "nor", "wearing", "wear", "wears", "have", "having", "has", "a", "an", "the", "any")


@dataclass
class Mention:
    """A noun with its adjectives, or a trait by itself. `after` are colours that were said after the noun."""

    kind: str  # garment, person, pronoun, part or say
    value: str
    words: str
    colours: list[str] = field(default_factory=list)
    after: list[str] = field(default_factory=list)
    said: dict[str, str] = field(default_factory=dict)  # length, tone, pattern, made; age, figure, stature
    denied: bool = False
    guessed: bool = False


@dataclass
class Reader:
    """A text being read."""

    mentions: list[Mention] = field(default_factory=list)
    cannot: list[Item] = field(default_factory=list)
    unknown: list[Item] = field(default_factory=list)
    pending: list[Item] = field(default_factory=list)  # adjectives
    last: Mention | None = None  # noun
    linked: bool = False  # what follows is said of it
    listing: bool = False  # by a colon: of several things
    before_and: int = 0  # adjectives that are said of it where the next noun takes those that follow
    denies: bool = False
    denied: bool = False  # the last noun was

    def read(self, item: Item) -> None:
        known = {
            "garment": self.noun,
            "person": self.noun,
            "part": self.noun,
            "say": self.say,
            "of": self.adjective,
            "colour": self.adjective,
            "no": self.no,
            "link": self.link,
            "weak": self.weak,
            "break": self.pause,
            "mark": self.mark,
            "pronoun": self.pronoun,
            "cannot": self.impossible,
            "never": self.never,
            "unknown": self.unknown.append,
        }
        if item.kind in known:
            known[item.kind](item)

    def noun(self, item: Item) -> None:
        """A noun takes the adjectives before it."""
        mention = Mention(
            kind=item.kind, value=item.value, words=item.words, denied=self.denies, guessed=item.guessed
        )
        if item.kind == "person" and self.pending and self.linked and self.last is not None:
            self.settle()  # `dressed in black, a man` has said it of the clothes
        for adjective in self.pending[: self.before_and]:
            attach(self.last or mention, adjective, after=True)
        for adjective in self.pending[self.before_and :]:
            attach(mention, adjective, after=False)
        if item.kind == "garment":
            mention.said = {name: word for name, word in mention.said.items() if name not in OF_A_BODY}
        self.pending, self.last, self.linked, self.before_and = [], mention, False, 0
        self.denied, self.denies = self.denies, False
        self.mentions.append(mention)

    def say(self, item: Item) -> None:
        """Traits by themselves; those of a body wait, as there are old jackets."""
        if item.value.split(":")[0] in OF_A_BODY and not self.denies:
            self.pending.append(item)
            return
        if item.value.startswith(("hair:", "beard:")) and not self.denies:
            self.color_of_hair(item)
        self.mentions.append(Mention(kind="say", value=item.value, words=item.words, denied=self.denies))
        self.denies, self.denied = False, self.denies

    def color_of_hair(self, item: Item) -> None:
        """A brown ponytail is of brown hair; a beard is of the hair's colour."""
        colours = [each for each in self.pending if each.kind != "say"]
        self.pending = [each for each in self.pending if each.kind == "say"]
        if colours and item.value.startswith("hair:"):
            hair = Mention(kind="part", value="hair", words=item.words)
            for each in colours:
                attach(hair, each, after=False)
            self.mentions.append(hair)
            self.last, self.linked = hair, False

    def adjective(self, item: Item) -> None:
        self.pending.append(item)
        if item.words.startswith("with "):
            self.linked = True
            self.settle()

    def pronoun(self, item: Item) -> None:
        if self.linked:
            self.settle()
        self.mentions.append(Mention(kind="pronoun", value=item.value, words=item.words))

    def no(self, item: Item) -> None:
        self.settle()
        self.denies = True

    def link(self, item: Item) -> None:
        self.settle_body()
        self.linked, self.listing = self.last is not None, False

    def weak(self, item: Item) -> None:
        """`and`, an article or a comma: what is linked to the noun before has been said of it."""
        if item.words in ("or", "nor") and self.denied:
            self.denies = True
        elif item.words not in KEEPS_DENYING:
            self.denies = False
        if self.linked and item.words in ("and", "plus", "&", "+"):
            # `trousers in red and black shoes`; but a man in red and black trousers is one phrase
            of_all = self.last is None or self.last.kind == "person" or self.last.value == "clothes"
            self.before_and = 0 if of_all or self.listing else len(self.pending)
        elif self.linked:
            self.settle()
        elif not self.linked:
            self.settle_body()

    def pause(self, item: Item) -> None:
        """A verb or a preposition: the phrase before is over, but for colours whose noun is still to come."""
        if item.words not in KEEPS_DENYING:
            self.denies = False
        if self.linked:
            self.settle()
        self.settle_body(length=True)

    def mark(self, item: Item) -> None:
        if item.value in ENDS:
            self.end()
        elif item.value == ":":
            self.linked, self.listing = self.last is not None, True
        else:
            self.weak(item)

    def impossible(self, item: Item) -> None:
        """What cannot be made takes its adjectives along."""
        if not self.denies:
            self.cannot.append(item)
        self.pending, self.denies, self.linked = [], False, False

    def never(self, item: Item) -> None:
        """What nobody is."""
        if not self.denies:
            self.cannot.append(item)
        self.denies = False

    def settle(self) -> None:
        """Adjectives go to the noun before, or to nobody in particular."""
        noun = self.last or self.somebody()
        for adjective in self.pending:
            attach(noun, adjective, after=True)
        self.pending, self.linked, self.before_and = [], False, 0

    def settle_body(self, *, length: bool = False) -> None:
        """What is said of a body, and a length that no hair follows, belongs to the person."""
        rest = []
        for adjective in self.pending:
            if adjective.kind == "say" or (length and adjective.value.startswith("length")):
                hair = self.last is not None and (self.last.kind, self.last.value) == ("part", "hair")
                to_hair = hair and adjective.kind == "of"
                attach(self.last if to_hair and self.last else self.somebody(), adjective, after=True)
            else:
                rest.append(adjective)
        self.pending = rest

    def end(self) -> None:
        """A sentence is over."""
        self.settle_body(length=self.last is None or self.last.kind == "garment")
        self.settle()
        self.denies = False

    def somebody(self) -> Mention:
        """The person that is spoken of."""
        for mention in self.mentions:
            if mention.kind == "person":
                return mention
        self.mentions.append(Mention(kind="person", value="", words=""))
        return self.mentions[-1]


def attach(mention: Mention, adjective: Item, *, after: bool) -> None:
    """Say an adjective of a noun."""
    if adjective.kind == "colour":
        (mention.after if after else mention.colours).append(adjective.value)
        mention.words += f" {adjective.words}" if after else ""
        return
    for said in adjective.value.split(" "):
        name, value = said.split(":")
        mention.said.setdefault(name, value)


def read(items: Sequence[Item]) -> Reader:
    """Read all items."""
    reader = Reader()
    for item in items:
        reader.read(item)
    reader.end()
    return reader
