"""Which parts of a request go together, where no library is needed to tell: the command asks before it
loads any, and every request asks again.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

from avatargen.errors import InputError
from avatargen.motion.names import SAID, parts_of

SHEETS = (".png", ".jpg", ".jpeg")
MOST_PHOTOS = 12
PERSON = ".safetensors"  # a person's file
TOLD = ("gender", "age", "height")  # traits that somebody may tell of a person in a photograph
MOST_ON_A_SHEET = 1_000
LONGEST_TEXT = 2_000  # characters


def check_one_or_many(
    *,
    many: bool,
    jobs: int | None,
    ray: str | None,
    out: Path | None,
    report: Path | None,
    preview: Path | None,
    dry_run: bool,
    budget_s: float | None,
    sheet: Path | None,
) -> None:
    """One seed goes into a file, many into a folder. Raises InputError for what only the other has."""
    for name, found in (("--jobs", jobs), ("--ray", ray), ("--sheet", sheet)):
        if not many and found is not None:
            raise InputError(f"found {name} with one seed; give --seeds A:B, or leave it out")
    if many and out is None:
        raise InputError("found --seeds without --out; name the folder that the files go into")
    if many and (report is not None or preview is not None):
        raise InputError(
            "found --seeds with --report or --preview, which are for one seed; the manifest and --sheet tell "
            "of all"
        )
    if many and (dry_run or budget_s is not None):
        raise InputError("found --seeds with --dry-run or --budget; both are for one seed, so give --seed")
    if preview is not None and preview.suffix.lower() != ".png":
        raise InputError(f"found --preview {preview}; give a name that ends in .png")


def check_sheet(sheet: Path | None, count: int) -> None:
    """Raises InputError for a contact sheet of another kind, or of too many people."""
    if sheet is not None and sheet.suffix.lower() not in SHEETS:
        raise InputError(f"found --sheet {sheet}; give a name that ends in {' or '.join(SHEETS)}")
    if sheet is not None and count > MOST_ON_A_SHEET:
        raise InputError(f"found --sheet with {count} seeds; {MOST_ON_A_SHEET} go on one, so leave it out")


def check_source(*, source: str | None, wardrobe: Path | None, weights: Path | None, chosen: bool) -> None:
    """Raises InputError for files of people that are not asked for, a wardrobe that is no folder, or traits
    that were chosen of the wardrobe's people.
    """
    if source == "wardrobe" and chosen:
        raise InputError(
            "found traits with --from wardrobe, whose people are drawn by their seed alone; leave one out"
        )
    if source == "wardrobe" and weights is not None:
        raise InputError(
            "found --from wardrobe with --weights; the wardrobe has none, so leave --weights out"
        )
    if source != "wardrobe" and wardrobe is not None:
        raise InputError("found --wardrobe without --from wardrobe; give both")
    if wardrobe is not None and not wardrobe.is_dir():
        raise InputError(
            f"found no folder {wardrobe}; get MakeHuman's assets (CC0, makehumancommunity.org) and name the "
            "folder that holds clothes/, hair/, skins/ and eyes/, or leave --wardrobe out"
        )


def check_text(text: str | None, *, change: bool) -> None:
    """Raises InputError for a text without words, one too long, or none where it says the change."""
    if change and text is None:
        raise InputError("found no text that says what to change; give --text, as in --text 'in a red shirt'")
    if text is not None and not any(map(str.isalpha, text)):
        raise InputError(f"found --text {text!r}, which has no words; describe a person and their clothes")
    if text is not None and len(text) > LONGEST_TEXT:
        raise InputError(f"found a text of {len(text)} characters, wanted at most {LONGEST_TEXT}; say less")


def check_speech(clips: Sequence[str], text: str | None, phonemes: Path | None) -> None:
    """Raises InputError for a clip that there is not, or where it is not told what is said, or told twice."""
    parts = [part for clip in clips for part in parts_of(clip)]
    if text is not None and phonemes is not None:
        raise InputError("found --say and --phonemes, of which each tells what is said; give one")
    if SAID in parts and text is None and phonemes is None:
        raise InputError(f"found --clip {SAID} without a word to say; give --say or --phonemes too")
    if text is not None and (not any(map(str.isalnum, text)) or len(text) > LONGEST_TEXT):
        raise InputError(
            f"found a text of {len(text)} characters to say, wanted words, at most {LONGEST_TEXT} characters"
        )


def check_wear(wear: Mapping[str, int], source: str | None, wardrobe: Path | None, count: int) -> None:
    """Raises InputError where a garment is borrowed twice, or of people who have none to lend."""
    if len(wear) < count:
        raise InputError("found --wear with a garment twice; one seed lends each, so give it once")
    if wear and source == "wardrobe" and wardrobe is None:
        raise InputError(
            "found --wear with the procedural wardrobe, whose people are one field; give --wardrobe too, or "
            "leave --from out"
        )


def check_photos(
    *,
    photos: Sequence[Path],
    mask: Path | None,
    texture_from: str | None,
    posed: bool,
    many: bool,
    seeds_people: bool,
    traits: Mapping[str, object],
    person: Path | None,
) -> None:
    """Raises InputError for what belongs to a photograph and there is none, or does not go with one."""
    if not photos:
        if mask is not None or (person is None and (posed or texture_from not in (None, "photo"))):
            raise InputError("found --mask, --texture-from or --pose photo without --photo; give that too")
        return
    if len(photos) > MOST_PHOTOS or len(set(photos)) < len(photos):
        raise InputError(f"found {len(photos)} photographs; give up to {MOST_PHOTOS}, each once")
    if many or seeds_people:
        raise InputError(
            "found --photo with --seeds, --from, --wear, --tolerance or --budget; a photograph shows one "
            "person, so leave those out"
        )
    if mask is not None and len(photos) > 1:
        raise InputError("found --mask with several photographs; give one photograph, or no mask")
    others = [name for name in traits if name not in TOLD]
    if others:
        raise InputError(
            f"found --{others[0].replace('_', '-')} with --photo, which shows it; only --gender, --age and "
            "--height can be told"
        )


def check_person(
    *, person: Path | None, kept: Path | None, many: bool, source: str | None, others: Sequence[str]
) -> None:
    """Raises InputError where a person's file is read beside `others`, options that say who it is as well, or
    written of many, of the wardrobe's people or under another kind of name."""
    if kept is not None and (many or source == "wardrobe"):
        raise InputError(
            "found --save-person with --seeds or --from wardrobe; a file keeps one of the generator's "
            "people, so leave those out"
        )
    if kept is not None and kept.suffix.lower() != PERSON:
        raise InputError(f"found --save-person {kept}; give a name that ends in {PERSON}")
    if person is not None and (many or others):
        raise InputError(
            f"found --person with --{'seeds' if many else others[0]}; the file says who it is, so leave that "
            "out"
        )


def check_chosen(*, tolerance_mm: float | None, budget_s: float | None, fixed: tuple[str, ...]) -> None:
    """Raises InputError where resolution and faces are to be chosen in two ways; `fixed` names options that
    set them."""
    wishes = {"tolerance": tolerance_mm, "budget": budget_s}
    chosen = [name for name, wish in wishes.items() if wish is not None]
    if len(chosen) > 1 or (chosen and fixed):
        names = " and ".join(f"--{name}" for name in [*chosen, *fixed])
        raise InputError(f"found {names}; --tolerance and --budget choose, so give one of them alone")
