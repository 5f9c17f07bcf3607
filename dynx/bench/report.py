"""The results of a session as a JSON document."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, Literal, TypedDict

from dynx._version import __version__
from dynx.argument_types import checks_types
from dynx.bench.cases import BenchmarkCase
from dynx.bench.machine import Cost, Peak, roofline
from dynx.bench.measurement import BenchmarkMeasurement
from dynx.bench.session import Session

# The JSON document of ``dynx bench``: its keys and types, from which its schema is generated.


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


SCHEMA = 1

_OF_MEASUREMENT = ("role", "version", "threads", "samples", "error", "tolerance", "problem")
"""Attributes of a measurement that the document has under the same name."""


@checks_types
def document(
    session: Session, found: Sequence[Sequence[BenchmarkMeasurement]], processor: str
) -> dict[str, Any]:
    """Assemble the document of a session: one entry of `found` for each measured case, in order."""
    plan = session.plan
    measured = {group[0].case for group in found if group}
    return {
        "schema": SCHEMA,
        "dynx": __version__,
        "robot": plan.model.name,
        "source": plan.model.source,
        "base": plan.model.base,
        "nq": plan.model.nq,
        "nv": plan.model.nv,
        "frame": plan.frame,
        "repetitions": plan.repetitions,
        "seed": plan.seed,
        "processor": processor,
        "load": session.load,
        "peaks": [asdict(peak) for peak in session.peaks.values()],
        "results": [
            result(group, [session.cost(each) for each in group], session.peaks) for group in found if group
        ],
        "not_done": [asdict(case) for case in plan.cases if case not in measured],
    }


def result(
    group: Sequence[BenchmarkMeasurement], costs: Sequence[Cost | None], peaks: Mapping[int, Peak]
) -> dict[str, Any]:
    """Return the entry of one case with all its implementations; a ratio is the time of a peer divided by
    that of the implementation."""
    timed = [each for each in group if each.role == "peer"]
    peers = {each.implementation: each.times.median for each in timed if each.times is not None}
    return {
        **asdict(group[0].case),
        "ways": [_entry(each, cost, peers, peaks) for each, cost in zip(group, costs, strict=True)],
    }


def wrong(found: Sequence[Sequence[BenchmarkMeasurement]]) -> list[BenchmarkMeasurement]:
    """Return the measurements of implementations with wrong results."""
    return [each for group in found for each in group if is_wrong(each)]


def is_wrong(measurement: BenchmarkMeasurement) -> bool:
    """Check whether the error exceeds the tolerance."""
    error, tolerance = measurement.error, measurement.tolerance
    return error is not None and tolerance is not None and not error <= tolerance


def _entry(
    measurement: BenchmarkMeasurement,
    cost: Cost | None,
    peers: Mapping[str, float],
    peaks: Mapping[int, Peak],
) -> dict[str, Any]:
    times = measurement.times
    peak = peaks.get(measurement.threads)
    entry: dict[str, Any] = {
        "way": measurement.implementation,
        **{name: getattr(measurement, name) for name in _OF_MEASUREMENT},
        "ns": None,
        "ns_quartiles": None,
        "ratios": {},
        "roofline": None,
    }
    if times is None:
        return entry
    entry["ns"] = 1e9 * times.median
    entry["ns_quartiles"] = [1e9 * each for each in times.quartiles]
    if times.median > 0.0:
        entry["ratios"] = {peer: seconds / times.median for peer, seconds in peers.items()}
        if cost is not None and peak is not None:
            found = roofline(cost, times.median, peak)
            entry["roofline"] = {**asdict(cost), **asdict(found), "binds": found.binds}
    return entry
