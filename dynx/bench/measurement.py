"""Measurement of one case: every implementation is checked, those within tolerance timed alternately."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import prod
from typing import NamedTuple

import numpy as np

from dynx.agreement import tolerances
from dynx.agreement.comparison import judge
from dynx.agreement.magnitudes import NATURAL_MAGNITUDES, Magnitudes
from dynx.agreement.sampling import FrameSamples, Kind, Samples
from dynx.backends.quantities import QUANTITIES, Quantity
from dynx.bench.cases import Batch, BenchmarkCase
from dynx.bench.implementations import Implementation, PreparedCall
from dynx.bench.timing import Times, interleaved, once
from dynx.errors import DynxError
from dynx.model import Model
from dynx.rbd.jacobians import LOCAL_WORLD_ALIGNED
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats

# Check of an implementation's results against the backend `reference`, before it is timed.
#
# The tolerance is that of `dynx agree`: errors are relative to the natural magnitude of the quantity.
# Accelerations are checked by their backward error: the torque that inverse dynamics computes for them,
# minus the given torque.


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


TRIAL_SAMPLES = 64
"""Number of samples from which the speed of an implementation that is not `whole` is estimated."""

TRIAL_COUNT = 3
"""Number of estimates of that speed, the fastest of which is used."""

MAX_REPETITION_TIME = 0.02
"""Longest time [s] of one repetition of such an implementation; a slower one is timed at fewer samples."""


LOST_IN_NOISE = "not measurable: in a quarter of the repetitions a call took no longer than its overhead"
"""Problem of a measurement whose time is not above that of its baseline."""


@dataclass(frozen=True)
class BenchmarkMeasurement:
    """Result of one implementation of a case.

    `times` are the times of one sample, or None if the implementation was not timed; `problem` is then the
    reason. `samples` is the number of samples in a call, `error` the largest error found before the timing,
    relative to the natural magnitude of the quantity.
    """

    case: BenchmarkCase
    implementation: str
    role: str
    version: str
    threads: int
    samples: int
    error: float | None = None
    tolerance: float | None = None
    times: Times | None = None
    problem: str | None = None


def measure(
    case: BenchmarkCase, implementations: Sequence[Implementation], batch: Batch, repetitions: int
) -> list[BenchmarkMeasurement]:
    """Measure all `implementations` that support this case; results have their order.

    `batch` holds at least ``case.batch`` samples, the first of which are used.
    """
    preparation = Preparation(case)
    candidates = [preparation.prepare(each, batch) for each in implementations if each.supports(case)]
    calls = [call for each in candidates if each.ready is not None for call in each.ready.calls]
    times = iter(interleaved(calls, repetitions))
    return [_timed(each, times) for each in candidates]


class CheckedImplementation(NamedTuple):
    """A checked implementation; `ready` is its prepared call, or None if it will not be timed."""

    found: BenchmarkMeasurement
    ready: PreparedCall | None


def _timed(candidate: CheckedImplementation, times: Iterator[Times]) -> BenchmarkMeasurement:
    found, ready = candidate
    if ready is None:
        return found
    of_call = next(times)
    if ready.baseline is not None:
        of_call = of_call.minus(next(times))
        if of_call.quartiles[0] <= 0.0:
            return replace(found, problem=LOST_IN_NOISE)
    return replace(found, times=of_call.per(found.samples))


class Preparation:
    """Preparation and check of the implementations of one case."""

    def __init__(self, case: BenchmarkCase) -> None:
        self._case = case
        self._judges: dict[tuple[Model, int], tuple[Judge, list[int]]] = {}
        self._memory = np.empty(0)

    def prepare(self, implementation: Implementation, batch: Batch) -> CheckedImplementation:
        """Prepare an implementation for the samples of `batch`, and check its results."""
        case, each = self._case, implementation
        own = each.samples(batch.first(case.batch))
        found = BenchmarkMeasurement(case, each.name, each.role, each.version, each.threads, len(own))
        try:
            if not implementation.whole:
                own = own.first(self._timed_samples(implementation, own))
                found = replace(found, samples=len(own))
            out = self._result_array(own)
            ready = implementation.prepare(case, own, out)
            # Filled with NaN, so that results which an implementation does not write are not those of another
            # one.
            out.fill(np.nan)
            results = np.reshape(np.asarray(ready.call()), out.shape)
            judge, rows = self._judge(own)
            check = judge.check(case.quantity, results[rows])
        except DynxError as error:
            return CheckedImplementation(replace(found, problem=str(error)), None)
        found = replace(found, error=check.error, tolerance=check.tolerance)
        if check.right:
            return CheckedImplementation(found, ready)
        problem = f"wrong result, not timed: error {check.error:.1e}, tolerance {check.tolerance:.1e}"
        return CheckedImplementation(replace(found, problem=problem), None)

    def _timed_samples(self, implementation: Implementation, batch: Batch) -> int:
        """Return the number of samples that fit into a repetition: all of them, or a power of two."""
        if len(batch) <= TRIAL_SAMPLES:
            return len(batch)
        few = batch.first(TRIAL_SAMPLES)
        trial = implementation.prepare(self._case, few, self._result_array(few)).call
        trial()
        fastest = min(once(trial) for _ in range(TRIAL_COUNT))
        count = int(MAX_REPETITION_TIME / max(fastest, 1e-9) * TRIAL_SAMPLES)
        return len(batch) if count >= len(batch) else max(TRIAL_SAMPLES, 2 ** (count.bit_length() - 1))

    def _result_array(self, batch: Batch) -> Floats:
        """Return an array for the results; all implementations use the same memory."""
        shape = (len(batch), *QUANTITIES[self._case.quantity].shape_of(batch.model))
        if self._memory.size < prod(shape):
            self._memory = np.empty(prod(shape))
        return self._memory[: prod(shape)].reshape(shape)

    def _judge(self, batch: Batch) -> tuple[Judge, list[int]]:
        """Return the judge of a batch, and the numbers of the samples it checks."""
        key = (batch.model, len(batch))
        if key not in self._judges:
            rows = checked_rows(len(batch))
            self._judges[key] = Judge(batch.take(rows)), rows
        return self._judges[key]
