"""Checks that no call to a backend shows in another: not through arrays, threads or copies."""

from __future__ import annotations

import pickle
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import numpy as np

from dynx.backends import Backend
from dynx.spatial.scalar import Floats
from tests.backends.robots import all_quantities, assert_same, motion

THREADS = 8
SWITCH_INTERVAL = 1e-6
"""Between threads, so that they meet in the middle of a call [s]."""

AnyBackend = TypeVar("AnyBackend", bound=Backend)


def check_answers_belong_to_the_caller(engine: Backend) -> None:
    """Later calls change no earlier answer, nor what is written into one a later call; arguments stay."""
    first, second = motion(engine.model, seed=1), motion(engine.model, seed=2)
    before = tuple(x.copy() for x in first)
    answers = all_quantities(engine, *first)
    kept = {quantity: answer.copy() for quantity, answer in answers.items()}
    all_quantities(engine, *second)
    assert_same(answers, kept)
    for answer in answers.values():
        answer[...] = np.nan
    assert_same(all_quantities(engine, *first), kept)
    for given_array, original in zip(first, before, strict=True):
        np.testing.assert_array_equal(given_array, original)


def check_threads_get_what_one_gets(engine: Backend, samples: int) -> None:
    """`THREADS` threads begin at once, each with another sample, and all go through all samples."""
    states = [motion(engine.model, seed) for seed in range(samples)]
    expected = [all_quantities(engine, *state) for state in states]
    together = threading.Barrier(THREADS)

    def work(worker: int) -> list[dict[str, Floats]]:
        together.wait()
        return [all_quantities(engine, *state) for state in states[worker:] + states[:worker]]

    interval = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH_INTERVAL)
    try:
        with ThreadPoolExecutor(THREADS) as pool:
            found = list(pool.map(work, range(THREADS)))
    finally:
        sys.setswitchinterval(interval)
    for worker, answers in enumerate(found):
        for answer, wanted in zip(answers, expected[worker:] + expected[:worker], strict=True):
            assert_same(answer, wanted)


def check_pickle_makes_the_same(engine: AnyBackend) -> AnyBackend:
    """A copy by way of pickle is of the same kind, for the same robot, and of one answer; it is returned."""
    copy: AnyBackend = pickle.loads(pickle.dumps(engine))
    assert type(copy) is type(engine)
    assert copy.model == engine.model
    assert copy._validate == engine._validate
    sample = motion(engine.model)
    assert_same(all_quantities(copy, *sample), all_quantities(engine, *sample))
    return copy
