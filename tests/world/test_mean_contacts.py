"""Mean contacts of an interval: their impulses are the change of momentum, on every engine."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import dynx
from dynx import Pose
from dynx.errors import ArgumentError, DivergedError, UnknownNameError
from dynx.spatial.scalar import Floats
from dynx.world import ExternalForce, Material, PDMotor, Scene, SceneRobot, World, box, ground, sphere
from tests.world.engines import WORLDS
from tests.world.standing import quadruped

ENGINES = [name for name in WORLDS if find_spec(name) is not None]

WEIGHT = np.array([0.0, 0.0, -9.81])

RESIDUALS = {"pybullet": 1e-9, "mujoco": 1e-4, "drake": 1e-6}
"""Residual of each engine's own contact solver in a step, relative to the impulses, in Drake to the momenta
(docs/explanation/what-engines-do-differently.md)."""


def mean_force(world: World, part: str) -> Floats:
    """Return the mean force (3,) of the contacts on a part."""
    total: Floats = np.zeros(3)
    for contact in world.mean_contacts(part):
        total = total + (contact.force if contact.a.startswith(part) else -contact.force)
    return total


def sliding_boxes() -> Scene:
    """Return boxes that slide on the ground, of which the second hits the third, and a ball that falls."""
    rough = Material(friction=0.5, restitution=0.0)
    twist = (2.0, 0.5, 0.0, 0.0, 0.0, 0.0)
    boxes = [
        box(f"box{k}", (0.2, 0.3, 0.1), mass=1.0 + k, pose=Pose(at), twist=speed, material=rough)
        for k, (at, speed) in enumerate(
            [((0.0, 1.0, 0.05), twist), ((0.0, 0.0, 0.05), twist), ((0.3, 0.05, 0.05), (0.0,) * 6)]
        )
    ]
    ball = sphere("ball", 0.1, mass=0.5, pose=Pose((-1.0, 0.0, 0.11)), twist=(0, 0, -1.0, 0, 0, 0))
    return Scene("sliding", bodies=(ground(material=rough), *boxes, ball))


@pytest.mark.parametrize("substeps", [1, 4])
@pytest.mark.parametrize("engine", ENGINES)
def test_the_mean_force_is_the_change_of_momentum_over_the_interval(engine: str, substeps: int) -> None:
    dt, interval = 2e-3, 0.05
    with World(sliding_boxes(), engine, dt, substeps=substeps, contact_interval=interval) as world:
        pushed = np.array([0.0, 3.0, -2.0])
        push = ExternalForce("box0", (*pushed.tolist(), 0.0, 0.0, 0.0))
        for _ in range(3):
            before = world.state
            world.run(interval, forces=[push])
            after = world.state
            for body in world.scene.bodies:
                if body.fixed:
                    continue
                mass = body.inertial.mass
                gained = mass * (after.bodies[body.name].twist - before.bodies[body.name].twist)[:3]
                outside = mass * WEIGHT + (pushed if body.name == "box0" else 0.0)
                found = mean_force(world, body.name) + outside
                impulses = max(float(np.linalg.norm(mean_force(world, body.name))), mass * 9.81)
                momenta = mass * float(np.linalg.norm(before.bodies["box1"].twist)) / (dt / substeps)
                residual = RESIDUALS[engine] * (momenta if engine == "drake" else impulses)
                np.testing.assert_allclose(found, gained / interval, atol=residual)


@pytest.mark.parametrize("engine", ENGINES)
def test_the_mean_moment_is_the_change_of_angular_momentum(engine: str) -> None:
    scene = Scene(
        "ball",
        bodies=(
            ground(),
            sphere("ball", 0.1, mass=2.0, pose=Pose((0.4, 0.2, 0.1)), twist=(1.0, 0.0, 0.0, 0, 0, 0)),
        ),
    )
    interval, mass, inertia = 0.02, 2.0, 0.4 * 2.0 * 0.1**2
    with World(scene, engine, 5e-4, contact_interval=interval) as world:
        world.run(0.01)
        before = world.state.bodies["ball"]
        world.run(interval)
        after = world.state.bodies["ball"]
        (contact,) = world.mean_contacts("ball")
        assert (contact.a, contact.b) == ("ground", "ball")

        def about_origin(position: Floats, twist: Floats) -> Floats:
            momentum: Floats = mass * np.cross(position, twist[:3]) + inertia * twist[3:]
            return momentum

        gained = about_origin(after.position, after.twist) - about_origin(before.position, before.twist)
        weight = mass * np.cross(0.5 * (before.position + after.position), WEIGHT)
        # The moment on the ball is the opposite; the lever is that at the end of each step.
        np.testing.assert_allclose(-contact.moment + weight, gained / interval, atol=0.02)
        assert np.linalg.norm(contact.moment) > 1.0


@pytest.mark.parametrize("engine", ENGINES)
def test_the_feet_of_a_robot_carry_the_change_of_its_momentum(engine: str) -> None:
    dog, q = quadruped("a1")
    scene = Scene("dog", robots=(SceneRobot("dog", dog, q=tuple(q)),), bodies=(ground(),))
    stand = {"dog": PDMotor(q[7:], 100.0, 2.0)}
    model = dynx.backend("reference", dog)

    def momentum(world: World) -> Floats:
        state = world.state.robots["dog"]
        R = np.asarray(model.forward_kinematics(state.q)[dog.frame_names.index(dog.root)])[:3, :3]
        total: Floats = R @ (model.mass_matrix(state.q)[:3] @ state.v)
        return total

    interval = 0.1
    with World(scene, engine, 1e-3, contact_interval=interval) as world:
        for duration in (0.02, interval):
            before = momentum(world)
            world.run(duration, motors=stand)
        force = mean_force(world, "dog")
        expected = (momentum(world) - before) / interval - dog.total_mass * WEIGHT
        np.testing.assert_allclose(force, expected, atol=0.01 * np.linalg.norm(expected))


@pytest.mark.parametrize("engine", ENGINES)
def test_the_mean_is_over_the_last_interval_or_since_the_state_was_set(engine: str) -> None:
    cube = box("cube", (0.1, 0.1, 0.1), mass=1.0, pose=Pose((0.0, 0.0, 0.05)))
    drop = (Pose((0.0, 0.0, 0.5)), np.zeros(6))
    with World(Scene("s", bodies=(ground(), cube)), engine, contact_interval=0.01) as world:
        assert world.mean_contacts() == ()
        world.run(0.3)
        (contact,) = world.mean_contacts("cube")
        assert contact.touching == 1.0
        assert contact.normal_force == pytest.approx(9.81, rel=1e-3)
        saved = world.save()
        # In flight for half of the interval: half of the impulse of the weight is left.
        push = ExternalForce("cube", (0.0, 0.0, 2e3, 0.0, 0.0, 0.0))
        world.step(1, forces=[push])
        world.step(4)
        (contact,) = world.mean_contacts()
        # At the beginning of the push the two touch without a force.
        assert contact.touching == pytest.approx(0.5, abs=0.11)
        assert contact.normal_force == pytest.approx(0.5 * 9.81, rel=1e-3)
        changes: list[Callable[[], None]] = [
            lambda: world.restore(saved),
            world.reset,
            lambda: world.set_state(bodies={"cube": drop}),
        ]
        for change in changes:
            change()
            assert world.mean_contacts() == ()
        # The state was set into the air: no contact was made since.
        world.step(3)
        assert world.mean_contacts() == ()


@pytest.mark.parametrize("engine", ENGINES)
def test_summing_contacts_changes_no_motion(engine: str) -> None:
    states = []
    for interval in (None, 0.01):
        with World(sliding_boxes(), engine, contact_interval=interval) as world:
            world.step(30)
            world.run(0.02)
            states.append(world.state)
    assert states[0].bodies == states[1].bodies


def test_steps_that_failed_are_not_in_the_mean() -> None:
    arm = dynx.load("planar_2r")
    cube = box("cube", (0.1, 0.1, 0.1), mass=1.0, pose=Pose((0.0, 5.0, 0.05)))
    scene = Scene("s", robots=(SceneRobot("arm", arm),), bodies=(ground(), cube))
    engine = ENGINES[0]
    with World(scene, engine, contact_interval=0.05, keep_last_step=True) as world:
        world.run(0.05)
        assert world.mean_contacts("cube")
        with pytest.raises(DivergedError):
            world.step(2000, torques={"arm": np.full(2, 1e15)})
        assert world.mean_contacts() == ()
        with pytest.raises(ArgumentError, match="no step was taken"):
            world.torque("arm")


def test_what_cannot_be_averaged_is_named() -> None:
    cube = box("cube", (0.1, 0.1, 0.1), mass=1.0, pose=Pose((0.0, 0.0, 0.05)))
    scene = Scene("s", bodies=(ground(), cube))
    with World(scene, ENGINES[0]) as world, pytest.raises(ArgumentError, match="contact_interval="):
        world.mean_contacts()
    for wrong in (0.0, -1.0, float("nan"), 1e12):
        with pytest.raises(ArgumentError, match="contact_interval"):
            World(scene, ENGINES[0], contact_interval=wrong)
    with World(scene, ENGINES[0], contact_interval=1e-6) as world:
        # At least one step of the engine.
        world.run(0.2)
        assert world.mean_contacts()[0].normal_force == pytest.approx(9.81, rel=1e-3)
        with pytest.raises(UnknownNameError, match="'cub'"):
            world.mean_contacts("cub")


def test_a_world_that_is_read_keeps_what_its_world_kept(tmp_path: Path) -> None:
    dog, q = quadruped("a1")
    scene = Scene("s", robots=(SceneRobot("dog", dog, q=tuple(q)),), bodies=(ground(),))
    with World(scene, ENGINES[0], contact_interval=0.01, keep_last_step=True) as world:
        world.run(0.05)
        world.write(tmp_path / "kept.world")
        with World.read(tmp_path / "kept.world") as again:
            assert again.mean_contacts() == ()
            assert again.identity == world.identity
            for each in (world, again):
                each.run(0.02)
            assert again.state == world.state
            found, expected = again.mean_contacts(), world.mean_contacts()
            assert [each.force.tolist() for each in found] == [each.force.tolist() for each in expected]
            np.testing.assert_array_equal(again.joint_wrenches(), world.joint_wrenches())
    with World(scene, ENGINES[0]) as world:
        world.write(tmp_path / "plain.world")
    with World.read(tmp_path / "plain.world") as again:
        with pytest.raises(ArgumentError, match="contact_interval="):
            again.mean_contacts()
        with pytest.raises(ArgumentError, match="keep_last_step=True"):
            again.joint_wrenches()
