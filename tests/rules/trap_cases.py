"""Traps of rules as cases, and checks of mended traps."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np

from dynx.model import Model
from dynx.model.xml.source import XmlSource
from dynx.reference.backend import ReferenceBackend
from dynx.rules import Case, Detection, Remedy, find_rule

TRAPS = Path(__file__).parents[2] / "models" / "traps"


def trap(rule_id: str, **choices: str) -> Case:
    """Return the trap of a rule, with the user's choices by rule id."""
    rule = find_rule(rule_id)
    path = TRAPS / rule.trap()
    return Case(XmlSource(path.read_bytes(), str(path)), rule.trap_base, choices=choices)


def mended(rule_id: str, case: Case) -> tuple[list[Detection], Remedy]:
    """Return the detections of the rule and its remedy, after which it must detect nothing."""
    rule = find_rule(rule_id)
    found = list(rule.detect(case))
    remedy = rule.remedy(case, found)
    assert remedy is not None
    assert list(rule.detect(remedy.case)) == []
    return found, remedy


def only(found: list[Detection]) -> Detection:
    """Return the only detection."""
    assert len(found) == 1, found
    return found[0]


def assert_same_robot(one: Model, other: Model) -> None:
    """Check that poses, mass matrix and inverse dynamics are equal up to four roundings."""
    assert one.joint_names == other.joint_names
    q = one.random(0)
    v, a = np.linspace(-1.0, 1.0, one.nv), np.linspace(0.5, -0.7, one.nv)
    with ReferenceBackend(one) as first, ReferenceBackend(other) as second:
        for right, got in (
            (first.mass_matrix(q), second.mass_matrix(q)),
            (first.inverse_dynamics(q, v, a), second.inverse_dynamics(q, v, a)),
            *((first.forward_kinematics(q, f), second.forward_kinematics(q, f)) for f in other.frame_names),
        ):
            # Four roundings: a scaled axis and a moved origin are each rounded once when they are written.
            assert np.max(np.abs(right - got)) <= 4 * np.finfo(float).eps * np.max(np.abs(right))


def changed_lines(before: Case, after: Case) -> list[str]:
    """List the lines of the old text that are not in the new one."""
    gone = Counter(before.source.text.splitlines()) - Counter(after.source.text.splitlines())
    return [line.strip() for line in gone.elements()]
