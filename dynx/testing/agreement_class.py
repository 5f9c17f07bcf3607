"""Tests of a robot as a class of a test file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import pytest

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, nearest, shown
from dynx.model.tree import Base
from dynx.testing.robot_checks import CHECKS, Disagreement, measured_agreement, require_agreement
from dynx.testing.robot_plan import path_or_name

_BASES: dict[str, tuple[Base, ...]] = {
    "fixed": ("fixed",),
    "floating": ("floating",),
    "both": ("fixed", "floating"),
}


@checks_types
def agreement_tests(
    robot: str,
    *,
    base: Literal["fixed", "floating", "both"] = "fixed",
    backends: Sequence[str] | None = None,
) -> type:
    """Make a test class that checks the agreement of engines on a robot in each quantity and identity.

        TestMyRobot = agreement_tests("my.urdf")

    `robot` is a URDF file, its path relative to the test file, or a name of the library. `backends` are the
    engines to compare (default: all that are installed). Name the class so that pytest collects it. Raises
    ArgumentError for an invalid base. Other invalid arguments make the tests fail.
    """
    if base not in _BASES:
        raise ArgumentError(f"base is {shown(base)}{nearest(base, _BASES)}")
    chosen = None if backends is None else tuple(backends)

    class AgreementTests:
        """The engines agree on a robot."""

        @pytest.mark.parametrize("check", CHECKS)
        @pytest.mark.parametrize("robot_base", _BASES[base])
        def test_agreement(self, robot_base: Base, check: str, request: pytest.FixtureRequest) -> None:
            """Check one quantity or identity."""
            found = path_or_name(robot, request.path.parent)
            try:
                require_agreement(measured_agreement(request.config, found, robot_base, chosen), check, robot)
            except Disagreement as difference:
                pytest.fail(str(difference), pytrace=False)

    AgreementTests.__doc__ = f"The engines agree on {robot}."
    return AgreementTests
