"""Fixed tendons of MJCF, in the terms of `dynx.model.stated_parts.StatedTendon`."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from xml.etree.ElementTree import Element as Written
from xml.etree.ElementTree import SubElement

from dynx.errors import escaped, nearest, shown
from dynx.model.elements import INFINITY, Joint
from dynx.model.mjcf.attributes import UNLIMITED, text
from dynx.model.mjcf.document import ATTRIBUTES, TENDON_SOFTNESS, MjcfText
from dynx.model.mjcf.sensors import names_by_kind
from dynx.model.stated_parts import StatedTendon
from dynx.model.xml.reading import Element

UNBOUNDED = (-INFINITY, INFINITY)

AUTOMATIC_LENGTH = -1.0
"""``springlength`` for which MuJoCo takes the length with all joints at their ``springref``."""
_AUTOMATIC = (AUTOMATIC_LENGTH, AUTOMATIC_LENGTH)


def read_tendons(
    document: MjcfText, joints: Mapping[str, Joint], spring_references: Mapping[str, float]
) -> tuple[tuple[StatedTendon, ...], list[tuple[Element, str]]]:
    """Return the fixed tendons of a robot, and those that are not taken, each with the reason.

    `spring_references` are the positions [rad or m] of the joints at their ``springref``. Raises
    DescriptionError for a malformed tendon, and for one of a joint that the file does not have, as MuJoCo
    does.
    """
    taken, left = [], []
    elements = list(document.named_elements("tendon", ("fixed", "spatial"), "tendon"))
    known = names_by_kind(document)["joint"] if elements else set()
    for element in elements:
        if element.tag == "spatial":
            left.append((element, "<spatial> runs along sites and geoms"))
            continue
        tendon = _read(document, element, known, joints, spring_references)
        missing = next((each for each in tendon.joints if each not in joints), None)
        if missing is None:
            taken.append(tendon)
        else:
            left.append((element, f"<fixed> has the joint {shown(missing)}, which the robot has not"))
    return tuple(taken), left


def _read(
    document: MjcfText,
    element: Element,
    known: set[str],
    joints: Mapping[str, Joint],
    spring_references: Mapping[str, float],
) -> StatedTendon:
    reading = document.reading
    reading.require_known_attributes(element, sorted(ATTRIBUTES["fixed"]))
    element = document.resolved(element, None, "tendon")
    given, options = element.attributes, document.options
    what = f"tendon {shown(given.get('name', ''))}"
    terms: list[tuple[str, float]] = []
    for each in element.children:
        if each.tag != "joint":
            raise reading.error(each, f"<fixed> has the element <{escaped(each.tag)}>; wanted <joint>")
        reading.require_known_attributes(each, ("joint", "coef"))
        joint = reading.attribute(each, "joint", what)
        if joint not in known:
            raise reading.error(
                each, f"{what} has the joint {shown(joint)}, which no body has{nearest(joint, known)}"
            )
        if joint in (stated for stated, _ in terms):
            raise reading.error(each, f"{what} has the joint {shown(joint)} twice")
        if joint in joints and joints[joint].type == "ball":
            raise reading.error(
                each, f"{what} has the ball joint {shown(joint)}; wanted joints with one coordinate"
            )
        terms.append((joint, reading.number(each, "coef", what)))
    if not terms:
        raise reading.error(element, f"{what} has no <joint>; wanted at least one")
    coefficients = {}
    for attribute in ("stiffness", "damping"):
        numbers = reading.some_numbers(element, attribute, what, 1, 3) if attribute in given else (0.0,)
        if any(numbers[1:]):
            reading.note(
                element, f"{attribute} of {what} is a polynomial; its terms beyond the first are not read"
            )
        coefficients[attribute] = numbers[0]
    if reading.number_or(element, "springyield", what, 0.0):
        reading.note(element, f"springyield of {what} is not read: its spring is elastic")
    lengths = (
        reading.some_numbers(element, "springlength", what, 1, 2) if "springlength" in given else (-1.0,)
    )
    ends = lengths[0], lengths[-1]
    if ends[0] > ends[1]:
        raise reading.error(
            element,
            f"springlength of {what} is {ends[0]:g} {ends[1]:g}; wanted a first number up to the second",
        )
    if ends == _AUTOMATIC:
        length = sum(factor * spring_references.get(joint, 0.0) for joint, factor in terms)
        ends = length, length
    softness = [each for each in sorted(TENDON_SOFTNESS) if each in given]
    if softness:
        reading.note(
            element, f"not read of {what}: {', '.join(softness)}, which are parameters of MuJoCo's solver"
        )
    return StatedTendon(
        given.get("name", ""),
        tuple(terms),
        _range(document, element, "limited", "range", what),
        coefficients["stiffness"] if options.disabled("spring") is None else 0.0,
        ends,
        coefficients["damping"] if options.disabled("damper") is None else 0.0,
        reading.number_or(element, "frictionloss", what, 0.0)
        if options.disabled("frictionloss") is None
        else 0.0,
        reading.number_or(element, "armature", what, 0.0),
        _range(document, element, "actuatorfrclimited", "actuatorfrcrange", what),
        element.line,
    )


def _range(document: MjcfText, element: Element, limited: str, ends: str, what: str) -> tuple[float, float]:
    if not document.is_limited(element, limited, ends, what):
        return UNBOUNDED
    low, high = document.reading.numbers(element, ends, what, 2)
    if low >= high:
        if element.attributes.get(limited) == "true":
            raise document.reading.error(
                element, f"{ends} of {what} is {low:g} {high:g}; wanted a first number below the second"
            )
        return UNBOUNDED  # MuJoCo takes such a range for none
    return low if low > -UNLIMITED else -INFINITY, high if high < UNLIMITED else INFINITY


def limited_range(ends: tuple[float, float]) -> tuple[float, float]:
    """Return a range in numbers that MuJoCo has."""
    return max(ends[0], -UNLIMITED), min(ends[1], UNLIMITED)


def spring_length_text(tendon: StatedTendon) -> str:
    """Write the lengths without a spring force.

    The pair that MuJoCo would compute anew is moved by rounding.
    """
    nearby = [math.nextafter(end, 0.0) for end in _AUTOMATIC]
    return text(nearby if tendon.spring_length == _AUTOMATIC else tendon.spring_length)


def write_tendons(section: Written, tendons: Iterable[StatedTendon]) -> None:
    """Add tendons to a section ``<tendon>``."""
    for each in tendons:
        given = {"name": each.name} if each.name else {}
        for attribute, ends in (("range", each.range), ("actuatorfrcrange", each.force_range)):
            if ends != UNBOUNDED:
                given[attribute] = text(limited_range(ends))
        numbers = {
            "stiffness": each.stiffness,
            "damping": each.damping,
            "frictionloss": each.friction,
            "armature": each.armature,
        }
        given |= {name: text(value) for name, value in numbers.items() if value}
        if each.stiffness:
            given["springlength"] = spring_length_text(each)
        tendon = SubElement(section, "fixed", given)
        for joint, factor in each.terms:
            SubElement(tendon, "joint", joint=joint, coef=text(factor))
