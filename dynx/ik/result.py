"""What inverse kinematics found, measured by the kinematics that it was asked about."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dynx.spatial.scalar import Floats


@dataclass(frozen=True, eq=False)
class IKResult:
    """Configurations with what forward kinematics says of each; leading axes are batch.

    `success` is decided by forward kinematics at the `q` that is returned and by nothing else. Where
    it is False, `q` is the best that was found, never a configuration outside the limits.
    """

    q: Floats
    """Configurations (..., nq), within the position limits."""
    success: NDArray[np.bool_]
    """Whether both errors are within the tolerances (...,)."""
    position_error: Floats
    """Distance from the target (...,) [m]."""
    rotation_error: Floats
    """Angle to the target (...,) [rad], between 0 and pi; 0 where only a position was asked for."""
    iterations: NDArray[np.int64]
    """Steps taken, over all starts (...,)."""
    restarts: NDArray[np.int64]
    """Starts after the first (...,)."""

    @property
    def message(self) -> str:
        """One sentence for a log or a terminal."""
        worst = (
            f"at most {float(np.max(self.position_error, initial=0.0)):.3g} m "
            f"and {float(np.max(self.rotation_error, initial=0.0)):.3g} rad off"
        )
        if self.success.ndim:
            return f"{int(self.success.sum())} of {self.success.size} reached, {worst}"
        if self.success:
            restarts = "1 restart" if self.restarts == 1 else f"{int(self.restarts)} restarts"
            steps = "1 step" if self.iterations == 1 else f"{int(self.iterations)} steps"
            return f"reached, {worst}, after {steps} and {restarts}"
        return (
            f"not reached: the best of {int(self.restarts) + 1} starts is "
            f"{float(self.position_error):.3g} m and {float(self.rotation_error):.3g} rad off"
        )

    def __bool__(self) -> bool:
        """Whether every target was reached."""
        return bool(self.success.all())
