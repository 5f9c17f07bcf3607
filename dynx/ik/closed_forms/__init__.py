"""Closed forms of inverse kinematics: all solutions of six-axis arms, with the names of their branches.

From the robot to its solutions: `chain` (axes of the joints), `lines`, `recognition` and
`sliding_recognition` (which family), the families, from `subproblems` and `quartic` (`spherical_wrist`,
`parallel_axes` and `outer_parallel_axes` of six revolute joints; `three_slides`, `sliding_arm` and
`parallel_arm` with prismatic ones), `polish` (Newton's method on the chain itself), `candidates` (one
branch), `review` and `branch_kernel` (all, by NumPy or a kernel), `solver`.
"""

from dynx.ik.closed_forms.solutions import IKSolutions
from dynx.ik.closed_forms.solver import ClosedForm, closed_form, redundant_joints

__all__ = ["ClosedForm", "IKSolutions", "closed_form", "redundant_joints"]
