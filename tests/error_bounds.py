"""Bounds of errors, as `dynx.agreement` derives them: relative to the magnitude of the quantity.

Tests have no tolerances of their own; they use those of `dynx.agreement.tolerances` through this module.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dynx.agreement import tolerances
from dynx.agreement.compared_quantities import compared_quantities
from dynx.agreement.comparison import judge
from dynx.agreement.magnitudes import Magnitudes
from dynx.agreement.sampling import Kind, Samples, assign_frames
from dynx.model import Model
from dynx.spatial.scalar import Floats

ANYWHERE: Kind = "anywhere"
BY_NAME = {quantity.name: quantity for quantity in compared_quantities()}


def samples_at(
    model: Model,
    q: ArrayLike,
    v: ArrayLike | None = None,
    a: ArrayLike | None = None,
    tau: ArrayLike | None = None,
    wrench: ArrayLike | None = None,
    frame: str | None = None,
    references: int = 3,
) -> Samples:
    """Return samples at given states: q (n, nq) or (nq,), the others likewise, zero where not given.

    Every frame is compared at every sample, in every reference, or in fewer, which take turns.
    """
    q = np.atleast_2d(np.asarray(q, dtype=float))
    n = len(q)

    def rows(x: ArrayLike | None, width: int) -> Floats:
        return np.array(np.broadcast_to(0.0 if x is None else np.asarray(x, dtype=float), (n, width)))

    frame_samples = assign_frames(model.frame_names, n, each=n, references=references)
    return Samples(
        model=model,
        index=np.arange(n),
        kinds=(ANYWHERE,) * n,
        q=q,
        v=rows(v, model.nv),
        a=rows(a, model.nv),
        tau=rows(tau, model.nv),
        wrench=rows(wrench, 6),
        wrench_frame=frame or model.frame_names[-1],
        every_frame=frame_samples,
        derivatives=frame_samples,
    )


class ErrorBounds:
    """Bounds of the errors of results at the given samples: one sample (nq,) or several (n, nq)."""

    def __init__(self, samples: Samples) -> None:
        self.samples = samples
        self.magnitudes = Magnitudes(samples)

    def check(self, quantity: str, got: ArrayLike, wanted: ArrayLike) -> None:
        """Assert that two results of `quantity` (for frames: of one frame) are equal within its tolerance."""
        got, wanted = np.asarray(got), np.asarray(wanted)
        assert got.shape == wanted.shape, f"{quantity}: shape {got.shape}, wanted {wanted.shape}"
        compared = BY_NAME[quantity]
        tolerance = compared.tolerance(self.magnitudes)
        self._assert_small(quantity, got - wanted, self._scale(quantity), tolerance, got, wanted)

    def check_rate(self, quantity: str, got: ArrayLike, wanted: ArrayLike) -> None:
        """Assert that a rate of `quantity` equals its numerical derivative along the motion."""
        got, wanted = np.asarray(got), np.asarray(wanted)
        scale = self._scale(quantity)
        rate = scale * self.magnitudes.frequency.reshape(-1, *([1] * (scale.ndim - 1)))
        tolerance = tolerances.derivative(self.magnitudes.depth)
        self._assert_small(f"rate of {quantity}", got - wanted, rate, tolerance, got, wanted)

    def check_solves(self, a: ArrayLike, tau_of_a: ArrayLike, tau: ArrayLike) -> None:
        """Assert that the acceleration `a` takes the torque `tau` that caused it (backward error)."""
        a, tau_of_a, tau = np.atleast_2d(a), np.atleast_2d(tau_of_a), np.atleast_2d(tau)
        scale = self.magnitudes.solved_torque(a)[:, None]
        tolerance = tolerances.solving()
        self._assert_small("forward_dynamics", tau_of_a - tau, scale, tolerance, tau_of_a, tau)

    def _scale(self, quantity: str) -> Floats:
        """Return the magnitude of the quantity at each sample, for one frame."""
        compared = BY_NAME[quantity]
        scale = np.asarray(compared.scale(self.magnitudes))
        if compared.layout == "frames":
            return np.asarray(scale[:, 0])
        return scale if compared.layout == "samples" else np.asarray(scale[0])

    def _assert_small(
        self,
        what: str,
        error: Floats,
        scale: Floats,
        tolerance: float,
        got: Floats,
        wanted: Floats,
    ) -> None:
        if len(self.samples) == 1 and error.ndim == scale.ndim - 1:
            error = error[None]
        verdict = judge(error, scale)
        assert verdict.relative <= tolerance, (
            f"{what}: relative error {verdict.relative:.3g} exceeds {tolerance:.3g} at "
            f"{verdict.position}\ngot    {got}\nwanted {wanted}"
        )
