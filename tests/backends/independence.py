"""Checks that no call to a backend affects another: not through arrays, threads or copies."""

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
"""Time [s] after which Python switches threads, so short that it happens within calls."""

AnyBackend = TypeVar("AnyBackend", bound=Backend)


def check_results_belong_to_the_caller(engine: Backend) -> None:
    """Check that neither a later call nor writing to a result changes another result or an argument."""
    first, second = motion(engine.model, seed=1), motion(engine.model, seed=2)
    before = tuple(x.copy() for x in first)
    results = all_quantities(engine, *first)
    kept = {quantity: result.copy() for quantity, result in results.items()}
    all_quantities(engine, *second)
    assert_same(results, kept)
    for result in results.values():
        result[...] = np.nan
    assert_same(all_quantities(engine, *first), kept)
    for given_array, original in zip(first, before, strict=True):
        np.testing.assert_array_equal(given_array, original)


def check_threads_get_equal_results(engine: Backend, samples: int) -> None:
    """Check the results of `THREADS` threads at once, each of which starts at another sample."""
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
    for worker, results in enumerate(found):
        for result, wanted in zip(results, expected[worker:] + expected[:worker], strict=True):
            assert_same(result, wanted)


def check_pickle_round_trip(engine: AnyBackend) -> AnyBackend:
    """Check that a pickled copy has the same class, robot and results, and return it."""
    copy: AnyBackend = pickle.loads(pickle.dumps(engine))
    assert type(copy) is type(engine)
    assert copy.model == engine.model
    assert copy._validate == engine._validate
    sample = motion(engine.model)
    assert_same(all_quantities(copy, *sample), all_quantities(engine, *sample))
    return copy
