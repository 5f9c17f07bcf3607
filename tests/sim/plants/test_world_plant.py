"""A robot in an engine's world as the plant of `dynx.simulate`: alone, where a step of MuJoCo and Drake is
semi-implicit Euler, and in a scene, with its motion, contacts, record and files."""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dynx
from dynx import control
from dynx.backends import backend, installed_backends
from dynx.control import BulletPositionMotor
from dynx.errors import ArgumentError, UnknownNameError, UnsupportedFeatureError
from dynx.sim import Scenario, ScenePlant, Simulation
from dynx.world import Material, Scene, SceneRobot, VelocityMotor, World, box, ground
from tests.backends.robots import mixed_robot
from tests.sim.bars import tutorial_robot
from tests.world.engines import WORLDS

STEPPERS = [name for name in ("mujoco", "drake") if name in installed_backends()]

ENGINES = [
    pytest.param(name, marks=pytest.mark.skipif(find_spec(name) is None, reason=f"needs {name}"))
    for name in WORLDS
    if name in ("pybullet", "mujoco")
]
"""Engines of worlds that are plants of `dynx.simulate` too."""

SLIDER = """<robot name="slider">
  <link name="rail"/>
  <link name="pusher">
    <inertial><mass value="2"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>
  </link>
  <joint name="x" type="prismatic">
    <parent link="rail"/><child link="pusher"/><origin xyz="0 0 0.1"/><axis xyz="1 0 0"/>
    <limit lower="-2" upper="2" effort="100" velocity="10"/><dynamics damping="0.5" friction="0.3"/>
  </joint>
</robot>"""

BRICK = """<robot name="brick">
  <link name="body">
    <inertial><mass value="3"/><inertia ixx="0.02" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision>
  </link>
</robot>"""

CUBE = box(
    "cube", (0.2, 0.2, 0.2), mass=0.5, pose=dynx.Pose((0.3, 0.0, 0.1)), material=Material(friction=0.3)
)


def pushing(engine: str) -> Scenario:
    """A motor pushes a slider against a cube on the ground."""
    slider = dynx.load(SLIDER)
    scene = Scene("pushing", robots=(SceneRobot("slider", slider),), bodies=(ground(), CUBE))
    plant = ScenePlant(scene, engine=engine)
    return Scenario(slider, control.PD(slider, kp=200.0, kd=40.0), [0.4], plant=plant, duration=0.5)


def rollout_of(scenario: Scenario) -> dynx.Rollout:
    return dynx.simulate(scenario)


@pytest.mark.parametrize("engine", ENGINES)
def test_without_contacts_the_motion_is_that_of_the_same_engine(engine: str) -> None:
    arm = dynx.load("ur5")
    q0 = np.array([0.0, -1.2, 1.5, -0.3, 0.5, 0.0])
    scene = Scene("alone", robots=(SceneRobot("arm", arm, q=tuple(q0)),))
    law = control.ComputedTorque(arm, kp=100.0, kd=20.0)
    goal = q0 + 0.4
    inside = dynx.simulate(arm, law, goal, plant=ScenePlant(scene, engine=engine), duration=0.3)
    alone = dynx.simulate(arm, law, goal, q0=q0, plant=engine, duration=0.3)
    np.testing.assert_allclose(inside.q, alone.q, rtol=0, atol=1e-10)
    np.testing.assert_allclose(inside.v, alone.v, rtol=0, atol=1e-10)
    assert inside.surroundings is not None
    assert len(inside.surroundings.contacts) == 0


