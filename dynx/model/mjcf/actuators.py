"""Actuators of MJCF that act on one joint or tendon, in the terms of `dynx.model.stated_parts.Actuator`.

The shortcuts ``motor``, ``position`` and ``velocity`` are written by MuJoCo as a ``general`` actuator, and
so they are here. Taken are fixed gains and affine biases without a state of their own.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from xml.etree.ElementTree import Element as Written
from xml.etree.ElementTree import SubElement

from dynx.errors import escaped, shown
from dynx.model.elements import INFINITY, ZERO, Joint, Vector
from dynx.model.mjcf.attributes import UNLIMITED, text
from dynx.model.mjcf.document import ACTUATORS, MjcfText
from dynx.model.stated_parts import Actuator
from dynx.model.xml.reading import Element

Range = tuple[float, float]

UNBOUNDED: Range = (-INFINITY, INFINITY)

_OF_ALL = frozenset(
    ["name", "class", "group", "user", "joint", "jointinparent", "tendon", "gear", "ctrllimited", "ctrlrange"]
) | {"forcelimited", "forcerange", "lengthrange", "actlimited", "actrange", "actearly"}
"""Attributes that every actuator has, and that are read or act on other actuators alone."""

_OF_ONE: Mapping[str, frozenset[str]] = {
    "motor": frozenset(),
    "position": frozenset(["kp", "kv", "inheritrange", "dampratio", "timeconst"]),
    "velocity": frozenset(["kv"]),
    "general": frozenset(["gaintype", "gainprm", "biastype", "biasprm", "dyntype", "dynprm"]),
}
"""Attributes of the actuators that are read."""


class NotTakenError(Exception):
    """An actuator is none that `Actuator` describes; the message says why."""


def read_actuators(
    document: MjcfText, joints: Mapping[str, Joint], tendons: Collection[str] = ()
) -> tuple[tuple[Actuator, ...], list[tuple[Element, str]]]:
    """Return the actuators on the joints and tendons of a robot, and those that are not taken, each with the
    reason.

    Raises DescriptionError for an attribute that is malformed.
    """
    taken, left = [], []
    for element in document.sections("actuator"):
        found = _read(document, element, joints, tendons)
        if isinstance(found, Actuator):
            taken.append(found)
        else:
            left.append((element, f"<{escaped(element.tag)}> {found}"))
    return tuple(taken), left


def _read(
    document: MjcfText, element: Element, joints: Mapping[str, Joint], tendons: Collection[str]
) -> Actuator | str:
    """Return an actuator, or why it is not taken."""
    try:
        return _actuator(document, element, joints, tendons)
    except NotTakenError as reason:
        return str(reason)


def _actuator(
    document: MjcfText, element: Element, joints: Mapping[str, Joint], tendons: Collection[str]
) -> Actuator:
    reading, tag = document.reading, element.tag
    if tag not in _OF_ONE:
        raise NotTakenError("is no motor, position, velocity or general")
    element = _with_defaults(document, element)
    given = element.attributes
    what = f"actuator {shown(given.get('name', ''))}"
    for name in given:
        if name not in _OF_ALL and name not in _OF_ONE[tag]:
            raise NotTakenError(f"has {escaped(name)}")
    on, tendon = given.get("joint", given.get("jointinparent", "")), given.get("tendon", "")
    if tendon and on:
        raise reading.error(element, f"{what} acts on a joint and a tendon; wanted one of them")
    if tendon and tendon not in tendons:
        raise NotTakenError(f"acts on the tendon {shown(tendon)}, which is not read")
    if not tendon and (on not in joints or not joints[on].moves or joints[on].type == "ball"):
        raise NotTakenError("acts on no joint of the robot with one coordinate, and on no tendon")
    gain, bias = _terms(document, element, what)
    gear = reading.some_numbers(element, "gear", what, 1, 6)[0] if "gear" in given else 1.0
    ranges = [_range(document, element, name, what) for name in ("ctrl", "force")]
    if reading.number_or(element, "inheritrange", what, 0.0):
        if tendon:
            raise NotTakenError("has an inheritrange, and acts on a tendon")
        ranges[0] = _inherited(reading.number(element, "inheritrange", what), joints[on], ranges[0])
    if document.options.disabled("clampctrl") is not None:
        ranges[0] = UNBOUNDED
    return Actuator(given.get("name", ""), on, gear, gain, bias, ranges[0], ranges[1], element.line, tendon)


def _with_defaults(document: MjcfText, element: Element) -> Element:
    """Return an actuator with the attributes of its class: a ``<default>`` has those of all actuators."""
    resolved = document.resolved(element, None)
    name = element.attributes.get("class", document.main_class)
    others = {
        tag: given
        for tag, given in document.defaults[name].items()
        if tag in ACTUATORS and tag != element.tag and given
    }
    shared: dict[str, str] = {}
    for tag, given in others.items():
        for each, value in given.items():
            if each in element.attributes or (element.tag == "motor" and each not in _OF_ALL):
                continue  # What the actuator states comes first; a motor has its own gain and no bias.
            if each not in _OF_ALL or {shared.get(each, value), resolved.attributes.get(each, value)} != {
                value
            }:
                raise NotTakenError(f"has a class of defaults for <{tag}>, too")
            shared[each] = value
    return document.reading.like(element, {**shared, **resolved.attributes}) if shared else resolved


def _terms(document: MjcfText, element: Element, what: str) -> tuple[float, Vector]:
    """Return gain and bias of an actuator."""
    reading, given = document.reading, element.attributes
    if element.tag == "motor":
        return 1.0, ZERO
    if element.tag == "velocity":
        kv = reading.number_or(element, "kv", what, 1.0)
        return kv, (0.0, 0.0, 0.0 - kv)
    if element.tag == "position":
        for name in ("dampratio", "timeconst"):
            if reading.number_or(element, name, what, 0.0):
                raise NotTakenError(f"has {name}")
        kp, kv = (reading.number_or(element, *each) for each in (("kp", what, 1.0), ("kv", what, 0.0)))
        return kp, (0.0, 0.0 - kp, 0.0 - kv)
    kinds = [given.get(name, absent) for name, absent in _KINDS.items()]
    gains, biases = (
        reading.some_numbers(element, name, what, 1, 10) if name in given else absent
        for name, absent in (("gainprm", (1.0,)), ("biasprm", ZERO))
    )
    if kinds[0] != "none":
        raise NotTakenError(f"has the dyntype {shown(kinds[0])}")
    if kinds[1] not in ("fixed", "affine") or (kinds[1] == "affine" and any(gains[1:3])):
        raise NotTakenError(f"has the gaintype {shown(kinds[1])}")
    if kinds[2] not in ("none", "affine"):
        raise NotTakenError(f"has the biastype {shown(kinds[2])}")
    first, second, third = (*biases, 0.0, 0.0)[:3] if kinds[2] == "affine" else ZERO
    return gains[0], (first, second, third)


_KINDS = {"dyntype": "none", "gaintype": "fixed", "biastype": "none"}


def _range(document: MjcfText, element: Element, name: str, what: str) -> Range:
    if not document.is_limited(element, f"{name}limited", f"{name}range", what):
        return UNBOUNDED
    low, high = document.reading.numbers(element, f"{name}range", what, 2)
    return low if low > -UNLIMITED else -INFINITY, high if high < UNLIMITED else INFINITY


def _inherited(share: float, joint: Joint, stated: Range) -> Range:
    """Return the range of the commands of a servo as a share of the range of its joint."""
    low, high = joint.limits.lower, joint.limits.upper
    if stated != UNBOUNDED or UNBOUNDED[0] in (low, -high):
        raise NotTakenError("has an inheritrange beside a ctrlrange, or for a joint without a range")
    middle, half = (low + high) / 2.0, (high - low) / 2.0
    return middle - share * half, middle + share * half


def write_actuators(section: Written, actuators: Iterable[Actuator]) -> None:
    """Add actuators to a section ``<actuator>``."""
    for each in actuators:
        given = {"name": each.name} if each.name else {}
        given |= {"tendon": each.tendon} if each.tendon else {"joint": each.joint}
        if each.gear != 1.0:
            given["gear"] = text(each.gear)
        for name, (low, high) in (("ctrl", each.control_range), ("force", each.force_range)):
            if (low, high) != UNBOUNDED:
                given[f"{name}range"] = text((max(low, -UNLIMITED), min(high, UNLIMITED)))
        if (each.gain, each.bias) == (1.0, ZERO):
            SubElement(section, "motor", given)
            continue
        given["gainprm"] = text(each.gain)
        if each.bias != ZERO:
            given |= {"biastype": "affine", "biasprm": text(each.bias)}
        SubElement(section, "general", given)
