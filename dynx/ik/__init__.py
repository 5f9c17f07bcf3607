"""Inverse kinematics: targets, a bounded Levenberg-Marquardt solver with restarts, checked results.

This package lies below `dynx.backends`: the solver depends only on a small protocol of poses and Jacobians,
so that every backend can offer `inverse_kinematics` as one of its quantities.
"""

from dynx.ik.closed_form import ClosedForm, IKSolutions, closed_form
from dynx.ik.frame_target import FrameTarget
from dynx.ik.options import IKOptions, Options, spells_options
from dynx.ik.problem import Problem, Requirement
from dynx.ik.reach import proofs
from dynx.ik.result import IKResult
from dynx.ik.search import SearchLimits
from dynx.ik.solver import inverse_kinematics
from dynx.ik.targets import Targets, checked_targets, is_rigid
from dynx.ik.tasks import Kinematics

__all__ = [
    "ClosedForm",
    "FrameTarget",
    "IKOptions",
    "IKResult",
    "IKSolutions",
    "Kinematics",
    "Options",
    "Problem",
    "Requirement",
    "SearchLimits",
    "Targets",
    "checked_targets",
    "closed_form",
    "inverse_kinematics",
    "is_rigid",
    "proofs",
    "spells_options",
]
