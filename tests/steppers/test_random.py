"""One source of random numbers for rollouts, batches and environments: NumPy's Philox, by its definition."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import dynx
from dynx.envs.environment import TaskEnvironment
from dynx.envs.tasks.cart_pole import CartPole
from dynx.envs.vector import RobotVectorEnvironment
from dynx.sim import Noise, simulate, simulate_batch
from dynx.steppers.random import BLOCK_STEPS, Purpose, Streams, step_normals


def generator(seed: int, lane: int, purpose: int, block: int) -> np.random.Generator:
    """Return NumPy's generator of a block, from the definition of its key and counter."""
    key = np.array([np.random.SeedSequence(seed).generate_state(1, np.uint64)[0], lane], dtype=np.uint64)
    counter = np.array([0, 0, purpose, block], dtype=np.uint64)
    return np.random.Generator(np.random.Philox(key=key, counter=counter))


@pytest.mark.parametrize("purpose", list(Purpose))
@pytest.mark.parametrize(("seed", "lane", "block"), [(0, 0, 0), (7, 2**53 + 1, 3), (2**70, 2**63, 2**40)])
def test_a_block_has_the_numbers_of_numpy(purpose: Purpose, seed: int, lane: int, block: int) -> None:
    streams, out = Streams(99, seed), np.empty((BLOCK_STEPS, 3))
    streams.normal(purpose, lane, block, out, row=1)
    np.testing.assert_array_equal(
        out, generator(seed, lane, purpose, block).standard_normal((BLOCK_STEPS, 3))
    )
    streams.uniform(purpose, lane, block, out, row=1)
    np.testing.assert_array_equal(out, generator(seed, lane, purpose, block).random((BLOCK_STEPS, 3)))


def test_numbers_of_steps_do_not_depend_on_the_order_in_which_they_are_drawn() -> None:
    streams, numbers, rng = Streams(4, 5, 6), step_normals(Purpose.ACTION, 3, 2), np.random.default_rng(0)
    for _ in range(200):
        rows = np.flatnonzero(rng.random(3) < 0.7)
        episodes, steps = rng.integers(0, 4, len(rows)), rng.integers(0, 3 * BLOCK_STEPS, len(rows))
        found = numbers.at(streams, rows, episodes, steps)
        for row, episode, step, each in zip(rows, episodes, steps, found, strict=True):
            block = generator(4 + int(row), episode, Purpose.ACTION, step // BLOCK_STEPS)
            np.testing.assert_array_equal(each, block.standard_normal((BLOCK_STEPS, 2))[step % BLOCK_STEPS])


def test_rollouts_and_batches_measure_with_the_numbers_of_their_stream() -> None:
    arm = dynx.load("double_pendulum_continuous")
    law = dynx.control.PD(arm, kp=1.0, kd=0.0)
    options: dict[str, Any] = {
        "duration": 0.1,
        "noise": Noise(q=1e-3, seed=3, rollout=5),
        "plant": "compiled",
    }
    one = simulate(arm, law, np.zeros(2), **options)
    drawn = np.concatenate(
        [generator(3, 5, Purpose.MEASUREMENT, block).standard_normal((64, 2, 2)) for block in (0, 1)]
    )
    measured = one.q[:-1] + 1e-3 * drawn[: len(one), 0]
    np.testing.assert_allclose(one.tau, -measured, rtol=0.0, atol=1e-15)
    many = simulate_batch(arm, law, np.zeros(2), rollouts=2, record_every=1, **options)
    np.testing.assert_allclose(many.tau_record[0], one.tau, rtol=0.0, atol=1e-14)


def test_noise_and_parameters_of_environments_are_those_of_their_streams() -> None:
    drawn: dict[str, Any] = {"observation_noise": 0.05, "joint_damping": {"normal": (0.3, 0.01)}}
    envs, plain = (
        RobotVectorEnvironment(CartPole(), 3, randomize=drawn),
        RobotVectorEnvironment(CartPole(), 3),
    )
    (noisy, infos), (clean, _) = envs.reset(seed=11), plain.reset(seed=11)
    assert not np.array_equal(noisy, clean)
    for k in range(3):
        numbers = generator(11 + k, 0, Purpose.OBSERVATION, 0).standard_normal((BLOCK_STEPS, 4))
        assert noisy[k] == pytest.approx(clean[k] + 0.05 * numbers[0], abs=1e-6)
        # The start of a single environment is that of its own seed, as in Gymnasium; its noise is the same.
        with TaskEnvironment(CartPole(), "reference") as alone:
            start, _ = alone.reset(seed=11 + k)
        with TaskEnvironment(CartPole(), "reference", randomize=drawn) as env:
            observation, info = env.reset(seed=11 + k)
            assert observation == pytest.approx(start + 0.05 * numbers[0], abs=1e-6)
            assert info["parameters"] == {name: values[k] for name, values in infos["parameters"].items()}
    damping = infos["parameters"]["joint_damping"]
    assert np.abs(damping - 0.3).max() <= 0.03
    assert len(set(damping.tolist())) == 3
