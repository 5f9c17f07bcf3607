"""A rollout is resumed by its own scenario only: every other field is refused by name."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx import ExternalForce
from dynx.control import PD, PID, ComputedTorque, Saturated
from dynx.errors import ArgumentError
from dynx.model.loading import load
from dynx.sim import Noise, Payload, Rollout, Scenario, simulate
from dynx.sim.scenario.options import OPTIONS
from dynx.trajectory import cycloidal
from dynx.world import Encoder

ARM = load("ur5")
START, END = np.zeros(6), np.full(6, 0.02)
SCENARIO = Scenario(
    ARM,
    ComputedTorque(ARM, kp=400, kd=40),
    cycloidal(START, END, duration=0.02),
    plant="compiled",
    integrator="adaptive",
    control_dt=2e-3,
    delay=1e-3,
    q0=START,
    v0=START,
    noise=Noise(1e-4, 1e-3, seed=5),
    joint_damping=0.1,
    joint_friction=0.2,
    joint_armature=0.01,
    effort_limits=np.full(6, 80.0),
    payload=Payload("tool0", 1.0),
    mass_scale={"forearm_link": 1.1},
    pushes=[ExternalForce("tool0", [1.0, 0, 0, 0, 0, 0], start=0.002, duration=0.01)],
    check_reference=True,
)
HEAVY = ARM.with_gravity([0.0, 0.0, -1.0])
CHANGES: dict[str, Any] = {
    "model": HEAVY,
    "controller": ComputedTorque(ARM, kp=400, kd=41),
    "reference": cycloidal(START, END + 1e-12, duration=0.02),
    "plant": "reference",
    "integrator": "rk4",
    "substeps": 2,
    "method": "RK45",
    "rtol": 1e-9,
    "atol": 1e-11,
    "dt": 5e-4,
    "duration": None,
    "control_dt": 1e-3,
    "delay": 0.0,
    "q0": START + 1e-15,
    "v0": START + 1e-15,
    "noise": Noise(1e-4, 1e-3, seed=6),
    "joint_damping": True,
    "joint_friction": 0.3,
    "friction_slip": 2e-2,
    "joint_armature": np.full(6, 0.01),
    "joint_springs": False,
    "effort_limits": True,
    "joint_limits": False,
    "payload": Payload("tool0", 1.0, center=(0.0, 0.0, 0.01)),
    "mass_scale": {"forearm_link": 1.2},
    "pushes": [ExternalForce("tool0", [1.0, 0, 0, 0, 0, 1e-9], start=0.002, duration=0.01)],
    "check_reference": False,
    "sensors": Encoder("elbow", "elbow_joint"),
}
"""Another value of each field."""

FREE = {"duration", "sensors", "joint_springs"}
"""Fields that may differ: no step depends on them. The robot has no springs."""

WHOLE = simulate(SCENARIO)


def test_every_field_has_another_value_here() -> None:
    assert set(CHANGES) == {each.name for each in fields(Scenario)}
    for name, value in CHANGES.items():
        if name not in ("duration", "joint_springs"):
            assert replace(SCENARIO, **{name: value}) != SCENARIO, name


@pytest.mark.parametrize("name", [each.name for each in fields(Scenario) if each.name not in FREE])
def test_another_value_of_any_field_is_refused_by_name(name: str) -> None:
    other = replace(SCENARIO, **{name: CHANGES[name]})
    if name == "model":
        other = replace(other, controller=ComputedTorque(HEAVY, kp=400, kd=40))
    with pytest.raises(ArgumentError, match=rf"the rollout to resume .*{name}.*") as caught:
        simulate(other, resume=WHOLE)
    assert "now it is" in str(caught.value) or "not of" in str(caught.value)


def test_a_robot_with_springs_is_resumed_with_springs() -> None:
    model = load(
        '<mujoco><worldbody><body name="arm"><joint name="j" stiffness="2"/><geom size="0.1"/></body>'
        "</worldbody></mujoco>"
    )
    options: dict[str, Any] = {"q0": [0.5], "duration": 0.01}
    whole = simulate(model, **options)
    np.testing.assert_array_equal(simulate(model, **options, resume=whole, step=3).q, whole.q)
    with pytest.raises(ArgumentError, match="joint_springs True; now it is False"):
        simulate(model, **options, joint_springs=False, resume=whole)


def test_other_sensors_read_the_resumed_simulation() -> None:
    resumed = simulate(replace(SCENARIO, sensors=CHANGES["sensors"]), resume=WHOLE)
    assert resumed.q.tobytes() == WHOLE.q.tobytes()
    assert "elbow" in resumed.sensors


INNER: dict[type, tuple[str, dict[str, Any]]] = {
    Noise: ("noise", {"q": 2e-4, "v": 2e-3, "seed": 7, "rollout": 3}),
    Payload: (
        "payload",
        {
            "frame": "wrist_3_link",
            "mass": 2.0,
            "center": (0.0, 1e-9, 0.0),
            "inertia": np.eye(3) * 1e-3,
        },
    ),
    ExternalForce: (
        "pushes",
        {
            "on": "wrist_3_link",
            "wrench": [2.0, 0, 0, 0, 0, 0],
            "start": 0.003,
            "duration": 0.02,
            "reference": "local",
            "point": (0.0, 0.0, 0.1),
        },
    ),
}
"""Another value of each field of the dataclasses inside a scenario."""


@pytest.mark.parametrize(
    ("part", "field", "value"),
    [(part, each.name, values[each.name]) for kind, (part, values) in INNER.items() for each in fields(kind)],
)
def test_another_value_inside_a_field_is_refused_too(part: str, field: str, value: Any) -> None:
    inner = getattr(SCENARIO, part)
    inner = inner[0] if isinstance(inner, tuple) else inner
    assert is_dataclass(inner)
    changed: Any = replace(inner, **{field: value})  # type: ignore[type-var]
    change: dict[str, Any] = {part: [changed] if part == "pushes" else changed}
    other = replace(SCENARIO, **change)
    with pytest.raises(ArgumentError, match=rf"the rollout to resume had {part}"):
        simulate(other, resume=WHOLE)


@pytest.mark.parametrize(
    "other",
    [
        ComputedTorque(ARM, kp=[400, 400, 400, 400, 400, 400 + 1e-12], kd=40),
        ComputedTorque(ARM, kp=400, kd=40, backend="reference"),
        PD(ARM, kp=400, kd=40),
        PID(ARM, kp=400, ki=1, kd=40, control_dt=2e-3),
        None,
    ],
)
def test_another_controller_or_another_engine_of_it_is_refused(other: Any) -> None:
    with pytest.raises(ArgumentError, match=r"the rollout to resume had controller"):
        simulate(replace(SCENARIO, controller=other), resume=WHOLE)


def test_the_pendulum_with_another_armature_is_refused() -> None:
    pendulum = load("pendulum")
    free = simulate(pendulum, q0=[1.0], duration=0.1)
    with pytest.raises(ArgumentError, match=r"had joint_armature True; now it is 5\.0"):
        simulate(pendulum, q0=[1.0], duration=0.1, joint_armature=5.0, resume=free, step=50)


@given(value=st.floats(1e-3, 1e3), change=st.sampled_from(["joint_damping", "joint_friction", "rtol"]))
def test_the_smallest_change_of_a_number_is_refused(value: float, change: str) -> None:
    before: dict[str, Any] = {change: value}
    after: dict[str, Any] = {change: float(np.nextafter(value, np.inf))}
    short = replace(SCENARIO, **before)
    record = replace(WHOLE, scenario=short)
    with pytest.raises(ArgumentError, match=rf"had {change} "):
        simulate(replace(short, **after), resume=record)


def test_a_longer_or_a_shorter_duration_resumes() -> None:
    long = replace(SCENARIO, duration=0.03)
    longer = simulate(long, resume=WHOLE)
    assert np.array_equal(longer.q, simulate(long).q)
    shorter = simulate(replace(SCENARIO, duration=0.01), resume=WHOLE, step=5)
    assert np.array_equal(shorter.q, WHOLE.q[:11])


def test_equal_scenarios_written_otherwise_resume(tmp_path: Path) -> None:
    WHOLE.first(9).save(tmp_path / "part.npz")
    part = Rollout.load(tmp_path / "part.npz")
    same = simulate(
        ARM,
        ComputedTorque(ARM, kp=np.full(6, 400.0), kd=[40.0] * 6),
        cycloidal([0.0] * 6, [0.02] * 6, duration=0.02),
        **{name: getattr(SCENARIO, name) for name in OPTIONS},
        resume=part,
    )
    assert np.array_equal(same.q, WHOLE.q)


def test_a_gain_of_a_controller_inside_another_is_refused_by_name() -> None:
    scenario, other, integral = (
        replace(SCENARIO, controller=Saturated(inner, limit=5.0))
        for inner in (
            PD(ARM, kp=400, kd=40),
            PD(ARM, kp=400, kd=41),
            PID(ARM, kp=400, ki=1, kd=40, control_dt=2e-3),
        )
    )
    assert [each.field for each in scenario.differences(other)] == ["controller.inner.kd"]
    assert [each.field for each in scenario.differences(integral)] == ["controller.inner"]
    whole = simulate(scenario)
    with pytest.raises(ArgumentError, match=r"had controller\.inner\.kd \[40\.0, .*; now it is \[41\.0, "):
        simulate(other, resume=whole)
    with pytest.raises(ArgumentError, match=r"had controller\.inner PD\(kp \[.*; now it is PID\(kp \["):
        simulate(integral, resume=whole)


LOAD = Payload("tool0", 1.0)


def force(x: float, start: float = 0.0) -> ExternalForce:
    return ExternalForce("tool0", [x, 0, 0, 0, 0, 0], start)


@pytest.mark.parametrize(
    ("then", "now", "part"),
    [
        ({"pushes": [force(1.0)]}, {"pushes": [force(2.0)]}, "pushes[0].wrench"),
        (
            {"pushes": [force(1.0)] * 9},
            {"pushes": [*[force(1.0)] * 8, force(1.0, start=0.5)]},
            "pushes[8].start",
        ),
        ({"pushes": [force(1.0)] * 9}, {"pushes": [force(1.0)] * 8}, "pushes"),
        ({"payload": [LOAD, LOAD]}, {"payload": [LOAD, Payload("tool0", 1.5)]}, "payload[1].mass"),
    ],
)
def test_the_refusal_shows_the_first_entry_that_differs(
    then: dict[str, Any], now: dict[str, Any], part: str
) -> None:
    before = simulate(ARM, duration=0.01, **then)
    with pytest.raises(ArgumentError) as refused:
        simulate(ARM, duration=0.02, resume=before, **now)
    had, _, has = str(refused.value).partition(f"had {part} ")[2].partition("; now it is ")
    assert had
    assert had != has
