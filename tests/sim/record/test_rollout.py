"""The record: what it says, and that files keep it."""

from __future__ import annotations

import csv
import pickle
from pathlib import Path

import numpy as np
import pytest

from dynx.backends import backend
from dynx.control import ComputedTorque, GravityCompensatedPD
from dynx.errors import ArgumentError
from dynx.model import Inertial, Link, Model
from dynx.model.loading import load
from dynx.model.tree import Base
from dynx.sim import Payload, Rollout, simulate
from dynx.trajectory.base import Setpoint
from tests.sim.bars import tutorial_motion, tutorial_robot


@pytest.fixture(scope="module")
def rollout() -> Rollout:
    robot = tutorial_robot()
    return simulate(
        robot,
        ComputedTorque(robot, kp=400, kd=40),
        tutorial_motion(0.5),
        payload=Payload("tool0", 1.0),
        joint_armature=0.1,
        check_reference=False,
        effort_limits=True,
    )


def test_rows_belong_together(rollout: Rollout) -> None:
    n = len(rollout)
    assert n == 500
    assert rollout.t.shape == (n + 1,)
    assert rollout.q.shape == rollout.v.shape == (n + 1, 6)
    assert rollout.a.shape == rollout.tau.shape == rollout.saturated.shape == (n, 6)
    assert isinstance(rollout.reference, Setpoint)
    np.testing.assert_array_equal(rollout.error, rollout.reference.q - rollout.q)
    # Semi-implicit Euler, read off the record.
    np.testing.assert_array_equal(rollout.v[1:], rollout.v[:-1] + 1e-3 * rollout.a)
    np.testing.assert_array_equal(rollout.q[1:], rollout.q[:-1] + 1e-3 * rollout.v[1:])
    assert repr(rollout) == "<Rollout of ur5: 500 steps to 0.5 s>"


def test_the_recorded_torque_is_what_the_motion_took(rollout: Rollout) -> None:
    with backend("pinocchio", rollout.model) as engine:
        took = engine.inverse_dynamics(rollout.q[:-1], rollout.v[:-1], rollout.a)
    took += rollout.a @ rollout.rotors
    np.testing.assert_allclose(took, rollout.tau, atol=1e-9)


def test_energy_is_that_of_what_moved(rollout: Rollout) -> None:
    with backend("pinocchio", rollout.model) as engine:
        bodies = engine.kinetic_energy(rollout.q, rollout.v) + engine.potential_energy(rollout.q)
    rotors = 0.5 * 0.1 * np.sum(rollout.v**2, axis=1)
    np.testing.assert_allclose(rollout.energy, bodies + rotors, rtol=1e-12)


def test_a_summary_is_what_the_record_says(rollout: Rollout) -> None:
    summary = rollout.summary()
    np.testing.assert_array_equal(summary.max_error, np.abs(rollout.error).max(axis=0))
    np.testing.assert_allclose(summary.rms_error, np.linalg.norm(rollout.error, axis=0) / np.sqrt(501))
    np.testing.assert_array_equal(summary.max_torque, np.abs(rollout.tau).max(axis=0))
    assert summary.saturated == np.mean(rollout.saturated.any(axis=1))
    assert "largest error" in str(summary)


def test_a_record_without_reference() -> None:
    passive = simulate(tutorial_robot(), q0=np.zeros(6), duration=0.01)
    assert passive.reference is None
    assert np.isnan(passive.error).all()
    assert "no reference" in str(passive.summary())


def test_a_file_keeps_every_bit(rollout: Rollout, tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    rollout.save(path)
    read = Rollout.load(path)
    for name in ("t", "q", "v", "a", "tau", "saturated", "error", "energy", "rotors"):
        np.testing.assert_array_equal(getattr(read, name), getattr(rollout, name), err_msg=name)
    assert read.settings == rollout.settings
    assert read.model == rollout.model
    assert pickle.loads(pickle.dumps(rollout)).settings == rollout.settings


def test_the_table_is_for_other_programs(tmp_path: Path) -> None:
    robot = load("solo12", base="floating")
    short = simulate(robot, duration=5e-3, v0=np.linspace(0.0, 1.0, robot.nv))
    short.save(tmp_path / "run.csv")
    with (tmp_path / "run.csv").open(newline="") as file:
        header, *rows = list(csv.reader(file))
    assert len(rows) == 6
    assert header[:5] == ["t", "q:x", "q:y", "q:z", "q:qx"]
    column = header.index(f"v:{robot.joint_names[3]}")
    assert [float(row[column]) for row in rows] == short.v[:, 9].tolist()
    column = header.index(f"tau:{robot.joint_names[0]}")
    assert [row[column] for row in rows] == ["0.0"] * 5 + [""]


@pytest.mark.parametrize("name", ["run.txt", "run"])
def test_other_formats_are_refused(rollout: Rollout, tmp_path: Path, name: str) -> None:
    with pytest.raises(ArgumentError, match=r"\.npz, \.csv or \.mcap"):
        rollout.save(tmp_path / name)


def test_what_is_no_rollout_is_not_read(tmp_path: Path, rollout: Rollout) -> None:
    (tmp_path / "text.npz").write_text("nothing")
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    np.savez(tmp_path / "older.npz", schema="dynx.rollout/0")
    np.savez(tmp_path / "pickled.npz", schema=np.array(["dynx.rollout/1", None], dtype=object))
    for name in ("text.npz", "other.npz", "older.npz", "pickled.npz", "missing.npz"):
        with pytest.raises(ArgumentError, match=name):
            Rollout.load(tmp_path / name)


def test_the_beginning_of_a_record(rollout: Rollout) -> None:
    part = rollout.first(10)
    assert len(part) == 10
    np.testing.assert_array_equal(part.q, rollout.q[:11])
    with pytest.raises(ArgumentError):
        rollout.first(501)


def test_a_plot_shows_every_joint_and_the_limits(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    robot = tutorial_robot()
    law = GravityCompensatedPD(robot, kp=60, kd=6)
    moved = simulate(robot, law, np.zeros(6), q0=np.full(6, 0.3), duration=0.05)
    figure = moved.plot(tmp_path / "run.png")
    joints, errors, torques = figure.axes
    assert len(joints.lines) == 2 * robot.nv
    assert len(errors.lines) == robot.nv
    assert len(torques.lines) >= robot.nv
    np.testing.assert_array_equal(errors.lines[2].get_ydata(), moved.error[:, 2])
    named = [text.get_text() for text in torques.get_legend().get_texts()]
    assert named[: robot.nv + 1] == [*robot.joint_names, "reference"]
    assert (tmp_path / "run.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_a_robot_without_joints(base: Base, tmp_path: Path) -> None:
    stone = Model.build("stone", [Link("stone", Inertial(1.0, ixx=1, iyy=1, izz=1))], [])
    fallen = simulate(stone.with_base(base), duration=0.01)
    assert len(fallen) == 10
    assert str(fallen.summary())
    fallen.save(tmp_path / "stone.npz")
    np.testing.assert_array_equal(Rollout.load(tmp_path / "stone.npz").q, fallen.q)
