"""Batches of rollouts: each is the rollout that `simulate` computes, however they are dealt out."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dynx
from dynx import trajectory
from dynx.control.base import Controller, Measurement
from dynx.control.computed_torque import ComputedTorque, DiscreteComputedTorque
from dynx.control.joint_space import PD, PID, FeedForward, GravityCompensatedPD
from dynx.control.saturation import Saturated
from dynx.errors import ArgumentError, DivergedError, UnsupportedFeatureError
from dynx.model import Model
from dynx.sim import Noise, simulate
from dynx.sim import batch as batch_module
from dynx.sim.batch import BatchInterrupted, BatchPart, PartOutcome, simulate_batch
from dynx.sim.batch_rollouts import BatchRollouts
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint, Trajectory
from tests.sim.bars import EXACT_ON_DYNX, apart
from tests.sim.batch.batches import assert_same, batch_and_one

DT = 1e-3
STEPS = 60


@pytest.fixture(scope="module")
def arm() -> Model:
    return dynx.load("ur5")


@pytest.fixture(scope="module")
def reference(arm: Model) -> Trajectory:
    return trajectory.cycloidal(np.zeros(arm.nq), np.linspace(-0.05, 0.05, arm.nq), duration=DT * STEPS)


def laws(arm: Model) -> dict[str, Controller[Any]]:
    return {
        "computed torque": ComputedTorque(arm, kp=400, kd=40),
        "discrete": DiscreteComputedTorque(arm, control_dt=DT),
        "feed-forward": FeedForward(arm),
        "gravity": GravityCompensatedPD(arm, kp=200, kd=20),
        "pd": PD(arm, kp=200, kd=20),
        "pid": PID(arm, kp=200, ki=50, kd=20, control_dt=DT),
        "saturated": Saturated(ComputedTorque(arm, kp=400, kd=40), limit=30.0),
    }


def close(found: Floats, wanted: Floats) -> bool:
    """Check that the results of two steppers of dynx differ by rounding only."""
    return apart(found, wanted) < EXACT_ON_DYNX


@pytest.mark.parametrize("name", list(laws(dynx.load("ur5"))))
def test_a_rollout_is_that_of_simulate(arm: Model, reference: Trajectory, name: str) -> None:
    law = laws(arm)[name]
    many, _ = batch_and_one(arm, law, reference, dt=DT)
    # Pinocchio, by its own algorithms, moves it alike.
    assert_same(many, 0, simulate(arm, law, reference, dt=DT))


def test_a_law_asked_at_some_steps_only(arm: Model, reference: Trajectory) -> None:
    for law in (ComputedTorque(arm, kp=400, kd=40), PID(arm, kp=200, ki=50, kd=20, control_dt=5 * DT)):
        one = simulate(arm, law, reference, dt=DT, control_dt=5 * DT, effort_limits=True)
        many = simulate_batch(
            arm, law, reference, dt=DT, control_dt=5 * DT, rollouts=2, record_every=20, effort_limits=True
        )
        assert close(many.q_record[1], one.q[20::20])
        assert np.allclose(many.t, one.t[20::20])


def equal(one: BatchRollouts, other: BatchRollouts) -> bool:
    return one.scenario == other.scenario and all(
        np.array_equal(getattr(one, field.name), getattr(other, field.name), equal_nan=True)
        for field in fields(one)
        if field.name != "scenario"
    )


def test_ctrl_c_keeps_what_is_done(
    arm: Model, reference: Trajectory, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(batch_module, "PART", 4)
    law = PD(arm, kp=200, kd=20)
    starts = np.linspace(0.0, 0.01, 16)[:, None] * np.ones(6)
    whole = simulate_batch(arm, law, reference, q0=starts, dt=DT)

    def stop(done: int, asked: int) -> None:
        assert asked == 16
        raise KeyboardInterrupt

    with pytest.raises(BatchInterrupted) as caught:
        simulate_batch(arm, law, reference, q0=starts, dt=DT, threads=1, keep=tmp_path, progress=stop)
    part = caught.value.rollouts
    assert 4 <= part.done.sum() <= 16
    assert str(caught.value) == f"interrupted with {part.done.sum()} of 16 rollouts done"
    assert np.array_equal(part.q[part.done], whole.q[part.done])
    assert np.isnan(part.q[~part.done]).all()
    assert np.isfinite(part.quantiles()).all()

    kept = len(list(tmp_path.glob("*.npz")))
    assert kept >= 1
    computed: list[int] = []
    does = BatchPart.__call__

    def counted(part: BatchPart) -> PartOutcome:
        computed.append(part.count)
        return does(part)

    monkeypatch.setattr(BatchPart, "__call__", counted)
    again = simulate_batch(arm, law, reference, q0=starts, dt=DT, keep=tmp_path)
    assert equal(again, whole)
    assert len(computed) == 4 - kept


KILLED = """
import os, signal, sys, numpy as np, dynx
from dynx import trajectory
from dynx.control.joint_space import PD
from dynx.sim import batch
batch.PART = 4
arm = dynx.load("ur5")
reference = trajectory.cycloidal(np.zeros(6), np.full(6, 0.05), duration=0.06)
def kill(done, asked):
    print(done, flush=True)
    if done >= 8 and sys.argv[2] == "kill":
        os.kill(os.getpid(), signal.SIGKILL)
