"""Inverse kinematics: targets, a bounded Levenberg-Marquardt solver with restarts, checked results.

This package lies below `dynx.backends`: the solver depends only on a small protocol of poses and Jacobians,
so that every backend can offer `inverse_kinematics` as one of its quantities.
"""

from dynx.ik.closed_form import ClosedForm, IKSolutions, closed_form
from dynx.ik.problem import Problem, improved
from dynx.ik.result import IKResult
from dynx.ik.search import Kinematics, SearchLimits
from dynx.ik.solver import inverse_kinematics
from dynx.ik.targets import Targets, checked_targets, is_rigid

__all__ = [
    "ClosedForm",
    "IKResult",
    "IKSolutions",
    "Kinematics",
    "Problem",
    "SearchLimits",
    "Targets",
    "checked_targets",
    "closed_form",
    "improved",
    "inverse_kinematics",
    "is_rigid",
]
