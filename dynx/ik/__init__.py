"""Inverse kinematics: targets, a bounded Levenberg-Marquardt solver with restarts, checked results."""

from dynx.ik.result import IKResult
from dynx.ik.search import Kinematics
from dynx.ik.solver import inverse_kinematics
from dynx.ik.targets import Targets, checked_targets

__all__ = ["IKResult", "Kinematics", "Targets", "checked_targets", "inverse_kinematics"]
