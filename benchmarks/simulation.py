"""Comparison of simulation with other libraries: ``python -m benchmarks.simulation``.

One closed loop in six implementations, and batches of rollouts on one thread and on two. Every one is checked
first; then each repetition runs all of them in turn, single loops three times. It prints two tables of
medians, and exits with 1 where a result was wrong. docs/bench.md describes what is compared.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from functools import partial

from benchmarks.closed_loops import LOOPS, closed_loop
from benchmarks.progress import tell
from benchmarks.rollout_batches import BATCHES, FULL, QUICK, Size, rollout_batch
from benchmarks.simulation_report import Found, bars, document, tables
from benchmarks.simulator import Simulator
from dynx.bench.machine import load, processor_description
from dynx.bench.timing import Times, once
from dynx.errors import NotInstalledError

REPETITIONS = 5
LOOPS_IN_A_TURN = 3
"""Number of runs of a single loop in a repetition: it takes hundredths of a second, a batch seconds."""
THREADS = (1, 2)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables and the promised bounds, or one JSON document."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.simulation", description=__doc__)
    parser.add_argument("--repetitions", type=int, default=REPETITIONS)
    parser.add_argument("--quick", action="store_true", help="few rollouts and steps, to see that it runs")
    parser.add_argument("--json", action="store_true", help="a document instead of tables")
    options = parser.parse_args(arguments)
    simulators, problems = make_simulators(QUICK if options.quick else FULL)
    try:
        right, wrong = check_simulators(simulators)
        found = time_simulators(right, max(1, options.repetitions))
    finally:
        tell("")
        for simulator in simulators:
            simulator.close()
    problems += wrong
    if options.json:
        print(json.dumps(document(found, problems), indent=2))
    else:
        print(f"{processor_description()}; load {load()}; medians of {options.repetitions} repetitions\n")
        reached = [] if options.quick else bars(found)
        print(*tables(found), "", *problems, *reached, sep="\n")
    return 1 if wrong else 0


def make_simulators(size: Size) -> tuple[list[Simulator], list[str]]:
    """Make all simulators whose libraries are installed; the reasons are returned for the others."""
    makers: list[Callable[[], Simulator]] = [partial(closed_loop, name, size.task) for name in LOOPS]
    makers += [partial(rollout_batch, name, size, threads) for name in BATCHES for threads in THREADS]
    attempts = [make_simulator(maker) for maker in makers]
    simulators = [each for each in attempts if isinstance(each, Simulator)]
    return simulators, [each for each in attempts if isinstance(each, str)]


def make_simulator(maker: Callable[[], Simulator]) -> Simulator | str:
    """Make a simulator, or return the reason why it cannot be made."""
    try:
        return maker()
    except NotInstalledError as reason:
        return f"left out: {reason}"


def check_simulators(simulators: Sequence[Simulator]) -> tuple[list[Found], list[str]]:
    """Return the simulators whose results are right, not timed yet, and the errors of the others."""
    right, wrong = [], []
    for simulator in simulators:
        tell(f"checking {simulator}")
        checks = simulator.checks()
        bad = [str(check) for check in checks if not check.right]
        if bad:
            wrong.append(f"{simulator}: wrong, not timed: {'; '.join(bad)}")
        else:
            right.append(Found(simulator, checks))
    return right, wrong


def time_simulators(right: Sequence[Found], repetitions: int) -> list[Found]:
    """Time the simulators: every repetition runs all of them, each time with another one first."""
    calls: list[list[float]] = [[] for _ in right]
    starts: list[list[float]] = [[] for _ in right]
    for repetition in range(repetitions):
        for turn in range(len(right)):
            number = (turn + repetition) % len(right)
            simulator = right[number].simulator
            tell(f"repetition {repetition + 1} of {repetitions}: {simulator}")
            start = simulator.start()
            for _ in range(LOOPS_IN_A_TURN if simulator.rollouts == 1 else 1):
                calls[number].append(once(simulator.call))
                if start is not None:
                    starts[number].append(once(start))
    return [
        Found(each.simulator, each.checks, Times(tuple(call)), Times(tuple(start)) if start else None)
        for each, call, start in zip(right, calls, starts, strict=True)
    ]


if __name__ == "__main__":
    sys.exit(main())
