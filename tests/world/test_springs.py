"""Springs of joints in the worlds of all engines: those of simulations, saved states, notes and exports."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import dynx
from dynx.model import JointDynamics, Limits, Model
from dynx.sim import simulate
from dynx.world import PDMotor, Scene, SceneRobot, World
from tests.backends.test_joint_dynamics import sliding_mass
from tests.sim.plants.test_springs import SPRING, sprung
from tests.world.engines import WORLDS


def scene_of(model: Model, q: tuple[float, ...], v: tuple[float, ...] | None = None) -> Scene:
    robot = SceneRobot("robot", model, q=q, v=(0.0,) * model.nv if v is None else v)
    return Scene("springs", robots=(robot,), gravity=model.gravity)


@pytest.mark.parametrize("engine", [*WORLDS, "dynx"])
@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize("alone", [True, False])
def test_worlds_move_as_simulations_do(engine: str, base: str, alone: bool) -> None:
    """With springs alone, and beside damping, dry friction and armature."""
    model = sprung(base)
    if alone:
        joints = (
            replace(j, dynamics=replace(j.dynamics, damping=0.0, friction=0.0, armature=0.0))
            for j in model.joints
        )
        model = replace(model, joints=tuple(joints))
    free = (replace(joint, limits=Limits(-50.0, 50.0)) for joint in model.joints)
    model = replace(model, joints=tuple(free))
    if engine == "drake":
        # Drake's own constraints couple mimic joints.
        model = replace(model, joints=tuple(replace(joint, mimic=None) for joint in model.joints))
    rng = np.random.default_rng(3)
    q, v = model.random(rng), 0.5 * rng.standard_normal(model.nv)
    exact = simulate(model, plant="pinocchio", q0=q, v0=v, duration=0.1, dt=1e-3)
    with World(scene_of(model, tuple(q), tuple(v)), engine, 1e-3) as world:
        world.step(100)
        found = world.state.robots["robot"]
    # Drake integrates a floating base by another scheme.
    tolerance = 1e-5 if engine == "drake" and base == "floating" else 1e-11
    assert np.abs(model.difference(exact.q[-1], found.q)).max() < tolerance


@pytest.mark.parametrize("engine", WORLDS)
def test_a_switch_removes_springs(engine: str) -> None:
    with World(scene_of(SPRING, (0.1,)), engine, joint_springs=False) as world:
        world.step(100)
        assert world.state.robots["robot"].q[0] == pytest.approx(0.1, abs=1e-12)


@pytest.mark.parametrize("engine", WORLDS)
def test_a_negative_stiffness_pushes_away(engine: str) -> None:
    model = sliding_mass(stiffness=-50.0, spring_reference=0.3)
    exact = simulate(model, plant="pinocchio", q0=[0.1], duration=0.2)
    assert exact.q[-1, 0] < 0.0
    with World(scene_of(model, (0.1,)), engine) as world:
        world.step(200)
        assert world.state.robots["robot"].q == pytest.approx(exact.q[-1], abs=1e-12)


@pytest.mark.parametrize("engine", WORLDS)
def test_a_saved_world_continues_bit_for_bit(engine: str, tmp_path: Path) -> None:
    with World(scene_of(sprung(), tuple(sprung().neutral())), engine) as world:
        world.step(50)
        world.write(tmp_path / "world")
        world.step(50)
        expected = world.state.robots["robot"]
    with World.read(tmp_path / "world") as again:
        assert again.scene.robots[0].model == sprung()
        again.step(50)
        found = again.state.robots["robot"]
    assert (found.q.tobytes(), found.v.tobytes()) == (expected.q.tobytes(), expected.v.tobytes())


def test_the_switch_of_springs_is_no_part_of_the_identity_of_a_world_without_any() -> None:
    identities = []
    plain = replace(SPRING, joints=tuple(replace(j, dynamics=JointDynamics()) for j in SPRING.joints))
    for model, switch in ((plain, True), (plain, False), (SPRING, True)):
        with World(scene_of(model, (0.1,)), "dynx", joint_springs=switch) as world:
            identities.append(world.identity)
    assert identities[0] == identities[1] != identities[2]


@pytest.mark.parametrize("engine", WORLDS)
def test_a_spring_too_stiff_for_the_step_is_noted(engine: str) -> None:
    """4 m / h^2 is 8e6 N/m."""
    for stiffness, noted in ((7e6, False), (9e6, True)):
        with World(scene_of(sliding_mass(stiffness=stiffness), (0.0,)), engine, 1e-3) as world:
            assert any("the spring of 'robot/slide' is stiff" in note for note in world.notes) == noted
            assert not any("outside of the engine" in note for note in world.notes)


@pytest.mark.parametrize("engine", WORLDS)
def test_motors_act_beside_springs(engine: str) -> None:
    """A PD motor of 100 N/m at 0.5 m and a spring of 50 N/m at 0.3 m rest at (50 + 15) / 150 m."""
    with World(scene_of(SPRING, (0.3,)), engine) as world:
        world.step(6000, motors={"robot": PDMotor(0.5, kp=100.0, kd=20.0)})
        assert world.state.robots["robot"].q == pytest.approx([65.0 / 150.0], abs=1e-6)


def test_an_exported_world_has_its_springs() -> None:
    mujoco = pytest.importorskip("mujoco")
    with World(scene_of(SPRING, (0.1,)), "mujoco") as world:
        compiled = mujoco.MjModel.from_xml_string(world.to_mjcf())
        assert (compiled.jnt_stiffness[0], compiled.qpos_spring[0]) == (50.0, 0.3)
    with World(scene_of(SPRING, (0.1,)), "mujoco", joint_springs=False) as world:
        assert "stiffness" not in world.to_mjcf()


def test_simulations_in_a_scene_have_springs() -> None:
    place = dynx.ScenePlant(scene_of(SPRING, (0.1,)), "robot", engine="dynx")
    alone = simulate(SPRING, q0=[0.1], duration=0.1, plant="pinocchio")
    assert simulate(SPRING, duration=0.1, plant=place).q == pytest.approx(alone.q, abs=1e-12)
