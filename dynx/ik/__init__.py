"""Inverse kinematics: targets, a bounded Levenberg-Marquardt solver with restarts, checked results.

This package lies below `dynx.backends`: the solver depends only on a small protocol of poses and Jacobians,
so that every backend can offer `inverse_kinematics` as one of its quantities.
"""

from dynx.ik.problem import Problem, improved
from dynx.ik.result import IKResult
from dynx.ik.search import Kinematics, SearchLimits
from dynx.ik.solver import inverse_kinematics
from dynx.ik.targets import Targets, checked_targets, is_rigid

__all__ = [
    "IKResult",
    "Kinematics",
    "Problem",
    "SearchLimits",
    "Targets",
    "checked_targets",
    "improved",
    "inverse_kinematics",
    "is_rigid",
]
