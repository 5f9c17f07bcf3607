"""Comparison of two results of one quantity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dynx.agreement.compared_quantities import ComparedQuantity
from dynx.agreement.magnitudes import Magnitudes
from dynx.agreement.natural_magnitudes import Layout, frame_samples
from dynx.agreement.results import DERIVED, BackendResults, Refusal
from dynx.agreement.sampling import Samples
from dynx.spatial.scalar import Array, Floats


@dataclass(frozen=True)
class WorstSample:
    """The sample with the largest error, and everything needed to reproduce it."""

    index: int
    kind: str
    q: tuple[float, ...]
    v: tuple[float, ...]
    a: tuple[float, ...]
    tau: tuple[float, ...]
    frame: str | None = None
    reference: str | None = None


@dataclass(frozen=True)
class Comparison:
    """The difference of two results of a quantity.

    `pair` joins two names by ``~``: two backends, or a backend and ``referee`` (50 digits) or ``derived``
    (results that dynx derives from that engine's own poses and inverse dynamics). `max_rel_error` is the
    largest error over its natural magnitude (`dynx.agreement.natural_magnitudes`).
    """

    quantity: str
    pair: str
    max_abs_error: float
    max_rel_error: float
    tolerance: float
    agree: bool
    worst_sample: WorstSample | None = None
    note: str | None = None

    @property
    def names(self) -> tuple[str, str]:
        """The two names of `pair`."""
        first, _, second = self.pair.partition("~")
        return first, second


@dataclass(frozen=True)
class ErrorVerdict:
    """The largest absolute and relative error, and the position of the latter in the array."""

    absolute: float
    relative: float
    position: tuple[int, ...] | None


def judge(error: Array, scale: Floats) -> ErrorVerdict:
    """Return the largest error relative to `scale`, which broadcasts against it; NaN counts as infinite."""
    absolute = np.abs(error).astype(np.float64)
    if not absolute.size:
        return ErrorVerdict(0.0, 0.0, None)
    absolute = np.where(np.isfinite(absolute), absolute, np.inf)
    relative = np.where(absolute == 0.0, 0.0, np.inf)
    np.divide(absolute, np.broadcast_to(scale, absolute.shape), out=relative, where=scale > 0.0)
    worst = np.unravel_index(int(np.argmax(relative)), relative.shape)
    return ErrorVerdict(float(np.max(absolute)), float(relative[worst]), tuple(int(k) for k in worst))


def compare(
    quantity: ComparedQuantity, first: BackendResults, second: BackendResults, magnitudes: Magnitudes
) -> Comparison:
    """Compare the results of two backends by their difference."""
    samples = first.samples
    tolerance = quantity.tolerance(magnitudes)
    results = [each.of(quantity.name, quantity.evaluate) for each in (first, second)]
    refusal = compare_refusals(quantity.name, first, second, results, tolerance)
    if refusal is not None:
        return refusal
    one, other = results
    assert not isinstance(one, Refusal)
    assert not isinstance(other, Refusal)
    if one.shape != other.shape:
        shapes = f"{first.name} gives shape {one.shape}, {second.name} {other.shape}"
        return failed_comparison(quantity.name, first, second, tolerance, shapes)
    scale = (quantity.derived_scale if second.name == DERIVED else None) or quantity.scale
    verdict = judge(_difference(one, other), scale(magnitudes))
    worst = locate(verdict.position, quantity.layout, samples)
    note = not_finite_note((first, one), (second, other))
    return concluded(quantity.name, first, second, verdict, tolerance, worst, note)


def not_finite_note(*results: tuple[BackendResults, Array]) -> str | None:
    """Return a note that names the backends whose results contain NaN or infinity, or None."""
    names = [by.name for by, result in results if not np.isfinite(result.astype(np.float64)).all()]
    return f"{' and '.join(names)}: NaN or infinity in the result" if names else None


def concluded(
    name: str,
    first: BackendResults,
    second: BackendResults,
    verdict: ErrorVerdict,
    tolerance: float,
    worst: WorstSample | None = None,
    note: str | None = None,
) -> Comparison:
    """Return the comparison of two results of the quantity `name`, whose largest error is `verdict`."""
    pair, error = f"{first.name}~{second.name}", verdict.relative
    return Comparison(name, pair, verdict.absolute, error, tolerance, error <= tolerance, worst, note)


def compare_refusals(
    name: str,
    first: BackendResults,
    second: BackendResults,
    results: Sequence[Array | Refusal],
    tolerance: float,
) -> Comparison | None:
    """Compare backends of which some raised an error; return None if all have results.

    They agree if all report a singular mass matrix.
    """
    refused = [result for result in results if isinstance(result, Refusal)]
    if not refused:
        return None
    if len(refused) == len(results) and all(result.singular for result in refused):
        note = f"refused alike: {refused[0].error}"
        return concluded(name, first, second, ErrorVerdict(0.0, 0.0, None), tolerance, note=note)
    note = "; ".join(
        f"{each.name} refuses: {result}"
        for each, result in zip((first, second), results, strict=False)
        if isinstance(result, Refusal)
    )
    return failed_comparison(name, first, second, tolerance, note)


def failed_comparison(
    name: str, first: BackendResults, second: BackendResults, tolerance: float, note: str
) -> Comparison:
    """Return a comparison that fails without a finite error."""
    return concluded(name, first, second, ErrorVerdict(np.inf, np.inf, None), tolerance, note=note)


def state(samples: Samples, k: int, frame: str | None = None, reference: str | None = None) -> WorstSample:
    """Return sample number k of `samples` as a record."""
    q, v, a, tau = (tuple(each[k].tolist()) for each in (samples.q, samples.v, samples.a, samples.tau))
    return WorstSample(int(samples.index[k]), samples.kinds[k], q, v, a, tau, frame, reference)


def locate(position: tuple[int, ...] | None, layout: Layout, samples: Samples) -> WorstSample | None:
    """Return the sample (and frame) of a position in a result."""
    if position is None:
        return None
    if layout == "samples":
        return state(samples, position[0])
    if layout == "frames":
        return state(samples, position[0], samples.model.frame_names[position[1]])
    entry = frame_samples(layout, samples)[position[0]]
    return state(samples, int(entry.samples[position[1]]), entry.frame, entry.reference)


def _difference(one: Array, other: Array) -> Array:
    """Return `one` minus `other`. The difference is exact where one of them holds 50-digit numbers, because
    those represent doubles exactly."""
    if one.dtype == object or other.dtype == object:
        return np.asarray(one.astype(object) - other.astype(object))
    with np.errstate(invalid="ignore"):
        return np.asarray(one - other)
