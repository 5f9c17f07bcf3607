"""Worlds that diverge or are interrupted: the likely cause by name, and a valid state afterwards."""

from __future__ import annotations

import _thread
import re
import signal
import threading
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

import dynx
from dynx import Pose
from dynx.errors import ClosedError, DivergedError, EngineError, SingularMassMatrixError
from dynx.steppers.forces import Forces
from dynx.world import ExternalForce, PDMotor, PositionMotor, Scene, SceneRobot, Weld, World, box, ground
from tests.world.engines import FAST_WORLDS, WORLDS


def arm(engine: str) -> World:
    return World(Scene("s", robots=(SceneRobot("arm", dynx.load("six_axis_arm")),)), engine)


def diverge(world: World, **loads: Any) -> str:
    with pytest.raises((DivergedError, EngineError)) as raised:
        world.run(3.0, **loads)
    assert np.isfinite(world.time)
    world.step()
    return str(raised.value)


@pytest.mark.parametrize("engine", WORLDS)
def test_stiff_gains_are_named_with_their_ratio_to_the_inertia(engine: str) -> None:
    with arm(engine) as world:
        message = diverge(world, motors={"arm": PDMotor(0.3, kp=1e4, kd=1e6)})
        M = dynx.backend("reference", dynx.load("six_axis_arm")).mass_matrix(np.zeros(6))
    ratio = float((1e-3 * 1e6 * np.linalg.inv(M).diagonal()).max())
    assert f"kd dt is {ratio:.3g} times the inertia" in message
    assert "PositionMotor" in message
    with arm(engine) as world:
        assert "kp dt^2 is" in diverge(world, motors={"arm": PDMotor(0.3, kp=1e9, kd=0.0)})


@pytest.mark.parametrize("engine", FAST_WORLDS)
def test_large_loads_are_named(engine: str) -> None:
    scene = Scene(
        "s",
        robots=(SceneRobot("arm", dynx.load("planar_2r")),),
        bodies=(box("brick", (0.1, 0.1, 0.1), mass=0.5, pose=Pose((0, 0, 3))),),
    )
    with World(scene, engine) as world:
        message = diverge(world, torques={"arm": [0.0, 1e59]})
        assert "torque of 1e+59 on 'arm/" in message
        message = diverge(world, forces=[ExternalForce("brick", (1e55, 1e57, 0.0, 1e58, 0, 1e58))])
        assert "changes the velocity of 'brick' by" in message


def test_a_cause_that_is_not_known_is_not_made_up() -> None:
    with arm("pybullet") as world:
        message = diverge(world, loads=lambda w: {"torques": {"arm": np.full(6, 1e-3 * np.exp(60 * w.time))}})
    assert "torque of" in message
    assert "gains" not in message
    assert "overlap" not in message


def interrupting(world: World, after: int) -> Callable[[int, Forces], None]:
    """Return the engine's step, interrupted after some steps of a call."""
    step = world._motion.engine.step

    def interrupted(n: int, forces: Forces) -> None:
        step(min(n, after), forces)
        raise KeyboardInterrupt

    return interrupted


