"""The results of a session as a JSON document, which docs/bench.md describes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from dynx._version import __version__
from dynx.bench.cost import Cost
from dynx.bench.measurement import BenchmarkMeasurement
from dynx.bench.roofline import Peak, roofline
from dynx.bench.session import Session

SCHEMA = 1

_OF_MEASUREMENT = ("role", "version", "threads", "samples", "error", "tolerance", "problem")
"""Attributes of a measurement that the document has under the same name."""


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
