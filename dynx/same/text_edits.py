"""Edits of numbers in a text: those that differ are replaced, and all others stay as they are written."""

from __future__ import annotations

import re
from collections.abc import Container, Iterator, Sequence

import numpy as np

from dynx.model.xml.source import Edit, SourceElement, XmlSource

NEARLY_EQUAL = 1e-13
"""Difference of two numbers, relative to 1 or to the larger one, that is taken for rounding."""

ROUNDING = 1e-15
"""Relative difference of a computed number from one that is written shorter."""

MIN_SAVED_DIGITS = 4
"""Number of digits by which a number is shorter if it is taken for the one that was computed."""

MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
"""Fields of an inertial with the entries of its tensor."""

_WORD = re.compile(rb"""[^\s"']+""")


class NotMendedError(Exception):
    """A change cannot be written into the text; the message says which."""


def number(value: float) -> str:
    """Write a number so that it reads back exactly."""
    return repr(float(value) + 0.0)


def numbers(values: object) -> str:
    """Write several numbers."""
    return " ".join(number(value) for value in np.ravel(np.asarray(values)).tolist())


def short_number(value: float) -> str:
    """Write a computed number with 15 digits if that is shorter and its rounding alone is left out."""
    short, exact = f"{value:.15g}", number(value)
    near = abs(float(short) - value) <= ROUNDING * abs(value)
    return number(float(short)) if near and len(short) + MIN_SAVED_DIGITS <= len(exact) else exact


def are_near(one: float, other: float) -> bool:
    """Check whether two numbers are equal up to rounding."""
    return one == other or abs(one - other) <= NEARLY_EQUAL * max(1.0, abs(one), abs(other))


def number_edits(
    source: XmlSource,
    element: SourceElement,
    name: str,
    values: Sequence[float],
    kept: Container[int] = (),
) -> Iterator[Edit]:
    """Yield the edits of an attribute of which the first numbers are to be `values`.

    Numbers of the text stay as they are written if they are those of `values` up to rounding, if `kept` has
    their index, and behind the last value.
    """
    given = element.attributes.get(name, "").split()
    if name not in element.attributes or not all(map(_is_number, given)):
        yield source.attribute_edit(element, name, numbers(values))
        return
    place = element.places[name]
    start = source.data.index(b"=", place.start) + 1
    words = [*_WORD.finditer(source.data, start, place.end)]
    if [word.group().decode() for word in words] != given:  # an escaped character
        words = []
    if not words:
        yield source.attribute_edit(element, name, numbers(values))
        return
    for index, (word, value) in enumerate(zip(words, values, strict=False)):
        if index not in kept and not are_near(float(given[index]), value):
            yield Edit(word.start(), word.end(), short_number(value))
    if len(values) > len(words):
        at = words[-1].end()
        yield Edit(at, at, f" {numbers(values[len(words) :])}")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
