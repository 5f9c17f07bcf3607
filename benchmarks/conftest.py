"""Puts the measurements of one run beside each other, and says what dynx adds to the engine."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from _pytest.terminal import TerminalReporter
from pytest_benchmark.fixture import BenchmarkFixture

Record = Callable[[str, str, BenchmarkFixture], None]
SECONDS = pytest.StashKey[dict[str, dict[str, float]]]()

CHECKED_MORE = 2e-6
"""Largest overhead of a checked call over the engine's own [s]."""
UNCHECKED_MORE, UNCHECKED_RATIO = 0.7e-6, 1.5
"""Largest overhead of an unchecked call: the larger of seconds and a factor."""


@pytest.fixture
def record(request: pytest.FixtureRequest) -> Record:
    """Keep the fastest round of a benchmark under (quantity, implementation), for the table at the end."""
    seconds = request.config.stash.setdefault(SECONDS, {})

    def keep(quantity: str, implementation: str, benchmark: BenchmarkFixture) -> None:
        # Without stats, benchmarks are switched off and only run once.
        if benchmark.stats is not None:
            seconds.setdefault(quantity, {})[implementation] = float(benchmark.stats.stats.min)

    return keep


def pytest_terminal_summary(terminalreporter: TerminalReporter, config: pytest.Config) -> None:
    """A line per quantity, if raw, checked and unchecked calls were all timed."""
    complete = {
        quantity: implementations
        for quantity, implementations in config.stash.get(SECONDS, {}).items()
        if implementations.keys() >= {"raw", "checked", "unchecked"}
    }
    if not complete:
        return
    write = terminalreporter.write_line
    terminalreporter.write_sep("-", "one call on UR5, fastest round [ns]")
    write(f"{'':22}{'pinocchio':>10}{'dynx':>9}{'more':>8}{'unchecked':>12}{'more':>8}{'ratio':>7}  bar")
    for quantity, implementations in complete.items():
        raw, checked, unchecked = (
            implementations["raw"],
            implementations["checked"],
            implementations["unchecked"],
        )
        allowed = max(UNCHECKED_MORE, (UNCHECKED_RATIO - 1.0) * raw)
        kept = checked - raw <= CHECKED_MORE and unchecked - raw <= allowed
        write(
            f"{quantity:22}{raw * 1e9:10.0f}{checked * 1e9:9.0f}{(checked - raw) * 1e9:+8.0f}"
            f"{unchecked * 1e9:12.0f}{(unchecked - raw) * 1e9:+8.0f}{unchecked / raw:7.2f}"
            f"  {'kept' if kept else 'MISSED'}"
        )
