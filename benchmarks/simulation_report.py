"""Results of the benchmark of simulation as Markdown tables, against promised bounds, and as JSON."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from benchmarks.closed_loops import DYNX, TUTORIAL
from benchmarks.rollout_batches import CLOSED, MUJOCO
from benchmarks.simulator import Check, Simulator
from dynx._version import __version__
from dynx.bench.machine import load, processor_description
from dynx.bench.timing import Times

SCHEMA = 1


@dataclass(frozen=True)
class Found:
    """One simulator, its checks, and the times of a call and of a call with a single step."""

    simulator: Simulator
    checks: Sequence[Check]
    call: Times | None = None
    start: Times | None = None

    @property
    def single(self) -> bool:
        """Whether it is one rollout."""
        return self.simulator.rollouts == 1

    @property
    def step(self) -> float:
        """Time of a step [s]: the median over the calls, divided by the steps of a call."""
        return float("nan") if self.call is None else self.call.median / self.simulator.steps


@dataclass(frozen=True)
class Baselines:
    """Times of a step [s] of the simulators that others are compared with; NaN where not measured."""

    tutorial: float
    mujoco: dict[int, float]
    """By the number of threads."""

    @classmethod
    def among(cls, found: Sequence[Found]) -> Baselines:
        """The baselines among the measured simulators."""
        steps = {(each.simulator.name, each.simulator.threads): each.step for each in found}
        mujoco = {threads: step for (name, threads), step in steps.items() if name == MUJOCO}
        return cls(steps.get((TUTORIAL, 1), float("nan")), mujoco)

    def ratios(self, found: Found) -> dict[str, float]:
        """Speed-up over the tutorial's loop, and over MuJoCo on as many threads."""
        mujoco = self.mujoco.get(found.simulator.threads, float("nan"))
        return {"tutorial": self.tutorial / found.step, "mujoco": mujoco / found.step}


def tables(found: Sequence[Found]) -> Iterator[str]:
    """Single loops, then batches.

    A speed-up is that of a step, over the tutorial's loop or over MuJoCo's rollout on as many threads.
    ``spread`` is the distance of the quartiles over the median.
    """
    baselines = Baselines.among(found)
    speed_up = "speed-up over the tutorial's loop"
    yield f"| one closed loop | us a step | spread | steps/s | {speed_up} | start [ms] | error [rad] |"
    yield "|---|---|---|---|---|---|---|"
    for each in found:
        if each.single:
            yield (
                f"| {each.simulator.name} | {1e6 * each.step:.1f} | {spread(each)} | {1.0 / each.step:,.0f} "
                f"| {times(baselines.ratios(each)['tutorial'])} | {start_of(each)} "
                f"| {each.checks[0].error:.1e} |"
            )
    yield ""
    head = f"spread | speed-up over MuJoCo | {speed_up} | start [ms] |"
    yield f"| batch | threads | rollouts | ns a step | {head}"
    yield "|---|---|---|---|---|---|---|---|"
    for each in found:
        if not each.single:
            ratios = baselines.ratios(each)
            yield (
                f"| {each.simulator.name} | {each.simulator.threads} | {each.simulator.rollouts:,} "
                f"| {1e9 * each.step:,.0f} | {spread(each)} | {times(ratios['mujoco'])} "
                f"| {times(ratios['tutorial'])} | {start_of(each)} |"
            )


def bars(found: Sequence[Found]) -> Iterator[str]:
    """List the goals, and whether each was reached."""
    baselines = Baselines.among(found)
    for each in found:
        ratios, threads = baselines.ratios(each), each.simulator.threads
        if each.simulator.name == DYNX:
            yield bar("closed loop [steps/s]", 1.0 / each.step, at_least=60_000)
            yield bar("closed loop, times faster than the tutorial's", ratios["tutorial"], at_least=3)
        if each.simulator.name == CLOSED:
            yield bar(f"batch, threads {threads}, times faster than MuJoCo", ratios["mujoco"], at_least=30)
        if each.simulator.name == CLOSED and threads == 2:
            yield bar("batch, threads 2, times faster than the tutorial's", ratios["tutorial"], at_least=400)
            yield bar("batch, threads 2 [steps/s]", 1.0 / each.step, at_least=1e9 / 75)


def bar(what: str, reached: float, *, at_least: float) -> str:
    """A line; a peer that is not there leaves nothing to compare."""
    if reached != reached:
        return f"{what}: not measured"
    verdict = "kept" if reached >= at_least else "MISSED"
    digits = 0 if reached >= 100 else 1
    return f"{what}: {reached:,.{digits}f}, wanted {at_least:,.0f} or more: {verdict}"


def document(found: Sequence[Found], problems: Sequence[str]) -> dict[str, Any]:
    """All of it as plain numbers: seconds, and null for what is not there."""
    baselines = Baselines.among(found)
    return {
        "schema": SCHEMA,
        "dynx": __version__,
        "processor": processor_description(),
        "load": load(),
        "problems": list(problems),
        "results": [entry(each, baselines.ratios(each)) for each in found],
    }


def entry(found: Found, ratios: dict[str, float]) -> dict[str, Any]:
    """The entry of one simulator."""
    one = found.simulator
    return {
        "name": one.name,
        "threads": one.threads,
        "rollouts": one.rollouts,
        "steps": one.steps,
        "step": finite(found.step),
        "calls": [] if found.call is None else list(found.call.seconds),
        "starts": [] if found.start is None else list(found.start.seconds),
        "times_faster": {name: finite(ratio) for name, ratio in ratios.items()},
        "checks": [
            {"what": check.what, "error": check.error, "allowed": check.allowed} for check in found.checks
        ],
    }


def times(ratio: float) -> str:
    """Three digits or whole; empty for what is not there."""
    if ratio != ratio:
        return ""
    return f"{ratio:.3g}" if ratio < 1000 else f"{ratio:,.0f}"


def spread(found: Found) -> str:
    """Format the interquartile range of the call times over their median."""
    return "" if found.call is None else f"{100.0 * found.call.spread:.0f} %"


def start_of(found: Found) -> str:
    """Format the time of a call before its first step [ms]; empty if there is none."""
    return "" if found.start is None else f"{1e3 * found.start.median:.1f}"


def finite(number: float) -> float | None:
    """None for NaN, which JSON has not."""
    return None if number != number else number
