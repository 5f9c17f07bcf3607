"""Reader of URDF's ``<link>``: its name and inertial. Shapes and materials do not affect dynamics."""

from __future__ import annotations

import numpy as np

from dynx.errors import shown
from dynx.model.elements import Inertial, Link
from dynx.model.urdf.origins import read_origin
from dynx.model.urdf.values import Reading
from dynx.model.xml.reading import Element

# Elements that some engine reads for contact, display or sensing; they do not affect dynamics.
_WITHOUT_DYNAMICS = frozenset(
    [
        *("visual", "collision", "contact", "material", "surface", "sensor", "gazebo", "gravity"),
        *("kinematic", "self_collide", "self_filter", "collision_checking"),
    ]
)
_KNOWN = _WITHOUT_DYNAMICS | {"inertial"}
_IN_INERTIAL = frozenset({"origin", "mass", "inertia"})
_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def read_link(element: Element, reading: Reading) -> Link:
    """Read a link; without ``<inertial>`` it has no mass."""
    name = reading.name(element, "name", "a <link>")
    reading.ignore_unknown(element, _KNOWN)
    inertial = reading.only(element, "inertial")
    return Link(name, None if inertial is None else _read_inertial(inertial, name, reading), element.line)


def _read_inertial(element: Element, link: str, reading: Reading) -> Inertial:
    what = f"link {shown(link)}"
    reading.ignore_unknown(element, _IN_INERTIAL)
    mass_element = reading.required(element, "mass", f"<inertial> of {what}")
    mass = reading.number(mass_element, "value", what)
    if mass < 0.0:
        raise reading.error(mass_element, f"the mass of {what} is {mass}; wanted at least 0")
    tensor = reading.required(element, "inertia", f"<inertial> of {what}")
    moments = {name: reading.number(tensor, name, what) for name in _MOMENTS}
    inertial = Inertial(mass, read_origin(element, what, reading), **moments, line=element.line)
    fault = inertia_fault(inertial)
    if fault is not None:
        reading.note(tensor, f"the inertia of {what} {fault}; it is used as stated")
    return inertial


def inertia_fault(inertial: Inertial) -> str | None:
    """Return why no rigid body has this inertia, or None if it is physically consistent.

    The principal moments are sums of two of three non-negative second moments of mass, so none is negative
    and none exceeds the sum of the other two (Wensing, Kim and Slotine 2018, section II).
    """
    tensor = inertial.tensor
    scale = float(np.max(np.abs(tensor)))
    if scale == 0.0:
        return None
    if inertial.mass == 0.0:
        return "is not zero although its mass is"
    small, middle, large = np.linalg.eigvalsh(tensor / scale)
    rounding = 16.0 * np.finfo(float).eps * max(abs(small), abs(large))
    if small < -rounding:
        return f"is not physical: the principal moment {small * scale:.6g} is negative"
    if small + middle < large - rounding:
        return (
            f"is not physical: the principal moment {large * scale:.6g} exceeds "
            f"the sum of the others, {small * scale:.6g} and {middle * scale:.6g}"
        )
    return None
