"""Level of a remedy: how much of a robot it changes, measured by reading the file before and after it.

``safe``: dynx reads the same numbers, bit for bit, and so does every engine that read the file right.
``rounding``: links, joints and limits stay, and the equations of motion change by rounding only: principal
axes, moments raised by their last digits, inertia moved between rigidly connected links.
``physics``: everything else that a reader of the file may notice: other numbers or names, and text that can
be read in more than one way.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from dynx.agreement.tolerances import BAR
from dynx.doctor.examine.reference_values import (
    ReferenceValues,
    draw_states,
    model_without_mimics,
    reference_values,
)
from dynx.errors import DynxError
from dynx.model import Model
from dynx.model.elements import Inertial
from dynx.model.xml.source import SourceElement, XmlSource
from dynx.rules import Case, Level, Remedy, Rule
from dynx.spatial.scalar import Floats

Part = tuple[str, str]
"""Tag and name of an element of the robot; the robot itself has its own tag."""

_STATES, _SEED = 2, 0
"""Number of states at which equations of motion are compared, and their seed."""


def level_of(rule: Rule, before: Case, remedy: Remedy) -> Level:
    """Return the level of the remedy of a rule for the case `before`."""
    after = remedy.case
    if before.source.data == after.source.data:
        return "safe"
    if remedy.changes_physics:
        return "physics"
    if not (before.readable and after.readable):
        return "safe" if rule.unambiguous else "physics"
    if _parts_of(before.model) != _parts_of(after.model) or _rest(before.source) != _rest(after.source):
        return "physics"
    if _numbers(before.model) == _numbers(after.model):
        return "safe"
    return "rounding" if _moves_alike(before, after) else "physics"


def changed_parts(before: XmlSource, after: XmlSource) -> tuple[Part, ...]:
    """Name the elements of the robot whose text differs, in document order; those that are new come last."""
    old, new = _texts(before), _texts(after)
    return tuple(
        dict.fromkeys(
            part for part, number in (*old, *new) if old.get((part, number)) != new.get((part, number))
        )
    )


def _texts(source: XmlSource) -> dict[tuple[Part, int], bytes]:
    """Return the text of each element of the robot, numbered where names repeat, and of the start tag."""
    root = source.root
    texts = {((root.tag, ""), 0): source.data[root.start_tag.start : root.start_tag.end]}
    numbers: Counter[Part] = Counter([(root.tag, "")])
    for element in root.children:
        part = (element.tag, element.attributes.get("name", ""))
        texts[part, numbers[part]] = source.data[element.span.start : element.span.end]
        numbers[part] += 1
    return texts


def _parts_of(model: Model) -> Any:
    """Return what a reader tells apart by name or kind."""
    return (
        model.name,
        {link.name for link in model.links},
        {
            joint.name: (joint.type, joint.parent, joint.child, joint.limits, joint.dynamics, joint.mimic)
            for joint in model.joints
        },
    )


def _numbers(model: Model) -> Any:
    """Return the numbers of links and joints; a link without mass and moments has no centre of mass."""
    none = Inertial()
    return (
        {link.name: _without_place(link.inertial or none) for link in model.links},
        {joint.name: replace(joint, line=None) for joint in model.joints},
    )


def _without_place(inertial: Inertial) -> Inertial:
    return inertial if inertial.mass or inertial.tensor.any() else Inertial()


def _rest(source: XmlSource) -> list[Any]:
    """Return what dynx does not read and other readers do: shapes, and elements beside links and joints."""
    rest: list[Any] = [source.root.attributes.get("name")]
    for element in source.root.children:
        if element.tag in ("link", "joint"):
            rest += [_words(shape) for tag in ("visual", "collision") for shape in element.all(tag)]
        else:
            rest.append(_words(element))
    return rest


def _words(element: SourceElement) -> tuple[Any, ...]:
    words = {name: value.split() for name, value in element.attributes.items()}
    return element.tag, words, [_words(child) for child in element.children]


def _moves_alike(before: Case, after: Case) -> bool:
    """Check whether the equations of motion are those of before to rounding, also if the base floats."""
    try:
        one, other = _values(before.source), _values(after.source)
    except DynxError:
        return False
    pairs = zip(_compared(one), _compared(other), strict=True)
    return all(_near(first, second) for first, second in pairs)


def _values(source: XmlSource) -> ReferenceValues:
    model = model_without_mimics(source, "floating")
    return reference_values(model, draw_states(model, _STATES, _SEED))


def _compared(values: ReferenceValues) -> Iterator[Floats]:
    yield from (values.poses, values.mass_matrix, values.torque)


def _near(one: Floats, other: Floats) -> bool:
    size = float(np.max(np.abs(one), initial=0.0))
    return one.shape == other.shape and bool(np.all(np.abs(one - other) <= BAR * size))
