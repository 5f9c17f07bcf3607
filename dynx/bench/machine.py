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
from dataclasses import dataclass
from typing import Literal

import numpy as np

from dynx.backends.quantities import QUANTITIES
from dynx.bench.timing import once
from dynx.compiled.kernels import compiles, evaluate_quantity
from dynx.compiled.simplification import simplify_mechanism
from dynx.model import Model
from dynx.rbd.jacobians import LOCAL_WORLD_ALIGNED
from dynx.simd.expr import Node
from dynx.simd.kernel import Kernel
from dynx.simd.program import Port, Program
from dynx.simd.target import host
from dynx.simd.trace import trace
from dynx.simd.trigonometry import COS, HALF_PI, SIN
from dynx.spatial.scalar import Floats

# Least cost of one sample of a program: bytes moved and operations.


SINE_COSINE_PAIRS = 1 + len(HALF_PI) + (len(SIN) - 1) + 1 + (len(COS) + 1)
"""Number of multiply-adds in the sine and cosine of one angle: the nearest multiple of pi/2, the
reduction, and the two polynomials (`dynx.simd.trigonometry`)."""

SINE_COSINE_SINGLES = 3
"""Number of sums and products besides those multiply-adds: the multiple of pi/2 as a number, r^2, and r^3."""

_SUMS = frozenset({"add", "sub"})
_NOT_COUNTED = frozenset({"input", "constant", "sin", "cos", "neg", "abs"})


@dataclass(frozen=True)
class Cost:
    """The cost of one sample.

    `bytes` are those of the inputs and outputs, each moved once. `operations` are sums, products, quotients
    and roots. `multiply_adds` counts instructions, where a product that only one sum uses is fused with that
    sum, and any other sum or product counts as one.
    """

    bytes: int
    operations: int
    multiply_adds: int


def cost_of(program: Program) -> Cost:
    """Return the cost of a traced program; the sine and cosine of one angle are computed together."""
    nodes = program.nodes
    uses = [0] * len(nodes)
    for index in (*(arg for node in nodes for arg in node.args), *program.results):
        uses[index] += 1
    single = sum(node.op not in _NOT_COUNTED for node in nodes)
    pairs = sum(
        node.op in _SUMS and any(nodes[arg].op == "mul" and uses[arg] == 1 for arg in node.args)
        for node in nodes
    )
    angles = len({node.args[0] for node in nodes if node.op in ("sin", "cos")})
    doubles = program.n_inputs + len(program.results)
    return Cost(
        bytes=8 * doubles,
        operations=single + angles * (2 * SINE_COSINE_PAIRS + SINE_COSINE_SINGLES),
        multiply_adds=single - pairs + angles * (SINE_COSINE_PAIRS + SINE_COSINE_SINGLES),
    )


def program_of(model: Model, quantity: str, frame: str) -> Program | None:
    """Return the program that the backend `compiled` compiles for a quantity, without checks of arguments.

    Return None if that backend evaluates the quantity with NumPy because its code would be too long.
    """
    mechanism, number = simplify_mechanism(model.mechanism), model.frame_index(frame)
    described = QUANTITIES[quantity]
    name, details = quantity, described.implied_details(model)
    if described.of_frame:
        details = (number, LOCAL_WORLD_ALIGNED)
    if quantity == "forward_kinematics":
        name, details = "frame_placement", (number,)
    if not compiles(mechanism, name):
        return None
    inputs: dict[str, tuple[int, ...]] = {
        argument: (model.nq if argument == "q" else model.nv,) for argument in described.arguments
    }
    return trace(lambda **arguments: evaluate_quantity(mechanism, name, details, *arguments.values()), inputs)


# The roofline model: the shares of memory bandwidth and arithmetic rate that a kernel reaches.
#
# A kernel cannot be faster than its bytes over the memory bandwidth, nor than its operations over the
# peak rate of arithmetic (Williams, Waterman and Patterson, Roofline, CACM 52(4), 2009).


Bound = Literal["memory", "arithmetic"]


@dataclass(frozen=True)
class Peak:
    """Measured peaks of the machine on a number of threads.

    `copy_bandwidth` [B/s] counts bytes read and bytes written; `multiply_adds` [1/s] counts a product
    with a sum as one.
    """

    threads: int
    copy_bandwidth: float
    multiply_adds: float


@dataclass(frozen=True)
class Roofline:
    """The shares of both peaks that a kernel reaches, and the one that limits it.

    The share of memory may exceed 1 where a batch fits into the caches, which are faster.
    """

    memory_share: float
    arithmetic_share: float

    @property
    def binds(self) -> Bound:
        """The bound with the larger share, which limits the kernel."""
        return "memory" if self.memory_share > self.arithmetic_share else "arithmetic"

    @property
    def share(self) -> float:
        """The larger of the two shares."""
        return max(self.memory_share, self.arithmetic_share)


def roofline(cost: Cost, seconds: float, peak: Peak) -> Roofline:
    """Return the roofline of a kernel that takes `seconds` for a sample of this cost."""
    return Roofline(
        memory_share=cost.bytes / peak.copy_bandwidth / seconds,
        arithmetic_share=cost.multiply_adds / peak.multiply_adds / seconds,
    )


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
