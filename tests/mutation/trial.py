"""One mutant and the tests that may catch it."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from dataclasses import dataclass
from functools import lru_cache

from tests.mutation.coverage_map import CoverageMap
from tests.mutation.population import Mutant
from tests.mutation.warm import ROOT, TIMED_OUT, Change, Runner

STAGES = ((30, 8.0), (80, 15.0))
"""Tests to run, at most, and the time that they take without a mutant [s]; the next stage if none fails."""
START = 20
"""Time that the import of dynx and the collection of tests may take [s]."""
SLOWER = 6
"""Factor by which tests may become slower (kernels are compiled anew, and others use the machine)."""

MIN_NAME = 4
"""Least length of a name by which the users of a constant are found."""
HOUSE = "tests/architecture/"
"""Tests of the names of all packages."""

CAUGHT = "caught"
SURVIVED = "survived"
UNTESTED = "no test"
BROKEN = "broken run"


@dataclass
class Outcome:
    """Verdict of the tests on a mutant."""

    key: str
    path: str
    function: str
    line: int
    operator: str
    before: str
    after: str
    status: str
    first_status: str
    """Status when it was tried first."""
    tests: int
    """Number of tests that were run, or could have been, until one failed."""
    caught_by: str = ""


def ordered(tests: set[str], durations: dict[str, float], room: str) -> list[str]:
    """Return tests in the order to run them: each function once, fastest first, then with other parameters.

    Tests of the room of the mutant (``tests/rbd`` of ``dynx/rbd``) count as four times as fast.
    """

    def cost(test: str) -> float:
        return durations[test] * (0.25 if test.startswith(f"tests/{room}/") else 1.0)

    by_function: dict[str, list[str]] = defaultdict(list)
    for test in sorted(tests, key=lambda test: (cost(test), test)):
        by_function[test.partition("[")[0]].append(test)
    turns = [(turn, cost(test), test) for same in by_function.values() for turn, test in enumerate(same)]
    return [test for _, _, test in sorted(turns)]


def own_tests(path: str) -> str:
    """Return the file of the tests of a module, which may look at its constants and execute no line of it."""
    folder, _, name = path.removeprefix("dynx/").rpartition("/")
    return "/".join(filter(None, ("tests", folder, f"test_{name}")))


def assigned_names(source: str, line: int) -> list[str]:
    """Return the names that the statement at a line assigns outside of functions."""
    statements = [ast.parse(source).body]
    while statements:
        for each in statements.pop():
            if isinstance(each, ast.ClassDef):
                statements.append(each.body)
            elif isinstance(each, ast.Assign | ast.AnnAssign) and each.lineno <= line <= (
                each.end_lineno or 0
            ):
                targets = each.targets if isinstance(each, ast.Assign) else [each.target]
                return [name.id for to in targets for name in ast.walk(to) if isinstance(name, ast.Name)]
    return []


@lru_cache(maxsize=1)
def source_lines() -> dict[str, list[str]]:
    """Return the lines of every file of dynx by its path."""
    files = sorted((ROOT / "dynx").rglob("*.py"))
    return {
        file.relative_to(ROOT).as_posix(): file.read_text(encoding="utf-8").splitlines() for file in files
    }


def tests_of_users(mutant: Mutant, coverage: CoverageMap) -> set[str]:
    """Return the tests that execute a line that mentions what a statement outside of functions assigns."""
    names = [name for name in assigned_names(mutant.source, mutant.line) if len(name) >= MIN_NAME]
    word = re.compile(rf"\b(?:{'|'.join(names)})\b")
    found: set[str] = set()
    for path, text in source_lines().items() if names else ():
        found |= coverage.tests(path, [at for at, line in enumerate(text, 1) if word.search(line)])
    return found


def covering_tests(mutant: Mutant, coverage: CoverageMap) -> set[str]:
    """Return the tests that execute the statement of a mutant. If there are none, because it runs when the
    module is imported: those that use what it assigns, or else the module, or else the room."""
    room = {test for test in coverage.durations if test.startswith((f"tests/{mutant.room}/", HOUSE))}
    return (
        coverage.tests(mutant.path, range(mutant.line, mutant.last_line + 1))
        or tests_of_users(mutant, coverage)
        or coverage.tests_of_file(mutant.path)
        or room
    )


def attempt(mutant: Mutant, coverage: CoverageMap, runner: Runner) -> Outcome:
    """Run the tests that execute the mutant until one fails."""
    covering = covering_tests(mutant, coverage)
    own = own_tests(mutant.path)
    covering |= {test for test in coverage.durations if test.startswith(f"{own}::")}
    waiting = ordered(covering, coverage.durations, mutant.room)
    outcome = Outcome(
        mutant.key,
        mutant.path,
        mutant.function,
        mutant.line,
        mutant.operator,
        mutant.before,
        mutant.after,
        UNTESTED,
        UNTESTED,
        0,
    )
    for most, time in STAGES:
        chosen, spent = 0, 0.0
        while chosen < min(most, len(waiting)) and spent + coverage.durations[waiting[chosen]] <= time:
            spent += coverage.durations[waiting[chosen]]
            chosen += 1
        # A test that takes longer than the whole stage is run alone rather than never.
        chosen = max(chosen, min(1, len(waiting)))
        if chosen == 0:
            break
        tests, waiting = waiting[:chosen], waiting[chosen:]
        timeout = int(START + SLOWER * spent)
        change = Change(mutant.module, mutant.source)
        code, output = runner.run(tests, change, timeout)
        gone = set(re.findall(r"^ERROR: not found: .*?(tests/.+)$", output, re.MULTILINE))
        if code == 4 and gone:
            # Tests that were renamed since the coverage was recorded.
            tests = [test for test in tests if test not in gone]
            code, output = runner.run(tests, change, timeout) if tests else (0, "")
        outcome.tests += len(tests)
        outcome.status, outcome.caught_by = verdict(code, output)
        if outcome.status != SURVIVED:
            break
    outcome.first_status = outcome.status
    return outcome


def verdict(code: int, output: str) -> tuple[str, str]:
    """Return the status that an exit code of pytest means, and the test that failed."""
    if code == 0:
        return SURVIVED, ""
    if code in TIMED_OUT:
        return CAUGHT, "time limit"
    if code < 0:
        return CAUGHT, f"signal {-code}"
    failed = re.search(r"^(?:FAILED|ERROR) (tests\S+)", output, re.MULTILINE)
    if code == 1 and failed:
        return CAUGHT, failed[1]
    # A module of tests could not be imported: 2 where files were named, 4 where tests in them were.
    unimported = re.search(r"found no collectors for (\S+)::", output) or failed
    if code in (2, 4) and unimported:
        return CAUGHT, f"import of {unimported[1]}"
    if code == 4 and "ImportError while loading conftest" in output:
        return CAUGHT, "import of tests/conftest.py"
    return BROKEN, output[-600:]
