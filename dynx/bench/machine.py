"""What this machine can do, measured: how fast it copies memory, and how fast it multiplies and adds.

Both are the best of some repetitions, since they stand for what the machine can do; the times of
kernels are medians, since they stand for what a user gets. On several threads each works on a part
of its own.
"""

from __future__ import annotations

import os
import platform
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

ROW = 8
"""Doubles in a row of it."""

CHAINS = 12
"""Products with a sum that do not wait for each other: they hide the delay of each and still fit, with
factor and term, into sixteen vector registers."""

LINKS = 64
"""Products with a sum in each chain, one after the other."""

PEAK_SAMPLES = 65536
"""Samples for which each thread runs the chains in one repetition."""

REPETITIONS = 10

Part = Callable[[int, int], object]
"""Does the rows from the first number up to the second."""


def measured_peak(threads: int, repetitions: int = REPETITIONS, size: int = COPIED_BYTES) -> Peak:
    """The machine's peaks on so many threads; `size` [B] is that of the array that is copied."""
    with ThreadPoolExecutor(threads) as pool:
        return Peak(
            threads,
            _copy_bandwidth(pool, threads, repetitions, size),
            _multiply_adds(pool, threads, repetitions),
        )


def described() -> str:
    """The processor, and how wide its vectors are, in one line."""
    target = host()
    return f"{target.cpu} ({platform.machine()}), {target.lanes} doubles in a vector"


def load() -> float | None:
    """How many programs wanted to run at a time during the last minute; None where nobody counts."""
    try:
        return os.getloadavg()[0]
    except (AttributeError, OSError):
        return None


def chains_program(chains: int = CHAINS, links: int = LINKS) -> Program:
    """Chains x -> x a + b in turns, and the sum of their ends; nothing in it can be left out.

    Built node by node, since the order matters: one link of every chain, then the next.
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
    """Bytes read and written in a second, by the faster of a kernel that copies and NumPy."""
    rows = max(size // (8 * ROW), threads * host().lanes)
    source, target = np.ones((rows, ROW)), np.zeros((rows, ROW))
    kernel = Kernel(trace(lambda x: x, {"x": (ROW,)}))

    def by_kernel(first: int, last: int) -> None:
        kernel([source[first:last]], [target[first:last]])

    def by_numpy(first: int, last: int) -> None:
        np.copyto(target[first:last], source[first:last])

    best = min(_best(pool, threads, rows, part, repetitions) for part in (by_kernel, by_numpy))
    return (source.nbytes + target.nbytes) / best


def _multiply_adds(pool: ThreadPoolExecutor, threads: int, repetitions: int) -> float:
    """Products with a sum done in a second."""
    program = chains_program()
    kernel = Kernel(program)
    rows = threads * PEAK_SAMPLES
    # One row stands for all: what is measured is arithmetic, not reading. 0.5 x + 1 stays between 1 and 2.
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
    """Seconds of the fastest repetition; all threads together do all rows once."""
    ends = [rows * k // threads for k in range(threads + 1)]

    def all_parts() -> None:
        if threads == 1:
            part(0, rows)
        else:
            list(pool.map(part, ends[:-1], ends[1:]))

    all_parts()
    return min(once(all_parts) for _ in range(repetitions))