@pytest.mark.parametrize("engine", ENGINES)
def test_contact_forces_account_for_the_motion_of_what_is_pushed(engine: str) -> None:
    rollout = rollout_of(pushing(engine))
    around = rollout.surroundings
    assert around is not None
    n, path = len(rollout), around.bodies["cube"][:, :3, 3]
    assert path[-1, 0] > path[0, 0] + 0.05
    force = around.contacts.force_on("cube")
    # Newton's second law over the last 0.1 s: change of momentum = impulse of contacts and gravity.
    window = slice(n - 100, n)
    momentum = 0.5 * (path[n] - path[n - 1] - (path[n - 100] - path[n - 101])) / rollout.scenario.dt  # type: ignore[union-attr]
    impulse = 1e-3 * (force[window] + [0.0, 0.0, -0.5 * 9.81]).sum(axis=0)
    np.testing.assert_allclose(momentum, impulse, atol=0.03)
    np.testing.assert_array_equal(
        around.contacts.force_on("slider"), around.contacts.force_on("slider/pusher")
    )
    assert not around.contacts.force_on("slider/rail").any()
    with pytest.raises(UnknownNameError, match="did you mean 'cube'"):
        around.contacts.force_on("cub")
    pusher = around.contacts.force_on("slider/pusher")
    assert (pusher[:, 0] <= 1e-9).all()
    assert pusher[:, 0].min() < -0.3 * 0.5 * 9.81


@pytest.mark.parametrize("engine", ENGINES)
def test_a_floating_robot_rests_with_its_payload_on_the_ground(engine: str) -> None:
    brick = dynx.load(BRICK, base="floating")
    start = (0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0)
    scene = Scene("resting", robots=(SceneRobot("brick", brick, q=start),), bodies=(ground(),))
    rollout = dynx.simulate(
        brick, plant=ScenePlant(scene, engine=engine), duration=1.0, payload=dynx.Payload("body", 2.0)
    )
    around = rollout.surroundings
    assert around is not None
    force = around.contacts.force_on("brick/body")
    np.testing.assert_allclose(force[-200:].mean(axis=0), [0.0, 0.0, 5.0 * 9.81], atol=0.05)
    assert around.contacts[999]
    assert {around.contacts[999][0].a, around.contacts[999][0].b} == {"brick/body", "ground"}


@pytest.mark.parametrize("engine", ENGINES)
def test_joint_friction_and_pushes_act_as_in_other_plants(engine: str) -> None:
    slider = dynx.load(SLIDER)
    plant = ScenePlant(Scene("free", robots=(SceneRobot("slider", slider),)), engine=engine)
    push = dynx.ExternalForce("pusher", [4.0, 0, 0, 0, 0, 0], duration=0.25)
    given = {
        "duration": 0.5,
        "joint_damping": True,
        "joint_friction": True,
        "joint_armature": 0.5,
        "pushes": push,
    }
    inside, alone = (dynx.simulate(slider, plant=each, **given) for each in (plant, "reference"))  # type: ignore[arg-type]
    np.testing.assert_allclose(inside.q, alone.q, atol=2e-3)
    assert 0.0 < inside.v[-1, 0] < inside.v.max()


@pytest.mark.parametrize("engine", ENGINES)
def test_a_simulation_returns_to_what_it_saved(engine: str) -> None:
    with Simulation(pushing(engine)) as simulation:
        simulation.run(until=0.3)
        saved = simulation.save()
        first = simulation.run()
        simulation.restore(saved)
        again = simulation.run()
        simulation.reset()
        anew = simulation.run()
    for other in (again, anew):
        assert other.q.tobytes() == first.q.tobytes()
        assert first.surroundings is not None
        assert other.surroundings is not None
        ours, theirs = (each.surroundings.contacts.normal_force for each in (first, other))  # type: ignore[union-attr]
        assert ours.tobytes() == theirs.tobytes()


@pytest.mark.parametrize("engine", ENGINES)
def test_the_record_is_saved_with_its_contacts(engine: str, tmp_path: Path) -> None:
    rollout = rollout_of(pushing(engine))
    around = rollout.surroundings
    assert around is not None
    rollout.save(tmp_path / "run.npz")
    found = dynx.Rollout.load(tmp_path / "run.npz")
    assert found.surroundings is not None
    assert found.surroundings.contacts.names == around.contacts.names
    for name in ("step", "a", "b", "point_a", "normal", "normal_force", "friction_force"):
        ours, theirs = getattr(around.contacts, name), getattr(found.surroundings.contacts, name)
        assert ours.tobytes() == theirs.tobytes()
    np.testing.assert_array_equal(found.surroundings.bodies["cube"], around.bodies["cube"])
    assert found.scenario == rollout.scenario
    assert rollout_of(found.scenario).q.tobytes() == rollout.q.tobytes()  # type: ignore[arg-type]
    rollout.save(tmp_path / "run.csv")
    head = (tmp_path / "run.csv").read_text().partition("\n")[0]
    assert "contact:cube:x" in head
    shorter = rollout.first(400).surroundings
    assert shorter is not None
    assert shorter.contacts.step.max() < 400
    assert len(shorter.bodies["cube"]) == 401


