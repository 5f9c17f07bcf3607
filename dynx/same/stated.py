"""Parts of two descriptions that are data beside the dynamics, such as sensors: which correspond, and which
differ."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Sequence
from typing import Protocol, TypeVar

from dynx.same.attributes import Attribute, Kind, Tag


class StatedPart(Protocol):
    """A part with a name, which may be empty, and a line."""

    @property
    def name(self) -> str: ...

    @property
    def line(self) -> int | None: ...


Part = TypeVar("Part", bound=StatedPart)


def counterparts(
    mine: Sequence[Part],
    other: Sequence[Part],
    are_equal: Callable[[Part, Part], bool],
    group: Callable[[Part], Hashable],
) -> Iterator[tuple[Part | None, Part | None, bool]]:
    """Yield pairs of parts, each with whether they are equal; None for a part that one description has alone.

    A part has the counterpart of its name; one without has the first that is equal. `group` returns the same
    for all parts that may be equal.
    """
    by_name = {each.name: each for each in other if each.name}
    named = {each.name for each in mine} & set(by_name)
    left: dict[Hashable, list[Part]] = {}
    for each in other:
        if each.name not in named:
            left.setdefault(group(each), []).append(each)
    for each in mine:
        if each.name in named:
            yield each, by_name[each.name], are_equal(each, by_name[each.name])
            continue
        candidates = left.get(group(each), [])
        found = next((one for one in candidates if are_equal(each, one)), None)
        yield each, found, found is not None
        if found is not None:
            left[group(each)] = [one for one in candidates if one is not found]
    for one in (each for several in left.values() for each in several):
        yield None, one, False


def part_differences(
    pairs: Iterator[tuple[Part | None, Part | None, bool]],
    kind: Kind,
    tag: Tag,
    words: Callable[[Part], str],
    label: Callable[[Part], str],
) -> Iterator[Attribute]:
    """Yield the parts that differ, that one description has alone, or that have other names.

    `words` writes a part, and `label` what stands for the name of one without a name.
    """
    for mine, other, equal in pairs:
        lines = (None if mine is None else mine.line), (None if other is None else other.line)
        if equal and mine is not None and other is not None:
            if mine.name != other.name:
                names = mine.name or "none", other.name or "none"
                yield Attribute("name", tag, mine.name, other.name, *names, *lines)
            continue
        first, second = ("none" if each is None else words(each) for each in (mine, other))
        if first == second:
            second = f"placed otherwise: {second}"
        labels = [None if each is None else each.name or label(each) for each in (mine, other)]
        yield Attribute(kind, tag, labels[0], labels[1], first, second, *lines)