@pytest.mark.parametrize("engine", WORLDS)
def test_an_interrupted_step_leaves_a_world_that_continues(
    engine: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = Scene("s", bodies=(ground(), box("brick", (0.1, 0.1, 0.1), mass=1.0, pose=Pose((0, 0, 1)))))
    with World(scene, engine) as world, World(scene, engine) as other:
        world.step(20)
        before = world.state
        monkeypatch.setattr(world._motion.engine, "step", interrupting(world, 3))
        with pytest.raises(KeyboardInterrupt):
            world.step(10)
        assert world.time == before.time
        np.testing.assert_array_equal(
            world.state.bodies["brick"].T_world_body, before.bodies["brick"].T_world_body
        )
        world.step(5)
        other.step(25)
        assert world.time == other.time
        np.testing.assert_allclose(
            world.state.bodies["brick"].T_world_body,
            other.state.bodies["brick"].T_world_body,
            rtol=0,
            atol=1e-12,
        )


def test_a_world_that_is_closed_after_an_interruption_stays_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(Scene("s", bodies=(ground(),)), WORLDS[0])
    monkeypatch.setattr(world._motion.engine, "step", interrupting(world, 3))
    with pytest.raises(KeyboardInterrupt):
        world.step(10)
    world.close()
    with pytest.raises(ClosedError):
        world.step(1)


def test_a_long_run_that_is_interrupted_keeps_what_was_simulated() -> None:
    scene = Scene("s", bodies=(box("brick", (0.1, 0.1, 0.1), mass=1.0),))
    # A program in the background of a shell ignores the signal.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with World(scene, "pybullet", 1e-4) as world:
            timer = threading.Timer(0.3, _thread.interrupt_main)
            timer.start()
            with pytest.raises(KeyboardInterrupt):
                world.run(1e3)
            timer.join()
            check_fall(world)
    finally:
        signal.signal(signal.SIGINT, before)


def check_fall(world: World) -> None:
    """Check that the brick of a world has fallen freely for the time of the world, and that steps go on."""
    assert world.time > 0.0
    # z = -g t (t + dt) / 2 of semi-implicit Euler.
    z = -9.81 * world.time * (world.time + 1e-4) / 2.0
    assert world.state.bodies["brick"].T_world_body[2, 3] == pytest.approx(z, rel=1e-9)
    world.step()


def test_stiff_motors_at_the_end_of_a_step_are_not_blamed() -> None:
    with arm("mujoco") as world:
        message = diverge(
            world,
            torques={"arm": np.full(6, 1e59)},
            motors={"arm": PositionMotor(0.0, 1e9, 1e9, max_force=1.0)},
        )
    assert "gains" not in message


@pytest.mark.parametrize("engine", FAST_WORLDS)
def test_links_without_mass_between_three_axes_are_named(engine: str) -> None:
    robot = SceneRobot("human", dynx.load("human"))
    with World(Scene("falling", robots=(robot,)), engine, collisions=False) as world:
        (note,) = world.notes
        message = diverge(world)
    assert "the links between 'human/left_hip_Z' and 'human/left_hip_Y' have no mass" in message
    assert note in message


def test_a_mass_matrix_that_is_singular_to_rounding_is_named_at_the_start() -> None:
    pytest.importorskip("mujoco")
    model = dynx.load("icub")
    hanging = SceneRobot("icub", model, q=tuple(model.clip(model.neutral())))
    scene = Scene("hanging", robots=(hanging,))
    named = r"almost no inertia about 'neck_\w+' and 'neck_\w+': use solver='pgs'"
    with pytest.raises(SingularMassMatrixError, match=named):
        World(scene, "mujoco")
    with World(scene, "mujoco", collisions=False, solver="pgs") as world:
        (note,) = (each for each in world.notes if "mass matrix" in each)
        assert "the mass matrix of 'icub' is singular to rounding" in note
        assert "almost no inertia about 'icub/neck_" in note
        world.run(0.5)
        assert abs(world.state.robots["icub"].v).max() < 100.0
    aside = np.array(hanging.q)
    aside[[model.joint_names.index(name) for name in ("neck_roll", "neck_yaw")]] = 0.2
    scene = Scene("aside", robots=(SceneRobot("icub", model, q=tuple(aside)),))
    with World(scene, "mujoco", collisions=False) as world:
        world.run(0.5)
        assert not world.notes
        assert abs(world.state.robots["icub"].v).max() < 100.0


def test_a_robot_in_the_ground_diverges_and_one_above_it_does_not() -> None:
    model = dynx.load("icub_reduced")
    robot = SceneRobot("icub", model, q=tuple(model.clip(model.neutral())))
    inside = Scene("inside", robots=(robot,), bodies=(ground(),))
    with (
        World(inside, "pybullet") as world,
        pytest.raises(DivergedError, match="'ground' overlap by 59") as error,
    ):
        world.run(1.0)
    assert re.search(r"ignored=\[\('icub/\w+', 'ground'\)\] of the Scene", str(error.value))
    above = Scene("above", robots=(robot,), bodies=(ground(pose=Pose((0, 0, -2))),))
    with World(above, "pybullet") as world:
        world.run(0.3)
        assert abs(world.state.robots["icub"].v).max() < 100.0


def test_gravity_and_violated_constraints_are_named() -> None:
    cubes = tuple(
        box(name, (0.2, 0.2, 0.2), mass=1.0, pose=Pose((5 * k, 0, 0))) for k, name in enumerate("ab")
    )
    with World(Scene("s", bodies=cubes, gravity=(0.0, 0.0, -1e50)), "pybullet") as world:
        assert "likely cause: gravity changes velocities by 1e+47 m/s in one step" in diverge(world)
    weld = Weld("a", "b", Pose((0.0, 0.0, 0.2)))
    with World(Scene("s", bodies=cubes, constraints=(weld,)), "mujoco") as world:
        assert "likely cause: the ends of the weld of 'a' and 'b' are 5e+03 mm apart" in diverge(world)


READY = (0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785, 0.02)
"""Ready posture of Panda."""


def held_panda(kp: float, q: Sequence[float] = READY) -> Scene:
    motor = PositionMotor(0.3, kp=kp, kd=kp / 10.0)
    return Scene(
        "held", robots=(SceneRobot("arm", dynx.load("panda"), q=q, motors=(motor,)),), bodies=(ground(),)
    )


@pytest.mark.parametrize("engine", FAST_WORLDS)
def test_motors_at_the_end_of_a_step_are_stable_in_short_steps_only(engine: str) -> None:
    for kp in (200.0, 2e6):
        with World(held_panda(kp), engine, 1e-3) as world:
            world.run(0.3)
            assert abs(world.state.robots["arm"].v).max() < 5.0
    for kp, dt in ((200.0, 0.04), (2e4, 0.02)):
        with World(held_panda(kp), engine, dt) as world, pytest.raises(DivergedError):
            world.run(1.0)


def step_and_read(world: World, n: int) -> None:
    for _ in range(20):
        world.step(n)
        assert world.state.time == world.time


def test_the_cause_is_not_a_consequence_however_often_the_state_is_read() -> None:
    """States just before divergence have deep overlaps and positions far beyond limits."""
    messages = []
    for n in (20, 1):
        with World(held_panda(200.0), "pybullet", 0.05) as world:
            with pytest.raises(DivergedError) as raised:
                step_and_read(world, n)
            messages.append(str(raised.value))
    once, often = (message.partition("likely cause: ")[2].partition("; the world")[0] for message in messages)
    assert once == often
    assert once.startswith("the step is too long for the motion and the gains of 'arm/panda_")
    assert "overlap" not in once
    beyond = (9.0, *READY[1:])
    with World(held_panda(200.0, beyond), "pybullet", 0.05) as world, pytest.raises(DivergedError) as raised:
        world.run(1.0)
    assert "'arm/panda_joint1' is at 9, beyond its limits -2.897 to 2.897, at the start" in str(raised.value)