@pytest.mark.parametrize("engine", ENGINES)
def test_the_plot_shows_the_contact_forces(engine: str) -> None:
    pytest.importorskip("matplotlib")
    figure = rollout_of(pushing(engine)).plot()
    labels = [axis.get_ylabel() for axis in figure.axes]
    assert labels[0] == "contact force [N]"
    assert len(labels) == 4


@pytest.mark.parametrize("engine", ENGINES)
def test_the_notes_of_the_world_are_in_the_record_and_its_files(engine: str, tmp_path: Path) -> None:
    slider = dynx.load(SLIDER)
    fast = replace(CUBE, twist=(90.0, 0.0, 0.0, 0.0, 0.0, 0.0), pose=dynx.Pose((1.0, 0.0, 0.1)))
    scene = Scene("noted", robots=(SceneRobot("slider", slider),), bodies=(ground(), fast))
    plant = ScenePlant(scene, engine=engine)
    rollout = dynx.simulate(
        slider, plant=plant, dt=2e-3, duration=0.01, joint_damping=True, joint_friction=True
    )
    with World(scene, engine, 2e-3) as world:
        expected = world.notes
    assert any("moves by" in note for note in expected)
    assert set(expected) <= set(rollout.notes)
    assert f"{len(rollout.notes)} notes" in repr(rollout)
    rollout.save(tmp_path / "run.npz")
    assert dynx.Rollout.load(tmp_path / "run.npz").notes == rollout.notes
    # From another start the notes are those of that start: the slider is inside of the cube.
    other = dynx.simulate(slider, plant=plant, q0=[1.0], dt=2e-3, duration=0.01)
    assert any("overlap by" in note for note in other.notes)
    assert not any("overlap by" in note for note in rollout.notes)


@pytest.mark.parametrize("engine", ENGINES)
def test_motors_of_the_scene_drive_the_other_robots_and_the_controller_its_own(engine: str) -> None:
    slider = dynx.load(SLIDER)
    driven = SceneRobot("belt", dynx.load(SLIDER), v=(1.0,), motors=(VelocityMotor(1.0, 1e4),))
    own = SceneRobot("slider", slider, motors=(VelocityMotor(1.0, 1e4),))
    scene = Scene("driven", robots=(own, driven.at(dynx.Pose((0.0, 3.0, 0.0)))))
    rollout = dynx.simulate(
        scene.robot("slider").model, plant=ScenePlant(scene, "slider", engine=engine), duration=0.2
    )
    assert rollout.surroundings is not None
    assert rollout.surroundings.robots["belt"][-1, 0] == pytest.approx(0.2, abs=1e-3)
    assert not rollout.q.any()


@pytest.mark.parametrize("engine", ENGINES)
def test_a_scene_refuses_what_it_cannot_do(engine: str) -> None:
    scenario = pushing(engine)
    scene = scenario.plant.scene  # type: ignore[union-attr]
    with pytest.raises(UnknownNameError, match="did you mean 'slider'"):
        ScenePlant(scene, "slide", engine=engine)
    with pytest.raises(UnknownNameError, match="no setting"):
        ScenePlant(scene, engine=engine, settings={"no_such_setting": 1.0})
    with pytest.raises(ArgumentError, match="wanted the name of the robot"):
        ScenePlant(Scene("empty", bodies=(ground(),)), engine=engine)
    with pytest.raises(ArgumentError, match="is not the model"):
        replace(scenario, model=dynx.load(BRICK), controller=None, reference=None)
    with pytest.raises(ArgumentError, match="own stepper"):
        dynx.simulate(replace(scenario, integrator="rk4"))
    with pytest.raises(ArgumentError, match="cannot be resumed"):
        dynx.simulate(scenario, resume=dynx.simulate(scenario), step=10)


