"""Diagnosis of all planted defects.

``python -m tests.doctor.planting [--robots 10] [--pairs 10] [--rules DX101 ...]``

Prints a table by rule, every miss, and the share of defects that were found correctly.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections import Counter
from collections.abc import Sequence

from dynx.model.tree import Base
from dynx.workers import Workers
from tests.doctor.planting.catalogue import EXEMPT, PLANTERS
from tests.doctor.planting.judging import Verdict, run_task
from tests.doctor.planting.plan import Trial, pair_trials, single_trials
from tests.doctor.planting.robots import ROBOTS, bases

MIN_SHARE = 0.99
"""Share of defects that must be found correctly, alone and in pairs."""

TIMEOUT = 120.0
"""Time limit of one trial [s]."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run all trials; return 0 if the share is reached and no clean robot has a finding."""
    options = _options(arguments)
    started = time.perf_counter()
    rules = options.rules or list(PLANTERS)
    trials = list(single_trials(rules, options.robots, options.seed))
    if len(rules) > 1:
        trials += pair_trials(rules, options.pairs, options.seed)
    clean = [(robot, base) for robot in ROBOTS for base in bases(robot)]
    tasks: list[Trial | tuple[str, Base]] = [*clean, *trials]
    print(f"{len(clean)} clean robots, {len(trials)} planted ones", flush=True)
    verdicts: list[Verdict] = []
    unclean = 0
    with Workers(run_task, options.jobs, TIMEOUT) as workers:
        for outcome in workers.run(tasks):
            task = tasks[outcome.index]
            if isinstance(task, Trial):
                failed = outcome.failure
                verdict = outcome.value if failed is None else Verdict(task, (), (failed.message,), TIMEOUT)
                verdicts.append(verdict)
                if verdict.complaints:
                    print(f"MISS {task}: {'; '.join(verdict.complaints)}", flush=True)
            elif outcome.value is not None or outcome.failure is not None:
                unclean += 1
                print(f"NOT CLEAN {outcome.value or outcome.failure}", flush=True)
    share = _table(verdicts)
    print(f"clean robots with a finding: {unclean}; {time.perf_counter() - started:.0f} s")
    return 0 if not unclean and share >= MIN_SHARE else 1


def _table(verdicts: Sequence[Verdict]) -> float:
    """Print the table; return the smaller of the two shares."""
    shares = []
    columns: list[dict[str, tuple[int, int]]] = []
    for count in (1, 2):
        right: Counter[str] = Counter()
        all_of: Counter[str] = Counter()
        for verdict in verdicts:
            if len(verdict.trial.rules) == count:
                all_of.update(verdict.trial.rules)
                right.update(verdict.right)
        columns.append({rule: (right[rule], all_of[rule]) for rule in all_of})
        if all_of:
            shares.append(sum(right.values()) / sum(all_of.values()))
    print(f"{'rule':8}{'alone':>10}{'in pairs':>12}")
    for rule in sorted({*columns[0], *columns[1]}):
        cells = ["{}/{}".format(*column[rule]) if rule in column else "-" for column in columns]
        print(f"{rule:8}{cells[0]:>10}{cells[1]:>12}")
    for rule, reason in EXEMPT.items():
        print(f"{rule:8} exempt: {reason}")
    print("found correctly: " + ", ".join(f"{share:.2%}" for share in shares) + " (alone, in pairs)")
    return min(shares, default=0.0)


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.doctor.planting", description=__doc__)
    parser.add_argument("--robots", type=int, default=10, help="robots for each rule alone")
    parser.add_argument("--pairs", type=int, default=10, help="pairs for each rule")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--rules", nargs="*", choices=sorted(PLANTERS), metavar="DX101")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
