"""`assert_same_robot`: an assertion for test suites that hold a robot in two formats."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, get_args

from dynx.argument_types import checks_types, is_listed
from dynx.errors import DTypeError, UnknownNameError, nearest, shown
from dynx.same import SameReport, same_robot
from dynx.same.attributes import Kind


@checks_types
def assert_same_robot(a: Any, b: Any, *, attributes: Collection[str] = (), **options: Any) -> SameReport:
    """Assert that two descriptions describe the same robot; return the report.

        def test_the_mjcf_is_the_urdf():
            assert_same_robot("arm.urdf", "arm.xml", attributes=("lower limit", "upper limit"))

    `a`, `b` and the options are those of `dynx.same_robot`. `attributes` names kinds of differences that do
    not change its verdict, but must not occur either: ``"lower limit"``, ``"upper limit"``,
    ``"velocity limit"``, ``"effort limit"``, ``"damping"``, ``"friction"``, ``"armature"``, ``"stiffness"``,
    ``"spring reference"``, ``"collision shapes"``, ``"visual shapes"``, ``"contact filter"``, ``"actuator"``,
    ``"sensor"``, ``"tendon"``, ``"equality"``, ``"gravity compensation"``, ``"configuration"``,
    ``"frame"``, ``"name"``, ``"gravity"`` or ``"base pose"``. Raises AssertionError with a line for each
    element that differs, UnknownNameError for another kind, and the errors of `dynx.same_robot`.
    """
    if not is_listed(attributes):
        raise DTypeError(f"attributes is {shown(attributes)}; wanted kinds in a tuple, such as ('damping',)")
    for kind in attributes:
        if kind not in get_args(Kind):
            raise UnknownNameError(f"attributes has {shown(kind)}{nearest(kind, get_args(Kind))}")
    report = same_robot(a, b, **options)
    lines = [
        f"{each.tag} {each.theirs}, {each.part} (line {each.second_line or '-'}): {each.message}"
        for each in report.differences
    ]
    lines += [each.message for each in report.unmatched]
    lines += [
        f"{each.kind} of {each.theirs or each.ours}: {each.second} instead of {each.first}"
        for each in report.attributes
        if each.kind in attributes
    ]
    if lines:
        raise AssertionError("\n  ".join([f"{report.first} and {report.second} differ:", *lines]))
    return report
