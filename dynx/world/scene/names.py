"""Names of the parts of a scene: ``world``, a robot, a body, or a link as ``robot/link``."""

from __future__ import annotations

from dynx.errors import ArgumentError, shown
from dynx.model.urdf.values import name_fault

WORLD = "world"
"""Name of the fixed world in constraints."""


def checked_name(what: str, name: object) -> str:
    """Return the name of a robot, body or group; raise ArgumentError for an invalid one."""
    if not isinstance(name, str):
        raise ArgumentError(f"the name of a {what} is {shown(name)}; wanted a str")
    fault = name_fault(name)
    if fault is not None:
        raise ArgumentError(f"the name of a {what} {fault}")
    if "/" in name or name == WORLD:
        raise ArgumentError(
            f"the name of a {what} is {shown(name)}; wanted one other than {WORLD!r} and without '/', which "
            "joins the names of a robot and its link"
        )
    return name


def split_name(name: str) -> tuple[str, str | None]:
    """Return the robot or body of a name, and the link where it is ``robot/link``."""
    owner, slash, link = name.partition("/")
    return owner, link if slash else None
