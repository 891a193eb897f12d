"""python -m avatargen.text.cut GLOVE.txt: cuts GloVe's vectors to the file that comes with the package.

Kept are words of letters alone that are near to one of the vocabulary: others mean nothing here. Vectors are
scaled to length 1 and rounded to 8 bits, which changes cosines by less than .01.
"""

import sys
from itertools import islice
from pathlib import Path

import numpy as np

from avatargen.text.near import FILE, LIKE
from avatargen.text.vocabulary import vocabulary

FREQUENT = 150_000  # words that are looked at
NEAR = 0.55  # cosine with a word of the vocabulary, at least
CHUNK = 10_000


def cut(table: Path) -> dict[str, np.ndarray]:
    """The arrays of the file, of a table in GloVe's own format: a word and its numbers a line, frequent ones
    first."""
    words, rows = [], []
    with table.open(encoding="utf-8") as lines:
        for line in islice(lines, FREQUENT):
            word, *numbers = line.rstrip().split(" ")
            if word.isascii() and word.isalpha() and word == word.lower():
                words.append(word)
                rows.append(np.array(numbers, dtype=np.float32))
    vectors = np.stack(rows)
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    known = vectors[[vocabulary()[word].kind in LIKE if word in vocabulary() else False for word in words]]
    chunks = [vectors[first : first + CHUNK] @ known.T for first in range(0, len(vectors), CHUNK)]
    kept = np.flatnonzero(np.concatenate([chunk.max(axis=1) for chunk in chunks]) >= NEAR)
    vectors = vectors[kept]
    rounded = np.rint(vectors / np.abs(vectors).max(axis=1, keepdims=True) * 127).astype(np.int8)
    names = "\n".join(words[place] for place in kept)
    return {"words": np.frombuffer(names.encode("ascii"), np.uint8), "vectors": rounded}


if __name__ == "__main__":
    arrays = cut(Path(sys.argv[1]))
    np.savez_compressed(FILE, words=arrays["words"], vectors=arrays["vectors"])
