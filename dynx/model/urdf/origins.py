"""Reader of URDF's ``<origin>``: a translation and an orientation, as angles or as a quaternion.

``quat_xyzw`` is part of URDF from version 1.1 on, and of no file that states an older version or none. As in
urdfdom, it excludes ``rpy`` and is scaled to length 1.
"""

from __future__ import annotations

import math

import numpy as np

from dynx.errors import shown
from dynx.model.elements import ZERO, Pose, Vector
from dynx.model.urdf.values import Reading, urdf_version
from dynx.model.xml.reading import Element
from dynx.spatial.so3 import rotation_from_quat, rpy_from_rotation

QUATERNION = "quat_xyzw"
"""Attribute of ``<origin>`` that holds a quaternion (x, y, z, w)."""

FULL_TURN = 6.29
"""Largest angle of an orientation that is written in radians: 2 pi, rounded up."""

_FIRST_VERSION = (1, 1)


def reads_quaternions(version: str | None) -> bool:
    """Check whether `quat_xyzw` has a meaning in a robot whose attribute ``version`` is this one."""
    return urdf_version(version) >= _FIRST_VERSION


def rpy_of_quaternion(quat_xyzw: tuple[float, ...]) -> Vector:
    """Return roll, pitch and yaw [rad] of a quaternion of any length.

    Raises ValueError if its length is 0 or overflows.
    """
    norm = _length(quat_xyzw)
    if norm == 0.0 or not math.isfinite(norm):
        raise ValueError(f"the length of a quaternion is {norm}")
    R = rotation_from_quat(np.array(quat_xyzw) / norm)
    roll, pitch, yaw = (rpy_from_rotation(R) + 0.0).tolist()
    return (roll, pitch, yaw)


def read_origin(parent: Element, what: str, reading: Reading) -> Pose:
    """Return the pose in the ``<origin>`` of `parent`; missing or empty vectors are zero."""
    element = reading.only(parent, "origin")
    if element is None:
        return Pose()
    parts = {}
    for attribute in ("xyz", "rpy"):
        text = element.attributes.get(attribute)
        if text is not None and not text.strip():
            reading.note(element, f"{attribute} in <origin> of {what} is empty; it is read as zero")
        parts[attribute] = ZERO if not (text and text.strip()) else reading.vector(element, attribute, what)
    largest = max(parts["rpy"], key=abs)
    if abs(largest) > FULL_TURN:
        reading.note(
            element,
            f"rpy in <origin> of {what} holds {largest:g}, more than a full turn; URDF reads radians, in "
            f"degrees it would be {math.radians(largest):.6g}",
        )
    if QUATERNION in element.attributes:
        if reading.quaternions:
            parts["rpy"] = _read_quaternion(element, what, reading)
        else:
            reading.note(
                element,
                f"{QUATERNION} in <origin> of {what} is ignored: it is part of URDF 1.1, and <robot> "
                "states no such version",
            )
    return Pose(parts["xyz"], parts["rpy"])


def _read_quaternion(element: Element, what: str, reading: Reading) -> Vector:
    if "rpy" in element.attributes:
        raise reading.error(element, f"<origin> of {what} has both rpy and {QUATERNION}; wanted one of them")
    quaternion = reading.numbers(element, QUATERNION, what, 4)
    try:
        rpy = rpy_of_quaternion(quaternion)
    except ValueError:
        text = shown(element.attributes[QUATERNION])
        raise reading.error(
            element,
            f"{QUATERNION} in <origin> of {what} is {text}, which is no rotation; wanted x y z w of length 1",
        ) from None
    norm = _length(quaternion)
    if abs(norm - 1.0) > 1e-12:
        reading.note(
            element, f"the quaternion in <origin> of {what} has length {norm:.12g}; it was scaled to 1"
        )
    return rpy


def _length(quaternion: tuple[float, ...]) -> float:
    return math.sqrt(sum(part * part for part in quaternion))
