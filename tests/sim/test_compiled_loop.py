"""The loop in compiled pieces gives the record of the plain loop, to the last bit."""

from __future__ import annotations

import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import FrozenInstanceError
from types import FrameType
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dynx import ExternalForce
from dynx.control import (
    PD,
    PID,
    ComputedTorque,
    DiscreteComputedTorque,
    FeedForward,
    FrictionCompensation,
    GravityCompensatedPD,
    OpenLoop,
    Saturated,
    Velocity,
)
from dynx.control.base import Controller, Measurement, substitute
from dynx.engines.pinocchio.backend import PinocchioBackend
from dynx.errors import ControlError, DivergedError
from dynx.model import Model
from dynx.model.loading import load
from dynx.sim import (
    Noise,
    Rollout,
    RolloutInterrupted,
    Scenario,
    Simulation,
    closed_loop,
    compiled_loop,
    simulate,
    simulate_batch,
)
from dynx.sim.compiled_loop import CompiledLoop, LaneLoop
from dynx.sim.plants import registry
from dynx.simd import cuts
from dynx.spatial.scalar import Floats
from dynx.testing.strategies import models
from dynx.trajectory.base import Setpoint, Trajectory
from tests.oracles.closed_form import MODELS
from tests.sim.bars import tutorial_motion, tutorial_robot
from tests.sim.test_resume import the_same

ARM = tutorial_robot()
STEPS = 70
LAWS: dict[str, Callable[[Model, float], Controller[Any]]] = {
    "computed torque": lambda m, dt: ComputedTorque(m, kp=400, kd=40),
    "discrete": lambda m, dt: DiscreteComputedTorque(m, control_dt=dt),
    "pid": lambda m, dt: PID(m, kp=300, ki=2000, kd=30, control_dt=dt, limit=500.0),
    "gravity": lambda m, dt: GravityCompensatedPD(m, kp=200, kd=20, backend="reference"),
    "feed-forward": lambda m, dt: FeedForward(m, kp=100, kd=10, backend="compiled"),
    "velocity": lambda m, dt: Velocity(m, kd=30),
    "saturated": lambda m, dt: Saturated(PD(m, kp=300, kd=30), limit=20.0),
}
OPTIONS: dict[str, dict[str, Any]] = {
    "plain": {},
    "rk4": {"integrator": "rk4"},
    "substeps": {"substeps": 3},
    "rate": {"control_dt": 3e-3},
    "delay": {"delay": 2e-3},
    "noise": {"noise": Noise(1e-4, 1e-3, seed=5)},
    "limits": {"effort_limits": 15.0},
    "all": {
        "integrator": "rk4",
        "substeps": 2,
        "control_dt": 3e-3,
        "delay": 5e-3,
        "noise": Noise(1e-3, 1e-2, seed=2),
        "effort_limits": 12.0,
    },
}
PAIRS = [
    *((law, option) for law in LAWS for option in ("plain", "all")),
    *zip(LAWS, list(OPTIONS)[1:-1], strict=False),
]
"""Each law without and with all options, and each option alone with one law."""


