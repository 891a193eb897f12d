"""A mouth that speaks: words become phonemes, phonemes visemes, and lips close where they must."""

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from assets.face.names import ARKIT
from assets.face.names import VISEMES as SHAPES
from avatargen.errors import InputError
from avatargen.motion.expression import FIRST_BLINK, LIDS, LONGEST_GAP, SHORTEST_GAP, blink_times, speech
from avatargen.motion.motion import Motion, mirrored, retimed
from avatargen.motion.speech.listed import EXCEPTIONS
from avatargen.motion.speech.mouth import STRENGTH, mouth_weights
from avatargen.motion.speech.numbers import number_words
from avatargen.motion.speech.phoneme_file import LONGEST, read_phonemes
from avatargen.motion.speech.rules import RULES
from avatargen.motion.speech.sounds import CLOSED, SILENCE, SOUNDS, VISEMES, VOWELS
from avatargen.motion.speech.spelling import spoken, word_sounds
from avatargen.motion.speech.timing import AFTER, BEFORE, PAUSE_SECONDS, segments_of_text

SENTENCE = "Bob, please bring my big map of Memphis; five people may have moved it!"
# as pronouncing dictionaries have them, without stress
KNOWN = {
    "map": "M AE P",
    "make": "M EY K",
    "making": "M EY K IH NG",
    "please": "P L IY Z",
    "night": "N AY T",
    "phone": "F OW N",
    "cheese": "CH IY Z",
    "judge": "JH AH JH",
    "thing": "TH IH NG",
    "that": "DH AE T",
    "knife": "N AY F",
    "queen": "K W IY N",
    "nation": "N EY SH AH N",
    "table": "T EY B AH L",
    "picked": "P IH K T",
    "wanted": "W AA N T IH D",
    "lamb": "L AE M",
    "thumb": "TH AH M",
    "city": "S IH T IY",
    "giant": "JH AY AH N T",
    "boy": "B OY",
    "house": "HH AW S",
    "box": "B AA K S",
    "funny": "F AH N IY",
    "five": "F AY V",
    "bird": "B ER D",
    "don't": "D OW N T",
    "it's": "IH T S",
    "bob's": "B AA B Z",
}


def weights_of(motion: Motion, shape: str) -> np.ndarray:
    assert motion.weights is not None
    return motion.weights[:, motion.shapes.index(shape)]


def test_most_everyday_words_are_said_as_dictionaries_have_them() -> None:
    wrong = {
        word: word_sounds(word) for word, said in KNOWN.items() if word_sounds(word) != tuple(said.split())
    }
    assert len(wrong) <= 1, wrong


def test_every_word_and_rule_has_known_sounds() -> None:
    """Any letters can be read, and all that is said is a phoneme."""
    said = {sound for rules in RULES.values() for *_, sounds in rules for sound in sounds.split()}
    said |= {sound for sounds in EXCEPTIONS.values() for sound in sounds.split()}
    assert said <= set(SOUNDS) and set(VOWELS) < set(SOUNDS)
    shown = {viseme for sound in SOUNDS.values() for viseme, _ in sound.visemes}
    assert shown == set(VISEMES) == set(STRENGTH)
    assert {f"viseme_{name}" for name in (*VISEMES, SILENCE)} == set(SHAPES)
    assert set(LIDS) < set(ARKIT)
    letters = np.array(list("abcdefghijklmnopqrstuvwxyz"))
    rng = np.random.default_rng(0)
    for _ in range(300):
        word = "".join(rng.choice(letters, rng.integers(1, 12)))
        assert set(word_sounds(word)) <= set(SOUNDS), word


def test_numbers_pauses_and_other_scripts() -> None:
    assert number_words("1250") == ["one", "thousand", "two", "hundred", "fifty"]
    assert number_words("007") == ["zero", "zero", "seven"]
    assert number_words("0") == ["zero"] and len(number_words("9" * 20)) == 20
    assert spoken("Caf\u00e9 1,250") == spoken("cafe one thousand two hundred fifty")
    assert [word for word in spoken("a, b. c") if isinstance(word, str)] == [",", "."]
    assert spoken("\u4f60\u597d") == []
    with pytest.raises(InputError, match="no English word"):
        segments_of_text("\u4f60\u597d!")


