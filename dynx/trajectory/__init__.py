"""Trajectories: desired position, velocity and acceleration of a robot as functions of time.

    from dynx import trajectory

    motion = trajectory.cycloidal(q0, q1, duration=2.0)
    q, v, a = motion(0.7)                          # one time: (nq,), (nv,), (nv,)
    q, v, a = motion(np.arange(0.0, 2.0, 0.001))   # many: (n, nq), (n, nv), (n, nv)
    trajectory.check(model, motion)                # LimitError before anything moves

Each function returns a `Trajectory`; docs/trajectories.md compares them.
"""

from dynx.trajectory.base import Setpoint, Trajectory
from dynx.trajectory.concatenation import concatenate
from dynx.trajectory.excitation import Identifiability, excitation
from dynx.trajectory.limit_check import check, violations
from dynx.trajectory.line import LineTrajectory, line
from dynx.trajectory.rest_to_rest import cubic, cycloidal, quintic, s_curve, trapezoidal
from dynx.trajectory.time_optimal import time_optimal
from dynx.trajectory.time_optimal_path import time_optimal_path
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
    "line",
    "quintic",
    "s_curve",
    "spline",
    "time_optimal",
    "time_optimal_path",
    "trapezoidal",
    "violations",
]
