"""All works of one robot by all ways, one after the other."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property, partial

from dynx.backends.registry import installed_backends
from dynx.bench.backend_implementations import backend_way
from dynx.bench.cases import ARGUMENTS, Batch, Work, draw_batch, require_memory
from dynx.bench.cost import Cost, cost_of, program_of
from dynx.bench.implementations import Prepared, Role, Way
from dynx.bench.machine import load, measured_peak
from dynx.bench.measurement import Measurement, measure
from dynx.bench.roofline import Peak
from dynx.errors import ArgumentError, DynxError, NotInstalledError
from dynx.model import Model
from dynx.spatial.scalar import Floats

BATCHES = (1, 8, 65536)
"""What is timed unless other batches are asked for: a control loop, a few candidates, many samples."""

REPETITIONS, QUICK_REPETITIONS = 20, 5

WORTH_THREADS = 1024
"""A batch of fewer samples is not tried on several threads unless that is asked for."""

COMPILED = "compiled"
"""The backend whose programs `dynx.bench.cost` counts."""


@dataclass(frozen=True)
class Plan:
    """What is to be timed on one robot. `frame` is that of kinematics; None for `backends` means all."""

    model: Model
    frame: str
    works: tuple[Work, ...]
    backends: tuple[str, ...] | None = None
    repetitions: int = REPETITIONS
    seed: int = 0

    def __post_init__(self) -> None:
        if not self.works:
            raise ArgumentError("a plan without works: there is nothing to time")
        if not self.model.nv:
            raise ArgumentError(f"{self.model.name} has no coordinates: there is nothing to time")
        self.model.frame_index(self.frame)
        for work in self.works:
            require_memory(self.model, work)

    @property
    def threads(self) -> tuple[int, ...]:
        """The numbers of threads that some work asks for, in order."""
        return tuple(sorted({work.threads for work in self.works}))


def works(
    quantities: Iterable[str] = tuple(ARGUMENTS),
    batches: Iterable[int] = BATCHES,
    threads: Iterable[int] = (1,),
    least: int = WORTH_THREADS,
) -> tuple[Work, ...]:
    """Every quantity at every batch on every number of threads, large batches first.

    Several threads only at batches of at least `least`.
    """
    return tuple(
        Work(quantity, batch, count)
        for batch in sorted(set(batches), reverse=True)
        for quantity in dict.fromkeys(quantities)
        for count in sorted(set(threads))
        if count == 1 or batch >= least
    )


class Session:
    """Measures a plan, one work at a time. Use it as a context: leaving it closes the backends.

    `load` is how busy the machine was before (`dynx.bench.machine.load`).
    """

    def __init__(
        self,
        plan: Plan,
        *,
        peak: Callable[[int], Peak] = measured_peak,
        ways: Callable[[Plan, int], list[Way]] | None = None,
    ) -> None:
        self.plan = plan
        self.load = load()
        self.peaks: dict[int, Peak] = {}
        self._measure_peak = peak
        self._make_ways = all_ways if ways is None else ways
        self._ways: dict[int, list[Way]] = {}
        self._costs: dict[str, Cost | None] = {}

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_: object) -> None:
        for ways in self._ways.values():
            for way in ways:
                way.close()

    def measure_machine(self, threads: int) -> None:
        """Measure the peaks on so many threads; they are then in `peaks`."""
        self.peaks[threads] = self._measure_peak(threads)

    def measure(self, work: Work) -> list[Measurement]:
        """What was found of one work.

        On several threads the backends that have one thread are left out if they are timed on one.
        """
        plan = self.plan
        if work.threads not in self._ways:
            self._ways[work.threads] = self._make_ways(plan, work.threads)
        fewest = min(plan.threads)
        ways = [
            way
            for way in self._ways[work.threads]
            if way.role == "peer" or way.threads == work.threads or work.threads == fewest
        ]
        return measure(work, ways, self._batch, plan.repetitions)

    def cost(self, measurement: Measurement) -> Cost | None:
        """What one sample costs at least, where it is known which operations the way does."""
        if measurement.way != COMPILED:
            return None
        quantity = measurement.work.quantity
        if quantity not in self._costs:
            program = program_of(self.plan.model, quantity, self.plan.frame)
            self._costs[quantity] = None if program is None else cost_of(program)
        return self._costs[quantity]

    @cached_property
    def _batch(self) -> Batch:
        count = max(work.batch for work in self.plan.works)
        return draw_batch(self.plan.model, self.plan.frame, count, self.plan.seed)


def all_ways(plan: Plan, threads: int) -> list[Way]:
    """The backends that are asked for or installed, then Pinocchio's own calls."""
    names = installed_backends() if plan.backends is None else plan.backends
    found: list[Way] = []
    for name in names:
        found += _or_refused(partial(_backend, plan.model, name, threads), name, "backend")
    return found + _or_refused(partial(_peers, plan.model, threads), "pinocchio itself", "peer")


def _backend(model: Model, name: str, threads: int) -> list[Way]:
    return [backend_way(model, name, threads)]


def _peers(model: Model, threads: int) -> list[Way]:
    from dynx.bench.pinocchio_implementations import pinocchio_ways  # imports the engine

    return list(pinocchio_ways(model, threads))


def _or_refused(make: Callable[[], list[Way]], name: str, role: Role) -> list[Way]:
    """The ways, or one that says why there are none; nothing where their engine is missing."""
    try:
        return make()
    except NotInstalledError:
        return []
    except DynxError as error:
        return [_Refused(name, role, error)]


class _Refused(Way):
    """Stands for ways that cannot be had for this robot."""

    version = ""
    threads = 1
    whole = True

    def __init__(self, name: str, role: Role, error: DynxError) -> None:
        self.name = name
        self.role = role
        self._error = error

    def prepare(self, work: Work, batch: Batch, out: Floats) -> Prepared:
        """Raises why."""
        raise self._error
