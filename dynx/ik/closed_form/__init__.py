"""Closed forms of inverse kinematics: all solutions of six-axis arms, with the names of their branches.

From the robot to its solutions: `chain` (axes of the joints), `lines` and `recognition` (which family),
`spherical_wrist` and `parallel_axes` (the families, from `subproblems` and `quartic`), `polish` (Newton's
method on the chain itself), `candidates` (one branch), `evaluation` (all, by NumPy or a kernel), `solver`.
"""

from dynx.ik.closed_form.solutions import IKSolutions
from dynx.ik.closed_form.solver import ClosedForm, closed_form, redundant_joints

__all__ = ["ClosedForm", "IKSolutions", "closed_form", "redundant_joints"]
