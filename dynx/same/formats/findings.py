"""Differences of a `SameReport` in one list: elements, joints without counterpart, and other differences,
which do not change the verdict."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, get_args

from dynx.same.attributes import Kind
from dynx.same.report import SameReport

RULES: dict[str, str] = {
    "joint-type": "The type of a joint differs from that of its counterpart.",
    "joint-origin": "The place of a joint differs.",
    "joint-axis": "The axis of a joint differs.",
    "joint-mimic": "What a mimic joint follows differs.",
    "link-inertial": "Mass, centre of mass or inertia of a body differ in a way that some state shows.",
    "joint-missing": "A joint of the first description has no counterpart in the second.",
    "joint-extra": "A joint of the second description has no counterpart in the first.",
    "joint-moved": "The joint of that name has another type or parent, so that it is no counterpart.",
    "base": "One base is fixed, the other floating.",
} | {
    kind.replace(" ", "-"): f"The {kind} of a joint or link differs, which does not change the verdict."
    for kind in get_args(Kind)
}
"""Meaning of each rule of `dynx same`, by the identifier of the rule."""


@dataclass(frozen=True)
class SameFinding:
    """A difference of two descriptions at an element of each; `level` is ``note`` if the verdict does not
    depend on it.

    `size` is relative to the scale of what differs; infinite where nothing is compared by size: for a joint
    without counterpart, a base, and a note.
    """

    rule: str
    level: Literal["error", "note"]
    tag: str
    ours: str | None
    theirs: str | None
    message: str
    first_line: int | None
    second_line: int | None
    size: float = math.inf

    @property
    def link(self) -> str | None:
        """Name of the link that differs, as the second description has it, if it has one."""
        return (self.theirs or self.ours) if self.tag == "link" else None

    @property
    def joint(self) -> str | None:
        """Name of the joint that differs, likewise."""
        return (self.theirs or self.ours) if self.tag == "joint" else None


def findings(report: SameReport) -> Iterator[SameFinding]:
    """Yield the differences of the verdict, then those apart from it."""
    for each in report.differences:
        yield SameFinding(
            f"{each.tag}-{each.part}",
            "error",
            each.tag,
            each.ours,
            each.theirs,
            f"{each.tag} {each.theirs}, {each.part}: {each.message}; {each.first} in {report.first}, "
            f"{each.second} in {report.second}; wanted {each.wanted}",
            each.first_line,
            each.second_line,
            each.size,
        )
    for one in report.unmatched:
        yield SameFinding(
            "base" if one.kind == "base" else f"joint-{one.kind}",
            "error",
            "robot" if one.kind == "base" else "joint",
            one.ours,
            one.theirs,
            one.message,
            one.first_line,
            one.second_line,
        )
    for apart in report.attributes:
        yield SameFinding(
            apart.kind.replace(" ", "-"),
            "note",
            apart.tag,
            apart.ours,
            apart.theirs,
            f"{apart.kind} of {apart.tag} {apart.theirs or apart.ours}: {apart.first} in {report.first}, "
            f"{apart.second} in {report.second}",
            apart.first_line,
            apart.second_line,
        )


def base_of(report: SameReport) -> str:
    """Return the base of the first description; the second has the other one if there is a finding `base`."""
    return "fixed" if report.T_first_second is None else "floating"


def bases_text(report: SameReport) -> str:
    """Write the base of both descriptions: ``fixed base``, or ``fixed base against a floating one``."""
    base = base_of(report)
    other = "floating" if base == "fixed" else "fixed"
    differs = any(each.kind == "base" for each in report.unmatched)
    return f"{base} base against a {other} one" if differs else f"{base} base"