def test_segments_follow_each_other_and_end_in_silence() -> None:
    segments = segments_of_text(SENTENCE)
    assert segments[0].start == 0 and segments[0].viseme == segments[-1].viseme == SILENCE
    assert segments[0].end == BEFORE and segments[-1].end - segments[-1].start == pytest.approx(AFTER)
    for before, behind in pairwise(segments):
        assert before.end == pytest.approx(behind.start) and behind.end > behind.start
    pauses = [one.end - one.start for one in segments[1:-1] if one.viseme == SILENCE]
    assert pauses == pytest.approx([PAUSE_SECONDS[","], PAUSE_SECONDS["."]])
    words = len(SENTENCE.split())
    assert 2 < words / (segments[-1].end - sum(pauses) - AFTER - BEFORE) < 5  # a second


@pytest.mark.parametrize("fps", [24.0, 25.0, 30.0, 60.0])
def test_lips_close_at_every_m_b_and_p_at_any_usual_rate(fps: float) -> None:
    segments = segments_of_text(SENTENCE)
    motion = retimed(speech("say", segments), fps)
    assert motion.weights is not None and (np.diff(motion.times) > 0).all()
    assert motion.weights.min() >= 0 and motion.weights.max() <= 1
    assert {*motion.shapes} <= set(ARKIT) | set(SHAPES)
    for viseme in CLOSED:
        found = [one for one in segments if one.viseme == viseme]
        assert found
        for one in found:
            near = (motion.times > one.start - 0.03) & (motion.times < one.end + 0.03)
            assert weights_of(motion, f"viseme_{viseme}")[near].max() >= 0.9
    mouth = motion.weights[:, [name.startswith("viseme_") for name in motion.shapes]]
    assert mouth.sum(axis=1).max() <= 1 + 1e-9  # a mouth is no more than one shape
    assert not motion.weights[[0, -1]].any()  # and closed in the end


def test_neighbours_blend_without_a_jump_and_silence_is_closed() -> None:
    segments = segments_of_text("Hello there. Good boy!")
    times = np.arange(0, segments[-1].end, 1 / 240)
    mouth = mouth_weights(segments, times)
    assert np.abs(np.diff(mouth, axis=0)).max() < 0.15  # in a 240th of a second
    for one in segments:
        inside = (times > one.start + 0.06) & (times < one.end - 0.06)
        if one.viseme == SILENCE:
            assert not mouth[inside].any()
    both = (mouth > 0.1).sum(axis=1)
    assert (both >= 2).mean() > 0.2


def test_a_sound_is_shown_most_in_its_middle() -> None:
    segments = segments_of_text("see you too")
    for one in segments:
        if one.viseme in VISEMES:
            shown = mouth_weights(segments, np.array([(one.start + one.end) / 2]))[0]
            assert VISEMES[int(shown.argmax())] == one.viseme


def test_speakers_blink_now_and_then() -> None:
    starts = blink_times(60.0)
    gaps = np.diff(starts)
    assert starts[0] == FIRST_BLINK and gaps.min() >= SHORTEST_GAP and gaps.max() <= LONGEST_GAP
    assert np.std(gaps) > 0.3 and blink_times(0.5) == []
    motion = speech("say", segments_of_text(SENTENCE * 2))
    assert weights_of(motion, "eyeBlinkLeft").max() == 1.0
    np.testing.assert_array_equal(weights_of(motion, LIDS[0]), weights_of(motion, LIDS[1]))


def test_a_mirror_changes_sides_and_not_the_mouth() -> None:
    motion = speech("say", segments_of_text("I wink at you now and then"))
    wink = [0.0 if shape == "eyeBlinkLeft" else 1.0 for shape in motion.shapes]
    assert motion.weights is not None
    motion = Motion(**{**vars(motion), "weights": motion.weights * wink})
    assert weights_of(mirrored(motion), "eyeBlinkRight").max() == 0
    assert weights_of(mirrored(motion), "eyeBlinkLeft").max() == 1
    np.testing.assert_array_equal(weights_of(mirrored(motion), "viseme_I"), weights_of(motion, "viseme_I"))


