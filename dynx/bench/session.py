"""Measurement of all cases of one robot, one after the other."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property, partial

from dynx.argument_types import checks_types, is_listed
from dynx.backends.registry import installed_backends
from dynx.bench.cases import BENCHMARK_QUANTITIES, Batch, BenchmarkCase, draw_batch, require_memory
from dynx.bench.implementations import Implementation, PreparedCall, Role, backend_implementation
from dynx.bench.machine import Cost, Peak, cost_of, load, measure_peak, program_of
from dynx.bench.measurement import BenchmarkMeasurement, measure
from dynx.errors import ArgumentError, DynxError, NotInstalledError, shown
from dynx.model import Model
from dynx.model.numbers import whole_number
from dynx.spatial.scalar import Floats

BATCHES = (1, 8, 65536)
"""Default batch sizes: one sample as in a control loop, a few, and very many."""

REPETITIONS, QUICK_REPETITIONS = 20, 5

MIN_BATCH_FOR_THREADS = 1024
"""Smallest batch that is timed on several threads by default."""

COMPILED = "compiled"
"""Name of the backend whose operations `dynx.bench.machine` counts."""


@checks_types
@dataclass(frozen=True)
class Plan:
    """Cases to time on one robot. Quantities of frames are timed at `frame`; `backends` None means all."""

    model: Model
    frame: str
    cases: tuple[BenchmarkCase, ...]
    backends: tuple[str, ...] | None = None
    repetitions: int = REPETITIONS
    seed: int = 0

    def __post_init__(self) -> None:
        if not self.cases:
            raise ArgumentError("the plan has no cases, so there is nothing to time")
        if not self.model.nv:
            raise ArgumentError(f"{self.model.name} has no coordinates, so there is nothing to time")
        self.model.frame_index(self.frame)
        for case in self.cases:
            require_memory(self.model, case)

    @property
    def threads(self) -> tuple[int, ...]:
        """The numbers of threads of the cases, in order."""
        return tuple(sorted({case.threads for case in self.cases}))


@checks_types
def benchmark_cases(
    quantities: Iterable[str] = tuple(BENCHMARK_QUANTITIES),
    batches: Iterable[int] = BATCHES,
    threads: Iterable[int] = (1,),
    least: int = MIN_BATCH_FOR_THREADS,
) -> tuple[BenchmarkCase, ...]:
    """Combine every quantity, batch and number of threads, large batches first.

    Batches smaller than `least` are not combined with several threads.
    """
    whole_number("least", least, 0)
    if isinstance(quantities, str):
        raise ArgumentError(f"quantities is {shown(quantities)}; wanted a list of names")
    return tuple(
        BenchmarkCase(quantity, batch, count)
        for batch in sorted(_counts("batches", batches), reverse=True)
        for quantity in dict.fromkeys(quantities)
        for count in sorted(_counts("threads", threads))
        if count == 1 or batch >= least
    )


def _counts(name: str, counts: Iterable[int]) -> set[int]:
    if not is_listed(counts):
        raise ArgumentError(f"{name} is {shown(counts)}; wanted whole numbers")
    return {whole_number(name, count, 1) for count in counts}


class Session:
    """Measurement of a plan, one case at a time. The end of a ``with`` block closes the backends.

    `load` is the load average before the measurement (`dynx.bench.machine.load`).
    """

    def __init__(
        self,
        plan: Plan,
        *,
        peak: Callable[[int], Peak] = measure_peak,
        implementations: Callable[[Plan, int], list[Implementation]] | None = None,
    ) -> None:
        self.plan = plan
        self.load = load()
        self.peaks: dict[int, Peak] = {}
        self._measure_peak = peak
        self._make_implementations = all_implementations if implementations is None else implementations
        self._implementations: dict[int, list[Implementation]] = {}
        self._costs: dict[str, Cost | None] = {}

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_: object) -> None:
        for implementations in self._implementations.values():
            for implementation in implementations:
                implementation.close()

    def measure_machine(self, threads: int) -> None:
        """Measure the peak rates of the machine on a number of threads, and store them in `peaks`."""
        self.peaks[threads] = self._measure_peak(threads)

    @checks_types
    def measure(self, case: BenchmarkCase) -> list[BenchmarkMeasurement]:
        """Measure one case.

        With several threads, backends that use one thread are left out if the plan also times them on one.
        """
        plan = self.plan
        if case.threads not in self._implementations:
            self._implementations[case.threads] = self._make_implementations(plan, case.threads)
        fewest = min(plan.threads)
        implementations = [
            implementation
            for implementation in self._implementations[case.threads]
            if implementation.role == "peer"
            or implementation.threads == case.threads
            or case.threads == fewest
        ]
        return measure(case, implementations, self._batch, plan.repetitions)

    @checks_types
    def cost(self, measurement: BenchmarkMeasurement) -> Cost | None:
        """Return the least cost of one sample; None if the operations of the implementation are not known."""
        if measurement.implementation != COMPILED:
            return None
        quantity = measurement.case.quantity
        if quantity not in self._costs:
            program = program_of(self.plan.model, quantity, self.plan.frame)
            self._costs[quantity] = None if program is None else cost_of(program)
        return self._costs[quantity]

    @cached_property
    def _batch(self) -> Batch:
        count = max(case.batch for case in self.plan.cases)
        return draw_batch(self.plan.model, self.plan.frame, count, self.plan.seed)


def all_implementations(plan: Plan, threads: int) -> list[Implementation]:
    """Return the implementations by the chosen or installed backends, then those by Pinocchio itself."""
    names = installed_backends() if plan.backends is None else plan.backends
    found: list[Implementation] = []
    for name in names:
        found += _or_unavailable(partial(_backend, plan.model, name, threads), name, "backend")
    return found + _or_unavailable(partial(_peers, plan.model, threads), "pinocchio itself", "peer")


def _backend(model: Model, name: str, threads: int) -> list[Implementation]:
    return [backend_implementation(model, name, threads)]


def _peers(model: Model, threads: int) -> list[Implementation]:
    # The module imports the engine.
    from dynx.bench.pinocchio_implementations import pinocchio_implementations

    return list(pinocchio_implementations(model, threads))


def _or_unavailable(make: Callable[[], list[Implementation]], name: str, role: Role) -> list[Implementation]:
    """Return the implementations; an empty list if their engine is missing, and a placeholder with the
    reason if they cannot be made."""
    try:
        return make()
    except NotInstalledError:
        return []
    except DynxError as error:
        return [_Unavailable(name, role, error)]


class _Unavailable(Implementation):
    """Placeholder for implementations that do not support this robot."""

    version = ""
    threads = 1
    whole = True

    def __init__(self, name: str, role: Role, error: DynxError) -> None:
        self.name = name
        self.role = role
        self._error = error

    def prepare(self, case: BenchmarkCase, batch: Batch, out: Floats) -> PreparedCall:
        """Raise the error."""
        raise self._error
