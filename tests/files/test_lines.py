"""Lines of two versions of a text: every matching gives the other text back, in bounded time."""

from __future__ import annotations

import difflib
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.files import lines
from dynx.files.excerpts import _difference
from dynx.files.lines import line_opcodes

texts = st.lists(st.sampled_from(["a", "b", "c", "", "link 1", "link 2", "link 3"]), max_size=40)


def rebuilt(one: list[str], other: list[str]) -> list[str]:
    """Return the other text from the lines of one that are equal and the rest of its own."""
    found, i, j = [], 0, 0
    for tag, first, last, start, end in line_opcodes(one, other):
        assert (first, start) == (i, j)
        assert (tag == "equal") == (one[first:last] == other[start:end])
        assert tag != "equal" or last > first
        found += one[first:last] if tag == "equal" else other[start:end]
        i, j = last, end
    assert (i, j) == (len(one), len(other))
    return found


@given(texts, texts)
def test_the_opcodes_make_one_text_of_the_other(one: list[str], other: list[str]) -> None:
    assert rebuilt(one, other) == other


@given(texts, texts)
def test_long_texts_are_matched_by_lines_that_occur_once(one: list[str], other: list[str]) -> None:
    with pytest.MonkeyPatch.context() as changed:
        changed.setattr(lines, "MAX_COMPARED", 2)
        assert rebuilt(one, other) == other


@given(st.integers(0, 2**32 - 1))
def test_a_few_edits_of_a_long_text_are_found_as_such(seed: int) -> None:
    rng = random.Random(seed)
    one = [rng.choice(["</link>", "", f"<link {k}>"]) for k in range(400)]
    other = list(one)
    for _ in range(3):
        at = rng.randrange(len(other))
        other[at : at + rng.randrange(2)] = [f"new {rng.random()}"]
    codes = line_opcodes(one, other)
    assert sum(last - first for tag, first, last, _, _ in codes if tag == "equal") >= len(one) - 70


@given(texts, texts)
def test_the_difference_is_that_of_diff(one: list[str], other: list[str]) -> None:
    ours = list(_difference(one, other))
    patch = list(difflib.unified_diff(one, other, n=2, lineterm=""))[2:]
    assert bool(ours) == bool(patch)
    hunks: list[tuple[str, list[str]]] = []
    for line in ours:
        if line.startswith("@@"):
            hunks.append((line, []))
        else:
            hunks[-1][1].append(line)
    for head, body in hunks:
        spans = head.removeprefix("@@ -").removesuffix(" @@").split(" +")
        for sign, span, text in zip("-+", spans, (one, other), strict=True):
            first, _, count = span.partition(",")
            start = int(first) - (count != "0")
            assert [each[1:] for each in body if each[0] in (" ", sign)] == text[start:][: int(count or 1)]


def test_a_change_at_both_ends_of_empty_lines_takes_no_time() -> None:
    middle = [""] * 200_000
    one, other = ["mass 1,5", *middle, "damping 0,1"], ["mass 1.5", *middle, "damping 0.1"]
    assert [each[0] for each in line_opcodes(one, other)] == ["replace", "equal", "replace"]
    longer = [*other[:-1], "new", other[-1]]
    assert rebuilt(one, longer) == longer