@contextmanager
def glue(*, on: bool, seen: list[bool] | None = None) -> Iterator[None]:
    """Glue for rollouts of any length, or for none; `seen` is told whether it was used."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(closed_loop, "MIN_STEPS_TO_COMPILE", 1 if on else 10**9)
        patch.setattr(compiled_loop, "is_one_lane", lambda plant, controller: False)
        patch.setattr(compiled_loop.CutLoop, "chunk_steps", 32)
        if seen is not None:
            run = compiled_loop.CutLoop.run

            def watched(loop: compiled_loop.CutLoop, *arguments: Any) -> None:
                seen.append(True)
                run(loop, *arguments)

            patch.setattr(compiled_loop.CutLoop, "run", watched)
        yield


def outcome(*asked: Any, **options: Any) -> tuple[Rollout, str]:
    """Return the record and the error."""
    try:
        return simulate(*asked, **options), ""
    except (DivergedError, ControlError) as error:
        return error.rollout, str(error)


def both(*asked: Any, glued: bool = True, **options: Any) -> Rollout:
    """Return the rollout of a simulation in stages, after checking that the plain one is the same."""
    seen: list[bool] = []
    with glue(on=True, seen=seen):
        quick, told = outcome(*asked, **options)
    assert bool(seen) == glued
    with glue(on=False):
        plain, told_plainly = outcome(*asked, **options)
    the_same(quick, plain)
    assert told == told_plainly
    return quick


def law_of(name: str, model: Model, options: dict[str, Any]) -> Controller[Any]:
    return LAWS[name](model, options.get("control_dt", 1e-3))


@pytest.mark.long_cases
@pytest.mark.parametrize(("law", "option"), PAIRS)
def test_the_record_is_that_of_the_plain_loop(law: str, option: str) -> None:
    options = OPTIONS[option]
    found = both(ARM, law_of(law, ARM, options), tutorial_motion(), duration=STEPS * 1e-3, **options)
    if "effort_limits" in options:
        assert found.saturated.any()
        assert not found.saturated.all()


@pytest.mark.parametrize("plant", ["pinocchio", "reference", "compiled"])
@pytest.mark.parametrize("robot", ["panda", "talos", "six_axis_arm"])
def test_robots_and_plants(robot: str, plant: str) -> None:
    model = load(MODELS / f"{robot}.urdf" if robot == "six_axis_arm" else robot)
    law = ComputedTorque(model, kp=100, kd=20, backend=plant)
    q = model.clip(model.neutral() + 0.1)
    both(model, law, q, q0=q, plant=plant, duration=0.03)


def test_a_robot_without_a_controller() -> None:
    both(ARM, q0=np.full(6, 0.3), duration=STEPS * 1e-3)


@settings(max_examples=10)
@given(model=models(solvable=True), step=st.integers(1, 19), data=st.data())
def test_random_robots_resumed_at_any_step(model: Model, step: int, data: st.DataObject) -> None:
    law = PID(model, kp=20, ki=50, kd=4, control_dt=4e-3, limit=50.0)
    options: dict[str, Any] = {
        "duration": 0.02,
        "control_dt": 4e-3,
        "effort_limits": data.draw(st.sampled_from([1.0, 30.0])),
        "noise": None if model.floating else Noise(1e-3, 1e-3),
        "check_reference": False,
    }
    rng = np.random.default_rng(data.draw(st.integers(0, 99)))
    options["q0"], options["v0"] = model.random(rng), rng.uniform(-1, 1, model.nv)
    whole = both(model, law, model.neutral(), **options, glued=model.nv > 0)
    step = min(step, len(whole))
    with glue(on=True):
        again, _ = outcome(model, law, model.neutral(), **options, resume=whole, step=step)
    the_same(again, whole)


class Counting(PD):
    """A law of somebody's own, which does more than it says."""

    asked = 0

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        type(self).asked += 1
        return super().torque(measurement, setpoint, state)


def test_a_law_of_one_s_own_is_asked_in_every_step() -> None:
    for law in (Counting(ARM, kp=10, kd=1), Saturated(Counting(ARM, kp=10, kd=1), limit=5.0)):
        Counting.asked = 0
        both(ARM, law, np.zeros(6), duration=STEPS * 1e-3, glued=False)
        assert Counting.asked == 2 * STEPS


@pytest.mark.parametrize(
    "options",
    [
        {"joint_friction": 0.1, "integrator": "rk4"},
        {"integrator": "adaptive"},
        {"pushes": [ExternalForce("tool0", [1, 0, 0, 0, 0, 0])]},
        {"substeps": 17},
    ],
)
def test_what_stages_do_not_know_goes_the_plain_way(options: dict[str, Any]) -> None:
    both(ARM, PD(ARM, kp=100, kd=10), np.zeros(6), duration=0.01, glued=False, **options)


