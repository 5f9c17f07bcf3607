"""Arguments of `conform` and cases of a user that cannot be used."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from typing import Any

import pytest

from dynx.contacts import ContactCase, Figure, conform
from dynx.contacts.cases.friction import Slope
from dynx.errors import ArgumentError
from dynx.model import Pose
from dynx.world import Scene, World, box, ground, register_world, unregister_world
from tests.contacts.exact_world import ExactWorld


@pytest.fixture(autouse=True)
def exact() -> Iterator[None]:
    register_world("exact", lambda: ExactWorld)
    yield
    unregister_world("exact")


class Resting(ContactCase):
    """A box at rest, of which a function gives the figures."""

    name = "resting"
    title = "A box at rest"
    law = "v = 0"
    source = "balance of forces"

    def __init__(self, figures: Callable[[World], Any]) -> None:
        self._figures = figures

    def scene(self, parameters: Any) -> Scene:
        cube = box("cube", (0.1, 0.1, 0.1), mass=1.0, pose=Pose((0.0, 0.0, 0.05)))
        return Scene("box", bodies=(ground(), cube))

    def measure(self, world: World, parameters: Any) -> Any:
        return self._figures(world)


def still(world: World) -> list[Figure]:
    return [Figure("speed", 0.0, 0.0, "m/s", 1.0)]


class Taken(Resting):
    name = "slope"


class Untitled(Resting):
    title = ""


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"engines": "exact"}, "engines is 'exact'; wanted a list of names"),
        ({"cases": "slope"}, "cases is 'slope'; wanted a list of names and cases"),
        ({"cases": [Slope]}, r"is the class Slope; wanted an instance, Slope\(\)"),
        ({"cases": [3]}, "a case is of type int"),
        ({"cases": [Taken(still)]}, "has the name 'slope', which is one of dynx's own"),
        ({"cases": [Resting(still), Resting(still)]}, "two cases have the name 'resting'"),
        ({"cases": ["slope", Slope()]}, "two cases have the name 'slope'"),
        ({"cases": [Untitled(still)]}, "Untitled has no title"),
        ({"steps": 1e-3}, "steps is '0.001'; wanted a list of steps"),
        ({"steps": [1e-9]}, "a step is 1e-09 s; wanted 1e-06 to 0.1 s"),
        ({"steps": [100.0, 1e-3]}, "a step is 100 s; wanted"),
        ({"settings": {"exact": {"substeps": 0}}}, "substeps is '0'; wanted a whole number"),
        ({"settings": {"exact": 3}}, "settings of exact is of type int"),
        ({"settings": 3}, "settings is of type int"),
    ],
)
def test_arguments_that_cannot_be_used_are_named(arguments: dict[str, Any], message: str) -> None:
    given: dict[str, Any] = {"engines": ["exact"], "steps": [4e-3], "cases": ["slope"], "jobs": 0}
    with pytest.raises(ArgumentError, match=message):
        conform(**given | arguments)


def test_substeps_are_taken_in_every_step() -> None:
    taken = []

    def count(world: World) -> list[Figure]:
        taken.append(world.substeps)
        return still(world)

    conform(["exact"], [4e-3], [Resting(count)], settings={"exact": {"substeps": 8}}, jobs=0)
    assert taken == [8]


def oops(world: World) -> list[Figure]:
    raise ValueError("oops")


def late(world: World) -> list[Figure]:
    return [*still(world), Figure("late", 0.0, 0.0, "", 1.0)] if world.dt < 3e-3 else still(world)


@pytest.mark.parametrize(
    ("figures", "message"),
    [
        (lambda world: [], "measure returned no figures"),
        (lambda world: None, "measure returned no figures"),
        (lambda world: [*still(world), *still(world)], "two figures of the name 'speed'"),
        (lambda world: [Figure("speed", float("nan"), 0.0, "m/s", 1.0)], "the figure 'speed' is nan"),
        (lambda world: [Figure("speed", 0.0, float("nan"), "m/s", 1.0)], "exact value of the figure 'speed'"),
        (oops, r"test_arguments\.py:\d+: ValueError: oops"),
    ],
)
def test_what_a_case_measures_is_checked(figures: Callable[[World], Any], message: str) -> None:
    found = conform(["exact"], [4e-3], [Resting(figures)], jobs=0)
    assert not found.results
    (lost,) = found.failures
    assert lost.kind == "error"
    assert re.search(message, lost.message)


def test_figures_are_the_same_at_every_step() -> None:
    with pytest.raises(ArgumentError, match="'resting' has the figures speed at one step and speed, late"):
        conform(["exact"], [4e-3, 2e-3], [Resting(late)], jobs=0)


@pytest.mark.skipif(find_spec("mujoco") is None, reason="needs MuJoCo")
def test_settings_that_an_engine_raises_are_returned_with_those_in_effect() -> None:
    given = {"mujoco": {"time_constant": 0.003, "impratio": 10.0, "slip_time_constant": 0.01}}
    found = conform(["mujoco"], [4e-3, 1e-3], [Resting(still)], settings=given, jobs=0)
    assert found.in_effect == {"mujoco": {"time_constant": (0.008, 0.003)}}
    given["mujoco"]["substeps"] = 4
    assert conform(["mujoco"], [4e-3], [Resting(still)], settings=given, jobs=0).in_effect["mujoco"] == {}
