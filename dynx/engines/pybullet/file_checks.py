"""Checks for files that crash PyBullet or make its results undefined (measured with pybullet 3.2.5 to 3.2.7).

PyBullet itself checks nothing. It uses names as printf formats, crashes on an element without ``name`` or
``type`` and on a graph that is not a tree, has room for the states of 127 joints, and does not initialise the
axis of a joint whose ``<axis>`` has no ``xyz``.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from dynx.errors import EngineError, ModelError, UnusableEngineError, shown
from dynx.files.reading import read_file
from dynx.loaded.robot import require_file
from dynx.model import Model
from dynx.model.elements import Note
from dynx.model.topology import MAX_LINKS
from dynx.model.xml.reading import Element, read_xml

MAX_JOINTS = 127
"""Largest number of joints, fixed ones included: from the 128th on Bullet returns no joint state."""

MAX_NAME_LENGTH = 1000
"""Largest length of a name [bytes]: 1,264 of a joint overflow Bullet's stack, 2,000 of a link crash it."""

_OPAQUE = frozenset(["visual", "collision", "transmission", "gazebo", "sensor", "ros2_control"])

_WITHOUT_AXIS = frozenset(["fixed", "floating"])
"""Types of joints whose ``<axis>`` PyBullet does not read."""


def require_harmless(path: Path, model: Model) -> None:
    """Raise EngineError, with the reason, for a file on which PyBullet crashes or its results are undefined.

    Its links and joints must be those of `model`, which dynx has checked to be one tree.
    """
    require_file(path)
    try:
        root = read_xml(
            read_file(str(path)),
            str(path),
            list[Note](),
            opaque=_OPAQUE,
            max_counts={"link": MAX_LINKS, "joint": MAX_LINKS},
        )
    except ModelError as error:
        raise EngineError(f"pybullet cannot load {model.name}: {error}") from error
    for reason in _hazards(root, model):
        raise UnusableEngineError(f"pybullet would crash on {model.name}: {reason}")
    for joint in root.all("joint"):
        axis = next(iter(joint.all("axis")), None)
        if (
            axis is not None
            and "xyz" not in axis.attributes
            and joint.attributes["type"] not in _WITHOUT_AXIS
        ):
            raise UnusableEngineError(
                f"pybullet reads the axis of joint {shown(joint.attributes['name'])} from memory that it did "
                f"not initialise (line {axis.line}: <axis> has no xyz), so its results change from run to run"
            )
    joints = len(root.all("joint"))
    if joints > MAX_JOINTS:
        raise UnusableEngineError(
            f"{model.name} has {joints} joints, fixed ones included; pybullet supports at most {MAX_JOINTS}"
        )


def _hazards(root: Element, model: Model) -> Iterator[str]:
    named = {"robot": [root], "link": root.all("link"), "joint": root.all("joint")}
    for kind, elements in named.items():
        for element in elements:
            name = element.attributes.get("name", "")
            if not name and kind != "robot":
                yield f"line {element.line}: a <{kind}> without a name"
            if "%" in name:
                yield f"line {element.line}: the name of a <{kind}>, {shown(name)}, has a %"
            if len(name.encode("utf-8")) > MAX_NAME_LENGTH:
                yield f"line {element.line}: the name of a <{kind}> has {len(name)} characters"
    for joint in named["joint"]:
        if "type" not in joint.attributes:
            yield f"line {joint.line}: joint {shown(joint.attributes['name'])} has no type"
    # Each added frame is a link on a fixed joint in the file, and the joint has a generated name.
    added = {frame.name for frame in model.extra_frames}
    links = [element.attributes["name"] for element in named["link"]]
    if sorted(links) != sorted(added.union(link.name for link in model.links)):
        yield "its <link> elements are not those of the tree that dynx read"
    joints = sorted(map(_ends, named["joint"]))
    wanted = {(joint.name, joint.parent, joint.child) for joint in model.joints}
    if sorted(wanted) != [each for each in joints if each[2] not in added]:
        yield "its <joint> elements are not those of the tree that dynx read"


def _ends(joint: Element) -> tuple[str, str, str]:
    """Name, parent and child of a joint; the first of several ends, as in the reader."""
    ends = [joint.all(role)[:1] for role in ("parent", "child")]
    parent, child = ("".join(element.attributes.get("link", "") for element in end) for end in ends)
    return joint.attributes["name"], parent, child
