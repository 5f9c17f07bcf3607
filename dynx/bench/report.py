"""The results of a session as a JSON document, which docs/bench.md describes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from dynx._version import __version__
from dynx.bench.cases import BenchmarkCase
from dynx.bench.cost import Cost
from dynx.bench.document import (
    BenchCase,
    BenchDocument,
    BenchPeak,
    BenchResult,
    BenchRoofline,
    BenchWay,
)
from dynx.bench.measurement import Measurement
from dynx.bench.roofline import Peak, roofline
from dynx.bench.session import Session

SCHEMA = 1


def document(session: Session, found: Sequence[Sequence[Measurement]], processor: str) -> BenchDocument:
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
        "peaks": [_peak(peak) for peak in session.peaks.values()],
        "results": [
            result(group, [session.cost(each) for each in group], session.peaks) for group in found if group
        ],
        "not_done": [_case(case) for case in plan.cases if case not in measured],
    }


def result(
    group: Sequence[Measurement], costs: Sequence[Cost | None], peaks: Mapping[int, Peak]
) -> BenchResult:
    """Return the entry of one case with all its implementations; a ratio is the time of a peer divided by
    that of the implementation."""
    timed = [each for each in group if each.role == "peer"]
    peers = {each.implementation: each.times.median for each in timed if each.times is not None}
    return {
        **_case(group[0].case),
        "ways": [_entry(each, cost, peers, peaks) for each, cost in zip(group, costs, strict=True)],
    }


def wrong(found: Sequence[Sequence[Measurement]]) -> list[Measurement]:
    """Return the measurements of implementations with wrong results."""
    return [each for group in found for each in group if is_wrong(each)]


def is_wrong(measurement: Measurement) -> bool:
    """Check whether the error exceeds the tolerance."""
    error, tolerance = measurement.error, measurement.tolerance
    return error is not None and tolerance is not None and not error <= tolerance


def _entry(
    measurement: Measurement, cost: Cost | None, peers: Mapping[str, float], peaks: Mapping[int, Peak]
) -> BenchWay:
    times = measurement.times
    peak = peaks.get(measurement.threads)
    entry: BenchWay = {
        "way": measurement.implementation,
        "role": measurement.role,
        "version": measurement.version,
        "threads": measurement.threads,
        "samples": measurement.samples,
        "error": measurement.error,
        "tolerance": measurement.tolerance,
        "problem": measurement.problem,
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
            entry["roofline"] = _roofline(cost, times.median, peak)
    return entry


def _roofline(cost: Cost, seconds: float, peak: Peak) -> BenchRoofline:
    found = roofline(cost, seconds, peak)
    return {
        "bytes": cost.bytes,
        "operations": cost.operations,
        "multiply_adds": cost.multiply_adds,
        "memory_share": found.memory_share,
        "arithmetic_share": found.arithmetic_share,
        "binds": found.binds,
    }


def _peak(peak: Peak) -> BenchPeak:
    return {
        "threads": peak.threads,
        "copy_bandwidth": peak.copy_bandwidth,
        "multiply_adds": peak.multiply_adds,
    }


def _case(case: BenchmarkCase) -> BenchCase:
    return {"quantity": case.quantity, "batch": case.batch, "threads": case.threads}
