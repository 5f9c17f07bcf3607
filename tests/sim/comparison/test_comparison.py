"""Rollouts part for the differences of their scenarios, which reruns prove one by one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dynx
from dynx import control, trajectory
from dynx.errors import ArgumentError
from dynx.model import Model
from dynx.sim import Noise, Payload, Rollout, Scenario, ScenePlant, compare, simulate
from dynx.sim.comparison import rollout_separation
from dynx.world import Material, Scene, SceneRobot, box, ground

ARM = dynx.load("so101")
MOTION = trajectory.cycloidal(np.zeros(6), [0.3, 0.2, 0.4, -0.2, 0.1, 0.0], duration=0.2)


def scenario(model: Model = ARM, **options: Any) -> Scenario:
    """Return a scenario of computed torque on the compiled plant."""
    law = control.ComputedTorque(model, kp=options.pop("kp", 100.0), kd=20.0)
    return Scenario(model, law, MOTION, **{"plant": "compiled", **options})


def other_robot() -> Model:
    """Return the arm with another mass of one link, and damping of one joint."""
    links = [
        replace(each, inertial=replace(each.inertial, mass=0.2))
        if each.name == "wrist_link" and each.inertial
        else each
        for each in ARM.links
    ]
    joints = [
        replace(each, dynamics=replace(each.dynamics, damping=0.5)) if each.name == "elbow_flex" else each
        for each in ARM.joints
    ]
    return replace(ARM, links=tuple(links), joints=tuple(joints))


def test_one_cause_is_proved_and_another_difference_has_no_effect() -> None:
    ours = simulate(scenario())
    theirs = simulate(scenario(payload=Payload("gripper_link", 0.1), plant="reference"))
    found = compare(ours, theirs)
    assert not found.alike
    assert found.proved
    assert (found.remaining, found.repeated) == (0.0, 0.0)
    assert found._repr_html_().count("<tr>") == 1 + len(found.causes)
    payload, plant = found.causes
    assert payload.factor.name == "payload"
    assert payload.alone == pytest.approx(found.separation.largest, rel=1e-9)
    assert plant.factor.name == "plant"
    assert not plant.acts(found.tolerance)
    parting = found.separation.first_beyond(1e-9)
    assert parting is not None
    assert parting == (ours.t[1], "gripper")


def test_links_joints_gains_and_noise_are_differences_of_their_own() -> None:
    ours = simulate(scenario(joint_damping=True))
    theirs = simulate(scenario(other_robot(), kp=50.0, noise=Noise(q=1e-4), joint_damping=True))
    found = compare(ours, theirs)
    assert found.proved
    effects = {cause.factor.name: cause for cause in found.causes}
    assert set(effects) == {
        "link wrist_link, inertial",
        "joint elbow_flex, dynamics",
        "controller.kp",
        "noise",
    }
    assert (effects["controller.kp"].factor.ours, effects["controller.kp"].factor.theirs) == ("100", "50")
    assert effects["link wrist_link, inertial"].factor.theirs == "mass 0.2"
    # With everything else taken over, each difference that acts leaves what it adds.
    assert all(cause.without is not None and cause.without > 1e-9 for cause in found.causes)
    order = [max(cause.alone or 0.0, cause.without or 0.0) for cause in found.causes]
    assert order == sorted(order, reverse=True)
    # The robot that both know to its controller moves alike, but for the gains.
    alone = effects["link wrist_link, inertial"].alone
    assert alone is not None
    assert alone < 1e-9


def test_a_cause_that_is_mended_leaves_the_rollouts_alike() -> None:
    ours = scenario(joint_damping=True)
    theirs = scenario(other_robot(), joint_damping=True)
    mended = replace(theirs, model=ARM, controller=control.ComputedTorque(ARM, kp=100.0, kd=20.0))
    found = compare(simulate(ours), simulate(mended))
    assert found.alike
    assert not found.causes
    assert not found.proved


def test_times_of_other_steps_are_interpolated() -> None:
    ours, theirs = simulate(scenario(dt=2e-3)), simulate(scenario(dt=1e-3))
    apart = rollout_separation(ours, theirs)
    np.testing.assert_array_equal(apart.times, ours.t)
    np.testing.assert_array_equal(apart.distances, np.abs(ARM.difference(ours.q, theirs.q[::2])))
    late = replace(theirs, t=theirs.t + 0.5e-3)
    middle = rollout_separation(late, theirs)
    assert len(middle.times) == len(theirs.t) - 1
    expected = np.abs(0.5 * (theirs.q[1:] - theirs.q[:-1]))
    np.testing.assert_allclose(middle.distances, expected, atol=1e-15)
    found = compare(ours, theirs)
    assert found.proved
    assert [cause.factor.name for cause in found.causes] == ["dt", "control_dt"]


def test_rollouts_that_cannot_be_compared() -> None:
    ours, other = simulate(scenario(duration=0.01)), dynx.load("ur5")
    theirs = simulate(other, None, plant="compiled", duration=0.01)
    with pytest.raises(ArgumentError, match="other coordinates: fixed base and joints shoulder_pan, "):
        compare(ours, theirs)
    with pytest.raises(
        ArgumentError,
        match=r"no common time .*: one is from 0 to 0\.01 s, the other from 5 to",
    ):
        compare(ours, replace(ours, t=ours.t + 5.0))


class Own(control.Controller[None], pure=True):
    """A damper that no file can rebuild."""

    def __init__(self, model: Model) -> None:
        self.model = model

    def torque(self, measurement: Any, setpoint: Any, state: None) -> Any:
        return -1e-4 * measurement.v, None


def test_what_cannot_be_simulated_again_is_said(tmp_path: Path) -> None:
    start: dict[str, Any] = {"q0": np.full(6, 0.1), "duration": 0.02, "plant": "compiled"}
    ours = simulate(ARM, Own(ARM), np.zeros(6), **start)
    theirs = simulate(ARM, Own(ARM), np.zeros(6), joint_damping=1.0, **start)
    assert compare(ours, theirs).proved  # as the objects are here
    ours.save(tmp_path / "own.npz")
    found = compare(Rollout.load(tmp_path / "own.npz"), theirs)
    assert not found.proved
    assert found.repeated is None
    assert any("controller cannot be rebuilt" in note for note in found.notes)
    bare = replace(theirs, scenario=None)
    found = compare(ours, bare)
    assert found.causes == ()
    assert found.notes == (
        "the second rollout has no scenario, so that differences cannot be listed or proved",
    )


def test_a_difference_that_diverges_has_an_infinite_effect() -> None:
    ours = simulate(scenario(duration=0.05))
    law = control.PD(ARM, kp=1.0, kd=1e-4)
    theirs = simulate(replace(scenario(duration=0.05), controller=law))
    assert theirs.scenario is not None
    again = replace(theirs.scenario, controller=control.PD(ARM, kp=1.0, kd=1e3), q0=np.full(6, 1e-3))
    found = compare(ours, theirs)
    assert found.proved
    mixed = compare(theirs, replace(ours, scenario=again), tolerance=0.0)
    assert any(cause.alone == float("inf") and "diverged" in (cause.obstacle or "") for cause in mixed.causes)
    assert not mixed.proved


def test_bodies_materials_and_the_engine_of_a_scene() -> None:
    def plant(mass: float, friction: float, engine: str) -> ScenePlant:
        cube = box(
            "cube",
            (0.05, 0.05, 0.05),
            mass=mass,
            pose=dynx.Pose((0.5, 0.0, 0.025)),
            material=Material(friction=friction),
        )
        slide = replace(cube, twist=(1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
        return ScenePlant(
            Scene("s", robots=(SceneRobot("arm", ARM),), bodies=(ground(), slide)), engine=engine
        )

    law = control.ComputedTorque(ARM, kp=100.0, kd=20.0)

    def run(*given: Any) -> Rollout:
        return simulate(ARM, law, np.zeros(6), plant=plant(*given), duration=0.1)

    found = compare(run(0.1, 0.5, "pybullet"), run(0.3, 0.8, "pybullet"), tolerance=1e-4)
    assert found.proved
    effects = {cause.factor.name: cause for cause in found.causes}
    assert set(effects) == {"body cube, material", "body cube, mass"}
    friction, mass = effects["body cube, material"], effects["body cube, mass"]
    # A sliding cube is decelerated by its friction, whatever its mass.
    assert friction.acts(1e-3)
    assert not mass.acts(1e-3)
    k, column = found.separation.farthest
    assert found.separation.names[column] == "cube"
    assert k == len(found.separation.times) - 1
