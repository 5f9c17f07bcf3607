"""Check of an implementation's results against the backend `reference`, before it is timed.

The tolerance is that of `dynx agree`: errors are relative to the natural magnitude of the quantity.
Accelerations are checked by their backward error: the torque that inverse dynamics computes for them, minus
the given torque.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynx.agreement import tolerances
from dynx.agreement.comparison import judge
from dynx.agreement.magnitudes import Magnitudes
from dynx.agreement.natural_magnitudes import NATURAL_MAGNITUDES
from dynx.agreement.sampling import FrameSamples, Kind, Samples
from dynx.backends.quantities import QUANTITIES, Quantity
from dynx.bench.cases import Batch
from dynx.rbd.jacobians import LOCAL_WORLD_ALIGNED
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats

CHECKED_AT_ENDS, CHECKED_BETWEEN = 16, 224
"""Number of samples checked at each end of a batch, where vectors may be incomplete, and in between."""


@dataclass(frozen=True)
class Check:
    """The largest relative error, and its tolerance."""

    error: float
    tolerance: float

    @property
    def right(self) -> bool:
        """True if the error is within the tolerance."""
        return self.error <= self.tolerance


def checked_rows(count: int, seed: int = 0) -> list[int]:
    """Return the indices of the samples to check, out of `count`."""
    if count <= 2 * CHECKED_AT_ENDS + CHECKED_BETWEEN:
        return list(range(count))
    between = np.random.default_rng(seed).choice(count, CHECKED_BETWEEN, replace=False)
    return sorted({*range(CHECKED_AT_ENDS), *range(count - CHECKED_AT_ENDS, count), *between.tolist()})


class Judge:
    """Checker of results at given samples."""

    def __init__(self, samples: Batch) -> None:
        self._samples = samples
        self._magnitudes = Magnitudes(_as_agreement_samples(samples))
        self._reference = ReferenceBackend(samples.model)

    def check(self, name: str, results: Floats) -> Check:
        """Return the largest error of results (n, ...) of the quantity `name`.

        Raises SingularMassMatrixError where there is no unique acceleration.
        """
        quantity = QUANTITIES[name]
        if quantity.solves:
            return self._check_forward_dynamics(results)
        reference, scale = self._reference_values(quantity)
        verdict = judge(results - reference, scale)
        return Check(verdict.relative, tolerances.rounding(self._magnitudes.depth))

    def _reference_values(self, quantity: Quantity) -> tuple[Floats, Floats]:
        """Return the reference values and natural magnitudes, of one frame for a quantity of frames."""
        frame = [self._samples.frame] if quantity.of_frame else []
        method = getattr(self._reference, quantity.name)
        magnitude = NATURAL_MAGNITUDES[quantity.natural_magnitude]
        scale = magnitude.scale(self._magnitudes)
        if magnitude.layout == "frames":
            scale = scale[:, 0]
        elif magnitude.layout != "samples":
            scale = scale[0]
        return method(*self._samples.arguments(quantity.name), *frame), scale

    def _check_forward_dynamics(self, a: Floats) -> Check:
        state = self._samples
        self._reference.forward_dynamics(state.q, state.v, state.tau)
        if not np.isfinite(a).all():
            return Check(float("inf"), tolerances.solving())
        required = self._reference.inverse_dynamics(state.q, state.v, a)
        verdict = judge(required - state.tau, self._magnitudes.solved_torque(a)[:, None])
        return Check(verdict.relative, tolerances.solving())


def _as_agreement_samples(batch: Batch) -> Samples:
    n = len(batch)
    kind: Kind = "within"
    frame_samples = (FrameSamples(batch.frame, LOCAL_WORLD_ALIGNED, np.arange(n)),)
    return Samples(
        model=batch.model,
        index=np.arange(n),
        kinds=(kind,) * n,
        q=batch.q,
        v=batch.v,
        a=batch.a,
        tau=batch.tau,
        wrench=np.zeros((n, 6)),
        wrench_frame=batch.frame,
        every_frame=frame_samples,
        derivatives=frame_samples,
    )
