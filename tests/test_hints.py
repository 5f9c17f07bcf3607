"""Hints at public doors: what people give first is answered with the call that they want."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.errors import ArgumentError, DTypeError, DynxError
from dynx.world import Scene, SceneRobot, World, box

untyped: Any = dynx
"""dynx without types: the mistakes are tested."""

ARM = dynx.load("six_axis_arm")
FORCE = dynx.ExternalForce("tool0", [0.0] * 6)


@pytest.fixture(scope="module")
def movers() -> Iterator[list[Any]]:
    """Return what takes steps."""
    scenario = dynx.Scenario(ARM, None, ARM.neutral(), duration=0.1)
    brick = Scene("s", bodies=(box("brick", (0.1, 0.1, 0.1), mass=1.0),))
    with World(brick) as world, World(brick, "drake") as other, dynx.Simulation(scenario) as simulation:
        yield [world, other, simulation]


@given(st.floats(1e-6, 1e6))
def test_a_time_given_for_a_number_of_steps_names_run(movers: list[Any], seconds: float) -> None:
    for mover in movers:
        for wrong in (seconds, np.float64(seconds)):
            with pytest.raises(ArgumentError, match=r"number of steps, .*; run\((duration|until)\) "):
                mover.step(wrong)


@pytest.mark.parametrize("wrong", [0, -3, True, "3", None, 10**13, [1]])
def test_other_numbers_of_steps_are_refused(movers: list[Any], wrong: Any) -> None:
    for mover in movers:
        with pytest.raises(ArgumentError, match=r"n is .*wanted a number of steps, from 1 to 1e\+12$"):
            mover.step(wrong)


HINTS: dict[str, tuple[Callable[[], object], str]] = {
    "a time step by the name of MuJoCo": (
        lambda: untyped.World(Scene("s"), timestep=0.01),
        "no setting 'timestep'; did you mean 'dt'",
    ),
    "a setting like no other": (
        lambda: untyped.World(Scene("s"), "dynx", foo=1),
        r"\d+ are known, such as backend, integrator, method, rtol, atol",
    ),
    "gravity of a world": (lambda: untyped.World(Scene("s"), gravity=(0, 0, -1)), r"Scene\(gravity=...\)"),
    "gravity of a simulation": (
        lambda: untyped.simulate(ARM, gravity=(0, 0, -1), duration=0.1),
        r"dynx.load\(..., gravity=...\)",
    ),
    "positions by the name of MuJoCo": (
        lambda: untyped.simulate(ARM, qpos=ARM.neutral(), duration=0.1),
        "did you mean 'q0'",
    ),
    "a coefficient of friction": (lambda: untyped.world.Material(mu=0.5), "did you mean 'friction'"),
    "a position of a box": (
        lambda: untyped.world.box("b", (1.0, 1.0, 1.0), position=(0, 0, 1)),
        "SceneBody has no option 'position'; did you mean 'pose', a dynx.Pose",
    ),
    "half of a box": (
        lambda: untyped.world.box("b", half_extents=(1, 1, 1)),
        r"did you mean 'size', from side to side: \(x, y, z\) \[m\] of a box",
    ),
    "noise of an IMU": (lambda: untyped.world.Imu("i", "tool0", noise=0.1), "'accelerometer', dynx.world.Se"),
    "a robot by its maker": (lambda: dynx.load("franka"), "did you mean 'panda'"),
    "a robot by its maker and name": (lambda: dynx.load("unitree_go1"), "did you mean 'go1'"),
    "a quaternion for a position": (
        lambda: untyped.Pose((0.0, 0.0, 0.0, 1.0)),
        r"shape \(4,\); wanted 3 numbers, x, y, z \[m\]; Pose.from_matrix\(\(\(x, y, z\), \(qx, qy, qz, qw",
    ),
    "a quaternion for angles": (
        lambda: untyped.Pose((0.0, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0]),
        r"wanted 3 numbers, roll, pitch, yaw \[rad\]; Pose.from_matrix",
    ),
    "a number for a position": (lambda: untyped.Pose(3.0), r"of shape \(\); wanted 3 numbers"),
    "a quaternion of a pose": (lambda: untyped.Pose(quaternion=(0, 0, 0, 1)), "Pose.from_matrix"),
    "torques without the robot": (
        lambda: untyped.World(Scene("s", robots=(SceneRobot("arm", ARM),))).step(torques=ARM.neutral()),
        r"torques is of type ndarray; wanted a dict by robot, such as \{'arm': ...\}",
    ),
    "a motor without the robot": (
        lambda: untyped.World(Scene("s", robots=(SceneRobot("arm", ARM),))).step(
            motors=untyped.PDMotor(0.0, 1.0, 1.0)
        ),
        r"motors is of type PDMotor; wanted a dict by robot, such as \{'arm': ...\}",
    ),
    "a setting of the search": (
        lambda: dynx.backend("reference", ARM).inverse_kinematics(
            np.eye(4),
            "tool0",
            q_init=ARM.neutral(),  # type: ignore[call-overload]
        ),
        "inverse_kinematics has no option 'q_init'; did you mean 'q0'",
    ),
    "a scene by its name": (
        lambda: untyped.World("stack"),
        r"wanted a Scene, such as dynx.world.read_scene\('stack'\)",
    ),
    "a scene by its file": (
        lambda: untyped.world.scene_to_mjcf("my.toml"),
        r"dynx.world.read_scene\('my.toml'\)",
    ),
    "several robots for the doctor": (
        lambda: untyped.diagnose(["ur5", "panda"]),
        "wanted a name, a path, URDF text or a Model; one at a time",
    ),
    "several robots as loaded": (lambda: untyped.compare_as_loaded([ARM]), "one at a time"),
    "no robot for the doctor": (
        lambda: untyped.diagnose(None),
        "wanted a name, a path, URDF text or a Model",
    ),
    "several models": (lambda: untyped.parametric([ARM, ARM]), "one at a time"),
    "a payload by frame": (
        lambda: untyped.simulate(ARM, None, ARM.neutral(), duration=0.1, payload={"tool0": 2.5}),
        r"wanted a Payload, or a list of them, such as Payload\('tool0', 2.5\)",
    ),
    "a payload by its fields": (
        lambda: untyped.simulate(
            ARM, None, ARM.neutral(), duration=0.1, payload={"frame": "tool0", "mass": 2.5}
        ),
        r"such as Payload\(frame='tool0', mass=2.5\)",
    ),
    "an empty payload": (
        lambda: untyped.simulate(ARM, None, ARM.neutral(), duration=0.1, payload={}),
        "payload is '{}'; wanted a Payload, or a list of them",
    ),
    "pushes by their fields": (
        lambda: untyped.simulate(
            ARM, None, ARM.neutral(), duration=0.1, pushes={"on": "tool0", "wrench": [0] * 6}
        ),
        r"such as ExternalForce\(on='tool0', wrench=\[0, 0, 0, 0, 0, 0\]\)",
    ),
    "pushes by frame": (
        lambda: untyped.simulate(
            ARM, None, ARM.neutral(), duration=0.1, pushes={"tool0": [1, 0, 0, 0, 0, 0]}
        ),
        r"such as ExternalForce\('tool0', \[1, 0, 0, 0, 0, 0\]\)",
    ),
    "external forces of a simulation": (
        lambda: untyped.simulate(ARM, None, ARM.neutral(), duration=0.1, external_forces=[FORCE]),
        "no option 'external_forces'; here it is pushes",
    ),
    "external forces of a batch": (
        lambda: untyped.simulate_batch(ARM, None, ARM.neutral(), duration=0.1, external_forces=[FORCE]),
        "no option 'external_forces'; here it is pushes",
    ),
}


@pytest.mark.parametrize("name", HINTS)
def test_a_mistake_is_answered_with_the_call(name: str) -> None:
    call, message = HINTS[name]
    with pytest.raises(DynxError, match=message):
        call()


@pytest.mark.parametrize("backend", ["reference", "pinocchio", "compiled"])
def test_an_external_force_is_no_wrench_of_a_backend(backend: str) -> None:
    zero = np.zeros(ARM.nv)
    with dynx.backend(backend, ARM) as engine:
        for wrong in ([FORCE], FORCE):
            call: Any = engine.inverse_dynamics
            with pytest.raises(ArgumentError, match=r"such as \{'tool0': .*ExternalForce is for what moves"):
                call(ARM.neutral(), zero, zero, external_forces=wrong)


def test_forces_by_part_name_the_object(movers: list[Any]) -> None:
    with pytest.raises(ArgumentError, match=r"such as ExternalForce\('brick', \[1, 0, 0, 0, 0, 0\]\)"):
        movers[0].step(forces={"brick": [1, 0, 0, 0, 0, 0]})


@given(st.floats(max_value=0.0, exclude_max=True) | st.just(-np.inf))
def test_a_force_from_before_the_start_is_refused(start: float) -> None:
    with pytest.raises(ArgumentError, match=r"the start of an external force .* at least 0"):
        dynx.ExternalForce("tool0", [0.0] * 6, start=start)


def test_a_list_of_wrong_objects_is_not_said_to_be_too_many() -> None:
    with pytest.raises(DTypeError) as error:
        untyped.diagnose([3])
    assert "one at a time" not in str(error.value)
    assert os.linesep not in str(error.value)


OTHER_FILES = {
    "a.sdf": ("<world name='w'/>", "this file is a part of SDF, whose root is <sdf>"),
    "b.xml": ('<gazebo version="1.0"/>', "dynx reads 1.4 to 1.12"),
    "empty.sdf": ("", "wanted <sdf version=...>"),
    "a.xml": ("<model><link/></model>", "the root element is <model>; wanted <robot>"),
    "a.dae": ("<COLLADA/>", "this file is a mesh; dynx.world.mesh"),
    "a.stl": ("solid a", "not XML.*a file .stl is a mesh; dynx.world.mesh"),
    "a.usda": ("#usda 1.0", "not XML.*a file .usda is USD, which dynx does not read"),
    "a.toml": ("name = 's'", r"not XML.*dynx.world.read_scene\(file\)"),
    "a.json": ("{}", r"not XML.*dynx.world.read_scene\(file\)"),
}
"""Files of other formats, and what each is said to be where a URDF is wanted."""


@pytest.mark.parametrize("name", OTHER_FILES)
def test_a_file_of_another_format_is_said_to_be_one(name: str, tmp_path: Path) -> None:
    text, message = OTHER_FILES[name]
    (tmp_path / name).write_text(text)
    with pytest.raises(DynxError, match=message):
        dynx.load(tmp_path / name)


@pytest.mark.parametrize("name", ["no.sdf", "no.stl", "no.usd"])
def test_a_scene_of_another_format_is_said_to_be_one(name: str) -> None:
    with pytest.raises(DynxError, match=f"a file of a scene ends in .toml.*a file {name[2:]} is "):
        dynx.world.read_scene(name)


@pytest.mark.parametrize("name", ["robots/arm.urdf", "robots/arm.xacro", "pendulum"])
def test_the_error_for_a_robot_in_place_of_a_scene_has_a_scene_with_it(name: str, tmp_path: Path) -> None:
    with pytest.raises(DynxError) as raised:
        dynx.world.read_scene(name)
    text = str(raised.value).partition("on the ground is ")[2].replace("arm.xacro", "arm.urdf")
    (tmp_path / "arm.urdf").write_text('<robot name="arm"><link name="base"/></robot>')
    (tmp_path / "scene.json").write_text(text[: text.rindex("}") + 1])
    scene = dynx.world.read_scene(tmp_path / "scene.json")
    assert [scene.bodies[0].name, scene.robots[0].name] == ["ground", "robot"]


def test_one_pose_of_a_sensor_at_rest_is_one_of_many() -> None:
    T = dynx.Pose((0.0, 0.0, 1.0), (0.1, 0.2, 0.3)).matrix
    one, many = (dynx.control.SensorMotion.at_rest(each) for each in (T, T[None]))
    np.testing.assert_array_equal(one.acceleration, many.acceleration)
    assert one.acceleration.shape == (1, 3)
