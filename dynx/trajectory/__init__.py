"""Trajectories: desired position, velocity and acceleration of a robot as functions of time.

    from dynx import trajectory

    motion = trajectory.cycloidal(q0, q1, duration=2.0)
    q, v, a = motion(0.7)                          # one time: (nq,), (nv,), (nv,)
    q, v, a = motion(np.arange(0.0, 2.0, 0.001))   # many: (n, nq), (n, nv), (n, nv)
    trajectory.check(model, motion)                # LimitError before anything moves

Each function returns a `Trajectory`; the page "Trajectories" of the documentation compares them. Each name is
imported when it is first used: what follows one trajectory needs no other.
"""

from typing import TYPE_CHECKING

from dynx.registry import moved_names

if TYPE_CHECKING:
    from dynx.trajectory.base import Setpoint, Trajectory
    from dynx.trajectory.concatenation import concatenate
    from dynx.trajectory.formula import from_function
    from dynx.trajectory.identification import Identifiability, excitation
    from dynx.trajectory.jerk_limited import time_optimal
    from dynx.trajectory.limit_check import check, violations
    from dynx.trajectory.path_timing import time_optimal_path
    from dynx.trajectory.rest_to_rest import cubic, cycloidal, quintic, s_curve, trapezoidal
    from dynx.trajectory.straight_line import LineTrajectory, line
    from dynx.trajectory.waypoints import spline

__all__ = [
    "Identifiability",
    "LineTrajectory",
    "Setpoint",
    "Trajectory",
    "check",
    "concatenate",
    "cubic",
    "cycloidal",
    "excitation",
    "from_function",
    "line",
    "quintic",
    "s_curve",
    "spline",
    "time_optimal",
    "time_optimal_path",
    "trapezoidal",
    "violations",
]

_HOME = {
    "Identifiability": "dynx.trajectory.identification",
    "LineTrajectory": "dynx.trajectory.straight_line",
    "Setpoint": "dynx.trajectory.base",
    "Trajectory": "dynx.trajectory.base",
    "check": "dynx.trajectory.limit_check",
    "concatenate": "dynx.trajectory.concatenation",
    "cubic": "dynx.trajectory.rest_to_rest",
    "cycloidal": "dynx.trajectory.rest_to_rest",
    "excitation": "dynx.trajectory.identification",
    "from_function": "dynx.trajectory.formula",
    "line": "dynx.trajectory.straight_line",
    "quintic": "dynx.trajectory.rest_to_rest",
    "s_curve": "dynx.trajectory.rest_to_rest",
    "spline": "dynx.trajectory.waypoints",
    "time_optimal": "dynx.trajectory.jerk_limited",
    "time_optimal_path": "dynx.trajectory.path_timing",
    "trapezoidal": "dynx.trajectory.rest_to_rest",
    "violations": "dynx.trajectory.limit_check",
}

# Hidden from type checkers, which would take any name for an attribute: they know the imports above.
if not TYPE_CHECKING:
    __getattr__ = moved_names(__name__, {}, _HOME)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
