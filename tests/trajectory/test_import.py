"""Trajectories bring in nothing that they do not need."""

from __future__ import annotations

from tests.contract.test_import import ENGINES, modules_after


def test_no_engine_and_no_planner_is_imported_before_it_is_asked_for() -> None:
    program = (
        "import dynx; dynx.trajectory.s_curve([0.0], [1.0], velocity=1.0, acceleration=1.0, jerk=1.0)(0.5)"
    )
    assert modules_after(program).isdisjoint({*ENGINES, "ruckig", "toppra", "matplotlib", "scipy"})
