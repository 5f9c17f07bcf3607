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
    """The sample of the largest error, with all that reproduces it."""

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
    """The difference of two results of a quantity; `pair` is two backends, or a backend and
    ``referee`` (50 digits) or ``derived`` (what dynx derives from that engine's own poses and inverse
    dynamics), joined by ``~``.

    `max_rel_error` is the largest error over its natural magnitude (`dynx.agreement.natural_magnitudes`).
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
        """The two that were compared."""
        first, _, second = self.pair.partition("~")
        return first, second


@dataclass(frozen=True)
class Verdict:
    """The largest absolute and relative error, and the position of the latter in the array."""

    absolute: float
    relative: float
    position: tuple[int, ...] | None


def judge(error: Array, scale: Floats) -> Verdict:
    """The largest error over `scale`, which broadcasts; NaN counts as infinite."""
    size = np.abs(error).astype(np.float64)
    if not size.size:
        return Verdict(0.0, 0.0, None)
    size = np.where(np.isfinite(size), size, np.inf)
    relative = np.where(size == 0.0, 0.0, np.inf)
    np.divide(size, np.broadcast_to(scale, size.shape), out=relative, where=scale > 0.0)
    worst = np.unravel_index(int(np.argmax(relative)), relative.shape)
    return Verdict(float(np.max(size)), float(relative[worst]), tuple(int(k) for k in worst))


def compare(
    quantity: ComparedQuantity, first: BackendResults, second: BackendResults, sizes: Magnitudes
) -> Comparison:
    """Compare two results whose error is their difference."""
    samples = first.samples
    tolerance = quantity.tolerance(sizes)
    results = [each.of(quantity.name, quantity.evaluate) for each in (first, second)]
    refused = refusals(quantity.name, first, second, results, tolerance)
    if refused is not None:
        return refused
    one, other = results
    assert not isinstance(one, Refusal)
    assert not isinstance(other, Refusal)
    if one.shape != other.shape:
        note = f"{first.name} gives shape {one.shape}, {second.name} {other.shape}"
        return failed_comparison(quantity.name, first, second, tolerance, note)
    derived = second.name == DERIVED and quantity.derived_scale is not None
    scale = quantity.derived_scale(sizes) if derived and quantity.derived_scale else quantity.scale(sizes)
    verdict = judge(_difference(one, other), scale)
    return Comparison(
        quantity.name,
        pair_name(first, second),
        verdict.absolute,
        verdict.relative,
        tolerance,
        verdict.relative <= tolerance,
        locate(verdict.position, quantity.layout, samples),
        note=not_finite_note((first, one), (second, other)),
    )


def not_finite_note(*results: tuple[BackendResults, Array]) -> str | None:
    """A note that names the backends whose results contain NaN or infinity, or None."""
    wild = [by.name for by, answer in results if not np.isfinite(answer.astype(np.float64)).all()]
    return f"{' and '.join(wild)}: NaN or infinity in the answer" if wild else None


def pair_name(first: BackendResults, second: BackendResults) -> str:
    """Such as ``pinocchio~pybullet``."""
    return f"{first.name}~{second.name}"


def refusals(
    name: str,
    first: BackendResults,
    second: BackendResults,
    results: Sequence[Array | Refusal],
    tolerance: float,
) -> Comparison | None:
    """The comparison of errors in place of results: the same error from both is agreement."""
    refused = [answer for answer in results if isinstance(answer, Refusal)]
    if not refused:
        return None
    alike = len(refused) == len(results) and all(answer.singular for answer in refused)
    if alike:
        note = f"refused alike: {refused[0].error}"
        return Comparison(name, pair_name(first, second), 0.0, 0.0, tolerance, True, note=note)
    note = "; ".join(
        f"{each.name} refuses: {answer}"
        for each, answer in zip((first, second), results, strict=False)
        if isinstance(answer, Refusal)
    )
    return failed_comparison(name, first, second, tolerance, note)


def failed_comparison(
    name: str, first: BackendResults, second: BackendResults, tolerance: float, note: str
) -> Comparison:
    """A comparison that fails without a finite error."""
    return Comparison(name, pair_name(first, second), np.inf, np.inf, tolerance, False, note=note)


def state(samples: Samples, k: int, frame: str | None = None, reference: str | None = None) -> WorstSample:
    """Sample number k (of those in `samples`) as a record."""
    return WorstSample(
        index=int(samples.index[k]),
        kind=samples.kinds[k],
        q=tuple(samples.q[k].tolist()),
        v=tuple(samples.v[k].tolist()),
        a=tuple(samples.a[k].tolist()),
        tau=tuple(samples.tau[k].tolist()),
        frame=frame,
        reference=reference,
    )


def locate(position: tuple[int, ...] | None, layout: Layout, samples: Samples) -> WorstSample | None:
    """The sample (and frame) of a position in a result."""
    if position is None:
        return None
    if layout == "samples":
        return state(samples, position[0])
    if layout == "frames":
        return state(samples, position[0], samples.model.frame_names[position[1]])
    question = frame_samples(layout, samples)[position[0]]
    return state(samples, int(question.samples[position[1]]), question.frame, question.reference)


def _difference(one: Array, other: Array) -> Array:
    """Exact where one holds 50-digit numbers, since doubles are exact in those."""
    if one.dtype == object or other.dtype == object:
        return np.asarray(one.astype(object) - other.astype(object))
    with np.errstate(invalid="ignore"):
        return np.asarray(one - other)
