"""Benchmarks of backends and other libraries on the user's machine and robot; results are checked first.

A `Plan` lists what is timed, a `Session` times it, and `document` converts the measurements to JSON values.
The command is `dynx bench`.
"""

from typing import TYPE_CHECKING

from dynx.bench.cases import BenchmarkCase
from dynx.bench.measurement import BenchmarkMeasurement
from dynx.bench.report import document
from dynx.bench.session import Plan, Session, benchmark_cases
from dynx.registry import moved_names

__all__ = ["BenchmarkCase", "BenchmarkMeasurement", "Plan", "Session", "benchmark_cases", "document"]

if not TYPE_CHECKING:
    __getattr__ = moved_names(__name__, {"Measurement": "dynx.bench.BenchmarkMeasurement"})
