"""Inverse kinematics on any backend: targets, a bounded search with restarts, checked results.

This package lies above `dynx.backends`, whose methods `inverse_kinematics`, `track` and `velocity_ik` are
doors to it (`dynx.registry.door`). What it keeps with a backend sits in `Backend.kept`. Closed forms are
imported when they are first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dynx.ik.options import FrameTarget, IKOptions, Options
from dynx.ik.result import IKResult
from dynx.ik.solver import inverse_kinematics
from dynx.registry import moved_names

if TYPE_CHECKING:
    from dynx.ik.closed_forms.solutions import IKSolutions
    from dynx.ik.closed_forms.solver import ClosedForm, closed_form

__all__ = [
    "ClosedForm",
    "FrameTarget",
    "IKOptions",
    "IKResult",
    "IKSolutions",
    "Options",
    "closed_form",
    "inverse_kinematics",
]

_HOME = {
    "ClosedForm": "dynx.ik.closed_forms.solver",
    "IKSolutions": "dynx.ik.closed_forms.solutions",
    "closed_form": "dynx.ik.closed_forms.solver",
}
_MOVED = {
    "Kinematics": "dynx.Backend",
    "Problem": "dynx.ik.problem.Problem",
    "Requirement": "dynx.ik.problem.Requirement",
    "SearchLimits": "dynx.ik.options.SearchLimits",
    "Targets": "dynx.model.targets.Targets",
    "checked_targets": "dynx.model.targets.checked_targets",
    "proofs": "dynx.ik.reach: a status UNREACHABLE and a distance, without proofs by intervals",
    "is_rigid": "dynx.model.targets.is_rigid",
    "spells_options": "dynx.ik.options.spells_options",
}

# Hidden from type checkers, which would take any name for an attribute: they know the imports above.
if not TYPE_CHECKING:
    __getattr__ = moved_names(__name__, _MOVED, _HOME)
