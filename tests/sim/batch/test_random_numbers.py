"""Random numbers of controllers: the same in every executor, partition and batch, by their own stream."""

from __future__ import annotations

import pickle
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

import dynx
from dynx import control
from dynx.control import Controller
from dynx.control.base import Measurement, Wrapper
from dynx.errors import ArgumentError, UnsupportedFeatureError
from dynx.sim import Noise, simulate, simulate_batch
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint

ARM = dynx.load("ur5")

STEPS = 300
"""Steps enough for compiled stages, with control steps in several blocks of the stream."""

DT = 1e-3


@dataclass(frozen=True)
class Explorer(Controller[None], pure=True):
    """Returns its random numbers as torque."""

    model: dynx.Model
    random_size: int

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        return measurement.random[: self.model.nv] * 1.0, None


class Impure(Explorer):
    """The same, which is not compiled."""


class Bound(Wrapper[None]):
    """Half of the torque of another controller."""

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        return 0.5 * self.inner.torque(measurement._replace(v=0.0 * measurement.v), setpoint, None)[0], None


def stream(seed: int, rollout: int, steps: int, size: int) -> Floats:
    """Return the numbers of a controller by NumPy's generator, from their definition."""
    key = np.array([np.random.SeedSequence(seed).generate_state(1, np.uint64)[0], rollout], dtype=np.uint64)
    rows = []
    for block in range(-(-steps // 64)):
        counter = np.array([0, 0, 1, block], dtype=np.uint64)
        rows.append(
            np.random.Generator(np.random.Philox(key=key, counter=counter)).standard_normal((64, size))
        )
    return np.concatenate(rows)[:steps]


def torques(controller: Controller[Any], **options: Any) -> tuple[str, Floats]:
    found = simulate(ARM, controller, ARM.neutral(), duration=STEPS * DT, dt=DT, **options)
    return found.executor, found.tau


@pytest.mark.long_cases
@pytest.mark.parametrize("kind", [Explorer, Impure])
@pytest.mark.parametrize(
    "noise", [None, Noise(seed=3, rollout=5), Noise(1e-4, 1e-3, seed=3, rollout=2**53 + 1)]
)
@pytest.mark.parametrize("plant", ["reference", "pybullet"])
def test_a_rollout_has_the_numbers_of_its_stream(
    kind: type[Explorer], noise: Noise | None, plant: str
) -> None:
    size, per_control = ARM.nv + 2, 2
    executor, tau = torques(
        kind(ARM, size), noise=noise, plant=plant, control_dt=per_control * DT, delay=2 * DT
    )
    assert executor.startswith("compiled pieces") == (kind is Explorer and plant == "reference")
    seed, rollout = (0, 0) if noise is None else (noise.seed, noise.rollout)
    wanted = stream(seed, rollout, STEPS // per_control, size)[:, : ARM.nv]
    np.testing.assert_array_equal(tau[::per_control], wanted)


@pytest.mark.parametrize("noise", [None, Noise(1e-4, 1e-3, seed=9, rollout=2)])
def test_a_batch_has_the_numbers_of_its_rollouts(noise: Noise | None) -> None:
    law = Explorer(ARM, ARM.nv)
    options: dict[str, Any] = {"duration": 80 * DT, "control_dt": 2 * DT, "noise": noise}
    many = simulate_batch(ARM, law, ARM.neutral(), rollouts=21, record_every=2, **options)
    seed, first = (0, 0) if noise is None else (noise.seed, noise.rollout)
    for row in (0, 20):
        np.testing.assert_array_equal(many.tau_record[row], stream(seed, first + row, 40, ARM.nv))
        own = replace(noise or Noise(), rollout=first + row)
        one = simulate(ARM, law, ARM.neutral(), plant="compiled", **options | {"noise": own})
        np.testing.assert_array_equal(one.tau[1::2], many.tau_record[row])
        assert np.abs(one.q[-1] - many.q[row]).max() < 1e-12
    few = simulate_batch(ARM, law, ARM.neutral(), rollouts=3, record_every=2, threads=1, **options)
    np.testing.assert_array_equal(few.q_record, many.q_record[:3])


def test_a_resumed_rollout_has_the_same_numbers() -> None:
    law = Impure(ARM, ARM.nv)
    options: dict[str, Any] = {"plant": "reference", "duration": 90 * DT, "noise": Noise(1e-4, seed=4)}
    whole = simulate(ARM, law, ARM.neutral(), **options)
    again = simulate(ARM, law, ARM.neutral(), resume=whole.first(70), **options)
    np.testing.assert_array_equal(again.tau, whole.tau)
    with dynx.Simulation(dynx.Scenario(ARM, law, ARM.neutral(), **options)) as stepped:
        stepped.step(70)
        snapshot = stepped.save()
        stepped.step(20)
        stepped.restore(snapshot)
        np.testing.assert_array_equal(stepped.run().tau, whole.tau)


@pytest.mark.parametrize("kind", [Bound, control.Saturated])
def test_wrappers_pass_the_numbers_on(kind: type[Wrapper[None]]) -> None:
    inner = Impure(ARM, ARM.nv)
    law = kind(inner) if kind is Bound else control.Saturated(inner, limit=1e3)
    scale = 0.5 if kind is Bound else 1.0
    assert law.random_size == ARM.nv
    numbers = stream(0, 0, STEPS, ARM.nv)
    np.testing.assert_array_equal(torques(law, plant="reference")[1], scale * numbers)
    many = simulate_batch(ARM, law, ARM.neutral(), rollouts=2, duration=3 * DT, record_every=1)
    np.testing.assert_array_equal(many.tau_record[0], scale * numbers[:3])


def test_a_wrong_size_is_refused() -> None:
    class Deaf(Controller[None]):
        def __init__(self, inner: Controller[None]) -> None:
            self.inner, self.model = inner, inner.model

        def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
            return self.inner.torque(measurement, setpoint, None)

    with pytest.raises(ArgumentError, match="Impure needs 6 random numbers; Deaf, which passes"):
        torques(Deaf(Impure(ARM, 6)))
    for size in (-1, 1.5, "6", None):
        with pytest.raises(ArgumentError, match="random_size of Impure"):
            torques(Impure(ARM, size))  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="steps"):
        torques(Impure(ARM, 10**9))


def test_a_refusal_of_random_torques_names_the_seeded_numbers() -> None:
    rng = np.random.default_rng()

    class Dice(Controller[None]):
        def __init__(self, model: dynx.Model) -> None:
            self.model = model

        def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
            return -measurement.v + rng.standard_normal(self.model.nv), None

    with pytest.raises(UnsupportedFeatureError, match=r"random_size .* measurement\.random;"):
        simulate_batch(ARM, Dice(ARM), ARM.neutral(), rollouts=2, duration=3 * DT)


def test_a_measurement_is_three_numbers_and_keeps_its_random_ones() -> None:
    measurement = Measurement(0.5, np.zeros(2), np.ones(2)).with_random(np.arange(3.0))
    t, q, v = measurement
    assert (t, q.size, v.size) == (0.5, 2, 2)
    for other in (pickle.loads(pickle.dumps(measurement)), measurement._replace(t=1.0)):
        np.testing.assert_array_equal(other.random, np.arange(3.0))
    assert Measurement(t, q, v).random.size == 0
