"""Distances over time equal those that NumPy gives, at the times that two records have in common."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dynx
from dynx import control
from dynx.errors import ArgumentError
from dynx.sim import Rollout, compare, simulate, simulate_batch
from dynx.sim.comparison import rollout_separation

ARM = dynx.load("double_pendulum_continuous")
OURS = simulate(ARM, None, q0=[0.5, 0.2], plant="compiled", duration=0.2)
THEIRS = simulate(ARM, None, q0=[0.5, 0.2], plant="compiled", duration=0.2, joint_damping=0.01)


def log(path: Path, t: np.ndarray, q: np.ndarray) -> Rollout:
    """Return the rollout of a table with these times and positions."""
    np.savetxt(
        path,
        np.column_stack([t, q]),
        delimiter=",",
        header="t," + ",".join(ARM.joint_names),
        comments="",
        fmt="%.17g",
    )
    return Rollout.load(path, ARM)


def test_a_log_at_other_times_is_interpolated_as_numpy_does(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    t = np.sort(rng.uniform(0.01, 0.3, 40))
    q = np.column_stack([np.sin(9.0 * t), np.cos(7.0 * t)])
    read = log(tmp_path / "log.csv", t, q)
    apart = rollout_separation(OURS, read)
    inside = t <= OURS.t[-1]
    np.testing.assert_array_equal(apart.times, t[inside])
    ours = np.column_stack([np.interp(t[inside], OURS.t, OURS.q[:, k]) for k in range(2)])
    expected = np.abs(ours - q[inside])
    np.testing.assert_allclose(apart.distances, expected, atol=1e-13)
    np.testing.assert_array_equal(apart.distances, rollout_separation(read, OURS).distances)
    k = int(np.argmax((expected > 0.3).any(axis=1)))
    assert apart.first_beyond(0.3) == (t[inside][k], ARM.joint_names[int(np.argmax(expected[k]))])
    row, column = np.unravel_index(int(np.argmax(expected)), expected.shape)
    assert apart.farthest == (int(row), int(column))


def test_a_log_in_milliseconds_is_not_like_the_simulation(tmp_path: Path) -> None:
    read = log(tmp_path / "log.csv", 1e3 * OURS.t[::10], OURS.q[::10])
    for apart in (rollout_separation(OURS, read), rollout_separation(read, OURS)):
        np.testing.assert_array_equal(apart.times, OURS.t)
        expected = [np.interp(OURS.t, read.t, read.q[:, k]) for k in range(2)]
        np.testing.assert_allclose(apart.distances, np.abs(OURS.q - np.column_stack(expected)), atol=1e-15)
        assert apart.largest > 1e-3


def test_times_of_a_clock_are_shown_to_the_last_digit() -> None:
    late = replace(OURS, t=OURS.t + 1764251202.25)
    with pytest.raises(ArgumentError, match=r"from 1764251202\.25 to 1764251202\.45 s, the other from 0"):
        rollout_separation(late, OURS)


@pytest.mark.parametrize("tolerance", [np.nan, np.inf, -1.0, "1e-3", None, True])
def test_an_invalid_tolerance_is_refused(tolerance: float) -> None:
    with pytest.raises(ArgumentError, match=r"tolerance is .*; wanted a number of rad or m, 0 or more"):
        compare(OURS, THEIRS, tolerance=tolerance)


def test_anything_but_a_rollout_is_refused() -> None:
    law = control.PD(ARM, kp=1.0, kd=0.1)
    many = simulate_batch(ARM, law, np.zeros(2), q0=ARM.random(1, 3), duration=0.01, plant="compiled")
    for other in (many, "b.npz", None):
        with pytest.raises(ArgumentError, match=r"theirs is of type .*; wanted a dynx\.Rollout"):
            compare(OURS, other)  # type: ignore[call-overload]


@pytest.mark.parametrize("count", [1, 2, 3])
def test_progress_ends_with_the_last_rerun(count: int) -> None:
    options: dict[str, Any] = dict(
        list({"joint_damping": 0.01, "joint_armature": 0.1, "joint_friction": 0.001}.items())[:count]
    )
    assert THEIRS.scenario is not None
    plain: dict[str, Any] = {"joint_damping": False}
    theirs = simulate(replace(THEIRS.scenario, **(plain | options)))
    calls: list[tuple[int, int]] = []
    found = compare(OURS, theirs, progress=lambda *each: calls.append(each))
    assert found.proved
    assert len(found.causes) == count
    total = 2 + 2 * count if count > 2 else 2**count
    assert calls == [(k, total) for k in range(1, total + 1)]
