"""Types of joints in URDF other than the four that a Model has under the same name."""

from __future__ import annotations

from collections.abc import Iterable

from dynx.errors import nearest, shown
from dynx.model.elements import JointType
from dynx.model.xml.reading import Element
from dynx.model.xml.values import Reading

_SPHERICAL = "spherical"

_REFUSED = {
    "planar": "two prismatic joints and a continuous one, with massless links between them",
    "floating": "base='floating' where the root moves freely, or three prismatic and three revolute joints",
    "ball": 'type="spherical", or three revolute joints, with massless links between them',
}

_SWINGS = ("lower", "upper", "twist")
"""Attributes of the ``<limit>`` of a spherical joint that are angles in PyBullet: swings and twist."""


def read_other_type(
    element: Element, kind: str, what: str, reading: Reading, floating_is_base: bool, known: Iterable[str]
) -> JointType:
    """Return the type of a joint whose type `kind` is none of those that are `known`.

    ``spherical``, an extension that PyBullet and MuJoCo read, is a ball joint. With `floating_is_base`, a
    floating joint stands for ``base=`` and is read as fixed. Other types are refused.
    """
    if kind == _SPHERICAL:
        return "ball"
    if kind == "floating" and floating_is_base:
        reading.note(
            element,
            f"{what} is a floating joint below an empty root link: it is read as fixed, "
            "and base='floating' lets the robot move freely",
        )
        return "fixed"
    if kind in _REFUSED:
        raise reading.unsupported(element, f"{what} is {kind}, which is not supported; use {_REFUSED[kind]}")
    raise reading.error(
        element, f"{what} has the unknown type {shown(kind)}{nearest(kind, [*known, _SPHERICAL])}"
    )


def note_swings(limit: Element, what: str, reading: Reading) -> None:
    """Note the angles in the limit of a spherical joint, which a Model does not have."""
    swings = [name for name in _SWINGS if name in limit.attributes]
    if swings:
        reading.note(
            limit,
            f"{what} is spherical; its limits ({', '.join(swings)}) were ignored: PyBullet alone has "
            "them, as angles of swing and twist",
        )
