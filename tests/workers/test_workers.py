"""Worker processes: only the task that kills its process is marked, and the rest is done."""

from __future__ import annotations

import signal
import threading
import time

import pytest

from dynx.agreement import results_document
from dynx.agreement.agreement import AgreementTask
from dynx.cli.agree import agreement_run
from dynx.workers import WorkerFailure, Workers
from tests.workers.targets import act, crash_on_panda


def outcomes(tasks: list[str], size: int = 2, timeout: float | None = None) -> list[object]:
    """Return the outcome of each task, in order: its name, or the failure."""
    found: list[object] = [None] * len(tasks)
    with Workers(act, size, timeout) as workers:
        for outcome in workers.run(tasks):
            found[outcome.index] = outcome.failure or outcome.value[0]
    return found


@pytest.mark.parametrize(("deadly", "message"), [("segfault", "SIGSEGV"), ("exit", "exit code 7")])
def test_only_the_culprit_of_a_crash_is_marked(deadly: str, message: str) -> None:
    found = outcomes(["a", deadly, "b", "c", deadly, "d"])
    assert [found[k] for k in (0, 2, 3, 5)] == ["a", "b", "c", "d"]
    for k in (1, 4):
        failure = found[k]
        assert isinstance(failure, WorkerFailure)
        assert failure.kind == "crash"
        assert message in failure.message


def test_a_hang_is_ended_and_the_rest_is_done() -> None:
    found = outcomes(["a", "hang", "b"], size=1, timeout=3.0)
    assert found[0] == "a"
    assert found[2] == "b"
    assert isinstance(found[1], WorkerFailure)
    assert found[1].kind == "timeout"


def test_the_import_of_the_target_is_not_part_of_the_first_task() -> None:
    from tests.workers.slow_import import name_of

    with Workers(name_of, 1, timeout=2.0) as workers:
        assert [outcome.value for outcome in workers.run(["a", "b"])] == ["a", "b"]


def test_an_exception_and_printing_are_survived_by_the_process() -> None:
    with Workers(act, 1) as workers:
        values = list(workers.run(["a", "raise", "print", "b"]))
    assert values[1].failure == WorkerFailure("defect", "ZeroDivisionError: no reason")
    assert values[0].value[1] == values[2].value[1] == values[3].value[1]


def test_the_next_call_has_the_same_processes() -> None:
    with Workers(act, 1) as workers:
        (first,) = workers.run(["a"])
        (second,) = workers.run(["b"])
        assert first.value[1] == second.value[1]
        (deadly,) = workers.run(["exit"])
        assert deadly.failure is not None
        (third,) = workers.run(["c"])
        assert third.value[0] == "c"


def test_leaving_ends_what_is_under_way() -> None:
    started = time.monotonic()
    with Workers(act, 2) as workers:
        running = workers.run(["hang", "a", "hang"])
        next(running)
    assert time.monotonic() - started < 30.0


@pytest.mark.skipif(not hasattr(signal, "pthread_kill"), reason="no signal to one thread")
def test_ctrl_c_is_noticed_where_another_thread_receives_it() -> None:
    started = time.monotonic()
    timer = threading.Timer(0.5, lambda: signal.pthread_kill(threading.get_ident(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt), Workers(act, 1, timeout=60.0) as workers:
        list(workers.run(["hang"]))
    assert time.monotonic() - started < 30.0


def test_an_engine_crash_is_an_entry_of_the_document() -> None:
    tasks = [AgreementTask(name, "fixed", (), ("reference",), 1, 0) for name in ("ur5", "panda", "z1")]
    run = agreement_run(tasks, crash_on_panda)
    run.measure(1, 120.0, show_progress=False)
    made = results_document(run.results, run.not_done)
    assert made["summary"] == {"robots": 3, "agree": 2, "differ": 0, "refused": 1, "not_done": 0}
    assert [entry["robot"] for entry in made["results"]] == ["ur5", "panda", "z1"]
    assert made["results"][1]["error"]["type"] == "EngineCrash"
    assert made["not_done"] == []
