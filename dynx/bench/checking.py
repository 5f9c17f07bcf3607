"""Whether a way answers rightly: only what does is timed.

The judge is the backend `reference`, and the tolerance that of `dynx agree`: an error counts relative to
the natural size of the quantity (`dynx.agreement.magnitudes`). Forward dynamics is judged by the torque
that the acceleration found really takes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynx.agreement import tolerances
from dynx.agreement.comparison import judge
from dynx.agreement.magnitudes import Magnitudes
from dynx.agreement.natural_magnitudes import largest, mass_scale, pose_scale
from dynx.agreement.sampling import Kind, Samples
from dynx.bench.cases import Batch
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats

ENDS, BETWEEN = 16, 224
"""Answers that are checked: so many at each end of a batch, where groups of samples are incomplete, and
so many in between."""


@dataclass(frozen=True)
class Check:
    """The largest error over its natural size, and what it may be."""

    error: float
    tolerance: float

    @property
    def right(self) -> bool:
        """Whether the answers may be timed."""
        return self.error <= self.tolerance


def checked_rows(count: int, seed: int = 0) -> list[int]:
    """The numbers of the samples whose answers are checked, of `count`."""
    if count <= 2 * ENDS + BETWEEN:
        return list(range(count))
    between = np.random.default_rng(seed).choice(count, BETWEEN, replace=False)
    return sorted({*range(ENDS), *range(count - ENDS, count), *between.tolist()})


class Judge:
    """Knows the right answers at some samples, all of which a way has to answer."""

    def __init__(self, samples: Batch) -> None:
        self._samples = samples
        self._sizes = Magnitudes(_as_agreement_samples(samples))
        self._reference = ReferenceBackend(samples.model)

    def check(self, quantity: str, answers: Floats) -> Check:
        """How far the answers (n, ...) are from the right ones.

        Raises SingularMassMatrixError where there is no right acceleration.
        """
        if quantity == "forward_dynamics":
            return self._check_forward_dynamics(answers)
        right, scale = self._expected(quantity)
        verdict = judge(answers - right, scale)
        return Check(verdict.relative, tolerances.rounding(self._sizes.depth))

    def _expected(self, quantity: str) -> tuple[Floats, Floats]:
        """The right answers, and their natural sizes."""
        state, sizes, reference = self._samples, self._sizes, self._reference
        if quantity == "forward_kinematics":
            return reference.forward_kinematics(state.q, state.frame), pose_scale(sizes)[:, 0]
        if quantity == "jacobian":
            rows = [sizes.linear_column] * 3 + [sizes.angular_column] * 3
            return reference.jacobian(state.q, state.frame), np.stack(rows, axis=1)
        if quantity == "mass_matrix":
            return reference.mass_matrix(state.q), mass_scale(sizes)
        return reference.inverse_dynamics(state.q, state.v, state.a), largest(sizes.torque)

    def _check_forward_dynamics(self, a: Floats) -> Check:
        state = self._samples
        self._reference.forward_dynamics(state.q, state.v, state.tau)
        if not np.isfinite(a).all():
            return Check(float("inf"), tolerances.solving())
        taken = self._reference.inverse_dynamics(state.q, state.v, a)
        verdict = judge(taken - state.tau, self._sizes.solved_torque(a)[:, None])
        return Check(verdict.relative, tolerances.solving())


def _as_agreement_samples(batch: Batch) -> Samples:
    n = len(batch)
    kind: Kind = "within"
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
        every_frame=(),
        derivatives=(),
    )
