"""The JSON document of ``dynx bench``: its keys and types, from which its schema is generated."""

from __future__ import annotations

from typing import Literal, TypedDict

from dynx.bench.cases import BenchmarkCase
from dynx.bench.roofline import Peak


class BenchRoofline(TypedDict):
    """Bytes and operations of one sample, and the fractions of both peaks that its time corresponds to."""

    bytes: int
    operations: int
    multiply_adds: int
    memory_share: float
    arithmetic_share: float
    binds: Literal["memory", "arithmetic"]


class BenchWay(TypedDict):
    """One implementation: its error, the median and quartiles of the time per sample [ns], and its speed
    relative to each peer. If it was not timed, times are null and `problem` is the reason."""

    way: str
    role: str
    version: str
    threads: int
    samples: int
    error: float | None
    tolerance: float | None
    problem: str | None
    ns: float | None
    ns_quartiles: list[float] | None
    ratios: dict[str, float]
    roofline: BenchRoofline | None


class BenchResult(TypedDict):
    """One case with all its implementations."""

    quantity: str
    batch: int
    threads: int
    ways: list[BenchWay]


class BenchDocument(TypedDict):
    """The document; `load` is the load average before the run, `not_done` the cases left out by Ctrl-C."""

    schema: int
    dynx: str
    robot: str
    source: str | None
    base: str
    nq: int
    nv: int
    frame: str
    repetitions: int
    seed: int
    processor: str
    load: float | None
    peaks: list[Peak]
    results: list[BenchResult]
    not_done: list[BenchmarkCase]
