"""Faults in some environments of a vector: named, and no bit of the others changes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from dynx.envs.tasks.cart_pole import CartPole
from dynx.envs.tasks.walk import Walk
from dynx.envs.vector import RobotVectorEnvironment
from dynx.errors import ArgumentError, NotFiniteError, SingularMassMatrixError
from dynx.model.numbers import DIVERGENCE_SPEED
from dynx.spatial.scalar import Floats
from dynx.world import Scene

COUNT = 9

Vectors = Mapping[str, RobotVectorEnvironment]


@pytest.fixture(scope="module")
def vectors() -> Iterator[Vectors]:
    made = {
        "walk": RobotVectorEnvironment(Walk(contacts="feet"), COUNT, autoreset_mode="Disabled"),
        "cart_pole": RobotVectorEnvironment(CartPole(), COUNT, autoreset_mode="Disabled"),
    }
    try:
        yield made
    finally:
        for each in made.values():
            each.close()


class Fault:
    """A change of the state of one environment, whose step may diverge."""

    def __init__(self, name: str, size: float, coordinate: int) -> None:
        self.name, self.size, self._coordinate = name, size, coordinate

    def __repr__(self) -> str:
        return f"Fault({self.name!r}, {self.size!r}, {self._coordinate})"

    def apply(self, envs: RobotVectorEnvironment, state: Floats) -> None:
        """Change a state (nq + nv + k,)."""
        model = envs.task.model
        base = (7, 6) if model.floating else (0, 0)
        joint = self._coordinate % (model.nq - base[0])
        if self.name == "speed":
            state[model.nq + self._coordinate % model.nv] = self.size
        elif self.name == "stop":
            # A joint close to its upper limit, on its way out.
            place = base[0] + joint
            state[place] = min(float(model.upper[place]), 1e3) - 1e-3
            state[model.nq + base[1] + joint] = abs(self.size)
        elif self.name == "beyond":
            state[base[0] + joint] += math.copysign(10.0, self.size)
        elif model.floating:
            # The robot begins in the ground.
            state[2] -= abs(self.size)


def faults() -> st.SearchStrategy[Fault]:
    sizes = st.one_of(
        st.floats(-100.0, 100.0),
        # Their products overflow in the step; observations of larger numbers would overflow in float32.
        st.sampled_from([1e6, -1e9, 1e30, -1e37]),
    )
    return st.builds(
        Fault, st.sampled_from(["speed", "stop", "beyond", "overlap"]), sizes, st.integers(0, 100)
    )


def step_from(envs: RobotVectorEnvironment, states: Floats) -> tuple[Any, ...]:
    """Return what a step from states returns, and the states after it."""
    size = envs.action_space.shape
    actions = np.random.default_rng(1).uniform(-1.0, 1.0, size)
    if envs.single_action_space.shape == ():
        actions = (actions > 0.0).astype(np.int64)
    envs.reset(seed=3)
    envs.set_states(states)
    return *envs.step(actions.astype(envs.action_space.dtype)), envs.states


@settings(max_examples=30, deadline=None)
@given(
    st.sampled_from(["walk", "cart_pole"]),
    st.dictionaries(st.integers(0, COUNT - 1), faults(), min_size=1, max_size=4),
    st.integers(0, COUNT - 1),
    st.floats(0.0, 0.8),
)
@example("walk", {0: Fault("speed", 1e37, 3)}, 5, 0.3)
def test_environments_with_faults_are_named_and_change_no_other(
    vectors: Vectors, name: str, given_faults: dict[int, Fault], stopped: int, distance: float
) -> None:
    """A joint of one of the others reaches a limit in some part of the step."""
    envs = vectors[name]
    envs.reset(seed=3)
    states = envs.states
    Fault("stop", 60.0, 1).apply(envs, states[stopped])
    states[stopped, 8 if envs.task.model.floating else 1] -= distance
    wanted = step_from(envs, states)
    for k, fault in given_faults.items():
        fault.apply(envs, states[k])
    observations, rewards, terminated, truncated, info, after = step_from(envs, states)
    others = [k for k in range(COUNT) if k not in given_faults]
    found = observations, rewards, terminated, truncated, after
    for mine, other in zip(found, (*wanted[:4], wanted[5]), strict=True):
        assert np.array_equal(mine[others], other[others])
    reasons = info.get("diverged", np.full(COUNT, None))
    model = envs.task.model
    velocities = after[:, model.nq : model.nq + model.nv]
    for k in range(COUNT):
        if reasons[k] is None:
            assert np.isfinite([*observations[k], rewards[k]]).all()
            assert (np.abs(velocities[k]) <= DIVERGENCE_SPEED).all()
        else:
            assert k in given_faults
            assert (truncated[k], rewards[k]) == (True, 0.0)
            assert "not finite or beyond" in reasons[k]
            assert np.array_equal(after[k], states[k])


@settings(max_examples=30, deadline=None)
@given(
    st.sampled_from(["walk", "cart_pole"]),
    st.integers(0, COUNT - 1),
    st.integers(0, 1000),
    st.sampled_from([math.nan, math.inf, -math.inf]),
)
def test_a_state_that_is_not_finite_is_named_and_changes_nothing(
    vectors: Vectors, name: str, row: int, place: int, value: float
) -> None:
    envs = vectors[name]
    envs.reset(seed=3)
    before = envs.states
    wrong = before.copy()
    wrong[row, place % wrong.shape[1]] = value
    with pytest.raises(NotFiniteError, match=rf"states\[{row}, {place % wrong.shape[1]}\] is "):
        envs.set_states(wrong)
    assert np.array_equal(envs.states, before)
    step_from(envs, before)


@pytest.mark.parametrize("scale", [0.0, (0.0, 1.0), -1.0, math.nan])
def test_masses_of_zero_are_refused_by_name(scale: Any) -> None:
    with pytest.raises(ArgumentError, match="mass_scale"):
        RobotVectorEnvironment(Walk(contacts="feet"), 2, randomize={"mass_scale": {"trunk": scale}})


def test_a_robot_without_mass_is_refused_by_name() -> None:
    walk = Walk(contacts="feet")
    dog = walk.model
    links = [replace(each, inertial=None) for each in dog.links]
    light = type(dog).build("light", links, dog.joints, base="floating", geometry=dog.geometry)

    class Light(Walk):
        """A walk of a robot without mass."""

        def scene(self) -> Scene:
            scene = super().scene()
            return replace(scene, robots=tuple(replace(each, model=light) for each in scene.robots))

    with pytest.raises(
        SingularMassMatrixError, match="light has no unique acceleration: nothing that 'base'"
    ):
        RobotVectorEnvironment(Light(contacts="feet"), 2)
