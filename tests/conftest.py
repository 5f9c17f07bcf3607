"""Hypothesis profiles, and one cache of compiled kernels for the whole run.

The profiles are ``ci`` (25 examples of each property, the default), ``dev`` (20, for a quick look),
``mutation`` (25, not shrunk: `tests.mutation` needs only whether a test fails), ``coverage`` (5:
`tests.mutation` records which lines a test executes) and ``long`` (1000, for a night). 25 are the examples
with which mutants are counted, so that the score is that of CI.
``pytest --hypothesis-profile dev`` or ``HYPOTHESIS_PROFILE=dev`` chooses.

Examples are drawn from a fixed seed, so a failure in CI is a failure everywhere; no deadline, since
the time of one example says more about the machine than about dynx.
"""

from __future__ import annotations

import gc
import os
import sys
import tempfile
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Generator
from typing import Any
from zlib import crc32

import pytest
from hypothesis import HealthCheck, Phase, settings

from dynx.errors import NotInstalledError, RobotNotFoundError
from dynx.model.library import EXAMPLE_ROBOT_DATA, robots

EXAMPLES_INSTALLED = any(entry.source == EXAMPLE_ROBOT_DATA for entry in robots())

needs_examples = pytest.mark.skipif(not EXAMPLES_INSTALLED, reason="needs example-robot-data")

settings.register_profile(
    "ci",
    max_examples=25,
    deadline=None,
    derandomize=True,
    print_blob=True,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.register_profile("dev", parent=settings.get_profile("ci"), max_examples=20)
settings.register_profile("long", parent=settings.get_profile("ci"), max_examples=1000)
settings.register_profile(
    "mutation",
    parent=settings.get_profile("ci"),
    phases=[Phase.explicit, Phase.generate],
)
settings.register_profile("coverage", parent=settings.get_profile("mutation"), max_examples=5)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci"))

LONGEST = (
    "tests/test_readme.py::test_blocks_run_alone",
    "tests/properties/",
    "tests/surveys/test_raw_engines.py",
    "tests/test_benchmarks_run.py",
    "tests/testing/test_scenes.py::test_every_sort_occurs",
)
"""Beginnings of the names of tests that take up to a minute each."""

WAITING = "tests/viewer/"
"""Beginning of the names of tests most of which wait for a browser, which has processes of its own."""


CASES, LONG_CASES = 4, 2
"""Largest number of cases of one test that run without ``--whole``, and of one with the mark ``long_cases``:
each takes a good part of a second or more, and repeats the others on another robot, engine or kind."""


LARGEST_CHUNK = 2
"""Largest number of tests that a parallel worker is given at a time."""


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """A process more than processors, for ``-n auto``: that of the tests that wait computes little."""
    # A container may have fewer than the machine.
    processors = len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1
    return processors + 1


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Let one process run the tests that wait, from the start, while the others compute; of several that wait
    at the same time, each would leave a processor without work, or the browsers would hold up each other."""
    if config.getoption("dist") != "load":
        return None
    from xdist.scheduler import LoadScheduling

    class WaitingApart(LoadScheduling):  # type: ignore[misc, unused-ignore]
        def _send_tests(self, node: Any, num: int) -> None:
            # Tests that wait are the first of all, and other processes get them when no others are left.
            first = bisect_left(
                self.pending, True, key=lambda test: not self.collection[test].startswith(WAITING)
            )
            if node is not self.nodes[0] and first < len(self.pending):
                chosen = self.pending[first : first + num]
                del self.pending[first : first + num]
                self.pending[:0] = chosen
            super()._send_tests(node, num)

    return WaitingApart(config, log)


def pytest_configure(config: pytest.Config) -> None:
    """Make one cache of compiled kernels for this run and its parallel workers, and remove it afterwards.

    Each kernel is compiled once, and no test depends on files of an earlier run. If DYNX_CACHE_DIR names a
    folder, that one is used and kept.
    """
    config.addinivalue_line("markers", "long_cases: each case takes a good part of a second or more")
    # By default one worker gets an eighth of all tests at the start, with all of the longest among them.
    if getattr(config.option, "maxschedchunk", 0) is None:
        config.option.maxschedchunk = LARGEST_CHUNK
    if "DYNX_CACHE_DIR" not in os.environ:
        folder = tempfile.TemporaryDirectory(prefix="dynx-tests-")
        os.environ["DYNX_CACHE_DIR"] = folder.name
        config.add_cleanup(folder.cleanup)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, Any, Any]:
    """Let Python search for unreachable objects seldom, and not among those that exist after the collection.

    Millions of objects of modules and tests stay to the end; looking through them took a tenth of all time.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()
        gc.set_threshold(10_000)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--one-in", type=int, default=1, metavar="N", help="run a random Nth of the quick tests")
    parser.addoption("--whole", action="store_true", help="run every case of each test, not a few at random")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keep the sample of ``--one-in``, and a few cases of each test if neither ``--whole`` nor a file is
    given; put those that wait first (`pytest_xdist_make_scheduler`) and then the longest, so that parallel
    workers end together."""
    one_in = config.getoption("--one-in")
    sample = list(items)
    if one_in > 1:
        sample = [item for item in items if is_quick(item) and crc32(item.nodeid.encode()) % one_in == 0]
    elif not config.getoption("--whole") and not any(".py" in argument for argument in config.args):
        sample = few_cases(items)
    if len(sample) < len(items):
        config.hook.pytest_deselected(items=list(set(items) - set(sample)))
        items[:] = sample
    items.sort(key=place_in_order)


def few_cases(items: list[pytest.Item]) -> list[pytest.Item]:
    """Return at most `CASES` or `LONG_CASES` cases of each test, at random, but the same ones in each run."""
    tests: dict[str, list[pytest.Item]] = defaultdict(list)
    for item in items:
        tests[item.nodeid.partition("[")[0]].append(item)
    kept = {
        item
        for cases in tests.values()
        for item in sorted(cases, key=lambda item: crc32(item.nodeid.encode()))[
            : LONG_CASES if cases[0].get_closest_marker("long_cases") else CASES
        ]
    }
    return [item for item in items if item in kept]


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Generator[None, Any, Any]:
    """Skip a module whose import needs an engine or a robot that is not installed."""
    report = yield
    if report.failed:
        text = str(report.longrepr)
        robot = "RobotNotFoundError" in text and not EXAMPLES_INSTALLED
        if robot or "NotInstalledError" in text:
            needed = "example-robot-data" if robot else "an engine that is not installed"
            report.outcome, report.longrepr = "skipped", (str(collector.path), 0, f"needs {needed}")
    return report


def _skip_what_is_not_installed() -> Generator[None, Any, Any]:
    """Skip a test, or its fixture, that needs an engine or a robot that is not installed."""
    try:
        return (yield)
    except NotInstalledError as error:
        pytest.skip(str(error))
    except RobotNotFoundError as error:
        if EXAMPLES_INSTALLED:
            raise
        pytest.skip(f"needs example-robot-data: {error}")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item: pytest.Item) -> Generator[None, Any, Any]:
    return (yield from _skip_what_is_not_installed())


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, Any, Any]:
    return (yield from _skip_what_is_not_installed())


def is_quick(item: pytest.Item) -> bool:
    return not item.nodeid.startswith((*LONGEST, WAITING))


def place_in_order(item: pytest.Item) -> int:
    """Return a number by which tests are sorted: those that wait and need a browser, others beside them, the
    longest, and the quick ones."""
    if item.nodeid.startswith(WAITING):
        return 0 if "browser" in getattr(item, "fixturenames", ()) else 1
    return 3 if is_quick(item) else 2
