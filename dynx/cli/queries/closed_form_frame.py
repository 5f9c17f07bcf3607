"""The frame before a gripper that ``dynx ik --all-solutions`` suggests where the default frame is in one."""

from __future__ import annotations

from collections.abc import Mapping

from dynx.cli.shell.exits import one_line
from dynx.errors import NoClosedFormError
from dynx.ik import closed_form
from dynx.model import Model

MAX_FRAMES = 4
"""Most moving joints that are left out from the tip backwards."""

GRIPPER_WORDS = ("gripper", "finger", "jaw", "hand")
"""Parts of the names of joints that belong to a gripper."""


def frame_advice(model: Model, frame: str, given: Mapping[str, float], error: NoClosedFormError) -> str:
    """Return the clause of an error that says that `frame` is the default, and which frame to choose.

    The frames before the last moving joints are tried. None is suggested where a joint of the arm itself can
    be given, as one of seven.
    """
    default = f"; the frame {one_line(frame)} was chosen by default"
    parents = {joint.child: joint for joint in model.joints}
    link, beyond = frame, set[str]()
    while link in parents and len(beyond) < MAX_FRAMES:
        joint = parents[link]
        link = joint.parent
        if not joint.moves:
            continue
        beyond.update({joint.name} if joint.mimic is None else {joint.name, joint.mimic.joint})
        in_gripper = any(word in joint.name.lower() for word in GRIPPER_WORDS)
        if error.remedies and not in_gripper and not beyond.intersection(error.remedies[0]):
            return default
        other = _tool_of(model, link)
        try:
            closed_form(model, other, {name: q for name, q in given.items() if name not in beyond})
        except NoClosedFormError as failure:
            if not failure.remedies:
                continue
            needed = ",".join(f"{name}=POSITION" for name in failure.remedies[0])
            with_given = f" and --given {needed}{failure.alternatives}"
        else:
            with_given = ""
        return f"{default}; there is a closed form with --frame {one_line(other)}{with_given}"
    return default


def _tool_of(model: Model, link: str) -> str:
    """Return the last link that fixed joints carry on `link`, such as the tool centre point of a hand."""
    fixed = {link}
    last = link
    for joint in model.joints:
        if joint.parent in fixed and not joint.moves:
            fixed.add(joint.child)
            last = joint.child
    return last
