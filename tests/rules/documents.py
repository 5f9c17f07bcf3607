"""Short robots as text, for tests of rules."""

from __future__ import annotations

from pathlib import Path

from dynx.model.tree import Base
from dynx.model.xml.source import XmlSource
from dynx.rules import Case

LIMIT = '<limit lower="-1" upper="1" effort="10" velocity="5"/>'


def case_of(*parts: str, base: Base = "fixed", source: Path | str = "<string>") -> Case:
    """Make the case of a robot with these elements, one per line; meshes are relative to `source`."""
    lines = "\n".join(f"  {part}" for part in parts)
    return Case(XmlSource(f'<robot name="robot">\n{lines}\n</robot>\n', str(source)), base=base)


def link(
    name: str,
    *shapes: str,
    mass: float | str = 1.0,
    moments: tuple[float, float, float] = (0.01, 0.01, 0.01),
    center: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> str:
    """Write a link with principal moments along its axes."""
    x, y, z = (repr(value) for value in center)
    ixx, iyy, izz = (repr(moment) for moment in moments)
    return (
        f'<link name="{name}"><inertial><origin xyz="{x} {y} {z}"/><mass value="{mass}"/>'
        f'<inertia ixx="{ixx}" ixy="0" ixz="0" iyy="{iyy}" iyz="0" izz="{izz}"/></inertial>'
        f"{''.join(shapes)}</link>"
    )


def visual(shape: str, xyz: str = "0 0 0", rpy: str = "0 0 0") -> str:
    """Write a visual with one shape element."""
    return f'<visual><origin xyz="{xyz}" rpy="{rpy}"/><geometry>{shape}</geometry></visual>'


def joint(
    name: str, parent: str, child: str, *inside: str, type: str = "revolute", limit: str = LIMIT
) -> str:
    """Write a joint about z at the parent's origin; `inside` are further elements."""
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    moving = "" if type == "fixed" else f'<axis xyz="0 0 1"/>{limit}'
    return f'<joint name="{name}" type="{type}">{ends}{moving}{"".join(inside)}</joint>'
