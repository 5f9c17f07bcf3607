"""Robots that every installed engine loads alike, made from real files, into which defects are planted.

Elements of a file that are no defects but make engines differ are removed (damping, friction, mimic joints,
limits without range, primitive collision shapes), and the rest is mended by the remedies of the catalogue.
Formatting and comments stay as they are.
"""

from __future__ import annotations

from functools import cache

from dynx.doctor.mending import mend
from dynx.model.library import find
from dynx.model.loading import read_model
from dynx.model.tree import Base
from dynx.model.xml.source import Edit, SourceElement, XmlSource
from dynx.rules import Case
from tests.doctor.planting.skeleton import Skeleton

BASES: tuple[Base, ...] = ("fixed", "floating")

REAL = (
    "a1",
    "anymal",
    "asr_twodof",
    "bolt",
    "double_pendulum",
    "go2",
    "hextilt",
    "kinova",
    "panda",
    "so100",
    "solo12",
    "talos_arm",
    "ur5",
    "z1",
)
"""Robots of example-robot-data: arms, quadrupeds, a biped, a flying arm."""

OWN = (
    "cart_pole",
    "dynx_double_pendulum",
    "pendulum",
    "planar_2r",
    "planar_3r",
    "scara",
    "seven_axis_arm",
    "six_axis_arm",
)
"""Models shipped with dynx that have a joint."""

ROBOTS = (*REAL, *OWN)

QUICK = (*OWN, "asr_twodof", "double_pendulum", "hextilt", "kinova", "so100", "ur5")
"""Robots that are diagnosed fastest."""


def bases(name: str) -> tuple[Base, ...]:
    """Return the bases for which the mass matrix is regular: not floating if the root group has no mass."""
    return BASES if _has_free_body(name) else ("fixed",)


_STRIPPED = ("dynamics", "mimic", "safety_controller")


@cache
def clean_text(name: str, base: Base) -> str:
    """The URDF of a robot on a base, without anything on which engines differ."""
    return mend(Case(_strip(name), base)).case.source.text


@cache
def clean_skeleton(name: str, base: Base) -> Skeleton:
    """Read the robot without defects, and its skeleton."""
    return Skeleton.of(read_model(clean_text(name, base), name, base=base))


@cache
def _has_free_body(name: str) -> bool:
    skeleton = Skeleton.of(read_model(_strip(name).text, name, base="floating"))
    return any(skeleton.mass(each) > 0.0 for each in skeleton.rigid_group(skeleton.model.root))


def _strip(name: str) -> XmlSource:
    path = find(name)
    source = XmlSource(path.read_bytes(), path.name)
    return source.apply(*(edit for part in source.root.children for edit in _strip_edits(source, part)))


def _strip_edits(source: XmlSource, part: SourceElement) -> list[Edit]:
    if part.tag == "link":
        return [source.removal(each) for each in part.all("collision") if not _is_mesh(each)]
    if part.tag != "joint":
        return []
    edits = [source.removal(each) for each in part.children if each.tag in _STRIPPED]
    limit = part.first("limit")
    if limit is not None and part.attributes.get("type") == "revolute" and _without_room(limit):
        edits.append(source.attribute_edit(part, "type", "continuous"))
    return edits


def _is_mesh(collision: SourceElement) -> bool:
    return any(element.tag == "mesh" for element in collision.walk())


def _without_room(limit: SourceElement) -> bool:
    return float(limit.attributes.get("lower", "0")) == float(limit.attributes.get("upper", "0"))
