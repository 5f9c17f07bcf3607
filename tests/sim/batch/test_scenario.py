"""A batch takes a scenario, beside which only what may differ from rollout to rollout is given."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dynx.control import PD
from dynx.errors import ArgumentError
from dynx.model.loading import load
from dynx.sim import BatchRollouts, Noise, Payload, Scenario, simulate, simulate_batch

ARM = load("planar_2r")
LAW = PD(ARM, kp=20.0, kd=4.0)
GOAL = np.full(2, 0.1)
OPTIONS: dict[str, Any] = {
    "duration": 0.02,
    "control_dt": 2e-3,
    "delay": 1e-3,
    "noise": Noise(1e-4, 1e-3, seed=4),
    "joint_damping": 0.2,
    "joint_armature": 0.05,
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
    assert by_keywords.scenario == by_scenario.scenario == SCENARIO


def test_what_differs_is_given_beside_the_scenario() -> None:
    starts = np.array([[0.0, 0.0], [0.1, -0.1], [0.2, 0.3]])
    many = simulate_batch(SCENARIO, q0=starts, joint_damping=[[0.1], [0.2], [0.3]])
    again = simulate_batch(
        ARM, LAW, GOAL, **{**OPTIONS, "q0": starts, "joint_damping": [[0.1], [0.2], [0.3]]}
    )
    assert np.array_equal(many.q, again.q)
    assert many.scenario == SCENARIO
    heavier = simulate_batch(SCENARIO, q0=starts, joint_damping=0.3)
    assert heavier.scenario == replace(SCENARIO, joint_damping=0.3)
    assert not np.array_equal(heavier.q, many.q)


def test_one_row_is_for_all_rollouts() -> None:
    of_joints = np.array([0.1, 0.2])
    many = simulate_batch(SCENARIO, rollouts=2, joint_damping=of_joints[None], q0=np.full((1, 2), 0.1))
    other = simulate_batch(replace(SCENARIO, joint_damping=of_joints, q0=np.full(2, 0.1)), rollouts=2)
    assert np.array_equal(many.q, other.q)


def test_a_file_keeps_the_scenario(tmp_path: Path) -> None:
    simulate_batch(SCENARIO, rollouts=2).save(tmp_path / "many.npz")
    again = BatchRollouts.load(tmp_path / "many.npz")
    assert again.scenario == SCENARIO
    assert np.array_equal(simulate_batch(again.scenario, rollouts=2).q, again.q)


def test_kept_parts_belong_to_their_scenario(tmp_path: Path) -> None:
    def kept(scenario: Scenario) -> int:
        simulate_batch(scenario, rollouts=2, keep=tmp_path)
        return len(list(tmp_path.glob("*.npz")))

    assert kept(SCENARIO) == kept(replace(SCENARIO, integrator="semi_implicit")) == 1
    # A reference that breaks no limit moves as it does unchecked, but it is another scenario.
    assert kept(replace(SCENARIO, check_reference=False)) == 2


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"plant": "pinocchio"}, "plant"),
        ({"integrator": "rk4"}, "integrator"),
        ({"substeps": 2}, "substeps"),
        ({"duration": None}, "duration"),
        ({"controller": None}, r"; control\.PD\(model, kp=0\.0, kd=0\.0\) applies no torque"),
        ({"reference": None}, "reference"),
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
    with pytest.raises(ArgumentError, match=f"{next(iter(given))} is given in addition to a scenario"):
        run(SCENARIO, **given)


def test_a_plant_is_a_name() -> None:
    with pytest.raises(ArgumentError, match="plant is 'pybullet'; a batch takes only 'compiled'"):
        simulate_batch(ARM, LAW, GOAL, plant="pybullet", **OPTIONS)
