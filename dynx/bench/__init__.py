"""Benchmarks of backends and other libraries on the user's machine and robot; results are checked first.

A `Plan` lists what is timed, a `Session` times it, and `document` converts the measurements to JSON values.
The command is `dynx bench`; docs/bench.md describes it.
"""

from dynx.bench.cases import BenchmarkCase
from dynx.bench.measurement import Measurement
from dynx.bench.report import document
from dynx.bench.session import Plan, Session, benchmark_cases

__all__ = ["BenchmarkCase", "Measurement", "Plan", "Session", "benchmark_cases", "document"]
