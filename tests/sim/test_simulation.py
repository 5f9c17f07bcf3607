"""A scenario stepped by its caller gives the bits of `simulate`; branches, resets, torques of the caller."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import dynx
from dynx import ExternalForce
from dynx.backends import installed_backends
from dynx.control import PD, PID, BulletPositionMotor, ComputedTorque, OpenLoop, Saturated
from dynx.control.base import Controller, Measurement
from dynx.errors import ArgumentError, ClosedError, ControlError, DivergedError
from dynx.model.loading import load
from dynx.sim import Noise, Payload, Scenario, Simulation, closed_loop, simulate, simulate_batch
from dynx.trajectory.base import Setpoint, Trajectory
from tests.sim.bars import tutorial_motion, tutorial_robot
from tests.sim.test_resume import the_same

needs_bullet = pytest.mark.skipif("pybullet" not in installed_backends(), reason="PyBullet is not installed")
ARM = tutorial_robot()
DOG = load("solo12", base="floating")
PID_LAW = PID(ARM, kp=300, ki=2000, kd=30, control_dt=3e-3)
SCENARIOS: dict[str, Scenario] = {
    "computed torque": Scenario(ARM, ComputedTorque(ARM, kp=400, kd=40), tutorial_motion(), duration=0.04),
    "rk4": Scenario(ARM, PID_LAW, tutorial_motion(), integrator="rk4", control_dt=3e-3, duration=0.04),
    "sensors": Scenario(
        ARM,
        PID_LAW,
        tutorial_motion(),
        control_dt=3e-3,
        delay=5e-3,
        noise=Noise(1e-4, 1e-3, seed=3),
        effort_limits=60.0,
        duration=0.04,
    ),
    "disturbances": Scenario(
        ARM,
        PD(ARM, kp=300, kd=30),
        np.zeros(6),
        joint_damping=0.3,
        joint_friction=0.2,
        joint_armature=0.05,
        payload=Payload("tool0", 1.0),
        pushes=[ExternalForce("tool0", [5, 0, 0, 0, 0, 0], start=0.01, duration=0.01)],
        joint_limits=True,
        duration=0.04,
    ),
    "floating": Scenario(DOG, PD(DOG, kp=3.0, kd=0.1), DOG.neutral(), duration=0.04),
    "passive": Scenario(ARM, q0=np.full(6, 0.3), duration=0.04),
}
SCENARIOS |= {
    f"{name} compiled": replace(SCENARIOS[name], plant="compiled") for name in ("sensors", "disturbances")
}
if "pybullet" in installed_backends():
    SCENARIOS |= {
        "pybullet": replace(SCENARIOS["sensors"], plant="pybullet"),
        "pybullet floating": replace(SCENARIOS["floating"], plant="pybullet"),
        "motor": Scenario(
            ARM, BulletPositionMotor(ARM), tutorial_motion(), plant="pybullet", control_dt=3e-3, duration=0.04
        ),
    }
STEPS = 40
names = st.sampled_from(sorted(SCENARIOS))


@pytest.mark.parametrize("name", SCENARIOS)
def test_simulate_is_a_loop_over_steps(name: str) -> None:
    scenario = SCENARIOS[name]
    with Simulation(scenario) as simulation:
        for k in range(STEPS):
            state = simulation.step()
            assert state.t == (k + 1) * scenario.dt
        the_same(simulation.rollout, simulate(scenario))


@settings(max_examples=20)
# A push that begins and ends in later chunks of a loop that is one kernel.
@example(name="disturbances compiled", parts=[3, 9, 9, 9], compiled=True)
@given(name=names, parts=st.lists(st.integers(1, 9), min_size=1, max_size=12), compiled=st.booleans())
def test_how_many_steps_at_a_time_changes_no_bit(name: str, parts: list[int], compiled: bool) -> None:
    scenario = replace(SCENARIOS[name], duration=0.1)
    with pytest.MonkeyPatch.context() as patch, Simulation(scenario) as simulation:
        patch.setattr(closed_loop, "MIN_STEPS_TO_COMPILE", 1)
        for n in parts:
            if compiled:
                simulation.run(simulation.time + n * scenario.dt)
                simulation.step()
            else:
                simulation.step(n)
        found = simulation.rollout
        the_same(found, simulate(scenario).first(len(found)))


@settings(max_examples=20)
@given(name=names, at=st.integers(0, STEPS - 2), beyond=st.integers(1, 20))
def test_a_restored_simulation_continues_bit_for_bit(name: str, at: int, beyond: int) -> None:
    scenario = SCENARIOS[name]
    whole = simulate(scenario)
    with Simulation(scenario) as simulation, Simulation(scenario) as other:
        if at:
            simulation.step(at)
        saved = simulation.save()
        simulation.step(min(beyond, STEPS - at), np.zeros(scenario.model.nv))
        assert simulation.rollout.departures
        for each in (simulation, other):
            assert each.restore(saved).t == saved.time
            the_same(each.run(), whole)
            assert each.rollout.departures == ()


@pytest.mark.parametrize("name", SCENARIOS)
def test_a_reset_simulation_starts_again(name: str) -> None:
    with Simulation(SCENARIOS[name]) as simulation:
        simulation.step(7)
        simulation.step(2, np.ones(SCENARIOS[name].model.nv))
        assert simulation.reset().t == 0.0
        the_same(simulation.run(), simulate(SCENARIOS[name]))


@pytest.mark.parametrize("plant", ["pinocchio", pytest.param("pybullet", marks=needs_bullet)])
def test_torques_of_the_caller_are_those_of_an_open_loop(plant: str) -> None:
    torques = np.cos(np.arange(30)[:, None] + np.arange(6))
    scenario = Scenario(ARM, OpenLoop(ARM, torques, control_dt=1e-3), plant=plant, duration=0.03)
    with Simulation(replace(scenario, controller=None, effort_limits=0.7)) as simulation:
        for tau in torques:
            simulation.step(tau=tau)
        the_same(simulation.rollout, simulate(replace(scenario, effort_limits=0.7)))
        assert simulation.rollout.saturated.any()


def test_a_rollout_with_torques_of_the_caller_is_not_resumed() -> None:
    scenario = SCENARIOS["computed torque"]
    with Simulation(scenario) as simulation:
        simulation.step(3)
        simulation.step(2, np.zeros(6))
        simulation.step(2)
        assert simulation.rollout.departures == ("torques of the caller from step 3",)
        with pytest.raises(ArgumentError, match="torques of the caller from step 3"):
            simulate(scenario, resume=simulation.rollout)
        for n, departures in ((2, ()), (3, ()), (4, simulation.rollout.departures)):
            prefix = simulation.rollout.first(n)
            assert prefix.departures == departures
            if not departures:
                the_same(simulate(scenario, resume=prefix), simulate(scenario))


def test_a_branch_with_another_controller_begins_where_it_was_saved() -> None:
    scenario = Scenario(ARM, PID_LAW, np.zeros(6), q0=np.full(6, 0.1), control_dt=3e-3, duration=0.04)
    other = replace(scenario, controller=PD(ARM, kp=200, kd=20))
    with Simulation(scenario) as simulation, Simulation(other) as branch:
        simulation.step(9)
        saved = simulation.save()
        branch.restore(saved)
        branch.run()
        found = branch.rollout
        assert found.departures == ("another controller from step 9",)
        # The steps before do not follow from the scenario of the branch.
        assert found.first(5).departures == found.departures
        assert np.array_equal(found.q[:10], simulation.rollout.q)
        fresh = simulate(replace(other, q0=found.q[9], v0=found.v[9], duration=0.031))
        assert np.array_equal(fresh.q, found.q[9:])


def test_a_snapshot_of_another_robot_or_step_is_refused() -> None:
    with Simulation(SCENARIOS["floating"]) as dog, Simulation(SCENARIOS["passive"]) as arm:
        with pytest.raises(ArgumentError, match="the snapshot is of"):
            arm.restore(dog.save())
        with Simulation(replace(SCENARIOS["passive"], dt=2e-3)) as slow:
            saved = slow.save()
        with pytest.raises(ArgumentError, match="dt"):
            arm.restore(saved)
        with pytest.raises(ArgumentError, match="of a world"):
            arm.restore(replace(saved, record=None))


def test_a_simulation_without_a_duration_goes_on() -> None:
    free = Scenario(ARM, PD(ARM, kp=50, kd=5), np.zeros(6), noise=Noise(1e-4, 1e-3), q0=np.full(6, 0.1))
    with Simulation(free) as simulation:
        with pytest.raises(ArgumentError, match="wanted `until`"):
            simulation.run()
        simulation.step(5)
        simulation.run(until=3.0)
        assert simulation.time == 3.0
        the_same(simulation.rollout, simulate(replace(free, duration=3.0)))
    with pytest.raises(ArgumentError, match=r"the reference is no trajectory.*; give duration= \[s\]"):
        simulate(free)


def test_after_its_end_a_reference_stands_still() -> None:
    scenario = SCENARIOS["computed torque"]
    with Simulation(scenario) as simulation:
        simulation.run()
        simulation.step(100)
        the_same(simulation.rollout, simulate(replace(scenario, duration=0.14)))


def test_real_time_takes_as_long_as_it_simulates() -> None:
    with Simulation(SCENARIOS["passive"]) as simulation:
        started = time.perf_counter()
        simulation.run(until=0.03, real_time=True)
        assert time.perf_counter() - started >= 0.03
        assert simulation.time == 0.03


def test_an_error_leaves_the_last_whole_step() -> None:
    class Failing(PD):
        def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> Any:
            return super().torque(measurement, setpoint, state) if measurement.t < 5e-3 else (None, None)

    with Simulation(Scenario(ARM, Failing(ARM, kp=300, kd=30), np.zeros(6), duration=0.02)) as simulation:
        with pytest.raises(ControlError) as caught:
            simulation.step(10)
        assert len(caught.value.rollout) == 5
        assert simulation.time == 5e-3
        simulation.step(2, np.zeros(6))
        assert len(simulation.rollout) == 7
    unbounded = Scenario(ARM, q0=np.zeros(6), v0=np.full(6, 1e3), joint_limits=False)
    with Simulation(unbounded) as simulation:
        with pytest.raises(DivergedError) as diverged:
            simulation.step(1000)
        assert len(diverged.value.rollout) == diverged.value.step


@pytest.mark.parametrize("plant", ["pinocchio", "compiled"])
def test_ctrl_c_while_a_simulation_grows_changes_nothing(plant: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: Any) -> Any:
        raise KeyboardInterrupt

    scenario = replace(SCENARIOS["passive"], plant=plant, duration=None)
    with Simulation(scenario) as whole:
        wanted = whole.step(2000)
    with Simulation(scenario) as simulation:
        simulation.step(300)
        with monkeypatch.context() as patch:
            patch.setattr("dynx.sim.simulation.setpoints_of", interrupted)
            with pytest.raises(KeyboardInterrupt):
                simulation.step(1700)
        assert simulation.time == pytest.approx(300 * scenario.dt)
        found = simulation.step(1700)
    np.testing.assert_array_equal(found.q, wanted.q)


@pytest.mark.parametrize("n", [0, -1, 1.5, "2", None, np.zeros(6)])
def test_steps_are_counted_in_whole_numbers(n: Any) -> None:
    with (
        Simulation(SCENARIOS["passive"]) as simulation,
        pytest.raises(ArgumentError, match="number of steps"),
    ):
        simulation.step(n)


def test_bad_torques_and_a_closed_simulation() -> None:
    simulation = Simulation(SCENARIOS["passive"])
    for tau in (np.zeros(5), np.zeros((2, 6)), [np.nan] * 6):
        with pytest.raises(ArgumentError):
            simulation.step(tau=tau)
    simulation.close()
    simulation.close()
    with pytest.raises(ClosedError, match="closed"):
        simulation.step()
    wrong: Any = ARM
    with pytest.raises(ArgumentError, match=r"wanted a dynx\.Scenario"):
        Simulation(wrong)


@pytest.mark.parametrize("plant", ["pinocchio", pytest.param("pybullet", marks=needs_bullet)])
def test_a_closed_simulation_is_neither_saved_nor_restored(plant: str) -> None:
    scenario = replace(SCENARIOS["passive"], plant=plant)
    with Simulation(scenario) as simulation:
        saved = simulation.save()
    for use in (simulation.save, lambda: simulation.restore(saved), simulation.run):
        with pytest.raises(ClosedError):
            use()


def test_a_torque_of_the_caller_is_copied_and_held_until_the_next_control_step() -> None:
    scenario = replace(SCENARIOS["rk4"], controller=PD(ARM, kp=1, kd=1))
    tau = np.ones(6)
    with Simulation(scenario) as simulation:
        simulation.step(tau=tau)
        tau[:] = 9.0
        simulation.step(3)
        found = simulation.rollout
    assert np.array_equal(found.tau[:3], np.ones((3, 6)))
    assert not np.array_equal(found.tau[3], np.ones(6))


@needs_bullet
def test_a_torque_of_the_caller_replaces_motors_of_the_engine() -> None:
    passive = replace(SCENARIOS["passive"], plant="pybullet")
    with Simulation(SCENARIOS["motor"]) as simulation:
        begun = simulation.step(4)
        moved = simulation.step(3, np.ones(6))
    with Simulation(replace(passive, q0=begun.q, v0=begun.v)) as free:
        assert np.array_equal(free.step(3, np.ones(6)).q, moved.q)


@needs_bullet
def test_simulations_that_take_turns_do_not_disturb_each_other() -> None:
    scenarios = [SCENARIOS["pybullet"], replace(SCENARIOS["pybullet"], payload=Payload("tool0", 2.0))]
    with Simulation(scenarios[0]) as one, Simulation(scenarios[1]) as other:
        for _ in range(STEPS):
            one.step()
            other.step()
        for each, scenario in zip((one, other), scenarios, strict=True):
            the_same(each.rollout, simulate(scenario))


def test_a_controller_that_changes_itself_is_not_restored() -> None:
    class Counting(Controller[None]):
        def __init__(self) -> None:
            self.model, self.calls = ARM, 0

        def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> Any:
            self.calls += 1
            return np.zeros(6), None

    with Simulation(Scenario(ARM, Counting(), np.zeros(6), duration=0.02)) as simulation:
        simulation.step(4)
        with pytest.raises(ArgumentError, match="changes itself"):
            simulation.restore(simulation.save())


def test_the_record_says_how_its_steps_were_computed() -> None:
    def executor(**options: Any) -> str:
        law = options.pop("law", ComputedTorque(ARM, kp=400, kd=40))
        return simulate(ARM, law, tutorial_motion(), duration=0.3, **options).executor

    assert executor() == "compiled pieces"
    with Simulation(replace(SCENARIOS["passive"], duration=0.3)) as simulation:
        simulation.run()
        simulation.step()
        assert simulation.rollout.executor == "compiled pieces; plain: stepped by the caller"
    assert executor(plant="compiled", dt=0.01) == "compiled"
    assert executor(plant="compiled", integrator="rk4", dt=1e-4) == "compiled pieces"
    assert executor(joint_limits=True) == "compiled pieces"
    assert executor(joint_damping=1.0, joint_friction=0.1, joint_armature=0.1) == "compiled pieces"
    push = ExternalForce("tool0", [1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert executor(pushes=[push]) == "plain: pushes are not compiled"
    few = closed_loop.MIN_STEPS_TO_COMPILE
    assert executor(dt=0.01) == f"plain: fewer than {few} steps"
    assert executor(integrator="rk4") == f"plain: fewer than {4 * few} steps"

    class Branching(PD, pure=True):
        def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> Any:
            tau, state = super().torque(measurement, setpoint, state)
            return (tau if measurement.q[0] > 0.0 else 2.0 * tau), state

    said = executor(law=Branching(ARM, kp=100, kd=10))
    assert said.startswith("plain: Branching.torque() cannot be traced:")
    assert "(test_simulation.py, line " in said


def test_the_names_are_exported() -> None:
    assert dynx.Scenario is Scenario
    assert dynx.Simulation is Simulation


def test_run_stops_on_the_grid_and_never_goes_back() -> None:
    with Simulation(SCENARIOS["passive"]) as simulation:
        assert len(simulation.run(until=0.0)) == 0
        with pytest.raises(ArgumentError, match=r"until is 0\.0015 s, which is not a multiple of dt"):
            simulation.run(until=0.0015)
        simulation.run(until=0.02)
        assert len(simulation.run(until=0.02)) == 20
        for passed in (0.01, 0.0, -1.0):
            with pytest.raises(ArgumentError, match=r"but 0\.02 s have been simulated"):
                simulation.run(until=passed)


def test_what_is_no_record_is_refused() -> None:
    scenario: Any = SCENARIOS["passive"]
    not_a_record: Any = "a.npz"
    with pytest.raises(ArgumentError, match=r"to resume is of type str; wanted a dynx\.Rollout"):
        simulate(scenario, resume=not_a_record)
    with Simulation(scenario) as simulation, pytest.raises(ArgumentError, match="snapshot is of type str"):
        simulation.restore(not_a_record)


class Brake(Controller[None]):
    """A damper with an attribute that users change."""

    def __init__(self, d: float) -> None:
        self.model, self.d, self.rates = ARM, d, np.full(6, 0.5)

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> Any:
        return -self.d * self.rates * measurement.v, None


class Ramp(Trajectory):
    """A trajectory with an attribute that users change."""

    slope = 0.1

    def inside(self, t: Any) -> Setpoint:
        rates = np.full((len(t), 6), self.slope)
        return Setpoint(rates * t[:, None], rates, 0.0 * rates)


@pytest.mark.parametrize("wrapped", [False, True])
def test_a_record_says_what_it_said_when_it_was_made(wrapped: bool) -> None:
    law, ramp = Brake(5.0), Ramp(0.02, *(Setpoint(*np.zeros((3, 6))) for _ in range(2)))
    ramp.slope = 0.1
    scenario = Scenario(ARM, Saturated(law, limit=50.0) if wrapped else law, ramp, plant="compiled")
    rollout, batch = simulate(scenario), simulate_batch(scenario, rollouts=2)
    text, settings = rollout.scenario.to_json(), rollout.settings  # type: ignore[union-attr]
    assert batch.scenario.to_json() == text
    law.d, ramp.slope = 7.0, 0.2
    law.rates[:] = 1.0
    for each in (rollout.scenario, batch.scenario):
        assert each is not None
        assert each.to_json() == text
        again = simulate(each)
        assert np.array_equal(again.q, rollout.q)
        assert again.settings == settings
    assert simulate(scenario).settings != settings
    with pytest.raises(ArgumentError, match="had controller"):
        simulate(scenario, resume=rollout)


@pytest.mark.parametrize("plant", ["pinocchio", "compiled"])
def test_a_gain_that_the_caller_changes_acts_from_then_on_and_is_a_departure(plant: str) -> None:
    law = Brake(5.0)
    scenario = Scenario(ARM, law, np.zeros(6), plant=plant, q0=np.full(6, 0.3), duration=0.02)
    first = simulate(scenario)
    second = simulate(replace(scenario, controller=Brake(50.0), q0=first.q[8], v0=first.v[8], duration=0.012))
    with Simulation(scenario) as simulation:
        before = simulation.save()
        simulation.step(8)
        law.d = 50.0
        changed = simulation.run()
        assert changed.departures == ("Brake changed by the caller (attribute d) from step 8",)
        assert changed.scenario == first.scenario != scenario
        assert changed.first(8).departures == ()
        assert changed.first(9).departures == changed.departures
        assert np.array_equal(changed.q[:9], first.q[:9])
        assert np.array_equal(changed.q[8:], second.q)
        simulation.restore(simulation.save())
        simulation.restore(before)
        assert simulation.rollout.departures == ("another controller from step 0",)
        simulation.reset()
        again = simulation.run()
        assert again.departures == ()
        assert again.scenario == scenario
        assert np.array_equal(again.q, simulate(scenario).q)


def test_ctrl_c_while_setpoints_are_prepared_stays_a_keyboard_interrupt(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    scenario = replace(SCENARIOS["passive"], plant="compiled", duration=0.02)
    whole = simulate(scenario)
    with monkeypatch.context() as patch:
        patch.setattr("dynx.sim.simulation.setpoints_of", interrupted)
        with pytest.raises(KeyboardInterrupt) as caught:
            simulate(scenario)
        assert caught.type is KeyboardInterrupt
    np.testing.assert_array_equal(simulate(scenario).q, whole.q)
