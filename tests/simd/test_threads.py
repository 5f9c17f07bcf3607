"""Parts of a task on several threads."""

from __future__ import annotations

import threading
from collections import Counter

import pytest

from dynx.errors import ArgumentError
from dynx.simd.machine import core_count
from dynx.simd.threads import checked_threads, run_parts


@pytest.mark.parametrize("threads", [1, 2, 5, 50])
@pytest.mark.parametrize("parts", [0, 1, 2, 7, 300])
def test_every_part_runs_once(parts: int, threads: int) -> None:
    done: list[int] = []
    run_parts(done.append, parts, threads)
    assert Counter(done) == Counter(range(parts))


def test_one_thread_is_the_callers_own() -> None:
    used: set[int] = set()
    run_parts(lambda part: used.add(threading.get_ident()), 20, 1)
    assert used == {threading.get_ident()}


def test_parts_run_at_the_same_time() -> None:
    """Each of two parts waits for the other to have begun."""
    meeting = threading.Barrier(2)
    run_parts(lambda part: meeting.wait(30), 2, 2)


def test_at_most_the_given_number_of_threads() -> None:
    most, now, lock = 0, 0, threading.Lock()
    step = threading.Event()

    def task(part: int) -> None:
        nonlocal most, now
        with lock:
            now += 1
            most = max(most, now)
        step.wait(0.001)
        with lock:
            now -= 1

    run_parts(task, 40, 2)
    assert 1 <= most <= 2


@pytest.mark.parametrize("threads", [1, 3])
def test_an_exception_reaches_the_caller(threads: int) -> None:
    def task(part: int) -> None:
        if part == 4:
            raise ValueError("part 4")

    with pytest.raises(ValueError, match="part 4"):
        run_parts(task, 9, threads)
    done: list[int] = []
    run_parts(done.append, 9, threads)
    assert sorted(done) == list(range(9))


def test_many_callers_share_the_threads() -> None:
    found: list[list[int]] = []

    def caller() -> None:
        done: list[int] = []
        run_parts(done.append, 50, 4)
        found.append(sorted(done))

    callers = [threading.Thread(target=caller) for _ in range(8)]
    for each in callers:
        each.start()
    for each in callers:
        each.join()
    assert found == [list(range(50))] * 8


def test_parts_within_parts() -> None:
    """A part that starts parts of its own does not wait for a thread that runs its caller."""
    done: list[int] = []
    run_parts(lambda part: run_parts(done.append, 3, 4), 6, 4)
    assert Counter(done) == Counter([0, 1, 2] * 6)


def test_numbers_of_threads() -> None:
    assert checked_threads(None) == core_count() >= 1
    assert checked_threads(3) == 3
    for odd in (0, -1, 1.5, "2", True):
        with pytest.raises(ArgumentError, match="threads is"):
            checked_threads(odd)
