"""All solutions of one pose in a few microseconds, by a compiled closed form."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from dynx.ik.closed_forms.branches import N_BRANCHES
from dynx.ik.closed_forms.solutions import IKSolutions
from dynx.ik.closed_forms.solver import ClosedForm, stored_closed_form
from dynx.ik.search import SearchLimits
from dynx.model import Model
from dynx.simd.variants import BoundVariants
from dynx.spatial.scalar import Floats

_FLOAT64 = np.dtype(np.float64)

_ALL = 2**N_BRANCHES - 1

_Workspace = tuple[Callable[[], None], memoryview, Floats, Floats, BoundVariants]
"""Function that evaluates the pose, its masks, the pose (4, 4), and the block (8, n + 2) of results; last
what holds their memory."""

_ROWS = [np.flatnonzero([bits >> k & 1 for k in range(N_BRANCHES)]) for bits in range(2**N_BRANCHES)]
"""Numbers of the branches whose bits are set, for every byte."""


class SinglePose:
    """Function from one pose to its solutions, for an arm whose joints are those of the model.

    Safe to use from several threads.
    """

    def __init__(self, form: ClosedForm) -> None:
        assert form.kernel is not None
        self._kernel, self._names = form.kernel, form.branches
        self._turns, self._count = form.full_turns, len(form.joints)
        # Workspaces that no call uses at the moment.
        self._free: list[_Workspace] = [self._workspace()]

    def __call__(self, target: Any, q0: Any = None) -> IKSolutions | None:
        """Return the solutions for a pose (4, 4) without q0, or None for q0, and if the pose is not valid or
        needs a review."""
        if (
            q0 is not None
            or type(target) is not np.ndarray
            or target.dtype is not _FLOAT64
            or target.shape != (4, 4)
        ):
            return None
        try:
            workspace = self._free.pop()
        except IndexError:
            workspace = self._workspace()
        run, masks, pose, block, _ = workspace
        pose[...] = target
        run()
        bits = masks[0]
        # The bits of solutions are the first byte; others are set where there is something to review.
        rows = None if bits > _ALL else block.copy() if bits == _ALL else block.take(_ROWS[bits], 0)
        self._free.append(workspace)
        if rows is None:
            return None
        count = self._count
        return IKSolutions(rows[:, :count], rows[:, count:], self._names, bits, full_turns=self._turns)

    def _workspace(self) -> _Workspace:
        block = np.empty((N_BRANCHES, self._count + 2))
        bound = self._kernel.bind(block)
        return bound.run, bound.masks, bound.inputs[0].reshape(4, 4), block, bound


def single_pose_call(model: Model, frame: str, limits: SearchLimits) -> SinglePose | None:
    """Return the call for poses of a frame, or None if its solutions are to be checked or completed."""
    form = stored_closed_form(model, frame, (), True)
    tolerance = min(limits.position_tolerance, limits.rotation_tolerance)
    return SinglePose(form) if form.covers_model and tolerance >= form.accuracy else None
