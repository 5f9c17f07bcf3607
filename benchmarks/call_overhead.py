"""Overhead of one call through dynx over the same call of an engine's own binding, on UR5.

``python -m benchmarks.call_overhead`` evaluates every quantity that an engine computes by the binding alone
(`benchmarks.bindings`), through dynx, and through dynx with ``validate=False``, checks that the results are
equal, and times the three in turn: the least processor time of all repetitions, in nanoseconds. A method that
adds more than `MAX_OVERHEAD` ends the command with 1.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module

import numpy as np

from benchmarks.bindings.sample import Call, Sample, through_dynx
from benchmarks.progress import tell
from dynx.backends import backend, installed_backends
from dynx.bench.timing import interleaved
from dynx.model.loading import load

ENGINES = ("pinocchio", "pybullet", "mujoco", "drake")

MAX_OVERHEAD = 2e-6
"""Largest time that a checked call may add to that of the binding [s]."""

TOLERANCES = {"pybullet": 1e-6}
"""Largest difference of two results, relative to the largest entry, where it is not `TOLERANCE`."""

TOLERANCE = 1e-10


@dataclass(frozen=True)
class Row:
    """Seconds that one quantity takes by the binding, through dynx, and through dynx without checks."""

    engine: str
    quantity: str
    binding: float
    checked: float
    unchecked: float

    @property
    def overhead(self) -> float:
        """Seconds that a checked call adds."""
        return self.checked - self.binding

    def __str__(self) -> str:
        times = self.binding, self.checked, self.overhead, self.unchecked
        columns = "".join(f"{1e9 * seconds:10,.0f}" for seconds in times)
        verdict = "  OVER" if self.overhead > MAX_OVERHEAD else ""
        return f"{self.engine:10}{self.quantity:26}{columns}{verdict}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; return 1 if a method adds too much."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.call_overhead", description=__doc__)
    parser.add_argument("--engine", action="append", choices=ENGINES, help="default: all installed")
    parser.add_argument("--quantity", action="append", help="default: all that the engine computes")
    parser.add_argument("--repetitions", type=int, default=40)
    chosen = parser.parse_args(arguments)
    print(f"{'engine':10}{'quantity':26}{'binding':>10}{'dynx':>10}{'more':>10}{'unchecked':>10}")
    over = False
    for engine in chosen.engine or [name for name in ENGINES if name in installed_backends()]:
        for row in measure(engine, chosen.quantity, chosen.repetitions):
            print(row, flush=True)
            over |= row.overhead > MAX_OVERHEAD
    return 1 if over else 0


def measure(engine: str, quantities: Sequence[str] | None, repetitions: int) -> Iterator[Row]:
    """Yield the times of each quantity of an engine."""
    model = load("ur5")
    sample = Sample(model)
    binding: dict[str, Call] = import_module(f"benchmarks.bindings.{engine}").binding_calls(model, sample)
    with backend(engine, model) as careful, backend(engine, model, validate=False) as trusting:
        checked, unchecked = through_dynx(careful, sample), through_dynx(trusting, sample)
        for quantity in quantities or binding:
            tell(f"{engine}, {quantity}")
            calls = binding[quantity], checked[quantity], unchecked[quantity]
            expected = calls[0]()
            bound = TOLERANCES.get(engine, TOLERANCE) * float(np.max(np.abs(expected)))
            # The second call is on the path that a loop takes.
            for call in 2 * calls:
                np.testing.assert_allclose(call(), expected, rtol=0.0, atol=bound)
            times = interleaved(calls, repetitions, time.process_time)
            tell("")
            yield Row(engine, quantity, *(min(each.seconds) for each in times))


if __name__ == "__main__":
    sys.exit(main())
