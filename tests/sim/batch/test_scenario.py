"""A batch takes a scenario, beside which only what may differ from rollout to rollout is given."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dynx.control import PD
from dynx.errors import ArgumentError
from dynx.model.loading import load
from dynx.sim import Noise, Payload, Scenario, simulate, simulate_batch

ARM = load("planar_2r")
LAW = PD(ARM, kp=20.0, kd=4.0)
GOAL = np.full(2, 0.1)
OPTIONS: dict[str, Any] = {
    "duration": 0.02,
    "control_dt": 2e-3,
    "delay": 1e-3,
    "noise": Noise(1e-4, 1e-3, seed=4),
    "damping": 0.2,
    "armature": 0.05,
    "effort_limits": 30.0,
    "payload": Payload(ARM.frame_names[-1], 0.5),
    "mass_scale": 1.1,
    "q0": np.zeros(2),
}
SCENARIO = Scenario(ARM, LAW, GOAL, plant="compiled", **OPTIONS)


def test_a_scenario_means_what_its_fields_mean_as_arguments() -> None:
    by_scenario = simulate_batch(SCENARIO, rollouts=3, record_every=1)
    by_keywords = simulate_batch(ARM, LAW, GOAL, rollouts=3, record_every=1, **OPTIONS)
    for name in ("q", "v", "max_error", "q_record", "tau_record", "saturated"):
        assert np.array_equal(getattr(by_scenario, name), getattr(by_keywords, name)), name


def test_what_differs_is_given_beside_the_scenario() -> None:
    starts = np.array([[0.0, 0.0], [0.1, -0.1], [0.2, 0.3]])
    many = simulate_batch(SCENARIO, q0=starts, damping=[[0.1], [0.2], [0.3]])
    again = simulate_batch(ARM, LAW, GOAL, **{**OPTIONS, "q0": starts, "damping": [[0.1], [0.2], [0.3]]})
    assert np.array_equal(many.q, again.q)


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"plant": "pinocchio"}, "plant"),
        ({"integrator": "rk4"}, "integrator"),
        ({"substeps": 2}, "substeps"),
        ({"position_limits": True}, "position_limits"),
        ({"duration": None}, "duration"),
    ],
)
def test_what_a_batch_does_not_have_is_refused_by_name(change: dict[str, Any], name: str) -> None:
    with pytest.raises(ArgumentError, match=name):
        simulate_batch(replace(SCENARIO, **change), rollouts=2)


@pytest.mark.parametrize(
    "given", [{"dt": 2e-3}, {"delay": 2e-3}, {"noise": Noise()}, {"controller": LAW}, {"mass_scale": 2.0}]
)
@pytest.mark.parametrize("run", [simulate, simulate_batch])
def test_what_the_scenario_has_is_not_given_beside_it(run: Any, given: dict[str, Any]) -> None:
    with pytest.raises(ArgumentError, match=f"{next(iter(given))} is given beside a scenario"):
        run(SCENARIO, **given)


def test_a_plant_is_a_name() -> None:
    with pytest.raises(ArgumentError, match="a batch runs on the plant 'compiled'"):
        simulate_batch(ARM, LAW, GOAL, plant="pybullet", **OPTIONS)
