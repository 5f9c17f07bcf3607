"""Attributes of MJCF's elements: numbers, poses, joints and simple shapes, alike in every writer of dynx.

The writer of a robot (`dynx.model.mjcf.writer`) and that of a world in MuJoCo (`dynx.engines.mujoco.mjcf`)
use them. The one keeps the links of the description, the other merges those that fixed joints connect.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from dynx.errors import UnsupportedFeatureError
from dynx.model.elements import Joint, JointDynamics
from dynx.model.geometry import Box, Capsule, Cylinder, Ellipsoid, Plane, Sphere
from dynx.model.geometry.solids import Shape
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.so3 import quat_from_rotation

MAX_DEPTH = 490
"""Largest number of links in a row; MuJoCo's reader refuses elements that are nested 500 deep."""

UNLIMITED = 1e10
"""Joint limit [rad or m] that stands for an absent one beside one that is stated, and bound of MuJoCo's
numbers (mjMAXVAL)."""

RANGE_GAP = 1e-12
"""Range given to a joint whose limits are equal, which MuJoCo refuses, relative to the limit and at least in
rad or m."""


def quat_wxyz(R: Array) -> Floats:
    """Return the quaternion (w, x, y, z) of a rotation matrix (3, 3)."""
    x, y, z, w = quat_from_rotation(np.asarray(R, dtype=np.float64))
    return np.array([w, x, y, z])


def text(value: Any) -> str:
    """Return an attribute as text: a word, or numbers, each the shortest that reads back exactly."""
    if isinstance(value, str):
        return value
    if isinstance(value, int | np.integer):
        return str(value)
    if isinstance(value, Iterable):
        return " ".join(repr(float(each)) for each in value)
    return repr(float(value))


def attributes(values: Mapping[str, Any], defaults: Mapping[str, Any] | None = None) -> dict[str, str]:
    """Return attributes as text, without those that are equal to the defaults."""
    written = {name: text(value) for name, value in values.items()}
    absent = {} if defaults is None else attributes(defaults)
    return {name: value for name, value in written.items() if absent.get(name) != value}


def placement(R: Array, p: Array) -> dict[str, str]:
    """Return the attributes of a pose, with the rotation R (3, 3) and the position p (3,)."""
    return attributes({"pos": np.asarray(p, dtype=np.float64), "quat": quat_wxyz(R)})


def joint_attributes(joint: Joint, limits: tuple[float, float], dynamics: JointDynamics) -> dict[str, str]:
    """Return type, axis, range and coefficients of a joint at the origin of its body, without its name.

    `limits` are its lower and upper one [rad or m], which may be infinite.
    """
    values: dict[str, Any] = {"type": {"prismatic": "slide", "ball": "ball"}.get(joint.type, "hinge")}
    if joint.type != "ball":
        values["axis"] = joint.axis
    lower, upper = limits
    if np.isfinite(lower) or np.isfinite(upper):
        lower, upper = max(lower, -UNLIMITED), min(upper, UNLIMITED)
        values["range"] = lower, max(upper, lower + RANGE_GAP * max(1.0, abs(lower)))
    coefficients = {
        "damping": dynamics.damping,
        "frictionloss": dynamics.friction,
        "armature": dynamics.armature,
        "stiffness": dynamics.stiffness,
        "springref": dynamics.spring_reference,
    }
    return attributes(values | {name: value for name, value in coefficients.items() if value})


def primitive_attributes(shape: Shape) -> dict[str, str]:
    """Return type and size of a geom that is a box, ball, cylinder, capsule, ellipsoid or plane.

    Raises UnsupportedFeatureError for another shape.
    """
    if isinstance(shape, Box):
        return {"type": "box", "size": text(0.5 * np.array(shape.size))}
    if isinstance(shape, Sphere):
        return {"type": "sphere", "size": text(shape.radius)}
    if isinstance(shape, Cylinder | Capsule):
        kind = "cylinder" if isinstance(shape, Cylinder) else "capsule"
        return {"type": kind, "size": text([shape.radius, 0.5 * shape.length])}
    if isinstance(shape, Ellipsoid):
        return {"type": "ellipsoid", "size": text(shape.radii)}
    if isinstance(shape, Plane):
        return {"type": "plane", "size": "0 0 1"}
    raise UnsupportedFeatureError(f"a {type(shape).__name__} is no simple shape of MJCF")


def new_document(name: str) -> Element:
    """Return an empty document of this name, in radians, whose inertias are those that it states."""
    root = Element("mujoco", model=name)
    flags = {"angle": "radian", "autolimits": "true", "inertiafromgeom": "false", "fusestatic": "false"}
    SubElement(root, "compiler", flags)
    return root


def document_text(root: Element, remarks: Iterable[str] = ()) -> str:
    """Return a document as text, one element a line, with remarks as comments at its beginning."""
    # Drake and Pinocchio refuse bodies without an inertia in a document that says that shapes have none.
    if all(body.find("inertial") is not None or body.find("geom") is None for body in root.iter("body")):
        for compiler in root.findall("compiler"):
            compiler.attrib.pop("inertiafromgeom", None)
    indent(root)
    # A comment cannot have two hyphens in a row.
    lines = [f"<!-- {re.sub('-(?=-)', '- ', remark)} -->\n" for remark in remarks]
    return "".join(lines) + tostring(root, encoding="unicode") + "\n"
