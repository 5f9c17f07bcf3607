"""Sensors of MJCF, in the terms of `dynx.model.stated_parts.StatedSensor`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from xml.etree.ElementTree import Element as Written
from xml.etree.ElementTree import SubElement

from dynx.errors import escaped, nearest, shown
from dynx.model.mjcf.attributes import text
from dynx.model.mjcf.document import MjcfText
from dynx.model.mjcf.sensor_objects import WORLD, SensorObjects
from dynx.model.stated_parts import StatedSensor
from dynx.model.xml.reading import Element

Slot = Mapping[str, str]
"""Attributes of which one names an object, each with the kind of the object; ``""`` for a kind that another
attribute states."""

_NONE: Slot = {}
_OBJECT: Slot = {"objname": ""}
_REFERENCE: Slot = {"refname": ""}
_SLOTS: dict[str, tuple[Slot, Slot]] = {
    **dict.fromkeys(
        ["touch", "accelerometer", "velocimeter", "gyro", "force", "torque", "magnetometer"],
        ({"site": "site"}, _NONE),
    ),
    "rangefinder": ({"site": "site", "camera": "camera"}, _NONE),
    "camprojection": ({"site": "site"}, {"camera": "camera"}),
    **dict.fromkeys(
        ["jointpos", "jointvel", "jointactuatorfrc", "jointlimitpos", "jointlimitvel", "jointlimitfrc"],
        ({"joint": "joint"}, _NONE),
    ),
    **dict.fromkeys(
        ["tendonpos", "tendonvel", "tendonactuatorfrc", "tendonlimitpos", "tendonlimitvel", "tendonlimitfrc"],
        ({"tendon": "tendon"}, _NONE),
    ),
    **dict.fromkeys(["ballquat", "ballangvel"], ({"joint": "joint"}, _NONE)),
    **dict.fromkeys(["actuatorpos", "actuatorvel", "actuatorfrc"], ({"actuator": "actuator"}, _NONE)),
    **dict.fromkeys(
        ["framepos", "framequat", "framexaxis", "frameyaxis", "framezaxis", "framelinvel", "frameangvel"],
        (_OBJECT, _REFERENCE),
    ),
    **dict.fromkeys(["framelinacc", "frameangacc"], (_OBJECT, _NONE)),
    **dict.fromkeys(["subtreecom", "subtreelinvel", "subtreeangmom"], ({"body": "body"}, _NONE)),
    "insidesite": (_OBJECT, {"site": "site"}),
    **dict.fromkeys(
        ["distance", "normal", "fromto"],
        ({"geom1": "geom", "body1": "body"}, {"geom2": "geom", "body2": "body"}),
    ),
    **dict.fromkeys(["e_potential", "e_kinetic", "clock"], (_NONE, _NONE)),
}
"""Attributes of each type of sensor for its object and its reference."""

_NOT_TAKEN = ("contact", "plugin", "tactile", "user")
"""Types of sensors that state more than `StatedSensor` has."""

_KINDS = ("body", "xbody", "geom", "site", "camera")
"""Kinds that an attribute states."""

_OF_NO_TREE = ("actuator", "camera", "tendon")
"""Kinds of objects that are taken by their names, whether or not the model has them."""

_DELAYS = ("delay", "interval", "nsample")
_OF_ALL = ("name", "user", "cutoff", "noise", "interp", *_DELAYS)


def read_sensors(
    document: MjcfText, parts: SensorObjects, links: Mapping[str, str], sites: Mapping[str, str]
) -> tuple[tuple[StatedSensor, ...], list[tuple[Element, str]]]:
    """Return the sensors of a robot, and those that are not taken, each with the reason.

    `links` are its links by the names of bodies, `sites` its frames by those of sites. Raises
    DescriptionError for a malformed sensor, and for one whose object the file does not have, as MuJoCo does.
    """
    taken, left = [], []
    for element, sensor, reason in _sensors(document):
        if sensor is not None and not reason:
            sensor = replace(
                sensor,
                object=_renamed(sensor.object_type, sensor.object, links, sites),
                reference=_renamed(sensor.reference_type, sensor.reference, links, sites),
            )
            missing = parts.missing(sensor, _OF_NO_TREE)
            if missing is None:
                taken.append(sensor)
                continue
            reason = f"senses no {missing} of the robot"
        left.append((element, f"<{escaped(element.tag)}> {reason}"))
    return tuple(taken), left


def require_objects(document: MjcfText) -> None:
    """Raise the errors of `read_sensors` for the sensors of a document."""
    for _ in _sensors(document):
        pass


def _renamed(kind: str, name: str, links: Mapping[str, str], sites: Mapping[str, str]) -> str:
    if kind == "site":
        return sites.get(name, name)
    return links.get(name, name) if kind in ("body", "xbody") else name


def _sensors(document: MjcfText) -> Iterator[tuple[Element, StatedSensor | None, str]]:
    """Yield the elements with what they state, or why that is not taken."""
    elements = list(document.named_elements("sensor", (*_SLOTS, *_NOT_TAKEN), "sensor"))
    known = names_by_kind(document) if elements else {}
    for element in elements:
        if element.tag in _NOT_TAKEN:
            yield element, None, "is of a type that is not read"
            continue
        yield (element, *_read(document, element, known))


def _read(document: MjcfText, element: Element, known: Mapping[str, set[str]]) -> tuple[StatedSensor, str]:
    """Return a sensor, and why it is not taken; an empty text if it is."""
    reading, given = document.reading, element.attributes
    what = f"sensor {shown(given.get('name', ''))}"
    slots = _SLOTS[element.tag]
    named = [each for slot in slots for each in slot]
    allowed = [
        *_OF_ALL,
        *named,
        *(_kind_attribute(each) for slot in slots for each in slot if not slot[each]),
    ]
    reading.require_known_attributes(element, [*allowed, *(["data"] if element.tag == "rangefinder" else [])])
    objects = [
        _object(document, element, slot, what, needed=number == 0 or slot is not _REFERENCE)
        for number, slot in enumerate(slots)
    ]
    for kind, name in objects:
        if kind and name not in known["body" if kind == "xbody" else kind]:
            raise reading.error(
                element,
                f"<{element.tag}> senses the {kind} {shown(name)}, which the file has not"
                f"{nearest(name, known['body' if kind == 'xbody' else kind])}",
            )
    cutoff, noise = (reading.number_or(element, each, what, 0.0) for each in ("cutoff", "noise"))
    for each, value in (("cutoff", cutoff), ("noise", noise)):
        if value < 0.0:
            raise reading.error(element, f"{each} of {what} is {value:g}; wanted at least 0")
    others = [
        each for each in _DELAYS if each in given and any(reading.some_numbers(element, each, what, 1, 2))
    ]
    others += ["data"] if given.get("data", "dist") != "dist" else []
    sensor = StatedSensor(
        given.get("name", ""), element.tag, *objects[0], *objects[1], cutoff, noise, element.line
    )
    return sensor, f"has {escaped(others[0])}" if others else ""


def _object(document: MjcfText, element: Element, slot: Slot, what: str, *, needed: bool) -> tuple[str, str]:
    """Return kind and name of the object that one of the attributes of a slot names."""
    reading = document.reading
    given = [each for each in slot if each in element.attributes]
    if len(given) > 1 or (needed and slot and not given):
        raise reading.error(element, f"<{element.tag}> of {what} wants one of {' and '.join(slot)}")
    if not given:
        if slot is _REFERENCE and "reftype" in element.attributes:
            raise reading.error(element, f"<{element.tag}> of {what} has reftype and no refname")
        return "", ""
    (attribute,) = given
    kind = slot[attribute] or reading.choice(element, _kind_attribute(attribute), what, _KINDS, "")
    if not kind:
        raise reading.error(element, f"<{element.tag}> of {what} has no {_kind_attribute(attribute)}")
    return kind, element.attributes[attribute]


def _kind_attribute(attribute: str) -> str:
    return attribute.replace("name", "type")


def names_by_kind(document: MjcfText) -> dict[str, set[str]]:
    """Return the names of what sensors, tendons and constraints may refer to, wherever in the file it is."""
    found: dict[str, set[str]] = {
        kind: set() for kind in ("body", "joint", "geom", "site", "camera", "tendon", "actuator")
    }
    found["body"].add(WORLD)
    waiting = list(document.root.all("worldbody"))
    while waiting:
        element = waiting.pop()
        waiting += element.children
        kind = "joint" if element.tag == "freejoint" else element.tag
        if kind in found and "name" in element.attributes:
            found[kind].add(element.attributes["name"])
    for tag in ("tendon", "actuator"):
        found[tag] |= {
            each.attributes["name"] for each in document.sections(tag) if "name" in each.attributes
        }
    return found


def write_sensors(section: Written, sensors: Iterable[StatedSensor], bodies: Mapping[str, str]) -> None:
    """Add sensors to a section ``<sensor>``; `bodies` are those of the links."""
    for each in sensors:
        given = {"name": each.name} if each.name else {}
        objects = (each.object_type, each.object), (each.reference_type, each.reference)
        for slot, (kind, name) in zip(_SLOTS[each.type], objects, strict=True):
            for attribute, of in slot.items():
                if kind and of in ("", kind):
                    given |= {} if of else {_kind_attribute(attribute): kind}
                    given[attribute] = bodies.get(name, name) if kind in ("body", "xbody") else name
        given |= {
            attribute: text(value)
            for attribute, value in (("cutoff", each.cutoff), ("noise", each.noise))
            if value
        }
        SubElement(section, each.type, given)
