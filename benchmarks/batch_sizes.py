"""Batches of several sizes on one thread: ``python -m benchmarks.batch_sizes ur5 talos``.

For inverse and forward dynamics the table gives the nanoseconds per sample of a call of `compiled` with
checked arguments, of the kernel alone on the same arrays, and of Pinocchio's C++ batch, each result checked
first; the microseconds that the call takes beside the kernel; and how many times as long Pinocchio takes.
Times are the least processor time of all repetitions, which other programs on the machine affect least. The
command ends with 1 if a call of at most `SMALL` samples takes more than `MAX_BESIDE_KERNEL`, or if the
largest batch is less than `MIN_RATIO` times as fast as Pinocchio's.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from benchmarks.peers import COMPILED, checked_call, make_implementation
from benchmarks.progress import tell
from dynx.bench.cases import Batch, BenchmarkCase, draw_batch
from dynx.bench.pinocchio_implementations import BATCH
from dynx.bench.timing import Call, interleaved
from dynx.compiled.kernels import quantity_kernel
from dynx.compiled.simplification import simplify_mechanism
from dynx.model import Model
from dynx.model.loading import load
from dynx.simd.call_sequence import CallSequence, StridedRows

SIZES = (8, 64, 256, 1024, 4096)
SMALL = 64
"""Largest number of samples of a call whose time beside the kernel is checked: the arrays of more leave the
first-level cache."""

MAX_BESIDE_KERNEL = 2.5e-6
"""Most time that such a call may take beside the kernel [s]."""

MIN_RATIO = {"inverse_dynamics": 30.0, "forward_dynamics": 25.0}
"""Least speed-up over Pinocchio's C++ batch."""


@dataclass(frozen=True)
class Row:
    """Seconds per sample of a call, of the kernel alone, and of Pinocchio's batch."""

    samples: int
    call: float
    kernel: float
    peer: float

    @property
    def beside_kernel(self) -> float:
        """Seconds that a call takes beside the kernel."""
        return self.samples * (self.call - self.kernel)

    @property
    def ratio(self) -> float:
        """Time of Pinocchio's batch over that of the call."""
        return self.peer / self.call

    def __str__(self) -> str:
        times = f"{1e9 * self.call:10.1f}{1e9 * self.kernel:10.1f}{1e9 * self.peer:12,.0f}"
        return f"{self.samples:8,}{times}{1e6 * self.beside_kernel:10.1f}{self.ratio:9.1f}x"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables; return 1 if a bound is missed."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.batch_sizes", description=__doc__)
    parser.add_argument("robots", nargs="*", default=["ur5", "talos"], help="default: ur5 and talos")
    parser.add_argument("--quantity", action="append", choices=list(MIN_RATIO), help="default: both")
    parser.add_argument("--batch", action="append", type=int, help=f"default: {', '.join(map(str, SIZES))}")
    parser.add_argument("--repetitions", type=int, default=40)
    chosen = parser.parse_args(arguments)
    missed = False
    for robot in chosen.robots:
        model = load(robot)
        for quantity in chosen.quantity or MIN_RATIO:
            print(f"{robot}, {quantity}")
            print(f"{'samples':>8}{'call':>10}{'kernel':>10}{'pinocchio':>12}{'extra us':>10}{'ratio':>10}")
            rows = []
            for row in measure(model, quantity, chosen.batch or SIZES, chosen.repetitions):
                print(row, flush=True)
                rows.append(row)
                missed |= row.samples <= SMALL and row.beside_kernel > MAX_BESIDE_KERNEL
            missed |= max(rows, key=lambda row: row.samples).ratio < MIN_RATIO[quantity]
    return 1 if missed else 0


def measure(model: Model, quantity: str, sizes: Sequence[int], repetitions: int) -> Iterator[Row]:
    """Yield the times of batches of these sizes."""
    samples = draw_batch(model, model.frame_names[-1], max(sizes))
    implementations = [make_implementation(model, name, 1) for name in (COMPILED, BATCH)]
    for size in sizes:
        tell(f"{quantity}, {size} samples")
        batch = samples.take(range(size))
        ready = [checked_call(each, BenchmarkCase(quantity, size), batch)[0] for each in implementations]
        calls = [ready[0].call, kernel_call(batch, quantity), ready[1].call]
        times = interleaved(calls, repetitions, time.process_time)
        tell("")
        yield Row(size, *(min(each.seconds) / size for each in times))


def kernel_call(batch: Batch, quantity: str) -> Call:
    """Return a call of the kernel alone."""
    kernel = quantity_kernel(simplify_mechanism(batch.model.mechanism), quantity, ())
    outputs = [np.empty((len(batch), port.size)) for port in kernel.outputs]
    ports, arrays = (*kernel.inputs, *kernel.outputs), (*batch.arguments(quantity), *outputs)
    first = np.zeros(1, dtype=np.int64)
    rows = {port.name: StridedRows(array[None], first) for port, array in zip(ports, arrays, strict=True)}
    return partial(CallSequence([kernel], first, rows, len(batch)).run, 0, 1)


if __name__ == "__main__":
    sys.exit(main())
