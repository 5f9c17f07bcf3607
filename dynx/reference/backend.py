"""The backend `reference`: the algorithms of `dynx.rbd` on float64, whole batches at a time.

It is written for clarity and accuracy: a call takes milliseconds, a batch of a thousand about ten times as
long. It has neither an engine nor state, so any number of threads may use it.
"""

from __future__ import annotations

from functools import cached_property
from typing import ClassVar

import numpy as np

from dynx._version import __version__
from dynx.backends.base import Backend
from dynx.rbd import aba, centroidal, crba, kinematics, rnea
from dynx.rbd.elimination import has_physical_inertias
from dynx.spatial.scalar import Floats


class ReferenceBackend(Backend):
    """`dynx.rbd` evaluated on float64; see `Backend` for the interface.

    NumPy evaluates a batch at once. The backend ``compiled`` gives the same numbers to rounding, about 300
    times as fast for the inverse dynamics of UR5 on one thread (``dynx bench ur5 --batch 65536 --threads 1``,
    which measures the other quantities too).
    """

    name: ClassVar[str] = "reference"
    vectorized: ClassVar[bool] = True
    takes_ball_joints: ClassVar[bool] = True

    @property
    def engine_version(self) -> str:
        """``dynx`` and its version."""
        return f"dynx {__version__}"

    @cached_property
    def _eliminates(self) -> bool:
        return self._uncoupled and has_physical_inertias(self._mechanism)

    def _frame_placements(self, q: Floats) -> Floats:
        return kinematics.frame_placements(self._mechanism, q)

    def _frame_placement(self, q: Floats, frame: int) -> Floats:
        T = kinematics.frame_placement(self._mechanism, self._body_poses(q), frame)
        return np.array(np.broadcast_to(T, (*q.shape[:-1], 4, 4)))

    def _body_poses(self, q: Floats) -> kinematics.Poses:
        return kinematics.body_poses(self._mechanism, q)

    def _inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        return rnea.inverse_dynamics(self._mechanism, q, v, a)

    def _forward_dynamics(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        # A singular mass matrix divides by zero; the base checks the result.
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return aba.forward_dynamics(self._mechanism, q, v, tau)

    def _mass_matrix(self, q: Floats) -> Floats:
        return crba.mass_matrix(self._mechanism, q)

    def _kinetic_energy(self, q: Floats, v: Floats) -> Floats:
        return centroidal.kinetic_energy(self._mechanism, self._body_poses(q), v)
