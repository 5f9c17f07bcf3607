"""Wrenches at joints along a rollout: from the recorded motion, pushes and contacts."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import dynx
from dynx import control
from dynx.backends import backend
from dynx.errors import UnsupportedFeatureError
from dynx.sim.plants.scene_plant import ScenePlant
from dynx.spatial.scalar import Floats
from dynx.world import ForceTorqueSensor, PointToPoint, Scene, SceneRobot, ground
from tests.world.engines import WORLDS
from tests.world.standing import quadruped

PUSHES = (
    dynx.ExternalForce("tool0", (20.0, 0.0, 5.0, 1.0, 2.0, 3.0), 0.0105, 0.02, "local", (0.0, 0.0, 0.1)),
    dynx.ExternalForce("forearm_link", (0.0, 8.0, 0.0, 0.0, 0.0, 1.0), 0.02),
    dynx.ExternalForce("wrist_1_link", (3.0, 0.0, 0.0, 0.0, 2.0, 0.0), 0.0, 0.03, "world"),
)


def along_axes(rollout: dynx.Rollout) -> Floats:
    """Return the components (n, n_joints that move) of the wrenches along the axes of revolute joints."""
    wrenches = rollout.joint_wrenches()
    axes = [(k, np.array(joint.axis)) for k, joint in enumerate(rollout.model.joints) if joint.moves]
    return np.stack([wrenches[:, k, 3:] @ axis for k, axis in axes], axis=-1)


@pytest.mark.parametrize("plant", ["pinocchio", "compiled", "mujoco", "drake", "pybullet"])
def test_the_moment_about_the_axis_is_the_recorded_torque(plant: str) -> None:
    """Pushes in three references, of which two act during a part of a step, and a payload."""
    if plant not in dynx.installed_backends():
        pytest.skip(f"needs {plant}")
    arm = dynx.load("ur5")
    q0 = np.array([0.0, -1.2, 1.5, -0.3, 0.2, 0.0])
    rollout = dynx.simulate(
        arm,
        control.ComputedTorque(arm, kp=100, kd=20),
        q0 + 0.1,
        duration=0.05,
        q0=q0,
        plant=plant,
        pushes=PUSHES,
        payload=dynx.Payload("tool0", 1.0),
    )
    assert set(rollout.external_forces) == {push.on for push in PUSHES}
    np.testing.assert_allclose(along_axes(rollout), rollout.tau, rtol=0, atol=1e-11)
    with backend("pinocchio", rollout.model) as engine:
        state = rollout.q[:-1], rollout.v[:-1], rollout.a
        options: dict[str, Any] = {"external_forces": rollout.external_forces, "force_reference": "world"}
        by_engine = engine.joint_wrenches(*state, frame="tool0", reference="world", **options)
        np.testing.assert_allclose(
            rollout.joint_wrenches(frame="tool0", reference="world"), by_engine, rtol=0, atol=1e-10
        )
        at_base = engine.base_wrench(*state, **options)
        np.testing.assert_allclose(rollout.base_wrench(), at_base, rtol=0, atol=1e-10)


def test_friction_and_armature_act_on_the_side_of_the_motor() -> None:
    """What the motor gives beyond the wrench at the joint is what friction and armature take."""
    arm = dynx.load("ur5")
    q0 = np.array([0.0, -1.2, 1.5, -0.3, 0.2, 0.0])
    rollout = dynx.simulate(
        arm,
        control.ComputedTorque(arm, kp=100, kd=20),
        q0 + 0.1,
        duration=0.05,
        q0=q0,
        joint_armature=0.2,
        joint_damping=3.0,
    )
    # Damping is that of the velocity at the end of the step.
    taken = 0.2 * rollout.a + 3.0 * rollout.v[1:]
    np.testing.assert_allclose(along_axes(rollout) + taken, rollout.tau, rtol=0, atol=1e-9)


RESIDUAL = {"mujoco": 1e-12, "drake": 5e-6, "pybullet": 5e-6}
"""Residual of each engine's equations of motion with contacts, as a share of the weight: rounding in MuJoCo,
what their solvers leave in the others."""


@pytest.mark.parametrize("engine", WORLDS)
def test_contacts_and_weight_are_the_rate_of_momentum(engine: str) -> None:
    """Nothing else holds a quadruped that stands on its feet and is pushed, so its base bears nothing."""
    dog, q = quadruped("a1")
    scene = Scene("field", robots=(SceneRobot("dog", dog, q=tuple(q)),), bodies=(ground(),))
    push = dynx.ExternalForce("trunk", (30.0, 10.0, 0.0, 0.0, 0.0, 0.0), 0.1, 0.1)
    plant, controller = ScenePlant(scene, engine=engine), control.PD(dog, kp=100, kd=4)
    rollout = dynx.simulate(dog, controller, q, duration=0.25, q0=q, plant=plant, pushes=[push])
    weight = 9.81 * rollout.model.total_mass
    assert {"trunk", "FR_foot"} <= set(rollout.external_forces)
    assert np.abs(rollout.base_wrench()).max() < RESIDUAL[engine] * weight
    unheld = replace(rollout, surroundings=None)
    assert np.abs(unheld.base_wrench()).max() > 0.9 * weight
    # The motors hold the legs with what the feet press.
    np.testing.assert_allclose(
        along_axes(rollout), rollout.tau[:, 6:], rtol=0, atol=RESIDUAL[engine] * weight
    )


def test_a_record_without_a_scenario_has_no_external_forces() -> None:
    arm = dynx.load("ur5")
    rollout = replace(
        dynx.simulate(arm, control.PD(arm, kp=50, kd=5), np.zeros(6), duration=0.01, q0=np.full(6, 0.1)),
        scenario=None,
    )
    assert rollout.external_forces == {}
    np.testing.assert_allclose(along_axes(rollout), rollout.tau, rtol=0, atol=1e-10)


@pytest.mark.parametrize(("end", "internal"), [("world", False), ("arm/base", True)])
@pytest.mark.parametrize("engine", WORLDS)
def test_a_robot_that_a_constraint_holds_is_refused_since_its_forces_are_not_recorded(
    engine: str, end: str, internal: bool
) -> None:
    model = dynx.load("planar_2r")
    scene = Scene("held", [SceneRobot("arm", model)], constraints=[PointToPoint("arm/forearm", end)])
    sensor = ForceTorqueSensor("wrench", model.joint_names[1])
    rollout = dynx.simulate(model, plant=ScenePlant(scene, engine=engine), duration=0.01, sensors=sensor)
    for refused in (rollout.joint_wrenches, lambda: rollout.sensors["wrench"]):
        with pytest.raises(UnsupportedFeatureError, match=r"a PointToPoint holds .*'arm/forearm'"):
            refused()
    if internal:
        assert rollout.base_wrench().shape == (len(rollout), 6)
    else:
        with pytest.raises(UnsupportedFeatureError, match="World"):
            rollout.base_wrench()
