"""Names of options: former and mistyped ones name the right one, whatever the function does with it."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import pytest

import dynx
from dynx.errors import ArgumentError, UnknownNameError
from dynx.option_names import checks_option_names, takes
from dynx.sim.scenario.options import option
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


@dataclass(frozen=True)
class ThrowArguments:
    """Arguments of `throw`."""

    target: str
    speed: float = option(2.5, "Speed of release", unit="m/s", group="Throw")
    tags: list[str] = field(default_factory=list)


@takes(ThrowArguments)
def throw(arguments: ThrowArguments) -> float:
    """Throw.

    At a target.
    """
    return arguments.speed * len(arguments.target)


def test_a_function_that_takes_a_dataclass_has_its_signature_and_documents_its_options() -> None:
    assert throw("door") == throw(target="door", speed=2.5) == 10.0
    assert throw("door", 1.0, ["high"]) == 4.0
    signature = inspect.signature(throw)
    assert list(signature.parameters) == ["target", "speed", "tags"]
    assert signature.return_annotation in (float, "float")
    text = inspect.getdoc(throw)
    assert text is not None
    before, options = text.split("Options:\n")
    assert before.strip().endswith("At a target.")
    lines = [line for line in options.splitlines() if line.strip()]
    assert len(lines) == 1
    assert lines[0].startswith("    speed: Speed of release")
    assert "m/s" in lines[0]


def test_arguments_that_do_not_fit_a_dataclass_are_refused_in_the_name_of_the_function() -> None:
    with pytest.raises(UnknownNameError, match="throw has no option 'sped'; did you mean 'speed'"):
        throw("door", sped=1.0)  # type: ignore[call-arg]
    for arguments, options in (((), {}), (("door", 1.0, [], 2), {}), (("door",), {"target": "wall"})):
        with pytest.raises(TypeError, match=r"^throw: "):
            throw(*arguments, **options)  # type: ignore[arg-type]


def test_a_field_that_is_missing_or_unknown_names_the_class() -> None:
    with pytest.raises(UnknownNameError, match="ExternalForce has no option 'at_time'"):
        ExternalForce(on="tip", wrench=[0.0] * 6, at_time=1.0)  # type: ignore[call-arg]
    with pytest.raises(UnknownNameError, match="'self'"):
        act(self=1, duration=1.0)  # type: ignore[call-arg]