def test_torques_from_a_table_go_the_plain_way() -> None:
    law = OpenLoop(ARM, np.ones((9, 6)), control_dt=1e-3)
    both(ARM, law, duration=0.01, glued=False)


@pytest.mark.parametrize("speed", ["measured", "setpoint"])
def test_compensated_friction_goes_the_plain_way(speed: str) -> None:
    """Its hyperbolic tangent is not rounded alike in NumPy and in a kernel."""
    law = FrictionCompensation(PD(ARM, kp=100, kd=10), damping=0.5, friction=0.3, speed=speed)
    both(ARM, law, np.zeros(6), q0=np.full(6, 0.1), duration=0.02, glued=False)


@pytest.mark.long_cases
@pytest.mark.parametrize("plant", ["pinocchio", "reference", "compiled"])
@pytest.mark.parametrize("options", [{}, {"substeps": 3}, {"control_dt": 3e-3, "delay": 2e-3}])
def test_a_floating_base(plant: str, options: dict[str, Any]) -> None:
    robot = load("solo12", base="floating")
    law = PD(robot, kp=5, kd=0.1)
    v0 = np.random.default_rng(0).normal(size=robot.nv)
    both(robot, law, robot.neutral(), plant=plant, v0=v0, duration=0.06, **options)


@pytest.mark.parametrize("options", [{"noise": Noise(1e-3, 1e-3)}, {"integrator": "rk4"}])
def test_a_floating_base_that_goes_the_plain_way(options: dict[str, Any]) -> None:
    robot = load("solo12", base="floating")
    both(robot, PD(robot, kp=5, kd=0.1), robot.neutral(), duration=0.01, glued=False, **options)


@pytest.mark.parametrize("kd", [-3e3, -1e306])
def test_errors_are_those_of_the_plain_loop(kd: float) -> None:
    """Damping turned round drives the robot away, or its torque beyond all numbers."""
    law = substitute(Velocity(ARM, kd=0.0), kd=np.full(6, kd))
    speed = 1e-3 if kd > -1e300 else 300.0
    start: dict[str, Any] = {"q0": np.zeros(6), "v0": np.full(6, speed), "joint_limits": False}
    found = both(ARM, law, np.zeros(6), duration=1.0, **start)
    assert len(found) < 1000
    with pytest.raises(DivergedError if kd > -1e300 else ControlError):
        simulate(ARM, law, np.zeros(6), duration=1.0, **start)


@pytest.mark.parametrize(("kd", "limits"), [(-3e3, False), (-1e306, False), (-1e306, 15.0)])
def test_errors_of_one_lane_are_those_of_the_plain_loop(kd: float, limits: Any) -> None:
    """The same error at the same step, whether steps are taken one by one or together, and as in a batch."""
    law = substitute(Velocity(ARM, kd=0.0), kd=np.full(6, kd))
    v0 = np.full(6, 1e-3 if kd > -1e300 else 300.0)
    start: dict[str, Any] = {"q0": np.zeros(6), "v0": v0, "effort_limits": limits, "duration": 0.5}
    start["joint_limits"] = False
    caught = []
    for plant in ("compiled", "reference"):
        with pytest.raises((DivergedError, ControlError)) as error:
            simulate(ARM, law, np.zeros(6), plant=plant, **start)
        caught.append(error.value)
    with Simulation(Scenario(ARM, law, np.zeros(6), plant="compiled", **start)) as simulation:
        with pytest.raises((DivergedError, ControlError)) as error:
            deque(iter(simulation.step, None), maxlen=0)
        caught.append(error.value)
        the_same(simulation.rollout, caught[0].rollout)
    assert len({(type(each), each.step) for each in caught}) == 1
    assert str(caught[0]) == str(caught[2])
    many = simulate_batch(ARM, law, np.zeros(6), rollouts=2, **start)
    np.testing.assert_array_equal(many.diverged, caught[0].time)


