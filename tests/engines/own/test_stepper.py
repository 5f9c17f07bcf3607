"""dynx's own stepper behind `World`: closed forms, orders of integrators, agreement with `simulate`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.errors import ArgumentError, UnsupportedFeatureError
from dynx.spatial.scalar import Floats
from dynx.world import ExternalForce, Scene, SceneRobot, World, box, ground
from tests.backends.robots import mixed_robot

PENDULUM = """<robot name="pendulum"><link name="base"/>
  <link name="bob"><inertial><origin xyz="0 0 -1"/><mass value="1"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="axle" type="revolute"><parent link="base"/><child link="bob"/><axis xyz="0 1 0"/>
    <limit lower="-0.5" upper="2" effort="1" velocity="1"/></joint></robot>"""


def alone(model: dynx.Model, q: Floats, v: Floats, dt: float, **options: Any) -> World:
    """Return a world of one robot."""
    robot = SceneRobot("robot", model, q=tuple(q.tolist()), v=tuple(v.tolist()))
    return World(Scene("alone", robots=(robot,), gravity=model.gravity), "dynx", dt, **options)


def test_a_body_falls_as_semi_implicit_euler_has_it() -> None:
    n, h = 200, 1e-3
    ball = box("brick", (0.1, 0.2, 0.3), mass=2.0, pose=dynx.Pose((0.0, 0.0, 5.0)))
    with World(Scene("fall", bodies=(ball,)), "dynx", h) as world:
        world.step(n)
        state = world.state.bodies["brick"]
    assert state.position[2] == pytest.approx(5.0 - 9.81 * h**2 * n * (n + 1) / 2, rel=1e-14)
    assert state.twist[2] == pytest.approx(-9.81 * n * h, rel=1e-13)


def test_a_wrench_acts_about_the_centre_of_mass() -> None:
    """Force and moment change the momenta of a body whose centre of mass is beside its origin."""
    inertia = ((0.3, 0.01, 0.02), (0.01, 0.4, 0.03), (0.02, 0.03, 0.5))
    center = (0.1, -0.2, 0.3)
    brick = replace(box("brick", (0.1, 0.2, 0.3), mass=2.0), inertia=inertia, center_of_mass=center)
    push = ExternalForce("brick", [3.0, 0.0, 0.0, 0.0, 0.0, 0.0], point=center)
    scene = Scene("push", bodies=(brick,), gravity=(0.0, 0.0, 0.0))
    with World(scene, "dynx", 1e-3) as world:
        world.run(0.5, forces=[push])
        assert world.state.bodies["brick"].twist == pytest.approx([0.75, 0, 0, 0, 0, 0], abs=1e-12)


@pytest.mark.parametrize("integrator", ["rk4", "adaptive"])
def test_a_free_body_tumbles_about_its_angular_momentum(integrator: str) -> None:
    """A symmetric top precesses about its angular momentum L at the rate |L| / I1."""
    I1, I3 = 0.4, 0.1
    top = replace(
        box("top", (0.1, 0.1, 0.4), mass=1.0),
        inertia=((I1, 0.0, 0.0), (0.0, I1, 0.0), (0.0, 0.0, I3)),
        twist=(0.0, 0.0, 0.0, 0.6, 0.0, 3.0),
    )
    scene = Scene("top", bodies=(top,), gravity=(0.0, 0.0, 0.0))
    L = np.array([I1 * 0.6, 0.0, I3 * 3.0])
    with World(scene, "dynx", 1e-3, integrator=integrator) as world:
        world.run(1.0)
        found = world.state.bodies["top"]
    R = found.T_world_body[:3, :3]
    inertia = R @ np.diag([I1, I1, I3]) @ R.T
    assert inertia @ found.twist[3:] == pytest.approx(L, abs=1e-10)
    axis, rate = L / np.linalg.norm(L), np.linalg.norm(L) / I1
    z = np.array([0.0, 0.0, 1.0])
    turned = z * np.cos(rate) + np.cross(axis, z) * np.sin(rate) + axis * (axis @ z) * (1 - np.cos(rate))
    assert R[:, 2] == pytest.approx(turned, abs=1e-10)


@pytest.mark.parametrize(("integrator", "order"), [("euler", 1), ("semi_implicit", 1), ("rk4", 4)])
def test_the_error_of_a_pendulum_has_the_order_of_the_integrator(integrator: str, order: int) -> None:
    model = dynx.load(PENDULUM)
    start = np.array([1.2]), np.array([0.0])
    with alone(model, *start, 0.4, integrator="adaptive", joint_limits=False) as world:
        world.run(0.4)
        exact = world.state.robots["robot"]
    assert energy(*exact) == pytest.approx(energy(*start), abs=1e-9)
    errors = []
    for n in (40, 80):
        with alone(model, *start, 0.4 / n, integrator=integrator, joint_limits=False) as world:
            world.step(n)
            errors.append(abs(world.state.robots["robot"].q[0] - exact.q[0]))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.15)


def energy(q: Floats, v: Floats) -> float:
    """Return the energy [J] of the pendulum, whose inertia about its axle is 1.1 kg m^2."""
    return float(0.55 * v[0] ** 2 - 9.81 * np.cos(q[0]))


@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize("integrator", ["semi_implicit", "rk4"])
def test_steps_are_those_of_simulate_bit_for_bit(base: str, integrator: str) -> None:
    model = mixed_robot(base, mimic=True)
    rng = np.random.default_rng(5)
    q, v = model.random(rng), 0.3 * rng.standard_normal(model.nv)
    joints: dict[str, Any] = {
        "joint_damping": True,
        "joint_friction": True,
        "joint_armature": True,
        "joint_springs": True,
    }
    rollout = dynx.simulate(
        model,
        plant="pinocchio",
        q0=q,
        v0=v,
        duration=0.1,
        dt=2e-3,
        substeps=2,
        integrator=integrator,
        **joints,
    )
    options: dict[str, Any] = {"backend": "pinocchio", "integrator": integrator, "substeps": 2}
    with alone(model, q, v, 2e-3, **options) as world:
        world.step(20)
        world.step(30)
        found = world.state.robots["robot"]
    assert found.q.tobytes() == rollout.q[-1].tobytes()
    assert found.v.tobytes() == rollout.v[-1].tobytes()


def test_joints_stop_at_their_limits_as_in_simulate() -> None:
    model = dynx.load(PENDULUM)
    q, v = np.array([1.0]), np.array([0.0])
    rollout = dynx.simulate(model, plant="pinocchio", q0=q, v0=v, duration=1.0, dt=1e-3, joint_limits=True)
    with alone(model, q, v, 1e-3, backend="pinocchio") as world:
        world.step(1000)
        found = world.state.robots["robot"]
    assert rollout.q.min() == -0.5
    assert found.q.tobytes() == rollout.q[-1].tobytes()


def test_a_written_world_continues_bit_for_bit(tmp_path: Path) -> None:
    model = dynx.load(PENDULUM)
    robot = SceneRobot("robot", model, q=(1.0,))
    brick = box("brick", (0.1, 0.2, 0.3), mass=1.0)
    scene = Scene("both", robots=(robot,), bodies=(replace(brick, twist=(0.0, 0.1, 0.0, 1.0, 2.0, 3.0)),))
    torques = {"robot": np.linspace(-1.0, 1.0, model.nv)}
    with World(scene, "dynx", 1e-3, collisions=False, integrator="rk4") as world:
        world.step(50, torques)
        world.write(tmp_path / "both.world")
        world.step(50, torques)
        expected = world.state
    with World.read(tmp_path / "both.world") as again:
        again.step(50, torques)
        found = again.state
    assert found.robots["robot"].q.tobytes() == expected.robots["robot"].q.tobytes()
    assert found.bodies["brick"].twist.tobytes() == expected.bodies["brick"].twist.tobytes()


def test_what_the_stepper_does_not_have_is_refused_by_name() -> None:
    brick = box("brick", (0.1, 0.2, 0.3), mass=1.0, pose=dynx.Pose((0.0, 0.0, 1.0)))
    with pytest.raises(UnsupportedFeatureError, match=r"'floor' has contacts, which the integrator rk4 .*"):
        World(Scene("floor", bodies=(ground(), brick)), "dynx", integrator="rk4")
    with pytest.raises(UnsupportedFeatureError, match="euler"):
        World(Scene("brick", bodies=(brick,)), "dynx", integrator="euler")
    with pytest.raises(ArgumentError, match="integrator"):
        World(Scene("brick", bodies=(brick,)), "dynx", integrator="leapfrog")