@pytest.mark.parametrize("engine", STEPPERS)
@pytest.mark.parametrize("mimic", [False, True])
def test_a_step_of_the_engine_is_that_of_dynx(engine: str, mimic: bool) -> None:
    model = mixed_robot("fixed", mimic=mimic)
    rng = np.random.default_rng(2)
    given: dict[str, Any] = {
        "q0": model.random(rng),
        "v0": 0.3 * rng.standard_normal(model.nv),
        "duration": 0.1,
        "substeps": 2,
        "joint_damping": True,
        "joint_friction": True,
        "joint_armature": True,
        "pushes": dynx.ExternalForce("tip", [1.0, 2.0, 3.0, 0.1, 0.2, 0.3], start=0.02, duration=0.033),
    }
    own = dynx.simulate(model, plant=engine, integrator="engine", **given)
    ours = dynx.simulate(model, plant=engine, integrator="semi_implicit", **given)
    # Drake's solver couples mimic joints by an iteration.
    tolerance = 1e-6 if mimic and engine == "drake" else 1e-10
    for name in ("q", "v"):
        np.testing.assert_allclose(getattr(own, name), getattr(ours, name), rtol=0.0, atol=tolerance)
    assert ours.settings["integrator"] == "semi_implicit"
    assert own.settings["integrator"] == "engine"


@pytest.mark.parametrize("engine", STEPPERS)
def test_motors_of_bullet_are_those_of_bullet(engine: str) -> None:
    arm = tutorial_robot()
    with pytest.raises(UnsupportedFeatureError, match="motor inside PyBullet"):
        dynx.simulate(
            arm, BulletPositionMotor(arm), arm.neutral(), plant=engine, integrator="engine", duration=0.1
        )


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("substeps", [1, 3])
def test_the_recorded_acceleration_is_that_of_the_equation_of_motion(engine: str, substeps: int) -> None:
    """Also that of a base that rotates, whose velocity is given in axes that rotate with it."""
    model = dynx.load("solo12", base="floating")
    rng = np.random.default_rng(4)
    q0, v0 = model.random(rng), 2.0 * rng.standard_normal(model.nv)
    scene = Scene("flight", robots=(SceneRobot("dog", model),), gravity=model.gravity)
    flight = dynx.simulate(
        model,
        plant=ScenePlant(scene, engine=engine),
        joint_limits=False,
        q0=q0,
        v0=v0,
        duration=0.02,
        substeps=substeps,
    )
    with backend("reference", model) as reference:
        for k in (0, 10, 19):
            exact = reference.forward_dynamics(flight.q[k], flight.v[k], flight.tau[k])
            np.testing.assert_allclose(flight.a[k], exact, rtol=0.0, atol=1e-8 * np.abs(exact).max())


@pytest.mark.parametrize("engine", ENGINES)
def test_a_rollout_runs_again_whatever_gravity_and_frames_it_has(engine: str, tmp_path: Path) -> None:
    gravity = (0.5, 0.0, -3.7)
    model = dynx.load("six_axis_arm", gravity=gravity).with_frame("site", "tool0", dynx.Pose((0.0, 0.0, 0.1)))
    scene = Scene("s", robots=(SceneRobot("arm", model),), gravity=gravity)
    law = control.ComputedTorque(model, natural_frequency=20.0)
    rollout = dynx.simulate(
        model, law, model.neutral(), duration=0.02, plant=ScenePlant(scene, engine=engine)
    )
    rollout.save(tmp_path / "r.npz")
    loaded = dynx.Rollout.load(tmp_path / "r.npz")
    assert loaded.scenario is not None
    assert loaded.scenario == rollout.scenario
    np.testing.assert_array_equal(dynx.simulate(loaded.scenario).q, rollout.q)
