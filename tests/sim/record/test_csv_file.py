"""Tables of rollouts and logs of robots are read to the last bit, or refused with line and column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import dynx
from dynx.control import PD
from dynx.errors import ArgumentError
from dynx.model.tree import Base
from dynx.sim import Rollout, simulate

ARM = dynx.load("dynx_double_pendulum")


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_a_table_of_dynx_keeps_every_bit(tmp_path: Path, base: Base) -> None:
    robot = dynx.load("six_axis_arm", base=base)
    start = robot.random(3)
    rollout = simulate(robot, None, q0=start, plant="compiled", duration=0.05)
    rollout.save(tmp_path / "run.csv")
    read = Rollout.load(tmp_path / "run.csv", robot)
    for name in ("t", "q", "v", "a", "tau"):
        np.testing.assert_array_equal(getattr(read, name), getattr(rollout, name))
    assert read.scenario is None


def test_a_log_of_positions_has_rates_by_differences(tmp_path: Path) -> None:
    t = np.linspace(0.0, 1.0, 101)
    q = np.column_stack([t**2, -3.0 * t])
    path = tmp_path / "log.csv"
    header = "stamp, time," + ",".join(ARM.joint_names)
    np.savetxt(path, np.column_stack([np.arange(101), t, q]), delimiter=",", header=header, comments="")
    read = Rollout.load(path, ARM)
    np.testing.assert_allclose(read.v[1:-1], np.column_stack([2.0 * t, np.full(101, -3.0)])[1:-1], atol=1e-12)
    assert np.isnan(read.tau).all()
    assert len(read) == 100


def test_rates_of_a_floating_base_are_in_its_axes(tmp_path: Path) -> None:
    robot = dynx.load("dynx_double_pendulum", base="floating")
    v = np.array([0.3, -0.1, 0.2, 0.5, 0.4, -0.6, 1.0, 2.0])
    t = np.linspace(0.0, 0.1, 101)
    q = robot.integrate(robot.random(1), t[:, None] * v)
    columns = ["x", "y", "z", "qx", "qy", "qz", "qw", *robot.joint_names]
    header = "t," + ",".join(f"q:{each}" for each in columns)
    np.savetxt(
        tmp_path / "log.csv",
        np.column_stack([t, q]),
        delimiter=",",
        header=header,
        comments="",
        fmt="%.17g",
    )
    read = Rollout.load(tmp_path / "log.csv", robot)
    np.testing.assert_allclose(read.v, np.tile(v, (101, 1)), atol=1e-6)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "is empty"),
        ("t,q:shoulder\n0,0\n1,0\n", "has no column 'q:elbow' or 'elbow'"),
        ("q:shoulder,q:elbow\n0,0\n", "has no column 't' or 'time' or 'timestamp'"),
        ("t,shoulder,elbow\n0,0,0\n1,x,0\n", ":3: column 'shoulder' has 'x'; wanted a number"),
        ("t,shoulder,elbow\n0,0,0\n1,nan,0\n", ":3: column 'shoulder' has 'nan'; wanted a finite number"),
        ("t,shoulder,elbow\n0,0,0\n1,0\n", ":3: column 'elbow' has ''; wanted a number"),
        ("t,shoulder,elbow\n0,0,0\n1,0,0\n\n1,0,0\n", ":5: the time 1 s follows 1 s; wanted times"),
        ("t,shoulder,elbow\n0,0,0\n", "has too few rows of numbers (1); wanted 2 or more"),
        ("t;shoulder;elbow\n0;0,5;0\n", "is separated by ';'; wanted commas between columns"),
        ("t,shoulder,elbow,shoulder\n0,0,0,1\n1,0,0,1\n", "has 2 columns 'shoulder'; wanted one"),
        ("t,shoulder,elbow\n0,1e200,0\n1,0,0\n", "has invalid positions: q[0, 0] is 1e+200"),
    ],
)
def test_what_is_no_log_is_refused_with_its_place(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "log.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ArgumentError) as raised:
        Rollout.load(path, ARM)
    assert said in str(raised.value)
    assert "log.csv" in str(raised.value)


def test_velocities_of_some_joints_are_read_and_those_of_the_others_computed(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(
        "t,shoulder,elbow,v:elbow,tau:shoulder\n0,0,0,7,5\n1,2,4,8,6\n2,4,8,9,\n", encoding="utf-8"
    )
    read = Rollout.load(path, ARM)
    np.testing.assert_array_equal(read.v, [[2.0, 7.0], [2.0, 8.0], [2.0, 9.0]])
    np.testing.assert_array_equal(read.a, [[0.0, 1.0], [0.0, 1.0]])
    np.testing.assert_array_equal(read.tau, [[5.0, np.nan], [6.0, np.nan]])


def test_a_quaternion_of_another_length_is_refused_with_the_file(tmp_path: Path) -> None:
    robot = dynx.load("dynx_double_pendulum", base="floating")
    columns = ["x", "y", "z", "qx", "qy", "qz", "qw", *robot.joint_names]
    lines = ["t," + ",".join(f"q:{each}" for each in columns), "0,0,0,0,0,0,0,1,0,0", "1,0,0,0,0,0,0,2,0,0"]
    (tmp_path / "log.csv").write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(ArgumentError, match=r"log\.csv' has invalid positions: .*length 2; wanted length 1"):
        Rollout.load(tmp_path / "log.csv", robot)


def test_robots_are_given_for_tables_only(tmp_path: Path) -> None:
    rollout = simulate(ARM, None, plant="compiled", duration=0.002)
    rollout.save(tmp_path / "run.csv")
    rollout.save(tmp_path / "run.npz")
    with pytest.raises(ArgumentError, match="does not have its robot: give it as model="):
        Rollout.load(tmp_path / "run.csv")
    with pytest.raises(ArgumentError, match=r"has its robot; model= is for \.csv files"):
        Rollout.load(tmp_path / "run.npz", ARM)
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(ArgumentError, match="is a directory"):
        Rollout.load(tmp_path / "folder.csv", ARM)


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_columns_are_those_of_the_table(tmp_path: Path, base: Base) -> None:
    robot = dynx.load("six_axis_arm", base=base)
    rollout = simulate(robot, None, robot.random(3), plant="compiled", duration=0.05, check_reference=False)
    found = rollout.columns()
    rollout.save(tmp_path / "run.csv")
    header = (tmp_path / "run.csv").read_text(encoding="utf-8").splitlines()[0].split(",")
    assert set(found) == {*header} - {"energy"}
    table = np.genfromtxt(tmp_path / "run.csv", delimiter=",", skip_header=1)
    for name, column in found.items():
        np.testing.assert_array_equal(column, table[:, header.index(name)])


def test_columns_of_a_batch_have_a_row_for_each_rollout() -> None:
    many = dynx.simulate_batch(ARM, PD(ARM, kp=1.0, kd=0.1), np.zeros(2), q0=ARM.random(1, 3), duration=0.01)
    found = many.columns()
    assert all(len(column) == 3 for column in found.values())
    np.testing.assert_array_equal(found["q:elbow"], many.q[:, 1])
    np.testing.assert_array_equal(found["worst"], many.worst)
