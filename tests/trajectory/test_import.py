"""Importing trajectories loads no engine and no planner."""

from __future__ import annotations

from tests.contract.test_import import ENGINES, modules_after


def test_engines_and_planners_are_imported_on_first_use() -> None:
    program = (
        "import dynx; dynx.trajectory.s_curve([0.0], [1.0], velocity=1.0, acceleration=1.0, jerk=1.0)(0.5)"
    )
    assert modules_after(program).isdisjoint({*ENGINES, "ruckig", "toppra", "matplotlib", "scipy"})


def test_modules_of_a_package_are_its_attributes() -> None:
    """Although the package imports none of them by itself."""
    program = (
        "import dynx; dynx.world.scene.read_scene, dynx.world.camera, dynx.control.bullet, "
        "dynx.trajectory.waypoints, dynx.distance; assert not hasattr(dynx.world, 'scenery')"
    )
    assert modules_after(program).isdisjoint(ENGINES)
