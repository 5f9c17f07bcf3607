"""The compiled backend beside its peers, as a table: ``python -m benchmarks.compare ur5 --threads 1``.

Every implementation is checked first against the backend `reference`; then each repetition calls all of
them in turn. Peers take the batch as a user has it, row-major doubles of NumPy. The time that a peer takes to
compile is a column of its own.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence

from benchmarks.libraries.compiling_peer import CompilingPeer
from benchmarks.libraries.jax_peers import JaxPeer, OnDevice
from benchmarks.peers import COMPILED, FRAMES, SUPPORTED, make_implementation
from dynx.bench.cases import BENCHMARK_QUANTITIES, BenchmarkCase, draw_batch
from dynx.bench.implementations import Implementation
from dynx.bench.measurement import BenchmarkMeasurement, measure
from dynx.errors import DynxError
from dynx.model import Model
from dynx.model.loading import load

LOCKED = {"panda": {"panda_finger_joint1": 0.02, "panda_finger_joint2": 0.02}}
"""Positions [m] at which joints are locked for all implementations, some of which have no mimic joints."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a table for each quantity; 1 where a peer is faster than dynx."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("robot", choices=FRAMES)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--batch", type=int, default=65536)
    parser.add_argument("--repetitions", type=int, default=20)
    parser.add_argument("--quantity", action="append", choices=list(BENCHMARK_QUANTITIES))
    parser.add_argument(
        "--without", action="append", default=[], choices=list(SUPPORTED), help="leave out a peer"
    )
    options = parser.parse_args(arguments)
    model = load(options.robot, lock=LOCKED.get(options.robot))
    batch = draw_batch(model, FRAMES[options.robot], options.batch)
    beaten = []
    implementations, absent = implementations_of(model, options.threads, options.without)
    for reason in absent:
        print(reason)
    for quantity in options.quantity or BENCHMARK_QUANTITIES:
        case = BenchmarkCase(quantity, options.batch, options.threads)
        able = [
            implementation
            for implementation in implementations
            if implementation.supports(case)
            and quantity in SUPPORTED.get(implementation.name, BENCHMARK_QUANTITIES)
        ]
        found = measure(case, able, batch, options.repetitions)
        print(f"\n{quantity}, {options.robot}, threads {options.threads}\n")
        print(*table(found, able), sep="\n", flush=True)
        left_out = [implementation.name for implementation in implementations if implementation not in able]
        print(*(f"- does not do this: {name}" for name in left_out), sep="\n", flush=True)
        beaten += faster_than_dynx(found)
    print(*(f"faster than dynx: {each.implementation}, {each.case.quantity}" for each in beaten), sep="\n")
    return 1 if beaten else 0


def implementations_of(
    model: Model, threads: int, without: Sequence[str] = ()
) -> tuple[list[Implementation], list[str]]:
    """All implementations that can be made, dynx first, and why the others cannot."""
    implementations: list[Implementation] = []
    absent = []
    for name in SUPPORTED:
        if name in without:
            continue
        try:
            implementation = make_implementation(model, name, threads)
        except DynxError as reason:
            absent.append(f"{name}: {reason}")
            continue
        implementations.append(implementation)
        if isinstance(implementation, JaxPeer):
            implementations.append(OnDevice(implementation))
    return implementations, absent


def table(found: Sequence[BenchmarkMeasurement], implementations: Sequence[Implementation]) -> Iterator[str]:
    """Lines of Markdown, the fastest implementation first."""
    compiling = {
        implementation.name: implementation.compile_seconds
        for implementation in implementations
        if isinstance(implementation, CompilingPeer)
    }
    dynx = next(
        (each.times.median for each in found if each.implementation == COMPILED and each.times), float("nan")
    )
    yield "| implementation | threads | samples | ns a sample | times dynx | compiling [s] |"
    yield "|---|---|---|---|---|---|"
    for each in sorted(found, key=lambda one: one.times.median if one.times else float("inf")):
        if each.times is None:
            yield f"| {each.implementation} | {each.threads} | | {each.problem} | | |"
            continue
        ns, ratio = 1e9 * each.times.median, each.times.median / dynx
        seconds = f"{compiling[each.implementation]:.1f}" if each.implementation in compiling else ""
        yield (
            f"| {each.implementation} | {each.threads} | {each.samples} | {ns:.0f} | "
            f"{ratio:.3g} | {seconds} |"
        )


def faster_than_dynx(found: Sequence[BenchmarkMeasurement]) -> list[BenchmarkMeasurement]:
    """The peers that took less time than the compiled backend."""
    times = {each.implementation: each.times.median for each in found if each.times is not None}
    return [
        each
        for each in found
        if times.get(each.implementation, float("inf")) < times.get(COMPILED, float("inf"))
    ]


if __name__ == "__main__":
    sys.exit(main())
