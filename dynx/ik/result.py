"""Results of inverse kinematics, with errors measured by forward kinematics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.spatial.scalar import Floats

Measures = tuple[float, float, float, int]

REACHED, UNREACHABLE, NOT_FOUND = "REACHED", "UNREACHABLE", "NOT_FOUND"
IN_COLLISION, TIMED_OUT = "IN_COLLISION", "TIMED_OUT"
"""Values of `IKResult.status`."""


def largest_error(errors: Floats) -> float:
    """Return the largest error, or 0; NaN of what was not begun does not count."""
    return float(np.fmax.reduce(errors, axis=None, initial=0.0))


@dataclass(frozen=True, eq=False)
class IKResult:
    """Configurations with their errors by forward kinematics; leading axes are batch.

    `success` is decided by forward kinematics at the returned `q`, with `avoid` also by certified distances.
    Where it is False, `q` is the best configuration found; it always lies within the limits.
    """

    q: Floats
    """Configurations (..., nq), within the position limits."""
    success: NDArray[np.bool_]
    """True where both errors are within the tolerances (...,), and with `avoid` all margins are kept."""
    position_error: Floats
    """Distance from the target (...,) [m]; 0 if the position is free."""
    rotation_error: Floats
    """Angle to the target (...,) [rad], between 0 and pi; 0 if the rotation is free."""
    iterations: NDArray[np.int64]
    """Number of solver steps, summed over all starts (...,)."""
    restarts: NDArray[np.int64]
    """Number of starts after the first (...,)."""
    proof: NDArray[np.object_] | None = field(default=None, kw_only=True)
    """Sentence (...,) that proves a target out of reach; empty where there is no proof. None if no target has
    a proof."""
    collision: NDArray[np.object_] | None = field(default=None, kw_only=True)
    """With `avoid` a sentence (...,) that says which bodies are too close in the solutions found; empty where
    that is not the failure."""
    timed_out: NDArray[np.bool_] | None = field(default=None, kw_only=True)
    """True (...,) where `timeout` ended the search before it was complete: q is the best found so far, which
    may reach the target if only the choice among solutions was cut short. None means False everywhere."""
    by_frame: Mapping[str, tuple[Floats, Floats]] = field(default_factory=dict, kw_only=True)
    """Position error (...,) [m] and rotation error (...,) [rad] of each frame, if there are several; those of
    the result are the largest."""

    note: str = field(default="", kw_only=True)
    """Sentence on what of the arguments was changed, such as a q0 outside the limits, and on what `avoid`
    leaves out, such as links without collision shapes; empty if nothing."""

    @property
    def status(self) -> Any:
        """``"REACHED"``, ``"UNREACHABLE"`` (there is a `proof`), ``"IN_COLLISION"`` (bodies are too close in
        every solution found), ``"TIMED_OUT"`` (the time was over before the search was complete) or
        ``"NOT_FOUND"``; an array (...,) of them for a batch."""
        proved = False if self.proof is None else self.proof != ""
        collides = False if self.collision is None else self.collision != ""
        late = False if self.timed_out is None else self.timed_out
        complete = np.where(collides, IN_COLLISION, NOT_FOUND)
        unreached = np.where(proved, UNREACHABLE, np.where(late, TIMED_OUT, complete))
        found = np.where(self.success, REACHED, unreached)
        return found if found.ndim else str(found)

    @property
    def message(self) -> str:
        """One sentence that summarises the result, for a log or a terminal."""
        return f"{self._summary()}; {self.note}" if self.note else self._summary()

    def _summary(self) -> str:
        position, rotation = largest_error(self.position_error), largest_error(self.rotation_error)
        worst = f"at most {position:.3g} m and {rotation:.3g} rad off"
        late = 0 if self.timed_out is None else int(np.sum(self.timed_out))
        if self.success.ndim:
            beyond = 0 if self.proof is None else int((self.proof != "").sum())
            proved = f", {beyond} proved out of reach" if beyond else ""
            close = int((self.status == IN_COLLISION).sum())
            proved += f", {close} only in collision" if close else ""
            proved += f", {late} stopped by timeout" if late else ""
            return f"{int(self.success.sum())} of {self.success.size} reached{proved}, {worst}"
        if self.success:
            restarts = "1 restart" if self.restarts == 1 else f"{int(self.restarts)} restarts"
            steps = "1 step" if self.iterations == 1 else f"{int(self.iterations)} steps"
            cut_short = ", the choice among solutions stopped by timeout" if late else ""
            return f"reached, {worst}, after {steps} and {restarts}{cut_short}"
        if self.collision is not None and self.collision != "":
            return f"{'stopped by timeout, best so far ' if late else ''}in collision: {self.collision}"
        status = str(self.status)
        why = {NOT_FOUND: "not found", TIMED_OUT: "stopped by timeout"}.get(status, "out of reach")
        starts = "the start" if not self.restarts else f"the best of {int(self.restarts) + 1} starts"
        off = f"{starts} is {float(self.position_error):.3g} m and {float(self.rotation_error):.3g} rad off"
        proof = f"; {self.proof}" if self.status == UNREACHABLE else ""
        return f"{why}: {off}{self._worst_frame()}{proof}"

    def _worst_frame(self) -> str:
        """Name the frames that are off the most."""
        if not self.by_frame:
            return ""
        errors = self.by_frame.items()
        names = [max(errors, key=lambda each: float(each[1][part]))[0] for part in (0, 1)]
        return f" ({' and '.join(dict.fromkeys(names))})"

    def __repr__(self) -> str:
        shape = "" if self.success.ndim else f": q [{', '.join(f'{x:.6g}' for x in self.q)}]"
        return f"<IKResult {self.message}{shape}>"

    def _repr_html_(self) -> str:
        from dynx.files.pages import html_table  # most results are shown on no page

        if self.success.ndim:
            return html_table("inverse kinematics", {"result": self.message, "q": self.q.shape})
        values = {f"q[{k}]": f"{x:.6g}" for k, x in enumerate(self.q)}
        return html_table("inverse kinematics", {"result": self.message, **values})

    def __bool__(self) -> bool:
        """Return whether every target was reached."""
        return bool(self.success.all())


class ReachedTarget(IKResult):
    """Result of one target that is reached. What is not asked for is not computed: the arrays of the other
    fields take longer than the kernel's steps."""

    by_frame: Mapping[str, tuple[Floats, Floats]] = MappingProxyType({})
    _measures: Measures

    @classmethod
    def of(cls, q: Floats, measures: Measures) -> ReachedTarget:
        """Make the result of q (nq,), with the position error [m], the rotation error [rad], and the numbers
        of iterations and restarts."""
        found = object.__new__(cls)
        found.__dict__["q"], found.__dict__["_measures"] = q, measures
        return found

    @cached_property
    def success(self) -> NDArray[np.bool_]:
        """True, without axes."""
        return np.array(True)

    @cached_property
    def position_error(self) -> Floats:
        """Distance from the target [m]."""
        return np.array(self._measures[0])

    @cached_property
    def rotation_error(self) -> Floats:
        """Angle to the target [rad]."""
        return np.array(self._measures[1])

    @cached_property
    def iterations(self) -> NDArray[np.int64]:
        """Number of solver steps, summed over all starts."""
        return np.array(self._measures[2], dtype=np.int64)

    @cached_property
    def restarts(self) -> NDArray[np.int64]:
        """Number of starts after the first."""
        return np.array(self._measures[3])