def test_a_rollout_of_a_batch_is_that_of_simulate_with_its_noise() -> None:
    law = PID(ARM, kp=300, ki=2000, kd=30, control_dt=2e-3, limit=500.0)
    options: dict[str, Any] = {"control_dt": 2e-3, "delay": 4e-3, "effort_limits": 40.0, "duration": 0.3}
    options |= {"joint_friction": 0.3, "pushes": [ExternalForce("tool0", [5, 0, 0, 0, 1, 0], 0.01, 0.1)]}
    many = simulate_batch(
        ARM, law, tutorial_motion(), rollouts=11, record_every=1, noise=Noise(1e-3, 1e-2, 4, 5), **options
    )
    for row in (0, 7, 10):
        noise = Noise(1e-3, 1e-2, 4, 5 + row)
        one = simulate(ARM, law, tutorial_motion(), plant="compiled", noise=noise, **options)
        np.testing.assert_array_equal(many.q_record[row], one.q[1:])
        np.testing.assert_array_equal(many.v_record[row], one.v[1:])
        np.testing.assert_array_equal(many.tau_record[row], one.tau)


@pytest.mark.parametrize("law", [PD(ARM, kp=100, kd=10), None])
def test_torques_of_the_caller_are_held_in_one_lane(law: Controller[Any] | None) -> None:
    """Also between control steps, after torques of the controller and before them; without a controller a
    control step ends them."""
    tau = np.linspace(-3.0, 3.0, 6)
    records = []
    for plant in ("compiled", "reference"):
        with Simulation(Scenario(ARM, law, np.zeros(6), plant=plant, control_dt=3e-3, duration=0.1)) as run:
            for n, given in ((4, None), (1, tau), (2, 2.0 * tau), (5, None), (1, tau), (7, None)):
                run.step(n, given)
            records.append(run.rollout)
    assert records[0].executor == "compiled"
    np.testing.assert_allclose(records[0].tau, records[1].tau, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(records[0].q, records[1].q, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(records[0].tau[4:9], [tau, *4 * [2.0 * tau]])
    assert records[0].tau[9:12].any() == (law is not None)


def test_an_engine_of_one_s_own_is_believed_on_the_compiled_plant() -> None:
    class Own(PinocchioBackend):
        """An engine of a user."""

    for law, executor in (
        (ComputedTorque(ARM, kp=400, kd=40), "compiled"),
        (ComputedTorque(ARM, kp=400, kd=40, backend=Own(ARM)), "plain"),
    ):
        found = simulate(ARM, law, np.zeros(6), plant="compiled", q0=np.full(6, 0.1), duration=0.02)
        assert found.executor.startswith(executor)


@pytest.mark.parametrize(
    "law",
    [
        PD(ARM, kp=1e308, kd=1e308),
        Saturated(PD(ARM, kp=1e308, kd=1e308), limit=20.0),
        PID(ARM, kp=1e308, ki=0.0, kd=0.0, control_dt=1e-3, limit=20.0),
        PD(ARM, kp=5e307, kd=0.0),
    ],
    ids=["pd", "saturated", "pid", "sum"],
)
@pytest.mark.parametrize("limits", [False, 15.0])
def test_a_torque_beyond_all_numbers_is_not_cut_to_the_limits(law: Controller[Any], limits: Any) -> None:
    both(ARM, law, np.zeros(6), q0=np.full(6, 2.0), duration=0.02, effort_limits=limits)


def test_a_controller_is_never_changed() -> None:
    """So a compiled stage of it stays right."""
    law = PD(ARM, kp=10, kd=1)
    for name in ("torque", "kp", "model"):
        with pytest.raises(FrozenInstanceError):
            setattr(law, name, None)


@pytest.mark.parametrize("question", ["inverse_dynamics", "_inverse_dynamics"])
@pytest.mark.parametrize("where", ["class", "instance"])
def test_an_engine_with_answers_of_its_own_is_believed(question: str, where: str) -> None:
    class Own(PinocchioBackend):
        """An engine that is off by 1 N m."""

    engine = Own(ARM)
    answer = getattr(PinocchioBackend(ARM), question)

    def off(*given: Floats) -> Floats:
        return np.asarray(answer(*given[-3:])) + 1.0

    if where == "class":
        setattr(Own, question, off)
    else:
        setattr(engine, question, off)
    law = ComputedTorque(ARM, kp=400, kd=40, backend=engine)
    found = both(ARM, law, np.zeros(6), duration=0.02)
    right = simulate(ARM, ComputedTorque(ARM, kp=400, kd=40), np.zeros(6), duration=0.02)
    np.testing.assert_allclose(found.tau[0], right.tau[0] + 1.0)


def test_gains_are_inputs_of_one_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cuts, "_made", {})
    for kp in (100.0, 200.0, 300.0):
        both(ARM, ComputedTorque(ARM, kp=kp, kd=20.0), np.zeros(6), q0=np.full(6, 0.1), duration=0.02)
    assert len(cuts._made) == 3


class Narrow(Trajectory):
    """A motion in single precision."""

    def inside(self, t: Floats) -> Setpoint:
        rows: Any = (x.astype(np.float32) for x in tutorial_motion().inside(t))
        return Setpoint(*rows)


def test_a_reference_in_other_numbers() -> None:
    wide = tutorial_motion()
    narrow = Narrow(wide.duration, wide.start, wide.end)
    assert narrow(np.full(3, 0.1)).q.dtype == np.float32
    both(ARM, PD(ARM, kp=100, kd=10), narrow, duration=0.02, glued=False, check_reference=False)


def test_no_controller_is_at_no_limit() -> None:
    assert not both(ARM, None, duration=0.05, q0=np.full(6, 0.3), effort_limits=5.0).saturated.any()


def test_progress_is_told_in_time_where_steps_are_slow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled_loop, "PROGRESS_INTERVAL", 1e-6)
    told: list[int] = []
    simulate(ARM, q0=np.zeros(6), duration=0.5, progress=lambda taken, wanted: told.append(taken))
    assert len(told) > 200


