"""Results of inverse kinematics, with errors measured by forward kinematics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dynx.files.notebook import html_table
from dynx.spatial.scalar import Floats


@dataclass(frozen=True, eq=False)
class IKResult:
    """Configurations with their errors by forward kinematics; leading axes are batch.

    `success` is decided by forward kinematics at the returned `q` and nothing else. Where it is False, `q` is
    the best configuration found; it always lies within the limits.
    """

    q: Floats
    """Configurations (..., nq), within the position limits."""
    success: NDArray[np.bool_]
    """True where both errors are within the tolerances (...,)."""
    position_error: Floats
    """Distance from the target (...,) [m]; 0 if the position is free."""
    rotation_error: Floats
    """Angle to the target (...,) [rad], between 0 and pi; 0 if the rotation is free."""
    iterations: NDArray[np.int64]
    """Number of solver steps, summed over all starts (...,)."""
    restarts: NDArray[np.int64]
    """Number of starts after the first (...,)."""

    @property
    def message(self) -> str:
        """One sentence that summarises the result, for a log or a terminal."""
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

    def __repr__(self) -> str:
        shape = "" if self.success.ndim else f": q [{', '.join(f'{x:.6g}' for x in self.q)}]"
        return f"<IKResult {self.message}{shape}>"

    def _repr_html_(self) -> str:
        if self.success.ndim:
            return html_table("inverse kinematics", {"result": self.message, "q": self.q.shape})
        values = {f"q[{k}]": f"{x:.6g}" for k, x in enumerate(self.q)}
        return html_table("inverse kinematics", {"result": self.message, **values})

    def __bool__(self) -> bool:
        """Return whether every target was reached."""
        return bool(self.success.all())
