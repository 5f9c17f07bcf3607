"""A model as the URDF text that peers read, who know less of URDF's defaults than URDF does.

adam has no place for a joint or an inertia without ``<origin>``, and for a joint without ``<axis>``; it also
reports the marks of locked joints and added frames, which other readers skip.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET

from dynx.model import Model
from dynx.model.urdf.reader import FRAME_TAG, LOCKED_TAG


def spelled_out(model: Model) -> str:
    """`model` as URDF in which the defaults of origins and axes are written, and nothing is an extension."""
    robot = ET.fromstring(model.to_urdf())
    for element in [*robot.iter("joint"), *robot.iter("inertial")]:
        for mark in [*element.findall(FRAME_TAG), *element.findall(LOCKED_TAG)]:
            element.remove(mark)
        if element.find("origin") is None:
            element.append(ET.Element("origin", xyz="0 0 0", rpy="0 0 0"))
        if element.tag == "joint" and element.find("axis") is None:
            element.append(ET.Element("axis", xyz="1 0 0"))
    return ET.tostring(robot, encoding="unicode")


def moving_joints(model: Model) -> list[str]:
    """The names of the joints, in the order of the coordinates."""
    return [joint.name for joint in model.joints if joint.moves]
