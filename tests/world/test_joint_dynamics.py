"""Damping, dry friction and armature of a robot's joints in the worlds of all engines, by closed forms."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.errors import SingularMassMatrixError
from dynx.model.elements import JointDynamics
from dynx.model.tree import Base
from dynx.world import PDMotor, PositionMotor, Scene, SceneRobot, World, ground
from tests.backends.robots import mixed_robot
from tests.sim.rigid_bodies import RIGID_BODIES
from tests.world.engines import WORLDS

TURNTABLE = """<robot name="turntable">
  <link name="base"/>
  <link name="disk"><inertial><mass value="1"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><sphere radius="0.05"/></geometry></collision></link>
  <joint name="axle" type="continuous"><parent link="base"/><child link="disk"/><axis xyz="0 1 0"/>
    <dynamics {}/></joint>
</robot>"""

PENDULUM = TURNTABLE.replace("<inertial>", '<inertial><origin xyz="0 0 -1"/>')
"""A pendulum of 1 kg whose centre of mass is 1 m below its axle: gravity pulls with 8.25 N m at 1 rad."""


def world_of(text: str, engine: str, dynamics: str, q: float = 0.0, **options: bool) -> World:
    """Return a world of one robot with these joint dynamics, above a floor that it does not touch."""
    robot = SceneRobot("robot", dynx.load(text.format(dynamics)), q=(q,))
    floor = replace(ground(), pose=dynx.Pose((0.0, 0.0, -2.0)))
    return World(Scene("joint", robots=(robot,), bodies=(floor,)), engine, 1e-3, **options)


TWO_JOINTS = """<robot name="rotor"><link name="base"/><link name="shaft"/>
  <link name="disk"><inertial><mass value="1"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="first" type="continuous"><parent link="base"/><child link="shaft"/><axis xyz="0 1 0"/></joint>
  <joint name="second" type="continuous"><parent link="shaft"/><child link="disk"/><axis xyz="0 1 0"/>
    <dynamics armature="0.02"/></joint>
</robot>"""
"""Joints about one axis without an inertia between them: only the armature decides how each of them moves."""


@pytest.mark.parametrize("engine", sorted({*WORLDS} - {"pybullet"}))
@pytest.mark.parametrize("options", [{}, {"joint_armature": False}])
def test_a_mass_matrix_that_armature_makes_regular_is_that_of_the_world(
    engine: str, options: dict[str, Any]
) -> None:
    """M = [[0.1, 0.1], [0.1, 0.12]] turns 0.02 N m at the second joint into -1 and 1 rad/s^2."""
    scene = Scene("rotor", robots=(SceneRobot("robot", dynx.load(TWO_JOINTS)),), gravity=(0.0, 0.0, 0.0))
    if options:
        with pytest.raises(SingularMassMatrixError, match="'first', 'second'"):
            World(scene, engine, 1e-3, **options)
        return
    with World(scene, engine, 1e-3) as world:
        world.step(1000, {"robot": [0.0, 0.02]})
        assert world.state.robots["robot"].v == pytest.approx([-1.0, 1.0], rel=1e-9)
        assert not world.notes


@pytest.mark.parametrize("engine", WORLDS)
def test_armature_adds_to_the_inertia(engine: str) -> None:
    """A torque of 1 N m accelerates 0.1 kg m^2 and 0.9 kg m^2 of armature to 1 rad/s in 1 s."""
    for options, speed in (({}, 1.0), ({"joint_armature": False}, 10.0)):
        with world_of(TURNTABLE, engine, 'armature="0.9"', **options) as world:
            world.step(1000, {"robot": [1.0]})
            assert world.state.robots["robot"].v[0] == pytest.approx(speed, rel=1e-10)


@pytest.mark.parametrize("engine", WORLDS)
@pytest.mark.parametrize("armature", ["", ' armature="0.4"'])
def test_friction_holds_a_pendulum_that_gravity_pulls(engine: str, armature: str) -> None:
    with world_of(PENDULUM, engine, 'friction="9"' + armature, 1.0) as world:
        world.step(2000)
        # MuJoCo's own friction is soft and creeps; the others hold exactly.
        creep = 1e-4 if engine == "mujoco" else 1e-12
        assert world.state.robots["robot"].q[0] == pytest.approx(1.0, abs=creep)
    with world_of(PENDULUM, engine, 'friction="9"' + armature, 1.0, joint_friction=False) as world:
        world.step(500)
        assert world.state.robots["robot"].q[0] < 0.5


@pytest.mark.parametrize("engine", WORLDS)
def test_friction_and_damping_stop_a_rotor(engine: str) -> None:
    """I w' = -d w - f stops w = 2 rad/s after I / d log(1 + d w / f) = 0.3466 s with I = 1 kg m^2."""
    with world_of(TURNTABLE, engine, 'armature="0.9" damping="2" friction="4"') as world:
        world.set_state(robots={"robot": ([0.0], [2.0])})
        world.step(340)
        assert 0.0 < world.state.robots["robot"].v[0] < 0.1
        world.step(60)
        assert abs(world.state.robots["robot"].v[0]) < 1e-3


@pytest.mark.parametrize("engine", WORLDS)
def test_motors_know_the_armature(engine: str) -> None:
    """A motor whose law holds at the end of each step is stable at gains that are stiff for the inertia."""
    with world_of(TURNTABLE, engine, 'armature="0.9" friction="0.1"') as world:
        world.step(400, motors={"robot": PositionMotor(0.5, kp=1e5, kd=1e3)})
        assert world.state.robots["robot"].q[0] == pytest.approx(0.5, abs=1e-4)


