"""Batches on other processes: spawned ones and those of a Dask cluster give the bits that threads give."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dynx
from dynx import trajectory
from dynx.control.computed_torque import ComputedTorque
from dynx.sim import BatchRollouts, Noise, simulate_batch
from dynx.sim import batch as batch_module

ROLLOUTS = 23

PATIENCE = 600
"""Time [s] in which a worker process starts and connects on a machine that is busy with other tests, where
Dask's default of 30 s is too short for the imports of a new process."""


@pytest.fixture(autouse=True)
def small_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Enough parts that every worker gets some."""
    monkeypatch.setattr(batch_module, "PART", 2)


def batch(executor: Executor | None, **options: Any) -> BatchRollouts:
    """Return a batch with its own payloads, gains and noise, to be computed by any executor."""
    arm = dynx.load("ur5")
    rng = np.random.default_rng(1)
    return simulate_batch(
        arm,
        ComputedTorque(arm, kp=400, kd=40),
        trajectory.cycloidal(np.zeros(6), np.full(6, 0.3), duration=0.4),
        parametric=dynx.parametric(arm, point_payload="tool0"),
        parameters=rng.uniform(0.0, 0.2, (ROLLOUTS, 4)),
        gains={"kp": rng.uniform(200.0, 600.0, ROLLOUTS)},
        noise=Noise(1e-5, 1e-3, seed=5),
        effort_limits=True,
        record_every=100,
        executor=executor,
        **options,
    )


def equal(one: BatchRollouts, other: BatchRollouts) -> bool:
    """To the last bit."""
    return all(
        np.asarray(getattr(one, field.name)).tobytes() == np.asarray(getattr(other, field.name)).tobytes()
        for field in fields(one)
        if field.name != "scenario"
    )


@pytest.fixture
def by_threads() -> BatchRollouts:
    found = batch(None)
    assert found.done.all()
    assert len(np.unique(found.q[:, 0])) == ROLLOUTS
    return found


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    """Dask client of a cluster of two worker processes on this machine."""
    distributed = pytest.importorskip("distributed")
    dask = pytest.importorskip("dask")
    patient = {"distributed.comm.timeouts.connect": PATIENCE, "distributed.comm.timeouts.tcp": PATIENCE}
    with (
        dask.config.set(patient),
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


def spawning(processes: int) -> ProcessPoolExecutor:
    """Processes that begin with nothing."""
    return ProcessPoolExecutor(processes, mp_context=multiprocessing.get_context("spawn"))


class Deadly(Executor):
    """An executor one of whose processes is killed in the middle of its work."""

    def __init__(self, inner: Executor, once: Path) -> None:
        self._inner, self._once = inner, once

    def submit(self, work: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Give the work to the other executor."""
        return self._inner.submit(killed_once, str(self._once), work)


def killed_once(once: str, work: Callable[[], Any]) -> Any:
    """Do the work; whoever comes second does not survive it."""
    for number in range(2):
        try:
            Path(f"{once} {number}").touch(exist_ok=False)
        except FileExistsError:
            continue
        if number == 1:
            os.kill(os.getpid(), signal.SIGKILL)
        break
    return work()


def test_processes_that_are_spawned(by_threads: BatchRollouts) -> None:
    with spawning(2) as pool:
        assert equal(batch(pool), by_threads)


def test_a_dask_cluster(client: Any, by_threads: BatchRollouts) -> None:
    told: list[int] = []
    found = batch(client.get_executor(), progress=lambda done, _: told.append(done))
    assert equal(found, by_threads)
    assert told == sorted(told)
    assert told[-1] == ROLLOUTS


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
def test_a_cluster_does_the_work_of_a_worker_that_is_killed(
    client: Any, by_threads: BatchRollouts, tmp_path: Path
) -> None:
    before = set(client.run(os.getpid).values())
    found = batch(Deadly(client.get_executor(), tmp_path / "once"))
    assert equal(found, by_threads)
    client.wait_for_workers(2, timeout=PATIENCE)
    after = set(client.run(os.getpid).values())
    assert len(before & after) == 1


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
def test_a_pool_that_lost_a_process_goes_on_from_what_was_kept(
    by_threads: BatchRollouts, tmp_path: Path
) -> None:
    kept = tmp_path / "kept"
    with spawning(1) as pool, pytest.raises(BrokenProcessPool):
        batch(Deadly(pool, tmp_path / "once"), keep=kept)
    with spawning(1) as pool:
        assert equal(batch(pool, keep=kept), by_threads)
    assert len(list(kept.glob("*.npz"))) == -(-ROLLOUTS // 2)
