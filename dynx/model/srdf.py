"""Group states of SRDF, MoveIt's semantic description of a robot, as named configurations.

A ``<group_state>`` states positions of joints. Other elements of SRDF describe groups, grippers and pairs of
links that need no check for collisions; none of them is read.
"""

from __future__ import annotations

import os
from collections import Counter
from dataclasses import replace

import numpy as np

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, DescriptionError, escaped, shown
from dynx.files.reading import printable, read_file
from dynx.model.elements import Note
from dynx.model.model import Model
from dynx.model.numbers import checked_quaternion
from dynx.model.package_search import StrPath
from dynx.model.stated_parts import NamedConfiguration
from dynx.model.xml.reading import Element, read_xml
from dynx.model.xml.values import Reading


@checks_types
def with_group_states(model: Model, srdf: StrPath | bytes) -> Model:
    """Return a robot with the group states of SRDF as named configurations; see `Model.with_group_states`."""
    if isinstance(srdf, bytes) or (isinstance(srdf, str) and srdf.lstrip().startswith("<")):
        data, source = srdf, "<string>"
    else:
        path = os.fspath(srdf)
        data, source = read_file(path), printable(path)
    reading = Reading(source)
    root = read_xml(data, source, reading.notes)
    if root.tag != "robot":
        raise DescriptionError(
            f"the root element is <{escaped(root.tag)}>; wanted <robot name=...> of SRDF",
            source=source,
            line=root.line,
        )
    states = root.all("group_state")
    counts = Counter(reading.name(each, "name", "a group state") for each in states)
    found: list[NamedConfiguration] = []
    taken = set(model.configurations)
    for state in states:
        name = state.attributes["name"]
        if counts[name] > 1:
            name = f"{reading.name(state, 'group', f'group state {shown(name)}')}/{name}"
        if name in taken:
            raise reading.error(state, f"a configuration {shown(name)} of {model.name} exists already")
        taken.add(name)
        found.append(_configuration(model, state, name, reading))
    others = dict.fromkeys(each.tag for each in root.children if each.tag not in ("group", "group_state"))
    if others:
        first = next(each for each in root.children if each.tag in others)
        reading.note(first, f"not read of SRDF: {', '.join(f'<{escaped(each)}>' for each in others)}")
    notes = [Note(f"{source}: {each.message}", each.line) for each in reading.notes]
    stated = (*(model.stated_configurations or ()), *found)
    return replace(model, stated_configurations=stated, notes=(*model.notes, *notes))


def _configuration(model: Model, state: Element, name: str, reading: Reading) -> NamedConfiguration:
    what = f"group state {shown(name)}"
    joints = {each.name: each for each in model.joints}
    positions: list[tuple[str, tuple[float, ...]]] = []
    base: tuple[float, ...] | None = None
    left: list[str] = []
    for each in state.all("joint"):
        joint = reading.name(each, "name", what)
        given = tuple(reading.numbers(each, "value", what, len(each.attributes.get("value", "").split())))
        if joint in joints:
            wanted = max(joints[joint].n_positions, 1)
            if len(given) != wanted:
                raise reading.error(
                    each, f"{what} has {len(given)} values of joint {shown(joint)}; wanted {wanted}"
                )
            if wanted == 4:
                given = _unit(given, each, what, reading)
            positions.append((joint, given))
        elif len(given) == 7 and model.floating and base is None:
            base = (*given[:3], *_unit(given[3:], each, what, reading))
        else:
            left.append(joint)
    if left:
        reading.note(
            state, f"{what} states joints that {model.name} has not: {', '.join(map(shown, left[:5]))}"
        )
    return NamedConfiguration(name, tuple(positions), base, state.line)


def _unit(quat_xyzw: tuple[float, ...], element: Element, what: str, reading: Reading) -> tuple[float, ...]:
    try:
        return tuple(checked_quaternion(what, np.array(quat_xyzw)).tolist())
    except ArgumentError as error:
        raise reading.error(element, str(error)) from None
