"""Names of options: former and mistyped ones name the right one, whatever the function does with it."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from typing import Any

import pytest

import dynx
from dynx.errors import ArgumentError, UnknownNameError
from dynx.option_names import checks_option_names
from dynx.steppers.forces import ExternalForce
from dynx.world import Scene, World, box


@pytest.fixture(scope="module")
def world() -> Iterator[World]:
    with World(Scene("s", bodies=(box("brick", (0.1, 0.1, 0.1), mass=1.0),)), dt=1e-3) as opened:
        yield opened


FORMER: dict[str, tuple[str, Callable[[Any], object]]] = {
    "ExternalForce": ("on", lambda _: ExternalForce(frame="tip", wrench=[0.0] * 6)),  # type: ignore[call-arg]
    "World.step": ("forces", lambda world: world.step(wrenches=[])),
    "World.run": ("forces", lambda world: world.run(0.01, wrenches=[])),
    # As the loads of a function, and of a task in a scene, reach the world.
    "loads": ("forces", lambda world: world.run(0.01, loads=lambda _: {"wrenches": []})),
}


@pytest.mark.parametrize("name", FORMER)
def test_a_former_keyword_names_the_present_one(name: str, world: World) -> None:
    present, call = FORMER[name]
    with pytest.raises(UnknownNameError, match=rf"; it is now {present}$"):
        call(world)


@checks_option_names(wrenches="forces")
def act(forces: Any = (), *, duration: float, strict: bool = True) -> Any:
    return len(forces) + duration


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        (
            {"force": (), "duration": 1.0},
            UnknownNameError,
            "act has no option 'force'; did you mean 'forces'",
        ),
        ({"wrenches": ()}, UnknownNameError, "it is now forces"),
        ({"forces": ()}, ArgumentError, "act needs duration="),
    ],
)
def test_keywords_that_do_not_fit(options: dict[str, Any], error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        act(**options)


def test_a_type_error_of_the_body_is_not_changed() -> None:
    with pytest.raises(TypeError, match="has no len"):
        act(forces=3, duration=1.0)
    assert act(forces=[1], duration=1.0) == 2.0
    assert list(inspect.signature(act).parameters) == ["forces", "duration", "strict"]


@pytest.mark.parametrize("given", [(1,), (1, 2), (1.0, 1e-3, 3)])
def test_compare_with_wrong_arguments_names_itself_alone(given: tuple[Any, ...]) -> None:
    rollout = dynx.simulate(dynx.load("pendulum"), duration=0.01)
    scene = Scene("s", bodies=(box("brick", (0.1, 0.1, 0.1), mass=1.0),))
    for pair, extra in (((rollout, rollout), given), ((scene, ["pybullet"]), (*given, *given))):
        with pytest.raises(TypeError, match=r"^compare: too many positional arguments$"):
            dynx.compare(*pair, *extra, *given)
        with pytest.raises(UnknownNameError, match=r"^compare has no option 'tolerence'"):
            dynx.compare(*pair, tolerence=1.0)
