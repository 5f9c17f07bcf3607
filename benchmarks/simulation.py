"""Simulation beside its peers, in one run: ``python -m benchmarks.simulation``.

One closed loop in six ways, and batches of rollouts on one thread and on two. Every way is checked first;
then each repetition does all of them in turn, single loops three times. It prints two tables of medians, and
ends with 1 where an answer was wrong. docs/bench.md says what is compared.
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
from dynx.bench.machine import described, load
from dynx.bench.timing import Times, once
from dynx.errors import NotInstalledError

REPETITIONS = 5
LOOPS_IN_A_TURN = 3
"""A single loop takes some hundredths of a second, a batch seconds: a repetition has more of the former."""
THREADS = (1, 2)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables and what the bars come to, or one document of JSON."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.simulation", description=__doc__)
    parser.add_argument("--repetitions", type=int, default=REPETITIONS)
    parser.add_argument("--quick", action="store_true", help="few rollouts and steps, to see that it runs")
    parser.add_argument("--json", action="store_true", help="a document instead of tables")
    asked = parser.parse_args(arguments)
    simulators, problems = made(QUICK if asked.quick else FULL)
    try:
        right, wrong = checked(simulators)
        found = measured(right, max(1, asked.repetitions))
    finally:
        tell("")
        for simulator in simulators:
            simulator.close()
    problems += wrong
    if asked.json:
        print(json.dumps(document(found, problems), indent=2))
    else:
        print(f"{described()}; load {load()}; medians of {asked.repetitions} repetitions\n")
        reached = [] if asked.quick else bars(found)
        print(*tables(found), "", *problems, *reached, sep="\n")
    return 1 if wrong else 0


def made(size: Size) -> tuple[list[Simulator], list[str]]:
    """All that can be simulated here, and why the rest cannot."""
    makers: list[Callable[[], Simulator]] = [partial(closed_loop, name, size.task) for name in LOOPS]
    makers += [partial(rollout_batch, name, size, threads) for name in BATCHES for threads in THREADS]
    attempts = [attempt(maker) for maker in makers]
    simulators = [each for each in attempts if isinstance(each, Simulator)]
    return simulators, [each for each in attempts if isinstance(each, str)]


def attempt(maker: Callable[[], Simulator]) -> Simulator | str:
    """What is made, or why it cannot be."""
    try:
        return maker()
    except NotInstalledError as reason:
        return f"left out: {reason}"


def checked(simulators: Sequence[Simulator]) -> tuple[list[Found], list[str]]:
    """Those that are right, not timed yet, and what is wrong with the others."""
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


def measured(right: Sequence[Found], repetitions: int) -> list[Found]:
    """With their times: every repetition does all, each time another one first."""
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
