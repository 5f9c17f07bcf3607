"""Values of attributes of a source element, read as `dynx.load` reads them, and edits of orientations."""

from __future__ import annotations

from dynx.model.elements import Pose, Vector
from dynx.model.urdf.origins import QUATERNION, read_origin, reads_quaternions
from dynx.model.urdf.values import Reading
from dynx.model.xml.reading import Element
from dynx.model.xml.source import Edit, SourceElement, XmlSource
from dynx.rules.text.number_text import decimal, is_number


def number_of(element: SourceElement, attribute: str) -> float | None:
    """Return the finite number that an attribute holds; None where it is absent.

    Raises DescriptionError for any other text, as `vector_of` and `origin_of` do.
    """
    if attribute not in element.attributes:
        return None
    return Reading("<string>").number(_plain(element), attribute, "this file")


def number_or_none(element: SourceElement, attribute: str) -> float | None:
    """Return the number that an attribute holds; None where it is absent or no finite number."""
    text = element.attributes.get(attribute, "")
    return float(text) if is_number(text) else None


def vector_of(element: SourceElement, attribute: str) -> Vector | None:
    """Return the three finite numbers that an attribute holds; None where it is absent."""
    if attribute not in element.attributes:
        return None
    return Reading("<string>").vector(_plain(element), attribute, "this file")


def origin_of(parent: SourceElement) -> Pose:
    """Return the pose in the ``<origin>`` of an element; absent and empty attributes are zero."""
    origins = [_plain(child) for child in parent.all("origin")]
    reading = Reading("<string>", quaternions=quaternions_count(parent))
    return read_origin(Element(parent.tag, {}, parent.line, origins), "this file", reading)


def quaternions_count(element: SourceElement) -> bool:
    """Check whether the robot of an element states a version of URDF that has ``quat_xyzw``."""
    root = element
    while root.parent is not None:
        root = root.parent
    return reads_quaternions(root.attributes.get("version"))


def orientation_edits(source: XmlSource, origin: SourceElement, rpy: Vector) -> list[Edit]:
    """Return the edits that give an ``<origin>`` these angles, in place of a quaternion if it has one."""
    edits = [source.attribute_edit(origin, "rpy", " ".join(map(decimal, rpy)))]
    if QUATERNION in origin.attributes:
        edits.append(source.attribute_removal(origin, QUATERNION))
    return edits


def _plain(element: SourceElement) -> Element:
    return Element(element.tag, element.attributes, element.line)
