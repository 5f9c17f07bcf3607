"""Hints at public doors: what people give first is answered with the call that they want."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.errors import ArgumentError, DTypeError
from dynx.world import Scene, World, box

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
    with pytest.raises(ArgumentError, match=message):
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