starts = np.linspace(0.0, 0.01, 16)[:, None] * np.ones(6)
found = batch.simulate_batch(arm, PD(arm, kp=200, kd=20), reference, q0=starts, threads=1,
                             keep=sys.argv[1], progress=kill)
print("done", int(found.done.sum()))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
def test_a_killed_run_goes_on_from_what_was_kept(tmp_path: Path) -> None:
    def run(mode: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-c", KILLED, str(tmp_path), mode]
        return subprocess.run(command, capture_output=True, text=True, check=False)

    killed = run("kill")
    assert killed.returncode == -9, killed.stderr
    kept = len(list(tmp_path.glob("*.npz")))
    assert kept >= 2
    (tmp_path / "half.part").write_bytes(b"PK")
    again = run("on")
    assert again.stdout.split()[-2:] == ["done", "16"], again.stderr
    assert again.stdout.split()[kept - 1] == str(4 * kept)


def test_a_rollout_that_diverges_leaves_the_others_alone(arm: Model) -> None:
    reference = trajectory.cycloidal(np.zeros(6), np.full(6, 0.05), duration=0.5)
    gains = np.array([200.0, 1e7, 200.0])
    # Stops would bound the motion.
    options: dict[str, Any] = {"dt": DT, "joint_limits": False}
    found = simulate_batch(arm, ComputedTorque(arm, kp=1.0, kd=40), reference, gains={"kp": gains}, **options)
    assert np.isnan(found.diverged[[0, 2]]).all()
    with pytest.raises(DivergedError) as alone:
        simulate(arm, ComputedTorque(arm, kp=1e7, kd=40), reference, plant="compiled", **options)
    assert found.diverged[1] == alone.value.time
    assert found.worst[1] == np.inf
    assert np.isfinite(found.worst[[0, 2]]).all()


def test_a_file_gives_them_back(arm: Model, reference: Trajectory, tmp_path: Path) -> None:
    found = simulate_batch(arm, PD(arm, kp=200, kd=20), reference, rollouts=3, dt=DT, record_every=30)
    found.save(tmp_path / "many.npz")
    again = dynx.BatchRollouts.load(tmp_path / "many.npz")
    assert equal(found, again)
    with pytest.raises(ArgumentError, match=r"'dynx\.rollouts/2', which dynx\.BatchRollouts\.load reads"):
        dynx.Rollout.load(tmp_path / "many.npz")
    simulate(arm, PD(arm, kp=200, kd=20), reference, plant="compiled", duration=DT, dt=DT).save(
        tmp_path / "one.npz"
    )
    with pytest.raises(ArgumentError, match=r"'dynx\.rollout/2', which dynx\.Rollout\.load reads"):
        dynx.BatchRollouts.load(tmp_path / "one.npz")
    assert again.joint_names == found.joint_names == tuple(arm.joint_names)
    for other in ("many.txt", "none.npz"):
        with pytest.raises(ArgumentError):
            found.save(tmp_path / other) if other == "many.txt" else BatchRollouts.load(tmp_path / other)


class Branching(Controller[None]):
    """A law that asks which way it goes."""

    def __init__(self, model: Model) -> None:
        self.model = model

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        return (measurement.v if measurement.q[0] > 0.0 else -measurement.v), None


def test_what_cannot_be_a_batch_is_refused(arm: Model, reference: Trajectory) -> None:
    pd = PD(arm, kp=200, kd=20)
    plant = dynx.parametric(arm, point_payload="tool0")
    bad: list[tuple[type[Exception], str, Controller[Any], dict[str, Any]]] = [
        (UnsupportedFeatureError, r"branches on a traced value.*\(test_batch\.py, line", Branching(arm), {}),
        (ArgumentError, "no gain", pd, {"gains": {"kpp": 1.0}}),
        (ArgumentError, "rollouts is", pd, {"rollouts": 0}),
        (ArgumentError, "2 rows", pd, {"rollouts": 3, "q0": np.zeros((2, 6))}),
        (ArgumentError, "without the model", pd, {"parameters": np.zeros((2, 4))}),
        (ArgumentError, "parameters", pd, {"parametric": plant, "parameters": np.zeros((2, 3))}),
        (ArgumentError, "record_every", pd, {"record_every": -1}),
        (ArgumentError, "dt is", pd, {"dt": 0.0}),
        (ArgumentError, "multiple", pd, {"control_dt": 1.5 * DT}),
        (ArgumentError, "threads", pd, {"threads": 0}),
        (ArgumentError, "was made for control_dt", DiscreteComputedTorque(arm, control_dt=2e-3), {}),
        (ArgumentError, "seed", pd, {"noise": Noise(1e-3, 1e-3, seed=-1)}),
    ]
    for error, said, law, options in bad:
        with pytest.raises(error, match=said):
            simulate_batch(arm, law, reference, **{"dt": DT, **options})
    floating = dynx.load("ur5", base="floating")
    with pytest.raises(ArgumentError, match="the controller is one of"):
        simulate_batch(floating, pd, floating.neutral(), duration=0.01)
