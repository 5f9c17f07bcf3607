"""Implementations with known results, right or wrong, and a session of them."""

from __future__ import annotations

from dynx.backends.quantities import QUANTITIES
from dynx.bench.cases import Batch, BenchmarkCase
from dynx.bench.implementations import Implementation, PreparedCall, Role
from dynx.bench.machine import Peak
from dynx.bench.session import Plan, Session
from dynx.errors import EngineError
from dynx.model import Model
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats

PEAK = Peak(threads=1, copy_bandwidth=10e9, multiply_adds=20e9)


class Scaled(Implementation):
    """The right results times a factor, and plus 1e-6 for the sample `spoilt`."""

    version = "reference"
    threads = 1
    whole = True

    def __init__(
        self, name: str, factor: float = 1.0, *, role: Role = "backend", spoilt: int | None = None
    ) -> None:
        self.name, self.role = name, role
        self.closed = False
        self.calls = 0
        self._factor, self._spoilt = factor, spoilt

    def prepare(self, case: BenchmarkCase, batch: Batch, out: Floats) -> PreparedCall:
        arguments = list(batch.arguments(case.quantity))
        frame = [batch.frame] if QUANTITIES[case.quantity].of_frame else []
        right = getattr(ReferenceBackend(batch.model), case.quantity)(*arguments, *frame)

        def call() -> Floats:
            self.calls += 1
            out[...] = self._factor * right
            if self._spoilt is not None:
                out[self._spoilt] += 1e-6
            return out

        return PreparedCall(call)

    def close(self) -> None:
        self.closed = True


class Silent(Scaled):
    """An implementation that returns the array without writing to it."""

    def prepare(self, case: BenchmarkCase, batch: Batch, out: Floats) -> PreparedCall:
        return PreparedCall(lambda: out)


class Failing(Scaled):
    """An implementation that raises while it is prepared."""

    def prepare(self, case: BenchmarkCase, batch: Batch, out: Floats) -> PreparedCall:
        raise EngineError("no such luck")


def session_of(
    implementations: list[Implementation],
    model: Model,
    cases: tuple[BenchmarkCase, ...],
    repetitions: int = 2,
) -> Session:
    """Return a session of these implementations on a machine whose peaks are known."""
    plan = Plan(model, model.frame_names[-1], cases, repetitions=repetitions)
    return Session(plan, peak=lambda threads: PEAK, implementations=lambda plan, threads: implementations)