class Interrupting(PinocchioBackend):
    """An engine whose 45th answer does not come, for Ctrl-C does."""

    calls = 0

    def _inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        self.calls += 1
        if self.calls == 45:
            raise KeyboardInterrupt
        return super()._inverse_dynamics(q, v, a)


class Failing(PinocchioBackend):
    """An engine whose third torque is no number, and which keeps what it is asked about."""

    def __init__(self, model: Model, *, validate: bool = True) -> None:
        super().__init__(model, validate=validate)
        self.calls = 0
        self.given: list[Floats] = []

    def _inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        self.calls += 1
        return super()._inverse_dynamics(q, v, a) * (np.nan if self.calls >= 3 else 1.0)

    def _forward_dynamics(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        self.given.append(tau.copy())
        return super()._forward_dynamics(q, v, tau)


@pytest.mark.parametrize("on", [True, False])
def test_no_plant_is_given_what_is_no_number(on: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """An engine may not survive it."""
    plant = Failing(ARM)
    monkeypatch.setattr(registry, "backend", lambda name, model, validate: plant)
    law = ComputedTorque(ARM, kp=400, kd=40, backend=Failing(ARM))
    with glue(on=on), pytest.raises(ControlError, match="not finite") as caught:
        simulate(ARM, law, np.zeros(6), duration=0.02)
    assert caught.value.step == 2
    assert len(plant.given) == 2
    assert np.isfinite(plant.given).all()


def test_going_back_and_forth_prepares_no_step_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither torques of the caller between the controller's, nor a return to a state a few steps ago."""
    made: list[int] = []
    prepare = LaneLoop._bound_calls

    def counted(loop: LaneLoop, steps: Any, *, given: bool) -> Any:
        made.append(len(steps))
        return prepare(loop, steps, given=given)

    monkeypatch.setattr(LaneLoop, "_bound_calls", counted)
    law = PID(ARM, kp=100, ki=50, kd=10, control_dt=1e-3, limit=50.0)
    with Simulation(Scenario(ARM, law, np.zeros(6), plant="compiled", q0=np.full(6, 0.3))) as simulation:
        states = []
        for _ in range(3):
            saved = simulation.save()
            for given in (None, np.ones(6), None):
                simulation.step(tau=given)
            states.append(simulation.state)
            simulation.restore(saved)
    assert len(made) == 2
    for each in states[1:]:
        np.testing.assert_array_equal(each.q, states[0].q)
        np.testing.assert_array_equal(each.v, states[0].v)


def test_ctrl_c_while_steps_are_prepared() -> None:
    """At any line, and the next steps are those that they would have been."""
    scenario = Scenario(ARM, PD(ARM, kp=100, kd=10), np.zeros(6), plant="compiled", q0=np.full(6, 0.3))
    with Simulation(scenario) as simulation:
        simulation.step(40)
        whole = simulation.rollout
    preparing = {LaneLoop._prepare, CompiledLoop._arrays_of, LaneLoop._arrays_of, CompiledLoop._rows}
    codes = {each.__code__ for each in (*preparing, LaneLoop._bound_calls)}
    line = 0
    while True:
        left = line

        def interrupt(frame: FrameType, event: str, _: object) -> Any:
            nonlocal left
            if frame.f_code in codes and event == "line":
                left -= 1
                if left < 0:
                    sys.settrace(None)
                    raise KeyboardInterrupt
            return interrupt

        with Simulation(scenario) as simulation:
            simulation.step(16)
            sys.settrace(interrupt)
            try:
                simulation.step(24)
                break
            except KeyboardInterrupt:
                simulation.step(40 - len(simulation.rollout))
            finally:
                sys.settrace(None)
            the_same(simulation.rollout, whole)
        line += 1
    assert line > 20


def test_ctrl_c_in_the_middle_of_a_stage() -> None:
    law = ComputedTorque(ARM, kp=400, kd=40, backend=Interrupting(ARM))
    with glue(on=True), pytest.raises(RolloutInterrupted, match="after 44 of 100") as caught:
        simulate(ARM, law, tutorial_motion(), duration=0.1)
    with glue(on=False):
        whole = simulate(ARM, ComputedTorque(ARM, kp=400, kd=40), tutorial_motion(), duration=0.1)
    the_same(caught.value.rollout, whole.first(44))


@pytest.fixture
def ctrl_c() -> Iterator[None]:
    """Python's own handler: a process that was started in the background ignores Ctrl-C."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize("on", [True, False])
def test_ctrl_c_keeps_what_was_computed(on: bool) -> None:
    law = ComputedTorque(ARM, kp=400, kd=40)
    told: list[tuple[int, int]] = []
    options: dict[str, Any] = {"duration": 2.0}
    motion = tutorial_motion()

    def interrupt(taken: int, wanted: int) -> None:
        told.append((taken, wanted))
        if taken > 300:
            assert threading.current_thread() is threading.main_thread()
            signal.raise_signal(signal.SIGINT)

    with glue(on=on):
        with pytest.raises(RolloutInterrupted, match="of 2000 steps") as caught:
            simulate(ARM, law, motion, **options, progress=interrupt)
        part = caught.value.rollout
        assert 300 < len(part) < 2000
        assert len(part) == told[-1][0]
        assert [taken for taken, _ in told] == sorted(taken for taken, _ in told)
        the_same(simulate(ARM, law, motion, **options, resume=part), simulate(ARM, law, motion, **options))


@pytest.mark.parametrize("on", [True, False])
def test_progress_is_told_to_the_end(on: bool) -> None:
    told: list[tuple[int, int]] = []
    with glue(on=on):
        simulate(ARM, q0=np.zeros(6), duration=0.5, progress=lambda *steps: told.append(steps))
    assert told[-1] == (500, 500)
    assert len(told) > 2


def test_a_step_that_is_not_compiled_is_named() -> None:
    robot = load("free_body", base="floating")
    rollout = simulate(robot, plant="reference", integrator="rk4", duration=2.5)
    assert "the integrator rk4 with a floating base is not compiled" in rollout.executor
