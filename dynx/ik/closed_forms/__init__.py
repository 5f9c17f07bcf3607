"""Closed forms of inverse kinematics: all solutions of six-axis arms, with the names of their branches.

From the robot to its solutions: `chain` (axes of the joints), `recognition` (which family), the families,
from `subproblems` (`spherical_wrist` and `parallel_axes` of six revolute joints; `sliding_arms` with
prismatic ones), `candidates` (one branch, polished by Newton's method on the chain itself, and reviewed),
`branch_kernel` (all branches), `solver`.
"""

from typing import TYPE_CHECKING

from dynx.ik.closed_forms.solutions import IKSolutions
from dynx.ik.closed_forms.solver import ClosedForm, closed_form, redundant_joints
from dynx.registry import moved_names

__all__ = ["ClosedForm", "IKSolutions", "closed_form", "redundant_joints"]

# Hidden from type checkers, which would take any name for an attribute.
if not TYPE_CHECKING:
    __getattr__ = moved_names(__name__, {})
