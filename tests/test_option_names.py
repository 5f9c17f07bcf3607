"""Names of options: former and mistyped ones name the right one, whatever the function does with it."""

from __future__ import annotations

import inspect
import pickle
from abc import ABCMeta
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, is_dataclass, replace
from functools import partial
from typing import Any

import pytest

import dynx
from dynx.engine_names import KEYWORDS, keyword_of_dynx, parameter_of
from dynx.errors import ArgumentError, UnknownNameError
from dynx.option_names import checks_option_names
from dynx.sim.scenario.options import option, takes
from dynx.steppers.forces import ExternalForce
from dynx.world import Material, Scene, World, box
from tests.random_calls.calls import public_modules


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


@pytest.mark.parametrize(("method", "known"), [("to_mjcf", ""), ("to_urdf", "; known: geometry")])
def test_a_method_with_its_body_elsewhere_names_itself(method: str, known: str) -> None:
    call = getattr(dynx.load("pendulum"), method)
    with pytest.raises(UnknownNameError, match=rf"^{method} has no option 'foo'{known}$"):
        call(foo=1)


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
    assert lines[0].startswith("- `speed`: Speed of release")
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


def public() -> Iterator[tuple[str, Callable[..., Any], bool]]:
    """Yield the name of each public function, class and method, itself, and whether it must answer a
    mistaken keyword, by the rule of `dynx.option_names.explained`. Objects of methods are not initialised."""
    for module in public_modules():
        for name in getattr(module, "__all__", ()):
            value = getattr(module, name)
            full = f"{module.__name__}.{name}"
            if inspect.isfunction(value):
                yield full, value, True
            if not isinstance(value, type) or issubclass(value, BaseException) or inspect.isabstract(value):
                continue
            result = is_dataclass(value) and not has_options(value.__init__)
            yield full, value, inspect.isfunction(value.__init__) and not result
            for holder in value.__mro__:
                for own, member in vars(holder).items():
                    function = inspect.unwrap(getattr(member, "__func__", member))
                    if own.startswith("_") or not inspect.isfunction(function):
                        continue
                    explained = holder.__module__.startswith("dynx") and not isinstance(holder, ABCMeta)
                    method = getattr(value, own)
                    explained &= has_options(function) and not issubclass(holder, tuple)
                    if inspect.isfunction(method) and explained:
                        method = partial(method, object.__new__(value))
                    yield f"{full}.{own}", method, explained


def has_options(function: Any) -> bool:
    return bool(function.__defaults__ or function.__kwdefaults__)


def parameters_of(function: Any) -> Mapping[str, inspect.Parameter]:
    """Return the parameters of a function or class; none of a class that nobody knows those of."""
    try:
        return inspect.signature(function).parameters
    except ValueError:
        return {}


def test_everything_public_answers_a_misspelt_keyword_with_the_right_one() -> None:
    silent: dict[str, str] = {}
    answered = set()
    for full, function, explained in public():
        names = [
            name
            for name, each in parameters_of(function).items()
            if each.kind in (each.POSITIONAL_OR_KEYWORD, each.KEYWORD_ONLY) and len(name) > 3
        ]
        if not explained or not names:
            continue
        wrong = names[0][:2] + names[0][1:]
        try:
            function(**{wrong: None})
        except UnknownNameError as error:
            answered.add(full)
            if f"did you mean {names[0]!r}" not in str(error):
                silent[full] = str(error)
        except Exception as error:
            silent[full] = f"{type(error).__name__}: {error}"
        else:
            silent[full] = "returns"
    assert silent == {}
    assert len(answered) > 150


def test_words_of_other_libraries_name_the_argument() -> None:
    """Each argument of the table is one of something public."""
    names = {name for _, function, _ in public() for name in parameters_of(function)}
    assert set(KEYWORDS) - names == set()
    for name, words in KEYWORDS.items():
        for word in words.split():
            assert parameter_of(word, [name]) == name
            assert f"did you mean {name!r}" in str(keyword_of_dynx(word, ["nothing", name]))


def test_a_public_class_keeps_its_signature_its_pickle_and_its_copy() -> None:
    for made in (dynx.Pose((1.0, 2.0, 3.0)), Material(friction=0.3), dynx.Noise(q=0.1)):
        assert pickle.loads(pickle.dumps(made)) == made
        assert replace(made) == made
    assert list(inspect.signature(dynx.Pose).parameters) == ["xyz", "rpy"]
    assert pickle.loads(pickle.dumps(dynx.world.box)) is dynx.world.box
    with pytest.raises(UnknownNameError, match="Pose has no option 'rotation'; did you mean 'rpy'"):
        replace(dynx.Pose(), rotation=(0.0, 0.0, 0.0))  # type: ignore[call-arg]
