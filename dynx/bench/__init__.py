"""Benchmarks of every backend and its peers on the user's own machine and robot, results checked first.

`Plan` says what is timed and `Session` does it; `document` makes plain numbers of what it found.
`dynx bench` is the command, docs/bench.md the page.
"""

from dynx.bench.cases import BenchmarkCase
from dynx.bench.measurement import Measurement
from dynx.bench.report import document
from dynx.bench.session import Plan, Session, benchmark_cases

__all__ = ["BenchmarkCase", "Measurement", "Plan", "Session", "benchmark_cases", "document"]
