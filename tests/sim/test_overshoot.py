"""The overshoot of a damped joint is damping times time step over inertia."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

import dynx
from dynx import control
from dynx.errors import DivergedError, SingularMassMatrixError
from dynx.model import Model
from dynx.sim import Noise, ScenePlant, simulate
from dynx.sim.overshoot import largest_overshoot, overcompensated_friction
from dynx.sim.plants.disturbances import Disturbances
from dynx.steppers.registry import installed_worlds
from dynx.world import Scene, SceneRobot

DT = 1e-3


def test_the_joint_with_the_largest_ratio_is_named() -> None:
    model = dynx.load("ur5")
    q = np.linspace(-1.0, 1.0, 6)
    inertia = np.diagonal(dynx.backend("pinocchio", model).mass_matrix(q))
    kd = np.full(6, 1.0)
    kd[4] = 3.0 * inertia[4] / DT
    kd[2] = 2.0 * inertia[2] / DT
    for controller in (
        control.PD(model, kp=0.0, kd=kd),
        control.FrictionCompensation(control.PD(model, kp=0.0, kd=kd)),
    ):
        found = largest_overshoot(controller, q, DT)
        assert found is not None
        assert found.joint == model.joint_names[4]
        assert found.ratio == pytest.approx(3.0, rel=1e-9)


def test_damping_that_overshoots_nothing_is_none() -> None:
    model = dynx.load("ur5")
    inertia = np.diagonal(dynx.backend("pinocchio", model).mass_matrix(np.zeros(6)))
    slow = control.PD(model, kp=0.0, kd=0.999 * inertia / DT)
    assert largest_overshoot(slow, np.zeros(6), DT) is None
    # Its gains are in 1/s, not in N m s/rad.
    slow_errors = control.ComputedTorque(model, kp=1.0, kd=0.999 / DT)
    assert largest_overshoot(slow_errors, np.zeros(6), DT) is None
    assert largest_overshoot(None, np.zeros(6), DT) is None


def test_damping_of_a_frame_acts_on_a_joint_through_the_jacobian() -> None:
    model = dynx.load("ur5")
    q = np.linspace(-1.0, 1.0, 6)
    frame = model.frame_names[-1]
    engine = dynx.backend("pinocchio", model)
    J = engine.jacobian(q, frame)
    D = np.array([40.0, 50.0, 60.0, 7.0, 8.0, 9.0])
    controller = control.Impedance(model, frame, stiffness=0.0, damping=D, joint_damping=0.5)
    ratio = (np.diagonal(J.T @ np.diag(D) @ J) + 0.5) / np.diagonal(engine.mass_matrix(q))
    dt = 2.0 / ratio.max()
    found = largest_overshoot(controller, q, dt)
    assert found is not None
    assert found.joint == model.joint_names[int(np.argmax(ratio))]
    assert found.ratio == pytest.approx(2.0, rel=1e-9)


def test_the_ratio_of_computed_torque_is_kd_dt() -> None:
    model = dynx.load("ur5")
    kd = np.array([1.0, 1.0, 40.0, 1.0, 1.0, 1.0])
    found = largest_overshoot(control.ComputedTorque(model, kp=400.0, kd=kd), np.zeros(6), 0.1)
    assert found is not None
    assert found.joint == model.joint_names[2]
    assert found.ratio == pytest.approx(4.0)
    assert found.hint("dt").startswith(f"kd dt is 4 at {found.joint}")


def test_a_diverged_simulation_names_the_joint_in_its_error() -> None:
    model = dynx.load("ur10")
    q0 = model.neutral() + 0.1
    inertia = np.diagonal(dynx.backend("pinocchio", model).mass_matrix(q0))
    damped = control.GravityCompensatedPD(model, kp=0.0, kd=5.0)
    options: dict[str, Any] = {"q0": q0, "duration": 1.0, "joint_limits": False}
    with pytest.raises(DivergedError) as raised:
        simulate(model, damped, model.neutral(), v0=np.ones(6), **options)
    ratio, name = 5.0 * DT / inertia.min(), model.joint_names[int(np.argmin(inertia))]
    hint = f"kd dt / inertia is {ratio:.3g} at {name}, and a step is unstable above 2"
    assert hint in str(raised.value)
    with pytest.raises(DivergedError) as raised:
        simulate(model, damped, model.neutral(), v0=np.ones(6), dt=DT / 2, control_dt=DT, **options)
    assert hint.replace(" dt ", " control_dt ") in str(raised.value)
    with pytest.raises(DivergedError) as raised:
        simulate(model, None, v0=np.full(6, 1e5), **options)
    assert "unstable" not in str(raised.value)


def test_friction_that_is_compensated_beyond_that_of_the_plant_is_named() -> None:
    model = dynx.load("ur5")
    law = control.FrictionCompensation(control.PD(model, kp=20.0, kd=0.5), damping=[0, 0, 0, 0, 9, 0])
    options: dict[str, Any] = {"duration": 0.5, "q0": np.zeros(6), "plant": "compiled", "joint_limits": False}
    with pytest.raises(DivergedError, match=r"of 9 N m s/rad .* at wrist_2_joint, where the plant has 2"):
        simulate(model, law, np.full(6, 0.1), joint_damping=2.0, **options)
    damped = simulate(model, law, np.full(6, 0.1), joint_damping=9.0, **options)
    assert np.abs(damped.v).max() < 100.0


@pytest.mark.parametrize(("name", "base"), [("panda", "fixed"), ("solo12", "floating")])
def test_friction_is_overcompensated_with_joints_that_follow_others_and_on_a_floating_base(
    name: str, base: Any
) -> None:
    """Against the plant with the joint dynamics of the description, the default."""
    model = dynx.load(name, base=base)
    law = control.FrictionCompensation(control.PD(model, kp=1.0, kd=0.1), damping={model.joint_names[1]: 5.0})
    found = overcompensated_friction(law, Disturbances(model).friction)
    assert found is not None
    assert f"damping of 5 N m s/rad or N s/m at {model.joint_names[1]}" in found
    same = control.FrictionCompensation(law.inner)
    assert overcompensated_friction(same, Disturbances(model).friction) is None


def test_one_coefficient_of_a_compensation_leaves_the_other_out() -> None:
    model = dynx.load("kinova")
    inner = control.PD(model, kp=20.0, kd=0.5)
    dry = control.FrictionCompensation(inner, friction=0.4)
    viscous = control.FrictionCompensation(inner, damping=0.4)
    np.testing.assert_array_equal(dry.losses.damping, 0.0)
    np.testing.assert_array_equal(dry.losses.friction, 0.4)
    np.testing.assert_array_equal(viscous.losses.friction, 0.0)
    np.testing.assert_array_equal(viscous.losses.damping, 0.4)


@pytest.mark.parametrize("kd", ["much", None, [1.0, 2.0], {"elbow_joint": 1.0}])
def test_a_controller_with_another_kd_has_no_known_overshoot(kd: object) -> None:
    model = dynx.load("ur5")
    law = control.PD(model, kp=0.0, kd=1.0)
    object.__setattr__(law, "kd", kd)
    assert largest_overshoot(law, np.zeros(6), DT) is None


def test_only_failures_of_dynx_hide_the_explanation_of_a_divergence(monkeypatch: pytest.MonkeyPatch) -> None:
    def diverge(error: Exception) -> None:
        def fail(*_: object, **options: object) -> None:
            raise error

        monkeypatch.setattr("dynx.sim.closed_loop.largest_overshoot", fail)
        options: dict[str, Any] = {"duration": 1.0, "plant": "reference", "joint_limits": False}
        simulate(dynx.load("ur5"), None, v0=np.full(6, 1e5), **options)

    with pytest.raises(DivergedError) as raised:
        diverge(SingularMassMatrixError("no inertia"))
    assert raised.value.overshoot is None
    with pytest.raises(ZeroDivisionError, match="a defect"):
        diverge(ZeroDivisionError("a defect"))


START = {
    "ur5": np.array([0.1, -1.0, 1.0, 0.2, 0.3, 0.1]),
    "panda": np.array([0.0, 0.2, 0.0, -2.0, 0.0, 2.0, 0.5, 0.02]),
}


def scene_of(model: Model, engine: str) -> ScenePlant:
    """Return the robot alone in a world."""
    return ScenePlant(Scene("s", robots=(SceneRobot("r", model),)), engine=engine)


PLANTS: dict[str, Callable[[Model], Any]] = {
    "compiled": lambda _: "compiled",
    "pinocchio": lambda _: "pinocchio",
    **{engine: partial(scene_of, engine=engine) for engine in installed_worlds()},
}


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("robot", ["ur5", "panda"])
def test_an_oscillation_that_effort_limits_bound_is_named(robot: str, plant: str) -> None:
    model = dynx.load(robot)
    q0 = START[robot]
    inertia = np.diagonal(dynx.backend("reference", model).mass_matrix(q0))
    kd = 0.3 * inertia / DT
    kd[4] *= 110.0
    for controller in (
        control.PD(model, kp=1.0, kd=kd),
        control.Saturated(control.GravityCompensatedPD(model, kp=1.0, kd=kd), limit=model.effort_limit),
    ):
        rollout = simulate(
            model,
            controller,
            q0 + 0.01,
            q0=q0,
            duration=0.2,
            plant=PLANTS[plant](model),
            effort_limits=not isinstance(controller, control.Saturated),
        )
        found = rollout.summary().overshoot
        assert found is not None
        assert found.joint == model.joint_names[4]
        assert found.ratio == pytest.approx(33.0)
        assert f"the torque of {found.joint} reverses in every control step" in str(rollout.summary())


@pytest.mark.skipif("drake" not in installed_worlds(), reason="drake")
@pytest.mark.parametrize("plant", ["compiled", "pybullet", "drake"])
def test_an_oscillation_that_joint_limits_bound_is_named(plant: str) -> None:
    model = dynx.load("ur5")
    rollout = simulate(
        model,
        control.PD(model, kp=100.0, kd=500.0),
        np.full(6, 0.5),
        q0=np.zeros(6),
        duration=0.1,
        plant=scene_of(model, "drake") if plant == "drake" else plant,
    )
    assert np.abs(rollout.v).max() > 1e3
    assert rollout.overshoot is not None
    assert rollout.overshoot.joint == model.joint_names[5]


@pytest.mark.parametrize(
    "options",
    [
        {"noise": Noise(v=0.05, seed=1)},
        {"joint_friction": 5.0},
        {"joint_armature": 1.0, "kd": 30.0},
    ],
    ids=["noise", "friction", "armature"],
)
def test_a_stable_motion_names_no_oscillation(options: dict[str, Any]) -> None:
    model = dynx.load("ur5")
    kd = options.pop("kd", None)
    if kd is None:
        kd = 0.9 * np.diagonal(dynx.backend("reference", model).mass_matrix(np.zeros(6))) / DT
    slow = control.PD(model, kp=10.0, kd=kd)
    rollout = simulate(
        model, slow, np.full(6, 0.3), q0=np.zeros(6), duration=0.3, effort_limits=True, **options
    )
    assert rollout.overshoot is None
    assert "reverses" not in str(rollout.summary())
