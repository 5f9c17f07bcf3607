"""Which tests execute a line of dynx, and how long each takes.

Recorded by coverage.py, whose dynamic contexts name the test that runs. Recording again replaces what is
known of the files of tests that ran, and keeps the rest. The lines are those of the sources as they were
then; `CoverageMap.moved` finds them in the sources as they stand.
"""

from __future__ import annotations

import json
import os
from collections import defaultdict
from collections.abc import Generator, Iterable
from dataclasses import dataclass, field
from difflib import SequenceMatcher
from pathlib import Path
from zlib import crc32

import coverage
import pytest


@dataclass
class CoverageMap:
    """Passed tests by the lines that they execute."""

    durations: dict[str, float] = field(default_factory=dict)
    """Test -> processor time of its process and those that it started and ended, with its fixtures [s]. That
    of the clock would depend on what else the machine did."""
    lines: dict[str, dict[int, set[str]]] = field(default_factory=dict)
    """Path of a source file -> line -> tests."""
    texts: dict[str, list[int]] = field(default_factory=dict)
    """Path of a source file -> checksums of the lines that it had."""

    def tests(self, path: str, lines: Iterable[int]) -> set[str]:
        """Return the tests that execute one of these lines."""
        known = self.lines.get(path, {})
        return {test for line in lines for test in known.get(line, ())}

    def tests_of_file(self, path: str) -> set[str]:
        """Return the tests that execute a line of a file."""
        return self.tests(path, self.lines.get(path, {}))

    @classmethod
    def load(cls, path: Path) -> CoverageMap:
        """Read a map; empty if there is no such file."""
        if not path.exists():
            return cls()
        document = json.loads(path.read_text(encoding="utf-8"))
        names = list(document["durations"])
        lines = {
            file: {int(line): {names[number] for number in numbers} for line, numbers in found.items()}
            for file, found in document["lines"].items()
        }
        return cls(document["durations"], lines, document["texts"])

    def save(self, path: Path) -> None:
        numbers = {name: number for number, name in enumerate(self.durations)}
        lines = {
            file: {line: sorted(numbers[test] for test in tests) for line, tests in found.items()}
            for file, found in self.lines.items()
        }
        document = {"durations": self.durations, "lines": lines, "texts": self.texts}
        path.write_text(json.dumps(document), encoding="utf-8")

    def moved(self, root: Path) -> CoverageMap:
        """Return this map for the sources as they stand: a line keeps its tests where edits move it, and
        changed lines have the tests of all that they replace."""
        texts = {path: checksums(root / path) for path in self.lines if (root / path).exists()}
        moved = CoverageMap(self.durations, {}, texts)
        for path, text in texts.items():
            before = self.lines[path]
            after: dict[int, set[str]] = {}
            blocks = SequenceMatcher(None, self.texts[path], text, autojunk=False).get_opcodes()
            for kind, first, last, new_first, new_last in blocks:
                replaced = {test for line in range(first, last) for test in before.get(line + 1, ())}
                for line in range(new_first, new_last):
                    tests = before.get(first + line - new_first + 1) if kind == "equal" else replaced
                    if tests:
                        after[line + 1] = tests
            moved.lines[path] = after
        return moved

    def replace(self, other: CoverageMap) -> None:
        """Take over what `other` recorded, and forget what was known of the files of its tests."""
        files = {name.partition("::")[0] for name in other.durations}
        kept = {name: time for name, time in self.durations.items() if name.partition("::")[0] not in files}
        self.durations = kept | other.durations
        self.texts |= other.texts
        for file in {*self.lines, *other.lines}:
            merged: defaultdict[int, set[str]] = defaultdict(set)
            for tests_by_line, names in ((self.lines, kept), (other.lines, other.durations)):
                for line, tests in tests_by_line.get(file, {}).items():
                    merged[line] |= {test for test in tests if test in names}
            self.lines[file] = dict(merged)


def checksums(source: Path) -> list[int]:
    """Return a checksum of each line of a file."""
    return [crc32(line) for line in source.read_bytes().splitlines()]


def processor_time() -> float:
    """Return the time that processors spent on this process and its ended children [s]."""
    return sum(os.times()[:4])


class ContextSwitcher:
    """A pytest plugin that tells coverage.py which test runs, and keeps the durations of passed tests."""

    def __init__(self, recorder: coverage.Coverage) -> None:
        self.recorder = recorder
        self.durations: dict[str, float] = {}
        self.not_passed: set[str] = set()

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, None, None]:
        self.recorder.switch_context(item.nodeid)
        before = processor_time()
        yield
        self.durations[item.nodeid] = processor_time() - before
        self.recorder.switch_context("")

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if not report.passed:
            self.not_passed.add(report.nodeid)


def record(root: Path, tests: list[str], scratch: Path) -> CoverageMap:
    """Run tests in this process, which must not have imported dynx, and return what they execute."""
    recorder = coverage.Coverage(data_file=str(scratch / "coverage"), include=[f"{root / 'dynx'}/*"])
    switcher = ContextSwitcher(recorder)
    recorder.erase()
    recorder.start()
    pytest.main(["-q", "-p", "no:xdist", "-p", "no:benchmark", "--no-header", *tests], plugins=[switcher])
    recorder.stop()
    data = recorder.get_data()
    passed = {name: time for name, time in switcher.durations.items() if name not in switcher.not_passed}
    found: dict[str, dict[int, set[str]]] = {}
    for file in data.measured_files():
        path = Path(file).relative_to(root).as_posix()
        found[path] = {
            line: {context for context in contexts if context in passed}
            for line, contexts in data.contexts_by_lineno(file).items()
        }
    return CoverageMap(passed, found, {path: checksums(root / path) for path in found})