@pytest.mark.parametrize("engine", WORLDS)
@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_worlds_move_as_simulations_do(engine: str, base: str) -> None:
    """The error against a simulation, with the same joint dynamics, halves with the step."""
    model = mixed_robot(base, mimic=True)
    rng = np.random.default_rng(3)
    q, v = model.random(rng), 0.5 * rng.standard_normal(model.nv)
    exact = dynx.simulate(model, plant="pinocchio", q0=q, v0=v, duration=0.2, dt=1e-4)
    errors = []
    for dt in (2e-3, 1e-3):
        robot = SceneRobot("robot", model, q=tuple(q), v=tuple(v))
        with World(Scene("free", robots=(robot,), gravity=model.gravity), engine, dt) as world:
            assert not [note for note in world.notes if "joints of" in note]
            world.run(0.2)
            found = world.state.robots["robot"]
        errors.append(np.abs(model.difference(exact.q[-1], found.q)).max())
    assert errors[1] < 0.7 * errors[0] < 0.02
    assert errors[1] < 2e-3


@pytest.mark.parametrize("engine", WORLDS)
def test_a_saved_world_continues_bit_for_bit(engine: str, tmp_path: Path) -> None:
    with world_of(PENDULUM, engine, 'armature="0.9" damping="2" friction="4"', 1.0) as world:
        noted = [note for note in world.notes if "outside of the engine" in note]
        assert bool(noted) == (engine != "mujoco")
        motors = {"robot": PDMotor(0.5, kp=30.0, kd=1.0)}
        world.step(50, motors=motors)
        world.write(tmp_path / "world")
        world.step(50, motors=motors)
        expected = world.state.robots["robot"]
    with World.read(tmp_path / "world") as again:
        again.step(50, motors=motors)
        found = again.state.robots["robot"]
    assert (found.q.tobytes(), found.v.tobytes()) == (expected.q.tobytes(), expected.v.tobytes())


@pytest.mark.parametrize("engine", WORLDS)
@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize("name", ["mixed", "ur5"])
def test_joint_dynamics_are_exact_where_nothing_reaches_the_robot(name: str, base: Base, engine: str) -> None:
    """Each alone and all together, with joint limits that no joint is at: the steps are those of dynx."""
    model = mixed_robot(base, mimic=engine != "drake") if name == "mixed" else dynx.load(name, base=base)
    laws = {"damping": 0.4, "friction": 0.6, "armature": 0.05}
    if name == "mixed":
        limits = (-50.0, 50.0)
        joints = [
            replace(each, limits=replace(each.limits, lower=limits[0], upper=limits[1]))
            for each in model.joints
        ]
        model = replace(model, joints=tuple(joints))
    rng = np.random.default_rng(8)
    q, v = 0.3 * model.random(rng) if base == "fixed" else model.random(rng), rng.standard_normal(model.nv)
    for chosen in (*([law] for law in laws), list(laws)):
        given: dict[str, Any] = {law: laws[law] for law in chosen}
        options = RIGID_BODIES | {f"joint_{law}": laws[law] for law in chosen}
        exact = dynx.simulate(model, plant="pinocchio", q0=q, v0=v, duration=0.1, **options)
        dynamics = JointDynamics(**given)
        joints = [
            replace(joint, dynamics=dynamics if joint.mimic is None else JointDynamics())
            for joint in model.joints
        ]
        robot = SceneRobot("robot", replace(model, joints=tuple(joints)), q=tuple(q), v=tuple(v))
        with World(Scene("free", robots=(robot,), gravity=model.gravity), engine, collisions=False) as world:
            world.step(100)
            found = world.state.robots["robot"]
        # Drake integrates a floating base by another scheme.
        tolerance = 1e-5 if engine == "drake" and base == "floating" else 1e-11
        assert np.abs(model.difference(exact.q[-1], found.q)).max() < tolerance, chosen


@pytest.mark.parametrize("engine", WORLDS)
@pytest.mark.parametrize("law", ["damping", "friction", "armature"])
def test_joint_dynamics_that_are_not_exact_are_noted(engine: str, law: str) -> None:
    """Exact where nothing reaches the robot; beside a floor that it may touch the note names what is not."""
    exact = {"mujoco": ("damping", "armature"), "drake": ("damping", "armature"), "pybullet": ()}[engine]
    with world_of(TURNTABLE, engine, f'{law}="0.5"') as world:
        assert bool(world.notes) == (law not in exact)
        assert all("'robot'" in note for note in world.notes)
    with world_of(TURNTABLE, engine, f'{law}="0.5"', collisions=False) as world:
        assert world.notes == ()


@pytest.mark.parametrize("engine", WORLDS)
def test_a_joint_held_at_its_limit_stays_there_under_friction_and_armature(engine: str) -> None:
    """Torque presses it against the limit with 3 N m for a second, then 3 N m the other way move it off."""
    text = PENDULUM.replace("continuous", "revolute").replace(
        "<dynamics", '<limit lower="-1" upper="1" effort="99" velocity="99"/><dynamics'
    )
    with world_of(text, engine, 'armature="0.4" friction="0.5"', 0.99, collisions=False) as world:
        world.step(1000, {"robot": [8.25 + 3.0]})
        assert world.state.robots["robot"].q[0] == pytest.approx(1.0, abs=5e-3)
        world.step(300, {"robot": [-3.0]})
        assert world.state.robots["robot"].q[0] < 0.9
