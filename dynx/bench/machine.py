"""Measured peaks of this machine: the bandwidth of copying memory, and the rate of multiply-adds.

Both are the best of some repetitions, because they are limits of the machine; the times of kernels are
medians, because those are what users observe. Each thread works on its own part.
"""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from dynx.bench.cost import cost_of
from dynx.bench.roofline import Peak
from dynx.bench.timing import once
from dynx.simd.expr import Node
from dynx.simd.kernel import Kernel
from dynx.simd.program import Port, Program
from dynx.simd.target import host
from dynx.simd.trace import trace
from dynx.spatial.scalar import Floats

COPIED_BYTES = 128 * 2**20
"""Size of the array that is copied: more than the caches hold."""

ROW_SIZE = 8
"""Number of doubles in a row of the copied array."""

CHAINS = 12
"""Number of independent chains of multiply-adds: enough to hide the latency of each, and few enough to fit
into sixteen vector registers together with factor and addend."""

CHAIN_LENGTH = 64
"""Number of successive multiply-adds in each chain."""

PEAK_SAMPLES = 65536
"""Samples for which each thread runs the chains in one repetition."""

REPETITIONS = 10

Part = Callable[[int, int], object]
"""Function that processes the rows from the first number up to the second."""


def measure_peak(threads: int, repetitions: int = REPETITIONS, size: int = COPIED_BYTES) -> Peak:
    """Measure the peaks on a number of threads; `size` [B] is the size of the array that is copied."""
    with ThreadPoolExecutor(threads) as pool:
        return Peak(
            threads,
            _copy_bandwidth(pool, threads, repetitions, size),
            _multiply_adds(pool, threads, repetitions),
        )


def processor_description() -> str:
    """Return the name of the processor and the width of its vectors, in one line."""
    target = host()
    return f"{target.cpu} ({platform.machine()}), {target.lanes} doubles in a vector"


def load() -> float | None:
    """Return the load average of the last minute; None where the system does not report it."""
    if sys.platform == "win32":
        return None
    try:
        return os.getloadavg()[0]
    except OSError:
        return None


def chains_program(chains: int = CHAINS, links: int = CHAIN_LENGTH) -> Program:
    """Return interleaved chains x -> x a + b and the sum of their ends, which no optimiser can shorten.

    It is built node by node, because the order matters: one link of every chain, then the next link.
    """
    inputs = [Node("input", slot=k) for k in range(chains + 2)]
    nodes, ends = list(inputs), list(range(chains))
    factor, term = chains, chains + 1
    for _ in range(links):
        for chain in range(chains):
            nodes.append(Node("mul", (ends[chain], factor)))
            nodes.append(Node("add", (len(nodes) - 1, term)))
            ends[chain] = len(nodes) - 1
    total = ends[0]
    for end in ends[1:]:
        nodes.append(Node("add", (total, end)))
        total = len(nodes) - 1
    ports = (Port("x", (chains,)), Port("a", (1,)), Port("b", (1,)))
    return Program(tuple(nodes), ports, (Port("sum", (1,)),), (total,))


def _copy_bandwidth(pool: ThreadPoolExecutor, threads: int, repetitions: int, size: int) -> float:
    """Return the bytes read and written per second by a copying kernel or by NumPy, the faster of them."""
    rows = max(size // (8 * ROW_SIZE), threads * host().lanes)
    source, target = np.ones((rows, ROW_SIZE)), np.zeros((rows, ROW_SIZE))
    kernel = Kernel(trace(lambda x: x, {"x": (ROW_SIZE,)}))

    def by_kernel(first: int, last: int) -> None:
        kernel([source[first:last]], [target[first:last]])

    def by_numpy(first: int, last: int) -> None:
        np.copyto(target[first:last], source[first:last])

    best = min(_best(pool, threads, rows, part, repetitions) for part in (by_kernel, by_numpy))
    return (source.nbytes + target.nbytes) / best


def _multiply_adds(pool: ThreadPoolExecutor, threads: int, repetitions: int) -> float:
    """Return the number of multiply-adds per second."""
    program = chains_program()
    kernel = Kernel(program)
    rows = threads * PEAK_SAMPLES
    # One row is read repeatedly, because arithmetic is to be measured, not reading. 0.5 x + 1 stays between 1
    # and 2.
    inputs = [
        np.broadcast_to(np.full(port.size, value), (rows, port.size))
        for port, value in zip(program.inputs, (1.5, 0.5, 1.0), strict=True)
    ]
    sums: Floats = np.zeros((rows, 1))

    def part(first: int, last: int) -> None:
        kernel([array[first:last] for array in inputs], [sums[first:last]])

    best = _best(pool, threads, rows, part, repetitions)
    return rows * cost_of(program).multiply_adds / best


def _best(pool: ThreadPoolExecutor, threads: int, rows: int, part: Part, repetitions: int) -> float:
    """Return the time of the fastest repetition [s], in which all threads together process all rows once."""
    ends = [rows * k // threads for k in range(threads + 1)]

    def all_parts() -> None:
        if threads == 1:
            part(0, rows)
        else:
            list(pool.map(part, ends[:-1], ends[1:]))

    all_parts()
    return min(once(all_parts) for _ in range(repetitions))
