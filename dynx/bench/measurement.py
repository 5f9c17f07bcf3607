"""One work by all ways: each is checked, then all that are right are timed in turn."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import prod
from typing import NamedTuple

import numpy as np

from dynx.bench.cases import Batch, Work, answer_shape
from dynx.bench.checking import Judge, checked_rows
from dynx.bench.implementations import Prepared, Way
from dynx.bench.timing import Times, interleaved, once
from dynx.errors import DynxError
from dynx.model import Model
from dynx.spatial.scalar import Floats

TRIAL = 64
"""Samples by which the speed of a way that is called for each sample is guessed."""

TRIALS = 3
"""So often that speed is guessed; the fastest counts."""

LONGEST_SECONDS = 0.02
"""One repetition of such a way takes about so long at most: it is timed at fewer samples otherwise."""


LOST = "lost in the noise: in a quarter of the repetitions a call took no longer than one without the work"
"""What is said where taking away what a call costs besides leaves nothing that can be relied on."""


@dataclass(frozen=True)
class Measurement:
    """What was found of one way to do a work.

    `times` are those of one sample, None where the way was not timed; `problem` then says why.
    `samples` is the number of samples in a call, `error` the largest one found before the timing, over
    the natural size of the quantity.
    """

    work: Work
    way: str
    role: str
    version: str
    threads: int
    samples: int
    error: float | None = None
    tolerance: float | None = None
    times: Times | None = None
    problem: str | None = None


def measure(work: Work, ways: Sequence[Way], batch: Batch, repetitions: int) -> list[Measurement]:
    """The measurements of all `ways` that do this work, in their order.

    `batch` holds at least ``work.batch`` samples, the first of which are used.
    """
    preparation = Preparation(work)
    candidates = [preparation.of(way, batch) for way in ways if way.does(work)]
    calls = [call for each in candidates if each.ready is not None for call in each.ready.calls]
    times = iter(interleaved(calls, repetitions))
    return [_timed(each, times) for each in candidates]


class Candidate(NamedTuple):
    """A way and what is known of it before it is timed; `ready` is None where it will not be."""

    found: Measurement
    ready: Prepared | None


def _timed(candidate: Candidate, times: Iterator[Times]) -> Measurement:
    found, ready = candidate
    if ready is None:
        return found
    of_call = next(times)
    if ready.baseline is not None:
        of_call = of_call.less(next(times))
        if of_call.quartiles[0] <= 0.0:
            return replace(found, problem=LOST)
    return replace(found, times=of_call.per(found.samples))


class Preparation:
    """Makes ways ready for one work, and checks them."""

    def __init__(self, work: Work) -> None:
        self._work = work
        self._judges: dict[tuple[Model, int], tuple[Judge, list[int]]] = {}
        self._memory = np.empty(0)

    def of(self, way: Way, batch: Batch) -> Candidate:
        """The way made ready for the samples of `batch`, unless it cannot do them or answers wrongly."""
        work = self._work
        own = way.samples(batch.first(work.batch))
        found = Measurement(work, way.name, way.role, way.version, way.threads, len(own))
        try:
            if not way.whole:
                own = own.first(self._affordable(way, own))
                found = replace(found, samples=len(own))
            out = self._answers(own)
            ready = way.prepare(work, own, out)
            # What a way leaves out must not be another's right answer.
            out.fill(np.nan)
            answers = np.reshape(np.asarray(ready.call()), out.shape)
            judge, rows = self._judge(own)
            check = judge.check(work.quantity, answers[rows])
        except DynxError as error:
            return Candidate(replace(found, problem=str(error)), None)
        found = replace(found, error=check.error, tolerance=check.tolerance)
        if check.right:
            return Candidate(found, ready)
        problem = f"wrong answer, not timed: error {check.error:.1e}, tolerance {check.tolerance:.1e}"
        return Candidate(replace(found, problem=problem), None)

    def _affordable(self, way: Way, batch: Batch) -> int:
        """How many samples fit into a repetition: all of them, or a power of two."""
        if len(batch) <= TRIAL:
            return len(batch)
        few = batch.first(TRIAL)
        trial = way.prepare(self._work, few, self._answers(few)).call
        trial()
        fastest = min(once(trial) for _ in range(TRIALS))
        count = int(LONGEST_SECONDS / max(fastest, 1e-9) * TRIAL)
        return len(batch) if count >= len(batch) else max(TRIAL, 2 ** (count.bit_length() - 1))

    def _answers(self, batch: Batch) -> Floats:
        """An array for the answers; all ways use the same memory."""
        shape = (len(batch), *answer_shape(batch.model, self._work.quantity))
        if self._memory.size < prod(shape):
            self._memory = np.empty(prod(shape))
        return self._memory[: prod(shape)].reshape(shape)

    def _judge(self, batch: Batch) -> tuple[Judge, list[int]]:
        """The judge of a batch, and the numbers of the samples it looks at."""
        key = (batch.model, len(batch))
        if key not in self._judges:
            rows = checked_rows(len(batch))
            self._judges[key] = Judge(batch.take(rows)), rows
        return self._judges[key]
