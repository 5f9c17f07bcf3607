"""Lines of a document, and which lines of two versions of it are the same.

`difflib` takes quadratic time where lines repeat, so that a file of empty lines would take hours. Here lines
that occur once in both versions are matched first, in their order, and only what lies between two of them is
given to `difflib`, if it is short.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections import Counter
from collections.abc import Iterator, Sequence
from difflib import SequenceMatcher

Opcode = tuple[str, int, int, int, int]
"""``equal``, ``replace``, ``delete`` or ``insert``; first and end in one text, first and end in the other."""

MAX_COMPARED = 64
"""Largest number of lines that are given to `difflib`."""

MAX_ROUNDS = 8
"""Largest number of times that a range is divided by lines that occur once in it."""


def lines_of(text: str) -> list[str]:
    """Split a text into lines as an XML parser counts them."""
    return re.split(r"\r\n|\r|\n", text)


def line_opcodes(one: Sequence[str], other: Sequence[str]) -> list[Opcode]:
    """Return how one sequence of lines becomes the other, as `SequenceMatcher.get_opcodes` does, in time
    proportional to their length but for sorting."""
    opcodes: list[Opcode] = []
    i = j = 0
    for first, start, size in _joined([*_matches(one, other, 0, len(one), 0, len(other)), _end(one, other)]):
        if i < first or j < start:
            tag = "replace" if i < first and j < start else "delete" if i < first else "insert"
            opcodes.append((tag, i, first, j, start))
        i, j = first + size, start + size
        if size:
            opcodes.append(("equal", first, i, start, j))
    return opcodes


Match = tuple[int, int, int]
"""First line in one text, first line in the other, number of equal lines."""


def _end(one: Sequence[str], other: Sequence[str]) -> Match:
    return len(one), len(other), 0


def _joined(matches: Sequence[Match]) -> Iterator[Match]:
    """Join matches that follow each other in both texts."""
    first, start, size = matches[0]
    for i, j, count in matches[1:]:
        if (first + size, start + size) == (i, j) and count:
            size += count
        else:
            if size:
                yield first, start, size
            first, start, size = i, j, count
    yield first, start, size


def _matches(one: Sequence[str], other: Sequence[str], a: int, b: int, c: int, d: int) -> Iterator[Match]:
    """Yield the matches of one[a:b] and other[c:d], in order."""
    waiting = [(a, b, c, d, 0)]
    while waiting:
        a, b, c, d, rounds = waiting.pop()
        while a < b and c < d and one[a] == other[c]:
            yield a, c, 1
            a, c = a + 1, c + 1
        tail = 0
        while a < b - tail and c < d - tail and one[b - 1 - tail] == other[d - 1 - tail]:
            tail += 1
        if tail:
            waiting.append((b - tail, b, d - tail, d, rounds))
            b, d = b - tail, d - tail
        if a == b or c == d:
            continue
        if b - a <= MAX_COMPARED and d - c <= MAX_COMPARED:
            short = SequenceMatcher(None, one[a:b], other[c:d], autojunk=False)
            for i, j, size in short.get_matching_blocks():
                yield from ((a + i + k, c + j + k, 1) for k in range(size))
            continue
        anchors = _anchors(one, other, a, b, c, d) if rounds < MAX_ROUNDS else []
        if anchors:
            ranges = []
            for i, j in anchors:
                ranges.append((a, i, c, j, rounds + 1))
                ranges.append((i, i + 1, j, j + 1, 0))
                a, c = i + 1, j + 1
            waiting.extend(reversed([*ranges, (a, b, c, d, rounds + 1)]))
        elif b - a == d - c:
            # Most remedies change lines and neither add nor remove one.
            yield from ((a + k, c + k, 1) for k in range(b - a) if one[a + k] == other[c + k])


def _anchors(
    one: Sequence[str], other: Sequence[str], a: int, b: int, c: int, d: int
) -> list[tuple[int, int]]:
    """Return lines that occur once in each range: the longest series that is in order in both."""
    counts, theirs = Counter(one[a:b]), Counter(other[c:d])
    places = {line: j for j, line in enumerate(other[c:d], c) if theirs[line] == 1}
    pairs = [(i, places[line]) for i, line in enumerate(one[a:b], a) if counts[line] == 1 and line in places]
    # Patience sorting: the last element of the best series of each length, and what precedes each pair.
    ends: list[int] = []
    last: list[int] = []
    before: list[int] = []
    for number, (_, j) in enumerate(pairs):
        length = bisect_left(ends, j)
        before.append(last[length - 1] if length else -1)
        if length == len(ends):
            ends.append(j)
            last.append(number)
        else:
            ends[length], last[length] = j, number
    series = []
    at = last[-1] if last else -1
    while at >= 0:
        series.append(pairs[at])
        at = before[at]
    return series[::-1]
