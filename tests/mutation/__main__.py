"""Mutation testing of dynx by the operators of mutmut::

    python -m tests.mutation --record            which tests execute which lines (once)
    python -m tests.mutation --seed 0 --count 300

Makes a random sample of mutants with at least 12 of each room, runs for each the tests that execute the
changed line (fastest first, up to the first failure), and prints the score by room and the survivors. What
is done is kept in the folder of ``--results``: the same command goes on where Ctrl-C ended it, ``--retry``
tries survivors again.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import ExitStack
from dataclasses import asdict
from hashlib import sha256
from pathlib import Path
from queue import SimpleQueue

from tests.mutation.coverage_map import CoverageMap, record
from tests.mutation.population import Mutant, sample
from tests.mutation.report import EQUIVALENT, reason, summary
from tests.mutation.trial import CAUGHT, Outcome, attempt
from tests.mutation.warm import ROOT, Runner

SOURCES = {
    path.stem: path.relative_to(ROOT).as_posix()
    for path in sorted((ROOT / "dynx").iterdir())
    if (path / "__init__.py").exists() or (path.suffix == ".py" and not path.name.startswith("_"))
}
"""Room of dynx -> its folder, or its file where it is a single module."""
TESTS = tuple(
    sorted(
        f"tests/{path.name}"
        for path in (ROOT / "tests").iterdir()
        if (path / "__init__.py").exists() or path.match("test_*.py")
    )
)
MIN_PER_ROOM = 12
"""Least number of mutants of a room in the sample, if the room has as many places."""


def main() -> None:
    arguments = parser().parse_args()
    arguments.results.mkdir(parents=True, exist_ok=True)
    map_file = arguments.results / "coverage.json"
    coverage = CoverageMap.load(map_file).moved(ROOT)
    if arguments.record is not None:
        os.environ.setdefault("HYPOTHESIS_PROFILE", "coverage")
        tests = arguments.record or list(TESTS)
        coverage.replace(record(ROOT, tests, arguments.results))
        coverage.save(map_file)
        return
    if not coverage.durations:
        raise SystemExit("no coverage is recorded yet: python -m tests.mutation --record")
    mutants, total = cached_sample(arguments.seed, arguments.count, arguments.results / "sample.json")
    mutants = [mutant for mutant in mutants if mutant.room in arguments.rooms]
    kept = arguments.results / "outcomes.json"
    outcomes = load(kept)
    equivalent = json.loads(EQUIVALENT.read_text(encoding="utf-8"))
    settled = {
        key
        for key, outcome in outcomes.items()
        if not arguments.retry or outcome.status == CAUGHT or reason(outcome, equivalent) is not None
    }
    waiting = [mutant for mutant in mutants if mutant.key not in settled]
    try:
        for outcome in attempts(waiting, coverage, arguments.jobs):
            if outcome.key in outcomes:
                outcome.first_status = outcomes[outcome.key].first_status
            outcomes[outcome.key] = outcome
            save(outcomes, kept)
            print(f"{outcome.status:9} {outcome.path}:{outcome.line} {outcome.after[:70]}", flush=True)
    except KeyboardInterrupt:
        print("interrupted; the same command goes on from here")
    done = [outcomes[mutant.key] for mutant in mutants if mutant.key in outcomes]
    print(summary(done, total, equivalent))


def parser() -> argparse.ArgumentParser:
    assert __doc__ is not None
    made = argparse.ArgumentParser(
        "python -m tests.mutation",
        description=__doc__.replace("::\n", ":\n"),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    made.add_argument("--seed", type=int, default=0, help="seed of the sample")
    made.add_argument("--count", type=int, default=300, help="number of mutants in the sample")
    made.add_argument(
        "--rooms",
        nargs="+",
        choices=SOURCES,
        default=tuple(SOURCES),
        metavar="ROOM",
        help="try the mutants of the sample in these rooms only",
    )
    made.add_argument("--jobs", type=int, default=2, help="mutants to try at a time")
    made.add_argument("--retry", action="store_true", help="try survivors again that are not equivalent")
    made.add_argument("--results", type=Path, default=ROOT / ".mutation", help="folder of what is kept")
    made.add_argument(
        "--record",
        nargs=argparse.REMAINDER,
        metavar="PYTEST-ARGUMENT",
        help="record what tests execute (all of them, or those of these arguments), and end",
    )
    return made


def cached_sample(seed: int, count: int, kept: Path) -> tuple[list[Mutant], int]:
    """Return the sample: from the file `kept`, if that was made of the same sources, or made anew."""
    digest = sha256(f"{seed} {count} {MIN_PER_ROOM}".encode())
    for file in sorted((ROOT / "dynx").rglob("*.py")):
        digest.update(file.read_bytes())
    if kept.exists():
        document = json.loads(kept.read_text(encoding="utf-8"))
        if document["of"] == digest.hexdigest():
            return [Mutant(**each) for each in document["mutants"]], document["places"]
    mutants, places = sample(ROOT, SOURCES.values(), seed, count, MIN_PER_ROOM)
    document = {"of": digest.hexdigest(), "places": places, "mutants": [asdict(each) for each in mutants]}
    kept.write_text(json.dumps(document), encoding="utf-8")
    return mutants, places


def attempts(mutants: list[Mutant], coverage: CoverageMap, jobs: int) -> Iterator[Outcome]:
    """Yield the outcomes as they come, of `jobs` mutants at a time."""
    with ExitStack() as stack:
        idle: SimpleQueue[Runner] = SimpleQueue()
        runners = [stack.enter_context(Runner()) for _ in range(jobs)]
        for runner in runners:
            idle.put(runner)

        def attempt_with_idle_runner(mutant: Mutant) -> Outcome:
            runner = idle.get()
            try:
                return attempt(mutant, coverage, runner)
            finally:
                idle.put(runner)

        pool = stack.enter_context(ThreadPoolExecutor(jobs))
        futures = [pool.submit(attempt_with_idle_runner, mutant) for mutant in mutants]
        try:
            for future in as_completed(futures):
                yield future.result()
        except (KeyboardInterrupt, GeneratorExit):
            pool.shutdown(wait=False, cancel_futures=True)
            for runner in runners:
                runner.interrupt()
            raise


def load(path: Path) -> dict[str, Outcome]:
    if not path.exists():
        return {}
    return {each["key"]: Outcome(**each) for each in json.loads(path.read_text(encoding="utf-8"))}


def save(outcomes: dict[str, Outcome], path: Path) -> None:
    partial = path.with_suffix(".part")
    partial.write_text(json.dumps([asdict(each) for each in outcomes.values()], indent=1), encoding="utf-8")
    partial.replace(path)


if __name__ == "__main__":
    main()
