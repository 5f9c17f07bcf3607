"""Random scenes on every engine: momentum, energy, rest, equal runs, other orders and other places.

``python -m tests.world.random_scenes --count 300`` prints for more of them how near each bound is.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

from dynx.spatial.scalar import Floats
from dynx.testing.strategies import scenes
from dynx.world import Scene, World, box, ground
from tests.world.engines import WORLDS
from tests.world.random_scenes.examination import (
    MOTION,
    distance,
    examine,
    final_state,
    moved,
    numbers,
    permuted,
)

EXAMPLES = {"pybullet": 8, "mujoco": 8, "drake": 4}
STEPS = 80

LARGEST_DISTANCE = 5e-3
"""Distance [m] after 0.08 s between runs in another order of the parts or at another place."""


@pytest.mark.parametrize("engine", WORLDS)
def test_momentum_and_energy_stay_within_the_bounds_of_the_engine(engine: str) -> None:
    @settings(max_examples=EXAMPLES[engine])
    @given(scenes())
    def check(scene: Scene) -> None:
        excess = examine(scene, engine, STEPS)
        assert max(excess.values()) <= 1.0, excess

    check()


@pytest.mark.parametrize("engine", WORLDS)
def test_runs_are_equal_and_depend_little_on_order_and_place(engine: str) -> None:
    @settings(max_examples=EXAMPLES[engine] // 2)
    @given(scenes())
    def check(scene: Scene) -> None:
        state = final_state(scene, engine, STEPS)
        assert (numbers(state) == numbers(final_state(scene, engine, STEPS))).all()
        assert distance(state, final_state(permuted(scene), engine, STEPS)) < LARGEST_DISTANCE
        elsewhere = final_state(moved(scene), engine, STEPS)
        assert distance(state, elsewhere, MOTION.matrix) < LARGEST_DISTANCE

    check()


@pytest.mark.parametrize("engine", WORLDS)
def test_forces_on_bodies_at_rest_balance_their_weights(engine: str) -> None:
    sizes = [(0.4, 0.3, 0.1), (0.3, 0.3, 0.2), (0.2, 0.1, 0.1)]
    heights = np.cumsum([0.0, 0.1, 0.2])
    boxes = tuple(
        box(f"box{k}", size, mass=3.0 / (k + 1), pose=_at(heights[k] + size[2] / 2))
        for k, size in enumerate(sizes)
    )
    scene = Scene("stack", bodies=(ground(), *boxes))
    forces = {each.name: np.zeros(3) for each in boxes}
    with World(scene, engine) as world:
        world.run(1.0)
        for _ in range(20):
            world.step()
            for contact in world.contacts():
                for name, sign in ((contact.a, 1.0), (contact.b, -1.0)):
                    if name in forces:
                        forces[name] += sign * contact.force / 20
    for each in boxes:
        assert each.mass is not None
        assert forces[each.name] == pytest.approx([0.0, 0.0, 9.81 * each.mass], abs=0.02 * 9.81 * each.mass)


def _at(height: float) -> Floats:
    T = np.eye(4)
    T[2, 3] = height
    return T


@pytest.mark.parametrize(
    ("changed", "error"),
    [
        ({"modulus": 1e8}, "rattles"),
        ({}, ""),
        ({"modulus": 1e8, "contact_approximation": "sap"}, ""),
    ],
)
def test_drake_rattles_under_uneven_pressure_with_a_stiff_modulus(
    changed: dict[str, object], error: str
) -> None:
    brick = box("brick", (0.4, 0.4, 0.2), mass=2.0, pose=_at(0.1), center_of_mass=(0.12, -0.07, -0.05))
    with World(Scene("rest", bodies=(ground(), brick)), "drake", **changed) as world:  # type: ignore[arg-type]
        world.run(1.0)
        speeds = []
        for _ in range(50):
            world.step()
            speeds.append(float(np.abs(world.state.bodies["brick"].twist).max()))
    assert (max(speeds) > 5e-3) == bool(error)