def entry(start: object, end: object, **sound: object) -> dict[str, object]:
    return {"start": start, "end": end, **sound}


def test_a_file_of_phonemes_says_what_stands_in_it_when_it_stands_there(tmp_path: Path) -> None:
    entries = [
        entry(0.5, 0.6, phoneme="m"),
        entry(0.6, 0.8, phoneme="AY1"),
        entry(1.0, 1.2, viseme="viseme_O"),
        entry(1.2, 1.3, phoneme="sil"),
        entry(1.3, 1.5, viseme="sil"),
        entry(1.5, 1.6, viseme="PP"),
    ]
    (tmp_path / "a.json").write_text(json.dumps(entries))
    segments = read_phonemes(tmp_path / "a.json")
    found = [(one.viseme, round(one.start, 6), round(one.end, 6)) for one in segments]
    assert found == [
        (SILENCE, 0.0, 0.5),
        ("PP", 0.5, 0.6),
        ("aa", 0.6, 0.72),
        ("I", 0.72, 0.8),
        (SILENCE, 0.8, 1.0),
        ("O", 1.0, 1.2),
        (SILENCE, 1.2, 1.3),
        (SILENCE, 1.3, 1.5),
        ("PP", 1.5, 1.6),
        (SILENCE, 1.6, 1.6 + AFTER),
    ]
    motion = speech("say", segments)
    lips = weights_of(motion, "viseme_PP")
    assert lips[motion.times.searchsorted(0.55)] == lips[motion.times.searchsorted(1.55)] == 1.0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is no JSON"),
        ("{", "is no JSON"),
        ("[" * 100_000, "is no JSON"),
        ("{}", "holds no list"),
        ("[]", "holds no list"),
        ("[3]", 'entry 1: found no "start"'),
        (json.dumps([entry(0, 0.1, phoneme="M"), {"start": 1}]), 'entry 2: found no "start" and "end"'),
        (json.dumps([entry(0.2, 0.1, phoneme="M")]), "entry 1: found 0.2 to 0.1"),
        (json.dumps([entry(-1, 0.1, phoneme="M")]), "entry 1: found -1 to 0.1"),
        (json.dumps([entry("0", 0.1, phoneme="M")]), "entry 1: found '0' to 0.1"),
        (json.dumps([entry(True, 2, phoneme="M")]), "entry 1: found True to 2"),
        ('[{"start": 0, "end": NaN, "phoneme": "M"}]', "entry 1: found 0 to nan"),
        ('[{"start": 0, "end": 1e999, "phoneme": "M"}]', "entry 1: found 0 to inf"),
        (json.dumps([entry(0, LONGEST + 1, phoneme="M")]), "from 0 to 3600"),
        (
            json.dumps([entry(0, 0.5, phoneme="M"), entry(0.4, 0.6, phoneme="M")]),
            "entry 2: it starts at 0.4 s, before the last ends at 0.5 s; sort",
        ),
        (json.dumps([entry(0, 1)]), 'either a "phoneme" or a "viseme"'),
        (json.dumps([entry(0, 1, phoneme="M", viseme="PP")]), 'either a "phoneme" or a "viseme"'),
        (json.dumps([entry(0, 1, phoneme=3)]), 'either a "phoneme" or a "viseme"'),
        (json.dumps([entry(0, 1, phoneme="QX")]), "found phoneme 'QX', wanted one of ARPAbet's"),
        (json.dumps([entry(0, 1, viseme="aaa")]), "found viseme 'aaa', wanted one of sil, PP"),
    ],
)
def test_bad_files_of_phonemes_get_one_line(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "bad.json").write_text(text)
    with pytest.raises(InputError) as told:
        read_phonemes(tmp_path / "bad.json")
    assert words in str(told.value) and "\n" not in str(told.value)


def test_a_file_that_is_not_there_or_no_text(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"cannot read .*; check the path"):
        read_phonemes(tmp_path / "none.json")
    (tmp_path / "bytes.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="is no JSON"):
        read_phonemes(tmp_path / "bytes.json")
