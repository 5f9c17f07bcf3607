"""Reductions of the details of a small robot: elements and attributes removed, numbers rounded."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from dynx.doctor.counterexample.tree_reductions import Reductions
from dynx.model.xml.quoting import quoteattr
from dynx.model.xml.source import Edit, SourceElement, XmlSource
from dynx.rules.numbers_in_text import is_number

DIGITS = (1, 2, 3)
"""Numbers of significant digits that are tried."""

_DYNAMIC = {
    "link": {"inertial"},
    "joint": {"origin", "parent", "child", "axis", "limit", "dynamics", "mimic"},
}
_NAMING = frozenset(["name", "type", "link", "joint", "filename"])

Simpler = Callable[[SourceElement, str, str], str]
"""Function of an element, the name of an attribute and a number in it as text; it returns a simpler
number."""


def fewer_extras(source: XmlSource) -> Reductions:
    """Remove elements that do not affect dynamics: shapes, materials, transmissions, elements of
    simulators."""
    extras = [element for element in source.root.children if element.tag not in _DYNAMIC]
    for tag, dynamic in _DYNAMIC.items():
        for part in source.root.all(tag):
            extras += [element for element in part.children if element.tag not in dynamic]
    return Reductions(extras, lambda chosen: source.apply(*_removals(source, chosen)))


def fewer_elements(source: XmlSource) -> Reductions:
    """Remove elements inside links and joints, except ``<parent>`` and ``<child>``."""
    parts = [part for tag in _DYNAMIC for part in source.root.all(tag)]
    inside = [element for part in parts for element in part.walk() if element is not part]
    droppable = [element for element in inside if element.tag not in ("parent", "child")]
    return Reductions(droppable, lambda chosen: source.apply(*_removals(source, chosen)))


def fewer_attributes(source: XmlSource) -> Reductions:
    """Remove attributes, except names and references."""
    found = [
        (element, attribute)
        for element in source.root.walk()
        for attribute in element.places
        if attribute not in _NAMING
    ]
    return Reductions(
        found,
        lambda chosen: source.apply(*(source.attribute_removal(*each) for each in chosen)),
    )


@dataclass(frozen=True, eq=False)
class _Rounding:
    """New numbers, as text, at some positions of an attribute."""

    element: SourceElement
    attribute: str
    words: dict[int, str]


def frame_axes(source: XmlSource) -> Reductions:
    """Replace the axis of a joint by the nearest axis of its frame."""
    changes = []
    for element, attribute, words in _numbers(source):
        largest = max(range(len(words)), key=lambda k: abs(float(words[k])))
        nearest = {k: "0" if k != largest else _unit(word) for k, word in enumerate(words)}
        changed = any(complexity(new) < complexity(words[k]) for k, new in nearest.items())
        if element.tag == "axis" and changed:
            changes.append(_Rounding(element, attribute, nearest))
    return Reductions(changes, lambda chosen: source.apply(*_rewrites(source, chosen)))


def plain_numbers(source: XmlSource) -> Reductions:
    """Replace a number by 0; a mass, a moment of inertia and a limit by 1, a lower limit by -1."""
    return _roundings(source, _plain)


def unit_numbers(source: XmlSource) -> Reductions:
    """Replace a number by 1 or -1."""
    return _roundings(source, lambda element, attribute, word: _unit(word))


def round_numbers(source: XmlSource, digits: int) -> Reductions:
    """Round numbers to `digits` significant digits."""
    return _roundings(source, lambda element, attribute, word: shortest(f"{float(word):.{digits}g}"))


def complexity(word: str) -> int:
    """Return the complexity of a number: 0 for zero, 1 for one, else 1 plus its significant digits."""
    value = abs(float(word))
    if value in (0.0, 1.0):
        return int(value)
    return 1 + len(f"{value:.16e}".partition("e")[0].replace(".", "").rstrip("0"))


def shortest(word: str) -> str:
    """Write a number in the fewest characters that read back the same; return other text as it is."""
    if not is_number(word):
        return word
    value = float(word)
    return repr(int(value)) if value == int(value) and abs(value) < 1e6 else repr(value)


def format_document(source: XmlSource, *, numbers: bool) -> str:
    """Format the document with two blanks of indentation and without comments, one element to a line, with
    numbers as short as possible if `numbers`."""
    return "\n".join(_lines(source.root, "", numbers)) + "\n"


def _lines(element: SourceElement, indent: str, numbers: bool) -> Iterator[str]:
    written = "".join(
        f" {name}={quoteattr(_format_value(value) if numbers and name not in _NAMING else value)}"
        for name, value in element.attributes.items()
    )
    if not element.children:
        yield f"{indent}<{element.tag}{written}/>"
        return
    yield f"{indent}<{element.tag}{written}>"
    for child in element.children:
        yield from _lines(child, indent + "  ", numbers)
    yield f"{indent}</{element.tag}>"


def _format_value(value: str) -> str:
    return " ".join(shortest(word) for word in value.split(" "))


def _removals(source: XmlSource, chosen: Sequence[SourceElement]) -> Iterator[Edit]:
    """Remove elements; an element inside another removed one needs no edit."""
    removed = {id(element) for element in chosen}
    for element in chosen:
        above = element.parent
        while above is not None and id(above) not in removed:
            above = above.parent
        if above is None:
            yield source.removal(element)


def _roundings(source: XmlSource, simpler: Simpler) -> Reductions:
    """Change single numbers of attributes to simpler ones; the numbers of an axis are changed together."""
    changes = []
    for element, attribute, words in _numbers(source):
        found = {k: simpler(element, attribute, word) for k, word in enumerate(words)}
        found = {k: new for k, new in found.items() if complexity(new) < complexity(words[k])}
        if element.tag != "axis":
            changes += [_Rounding(element, attribute, {k: new}) for k, new in found.items()]
    return Reductions(changes, lambda chosen: source.apply(*_rewrites(source, chosen)))


def _numbers(source: XmlSource) -> Iterator[tuple[SourceElement, str, list[str]]]:
    """Yield the attributes that hold finite numbers and nothing else, with these numbers as text."""
    for element in source.root.walk():
        for attribute in element.places:
            words = element.attributes[attribute].split()
            if attribute not in _NAMING and words and all(map(is_number, words)):
                yield element, attribute, words


def _rewrites(source: XmlSource, chosen: Sequence[_Rounding]) -> Iterator[Edit]:
    together: dict[tuple[int, str], list[_Rounding]] = {}
    for change in chosen:
        together.setdefault((id(change.element), change.attribute), []).append(change)
    for (_, attribute), changes in together.items():
        element = changes[0].element
        words = element.attributes[attribute].split()
        for change in changes:
            for k, word in change.words.items():
                words[k] = word
        yield source.attribute_edit(element, attribute, " ".join(words))


def _unit(word: str) -> str:
    return "-1" if float(word) < 0.0 else "1"


def _plain(element: SourceElement, attribute: str, word: str) -> str:
    if element.tag == "limit":
        return "-1" if attribute == "lower" else "1"
    return "1" if element.tag == "mass" or attribute in ("ixx", "iyy", "izz") else "0"
