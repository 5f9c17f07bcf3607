"""The attributes of a URDF that hold numbers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from dynx.model.xml.source import SourceElement, XmlSource

MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
"""The attributes of ``<inertia>``: moments and products of inertia."""

_ORIGIN = {"xyz": 3, "rpy": 3}
_IN_INERTIAL = {
    "origin": _ORIGIN,
    "mass": {"value": 1},
    "inertia": dict.fromkeys(MOMENTS, 1),
}
_IN_SHAPE = {"origin": _ORIGIN}
_IN_GEOMETRY = {
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "mesh": {"scale": 3},
}
_IN_JOINT = {
    "origin": _ORIGIN,
    "limit": dict.fromkeys(("lower", "upper", "effort", "velocity"), 1),
    "dynamics": dict.fromkeys(("damping", "friction"), 1),
    "mimic": dict.fromkeys(("multiplier", "offset"), 1),
    "calibration": dict.fromkeys(("rising", "falling"), 1),
    "safety_controller": dict.fromkeys(
        ("soft_lower_limit", "soft_upper_limit", "k_position", "k_velocity"), 1
    ),
}
_WITHOUT_AXIS = ("fixed", "floating")


@dataclass(frozen=True, eq=False)
class NumericAttribute:
    """An attribute that holds `count` numbers, one or three."""

    element: SourceElement
    name: str
    count: int

    def text_in(self, source: XmlSource) -> str:
        """Return the text as written, in which tabs and line breaks are not yet replaced by blanks."""
        place = self.element.places[self.name]
        written = source.data[place.start : place.end].decode("utf-8").partition("=")[2].strip()[1:-1]
        return self.element.attributes[self.name] if "&" in written else written


def numeric_attributes(source: XmlSource) -> Iterator[NumericAttribute]:
    """Yield all numeric attributes of links and joints, in document order."""
    for part in source.root.children:
        if part.tag == "link":
            yield from _of_link(part)
        elif part.tag == "joint":
            yield from joint_attributes(part)
            # MuJoCo alone reads the axis of these joints, see DX219.
            if part.attributes.get("type") not in _WITHOUT_AXIS:
                yield from _below(part, {"axis": {"xyz": 3}})


def _of_link(link: SourceElement) -> Iterator[NumericAttribute]:
    for child in link.children:
        if child.tag == "inertial":
            yield from _below(child, _IN_INERTIAL)
        elif child.tag in ("visual", "collision"):
            yield from shape_attributes(child)


def joint_attributes(joint: SourceElement) -> Iterator[NumericAttribute]:
    """Yield the numeric attributes of a joint but those of its axis, in document order."""
    yield from _below(joint, _IN_JOINT)


def shape_attributes(part: SourceElement) -> Iterator[NumericAttribute]:
    """Yield the numeric attributes of a ``<visual>`` or a ``<collision>``, in document order."""
    yield from _below(part, _IN_SHAPE)
    for geometry in part.all("geometry"):
        yield from _below(geometry, _IN_GEOMETRY)


def _below(parent: SourceElement, table: dict[str, dict[str, int]]) -> Iterator[NumericAttribute]:
    for element in parent.children:
        for name, count in table.get(element.tag, {}).items():
            if name in element.attributes:
                yield NumericAttribute(element, name, count)
