"""Messages for names of parts that a robot does not have."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from dynx.errors import nearest, shown
from dynx.model.elements import Joint, Link


def unknown_name_message(
    robot: str,
    links: Sequence[Link],
    joints: Sequence[Joint],
    kind: str,
    name: object,
    known: Mapping[str, object],
) -> str:
    """Return a sentence for an unknown name of a joint, link or frame: what it is instead, or a near name."""
    message = f"no {kind} {shown(name)} in {robot}"
    if not isinstance(name, str):
        return f"{message}: a name is a str, not {type(name).__name__}"
    above = {joint.child: joint.name for joint in joints}
    child = next((joint.child for joint in joints if joint.name == name), None)
    if kind != "joint" and child is not None:
        return f"{message}: that is a joint; the {kind} it moves is {shown(child)}"
    if kind == "joint" and any(link.name == name for link in links):
        moved = f"; the joint that moves it is {shown(above[name])}" if name in above else ", the root"
        return f"{message}: that is a link{moved}"
    return message + nearest(name, known)
