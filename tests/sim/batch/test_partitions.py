"""A rollout of a batch is the same bits in every batch, part, thread, process and number of lanes.

A vector longer than the processor's registers is divided, and LLVM then joins other products and sums into
one operation (``contract``). dynx never uses one: `Processor.lanes` is what a register holds.
"""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dynx import ExternalForce
from dynx.compiled import step as step_module
from dynx.control import PID, FrictionCompensation
from dynx.errors import ArgumentError
from dynx.model.loading import load
from dynx.sim import BatchRollouts, Noise, simulate_batch
from dynx.sim import batch as batch_module
from dynx.sim.closed_loop import Sensors
from dynx.simd.cache import load_kernel
from dynx.simd.emit import Settings
from dynx.simd.target import host
from dynx.spatial.scalar import Floats
from dynx.steppers.clock import Clock
from dynx.steppers.random import BLOCK_STEPS

ARM = load("ur5")
POSTURE = np.array([0.3, -1.2, 1.0, 0.2, 0.4, 0.1])
ROLLOUTS = 40
NOISE = Noise(1e-4, 1e-3, seed=11)
STEPS = 2 * (2 * BLOCK_STEPS + 3)
"""Control steps of three blocks of noise, with two steps each."""
OPTIONS: dict[str, Any] = {
    "duration": STEPS * 1e-3,
    "control_dt": 2e-3,
    "delay": 3e-3,
    "effort_limits": [150, 35, 18, 2.5, 2, 2],
    "pushes": [ExternalForce("tool0", [10, 5, 0, 1, 0, 0], 0.02, 0.02)],
    "joint_friction": 0.2,
    "record_every": 40,
}


def batch(rows: slice = slice(None), *, noise: Noise = NOISE, **options: Any) -> BatchRollouts:
    """Rollouts of a batch of `ROLLOUTS` that differ in gains, starts, damping and noise."""
    rng = np.random.default_rng(3)
    gains, damping = rng.uniform(30, 60, (2, ROLLOUTS, 6))
    starts = POSTURE + rng.uniform(-0.05, 0.05, (ROLLOUTS, 6))
    pid = PID(ARM, kp=60, ki=20, kd=6, control_dt=2e-3)
    return simulate_batch(
        ARM,
        FrictionCompensation(pid, damping=0.1, friction=0.1),
        POSTURE,
        gains={"kp": gains[rows]},
        joint_damping=0.01 * damping[rows],
        q0=starts[rows],
        noise=noise,
        **{**OPTIONS, **options},
    )


@cache
def whole() -> BatchRollouts:
    """Return the whole batch in one part; computed before a test changes the size of parts."""
    return batch(threads=1)


def assert_rows(found: BatchRollouts, rows: slice) -> None:
    """Every array of `found` is that of the whole batch, bit for bit."""
    for field in fields(found):
        if field.name == "scenario":
            continue
        one, other = (np.asarray(getattr(each, field.name)) for each in (found, whole()))
        if field.name not in ("t", "own_parameters"):
            other = other[rows]
        assert one.tobytes() == np.ascontiguousarray(other).tobytes(), field.name


@settings(max_examples=15)
@given(
    first=st.integers(0, ROLLOUTS - 1),
    count=st.integers(1, ROLLOUTS),
    part=st.integers(1, ROLLOUTS + 1),
    threads=st.integers(1, 3),
    lanes=st.sampled_from([lanes for lanes in (2, 4, 8) if lanes <= host().lanes]),
)
def test_rows_of_a_batch_do_not_depend_on_its_partition(
    first: int, count: int, part: int, threads: int, lanes: int
) -> None:
    rows = slice(first, min(first + count, ROLLOUTS))
    whole()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(batch_module, "PART", part)
        patch.setattr(step_module, "_kernels", {})
        patch.setattr(
            step_module, "load_kernel", lambda *given: load_kernel(*given, settings=Settings(lanes))
        )
        assert_rows(batch(rows, noise=replace(NOISE, rollout=first), threads=threads), rows)


def noise_rows(noise: Noise, n_controls: int) -> Floats:
    rows = Sensors(ARM, Clock(1e-3, n_controls, 1, 0), noise).noise
    assert rows is not None
    return np.stack(rows, axis=1)


@given(
    seed=st.integers(0, 2**70),
    rollout=st.integers(0, 2**40),
    long=st.integers(1, 3 * BLOCK_STEPS),
    short=st.integers(1, 3 * BLOCK_STEPS),
)
def test_the_noise_of_a_control_step_does_not_depend_on_the_number_of_steps(
    seed: int, rollout: int, long: int, short: int
) -> None:
    short, long = sorted((short, long))
    noise = Noise(1.0, 1.0, seed, rollout)
    rows = noise_rows(noise, long)
    np.testing.assert_array_equal(noise_rows(noise, short), rows[:short])
    for other in (replace(noise, seed=seed + 1), replace(noise, rollout=rollout + 1)):
        assert not np.isin(noise_rows(other, short), rows).any()
    assert len(np.unique(rows)) == rows.size


def test_noise_is_normal_and_independent_between_rollouts() -> None:
    n, nv = 200, 6
    drawn = np.array([noise_rows(Noise(1.0, 1.0, 5, rollout), 100) for rollout in range(n)])
    count = drawn.size
    # Five standard errors of each estimate.
    assert abs(drawn.mean()) < 5 / np.sqrt(count)
    assert abs(drawn.std() - 1.0) < 5 / np.sqrt(2 * count)
    assert abs((drawn**4).mean() - 3.0) < 5 * np.sqrt(96 / count)
    neighbours = (drawn[1:] * drawn[:-1]).mean(), (drawn[:, 1:] * drawn[:, :-1]).mean()
    assert np.abs(neighbours).max() < 5 / np.sqrt(count - count / 100)
    assert drawn.shape == (n, 100, 2, nv)


def test_an_invalid_seed_or_rollout_is_refused() -> None:
    for name in ("seed", "rollout"):
        wrongs: list[Any] = [-1, 1.5, True]
        for wrong in wrongs:
            with pytest.raises(ArgumentError, match=rf"{name} is .*; wanted a whole number, at least 0"):
                noise_rows(Noise(**{"q": 1e-4, name: wrong}), 1)
