"""Reports on two descriptions, with everything a format has to show."""

from __future__ import annotations

from functools import cache

from dynx.same import SameReport, same_robot

LINK = """<link name="{name}"><inertial><origin xyz="0.1 0.02 0.03"/><mass value="{mass}"/>
    <inertia ixx="0.1" iyy="0.12" izz="0.13" ixy="0.01" ixz="0" iyz="0"/></inertial></link>"""

HOSTILE = "<b>&amp;\"'::error,%0A"


def arm(
    mass: float = 1.5, x: float = 0.3, damping: float = 0.0, name: str = "tip", more: bool = False
) -> str:
    """Return an arm with two joints, three with `more`."""
    links = "".join(LINK.format(name=link, mass=mass) for link in ("base", "upper", name, "last")[: 3 + more])
    joints = "".join(
        f"""
  <joint name="{joint}" type="revolute"><parent link="{parent}"/><child link="{child}"/>
    <origin xyz="{x} 0 0.1"/><axis xyz="0 1 0"/><dynamics damping="{damping}"/>
    <limit lower="-1" upper="1" effort="2" velocity="3"/></joint>"""
        for joint, parent, child in (
            ("shoulder", "base", "upper"),
            ("elbow", "upper", name),
            ("wrist", name, "last"),
        )[: 2 + more]
    )
    return f'<robot name="arm">\n  {links}{joints}\n</robot>\n'


FIRST = arm()
SECOND = arm(x=0.31, damping=2.0).replace('value="1.5"', 'value="1.7"', 3)


@cache
def alike() -> SameReport:
    """Return a report on one robot."""
    return same_robot(FIRST, FIRST)


@cache
def differing() -> SameReport:
    """Return a report with elements that differ, and damping, which does not change the verdict."""
    return same_robot(FIRST, SECOND)


@cache
def shorter() -> SameReport:
    """Return a report with a joint that has no counterpart in the second robot."""
    return same_robot(arm(more=True), FIRST)


@cache
def hostile() -> SameReport:
    """Return a report with a name of any characters."""
    name = HOSTILE.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
    return same_robot(arm(name=name), arm(1.7, name=name))
