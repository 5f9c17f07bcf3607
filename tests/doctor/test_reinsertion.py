"""Reinsertion of a cause into a mended text: its lines as they were given, the rest as mended."""

from __future__ import annotations

import pytest

from dynx.doctor.attribution import reinserted_text
from dynx.model.xml.source import XmlSource

LINES = ("<robot>", *(f'  <link name="l{k}" mass="{k}"/>' for k in range(6)), "</robot>")


def text_with(changes: dict[int, str | None]) -> XmlSource:
    """Return the document with other text in some lines; None takes a line away."""
    kept = [changes.get(k, line) for k, line in enumerate(LINES)]
    return XmlSource("\n".join(line for line in kept if line is not None))


BAD, GOOD, OTHER = (
    '  <link name="bad" mass="1,5"/>',
    '  <link name="bad" mass="1.5"/>',
    '  <link name="new"/>',
)


@pytest.mark.parametrize("cause", range(1, 7))
@pytest.mark.parametrize("other", range(1, 7))
@pytest.mark.parametrize("mended", [OTHER, None, f"{OTHER}\n{OTHER}"])
@pytest.mark.parametrize("good", [GOOD, None])
def test_the_cause_comes_back_and_nothing_else(
    cause: int, other: int, mended: str | None, good: str | None
) -> None:
    if abs(cause - other) < 2:
        return
    given, without = text_with({cause: BAD}), text_with({cause: good})
    found = reinserted_text(given, without, text_with({cause: good, other: mended}))
    assert found is not None
    assert found.text == text_with({cause: BAD, other: mended}).text


def test_two_remedies_in_one_line_cannot_be_told_apart() -> None:
    given, without = text_with({2: BAD}), text_with({2: GOOD})
    assert reinserted_text(given, without, text_with({2: '  <link name="bad" mass="7"/>'})) is None


def test_a_remedy_that_changed_nothing_has_nothing_to_put_back() -> None:
    given = text_with({})
    assert reinserted_text(given, given, text_with({3: OTHER})) is None
