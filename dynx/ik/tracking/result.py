"""Results of tracking: configurations along a path, with a status of each sample."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from dynx.files.notebook import html_table
from dynx.spatial.scalar import Floats


class TrackStatus(IntEnum):
    """Status of one sample of a path."""

    OK = 0
    """The target is reached, and q is continuous with the sample before."""
    LIMITED = 1
    """The target is not reached: a position limit, its margin or a velocity limit holds the robot back."""
    HELD = 2
    """The target is not reached, and no limit is the cause: it is out of reach, or singular. q has the least
    error that is continuous with the sample before."""
    JUMPED = 3
    """The target is reached, but only by a configuration that is not continuous with the sample before."""


@dataclass(frozen=True, eq=False)
class TrackResult:
    """Configurations along a path of n targets, with their errors by forward kinematics; leading axes are
    batch, one path each."""

    q: Floats
    """Configurations (..., n, nq), within the position limits."""
    status: NDArray[np.int8]
    """Status (..., n), values of `TrackStatus`."""
    position_error: Floats
    """Distance from the target (..., n) [m]; 0 if the position is free."""
    rotation_error: Floats
    """Angle to the target (..., n) [rad], between 0 and pi; 0 if the rotation is free."""
    jump: Floats
    """Largest change of a joint from the sample before (..., n) [rad or m] where the status is JUMPED,
    otherwise 0."""
    iterations: NDArray[np.int64]
    """Number of solver steps (..., n)."""
    dt: float | None
    """Time between two samples [s], if velocity limits were kept."""
    reason: str = ""
    """Why the first sample that is not OK is so, of one path; empty if all are OK, and for several paths."""
    note: str = ""
    """Sentence on a q0 that was moved into the limits, and on what `avoid` leaves out; empty otherwise."""

    @property
    def ok(self) -> NDArray[np.bool_]:
        """True where the status is OK (..., n)."""
        return np.asarray(self.status == TrackStatus.OK)

    @property
    def fraction(self) -> Floats:
        """Fraction of each path (...,) that is OK from its start without interruption, from 0 to 1."""
        leading = np.logical_and.accumulate(self.ok, axis=-1)
        return np.asarray(leading.mean(axis=-1))

    @property
    def message(self) -> str:
        """One sentence that summarises the result, for a log or a terminal."""
        n = self.status.size
        counts = [(status, int((self.status == status).sum())) for status in TrackStatus]
        found = ", ".join(f"{count} {status.name}" for status, count in counts if count and count < n)
        whole = next((status.name for status, count in counts if count == n), found)
        worst = (
            f"at most {float(np.max(self.position_error, initial=0.0)):.3g} m "
            f"and {float(np.max(self.rotation_error, initial=0.0)):.3g} rad off"
        )
        text = f"{n} samples {whole if whole != found else f'({found})'}, {worst}"
        if self.status.ndim == 1 and not self:
            first = int(np.argmin(self.ok))
            text += f"; the first that is not OK is number {first}, {TrackStatus(self.status[first]).name}"
            text += f": {self.reason}" if self.reason else ""
        return f"{text}; {self.note}" if self.note else text

    def __repr__(self) -> str:
        return f"<TrackResult {self.message}>"

    def _repr_html_(self) -> str:
        return html_table("tracking", {"result": self.message, "q": self.q.shape})

    def __bool__(self) -> bool:
        """Return whether every sample is OK."""
        return bool(self.ok.all())
