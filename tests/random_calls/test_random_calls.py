"""No public call raises anything but an error of dynx, whatever it is given.

2,000 calls or more are made outside this suite by ``python -m tests.random_calls``.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dynx
import dynx.doctor
from dynx import trajectory
from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, DTypeError
from tests.random_calls.calls import (
    Call,
    Door,
    Foreign,
    NoNumbers,
    Unwritable,
    doors,
    outcome,
    public_modules,
    random_call,
)
from tests.random_calls.messages import omissions
from tests.random_calls.objects import OBJECTS, arm, motion, scene

CALLS = 250
SEED = 20

LARGEST_SHARE = 0.01
"""Largest share of calls whose errors omit the name of the argument, what was given, or what is valid."""


def test_random_calls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    outcomes = {}
    for number in range(CALLS):
        call = random_call(SEED, number)
        if call is not None:
            wrong, error = outcome(call)
            outcomes[str(call)] = wrong, str(error), [] if error is None else omissions(call, error)
    assert {call: wrong for call, (wrong, *_) in outcomes.items() if wrong is not None} == {}
    incomplete = {call: (text, missing) for call, (_, text, missing) in outcomes.items() if missing}
    assert len(incomplete) <= LARGEST_SHARE * CALLS, incomplete


def test_the_calls_reach_every_room() -> None:
    """A door that no longer opens would leave the calls as they are, only fewer."""
    names = [door.name for door in doors()]
    assert len(names) > 250
    for part in (
        "dynx.control.",
        "dynx.world.",
        "dynx.trajectory.",
        "dynx.ik.",
        "<world>.",
        "<bench session>.",
        "<readings>.",
        "<tool>.",
        "<backend drake>.",
    ):
        assert any(name.startswith(part) for name in names), part


NOT_MADE = {
    "Detection": "what a rule returns",
    "Episodes": "a task returns one to an environment",
    "Plant": "`Simulation` makes one and calls it",
    "WrenchEstimate": "what an observer returns",
}
"""Public classes of whose objects no methods are called, and why; their subclasses stand for base classes."""


def test_every_public_class_has_an_object_whose_methods_are_called() -> None:
    """A class that is added without one would stay untried."""
    # An object stands for its class and its bases, and for other classes with a base of its: there is one
    # task, say.
    tried = {base for make in OBJECTS.values() for base in type(make()).__mro__ if _is_own(base)}
    missing = {
        each.__name__
        for module in public_modules()
        for each in (getattr(module, name) for name in getattr(module, "__all__", ()))
        if isinstance(each, type) and not issubclass(each, BaseException)
        if any(inspect.isroutine(member) and _is_own(member) for member in _public_members(each))
        if not tried & set(each.__mro__)
    }
    assert missing == set(NOT_MADE)


def _public_members(kind: type) -> Iterator[object]:
    for name, member in vars(kind).items():
        if not name.startswith("_") or name == "__call__":
            yield getattr(member, "__func__", member)


def _is_own(member: Any) -> bool:
    return (member.__module__ or "").startswith("dynx")


untyped: Any = dynx
"""dynx without types: the mistakes are tested."""


def untyped_scene() -> Any:
    """Return the scene without types."""
    return scene()


WRONG: dict[str, tuple[Callable[[], Any], str]] = {
    "model": (
        lambda: untyped.control.Velocity(3, kd=1.0),
        "model is '3', of type int; wanted a Model, such as dynx.load",
    ),
    "model by name": (lambda: untyped.control.PD("ur5", kp=1.0, kd=1.0), "such as dynx.load\\('ur5'\\)"),
    "parameters": (
        lambda: untyped.ParametricDynamics(3),
        "parameters is '3', of type int; wanted Parameters",
    ),
    "joints": (
        lambda: untyped.PDMotor(0.1, 1.0, 1.0, joints=3),
        "joints is '3', of type int; wanted Sequence\\[str\\]",
    ),
    "class imported for types": (
        lambda: untyped.trajectory.Identifiability(arm()).condition_number(0),
        "trajectory is '0'",
    ),
    "record": (lambda: untyped.world.separation(3, 4), "ours is '3', of type int; wanted Record"),
    "path": (lambda: untyped.world.write_scene(scene(), 3), "path is '3', of type int; wanted str"),
    "callable": (lambda: untyped.agree(arm(), progress=3), "progress is '3'"),
    "class": (lambda: untyped.backends.native_quantities(int), "backend is .*int"),
    "name of many axes": (lambda: untyped_scene().robot(np.eye(2)), "name is .*of type ndarray; wanted str"),
    "truth value": (
        lambda: untyped.backend("reference", arm()).mass_matrix(np.zeros(3), joint_dynamics=np.ones(2)),
        "joint_dynamics",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_type_is_named_with_what_was_given_and_what_is_valid(case: str) -> None:
    call, message = WRONG[case]
    with pytest.raises(DTypeError, match=message):
        call()


def test_the_signature_and_a_right_call_are_those_of_the_function() -> None:
    calls: list[tuple[Any, ...]] = []

    @checks_types
    def follow(
        path: trajectory.Trajectory, /, names: list[str] | None = None, *rest: int, **others: int
    ) -> None:
        """Follow."""
        calls.append((path, names, rest, others))

    follow(motion(), None, 1, 2, extra=3)
    follow(motion(), names=["a"])
    assert calls == [(motion(), None, (1, 2), {"extra": 3}), (motion(), ["a"], (), {})]
    assert list(inspect.signature(follow).parameters) == ["path", "names", "rest", "others"]
    assert follow.__doc__ == "Follow."
    for wrong in ([3], 3, np.array(1.0), Foreign()):
        with pytest.raises(DTypeError, match="names is"):
            follow(motion(), wrong)  # type: ignore[arg-type]  # the mistake that is tested
    with pytest.raises(TypeError, match="missing 1 required positional argument"):
        follow()  # type: ignore[call-arg]


def test_the_second_of_two_arguments_of_one_type_is_named() -> None:
    @checks_types
    def chosen(first: bool, second: bool) -> bool:
        return first and second

    with pytest.raises(DTypeError, match=r"^second is '3', of type int; wanted True or False$"):
        chosen(True, 3)  # type: ignore[arg-type]  # the mistake that is tested


def test_an_iterator_is_left_for_the_function() -> None:
    @checks_types
    def joined(names: Iterable[str]) -> str:
        return ",".join(names)

    assert joined(name for name in "ab") == "a,b"


def test_a_matrix_is_a_pose_where_one_is_read() -> None:
    """The field of a dataclass holds what is made of an argument, whose type may be wider."""
    matrix: Any = np.eye(4)
    assert untyped.world.Camera(pose=matrix).pose == dynx.Pose()
    assert untyped.world.Weld("a", "b", matrix).T_a_b == dynx.Pose()
    assert untyped.world.box("b", (1.0, 1.0, 1.0), pose=matrix).pose == dynx.Pose()


def test_errors_name_the_argument_what_was_given_and_what_is_valid() -> None:
    """The checker of messages sees what each omits."""
    call = Call(Door("f", lambda: lambda samples: None), lambda samples: None, {"samples": 1.5}, {})
    for text, expected in (
        ("samples is 1.5; wanted a whole number", []),
        ("wanted a whole number, not 1.5", ["name"]),
        ("samples must be whole", ["given"]),
        ("samples is 1.5", ["valid"]),
        ("no", ["name", "given", "valid"]),
    ):
        assert omissions(call, ArgumentError(text)) == expected, text


def test_errors_about_objects_without_elements_are_read() -> None:
    """An object may have a length and no elements."""
    call = Call(Door("f", lambda: lambda samples: None), lambda samples: None, {"samples": NoNumbers()}, {})
    assert omissions(call, ArgumentError("samples is of type NoNumbers; wanted a whole number")) == []


def test_a_number_that_no_float_holds_is_refused_and_a_seed_may_be_one() -> None:
    engine = dynx.backend("reference", arm())
    with pytest.raises(ArgumentError, match=r"max_iterations is .* at most 1000000000"):
        engine.inverse_kinematics(np.eye(4), "tip", max_iterations=10**400)
    assert dynx.Noise(0.1, 0.1, seed=2**128).seed == 2**128


def test_an_array_in_the_place_of_sensors_is_named() -> None:
    with pytest.raises(ArgumentError, match="sensor"):
        untyped.Scene("s", sensors=np.eye(3))


def test_wrong_names_and_choices_of_a_page_are_named() -> None:
    pytest.importorskip("viser")
    page: Any = OBJECTS["viewer"]()
    calls: tuple[tuple[Callable[[], Any], str], ...] = (
        (lambda: page.show_view(np.eye(4)), "name is"),
        (lambda: page.show_view("no"), "no view 'no'"),
        (lambda: page.camera_pane(dynx.world.Camera(), shows=np.eye(4)), "shows is"),
        (lambda: page.dropdown("d", np.array(Foreign())), "options of dropdown 'd'"),
    )
    for call, message in calls:
        with pytest.raises(ArgumentError, match=message):
            call()


def test_an_array_in_the_place_of_an_objective_is_named() -> None:
    solve: Any = dynx.backend("reference", arm()).inverse_kinematics
    with pytest.raises(ArgumentError, match="maximize"):
        solve(np.eye(4), "tip", maximize=np.zeros((2, 3)))


def test_elements_of_an_iterator_are_checked_as_they_are_read() -> None:
    @checks_types
    def joined(names: Iterable[str], *more: int) -> str:
        return ",".join(names)

    assert joined(name for name in "ab") == joined(names=iter("ab")) == "a,b"
    with pytest.raises(DTypeError, match=r"names yields '3' at place 1, of type int; wanted Iterable\[str\]"):
        joined(iter(["a", 3]), 1)  # type: ignore[arg-type]  # the mistake that is tested
    with pytest.raises(DTypeError, match="reports yields '0' at place 0, of type int"):
        untyped.doctor.results_document(each for each in range(3))


def _list_of_itself() -> list[Any]:
    found: list[Any] = []
    found.append(found)
    return found


HARD: dict[str, tuple[Callable[[], Any], str]] = {
    "span of time as a number": (
        lambda: untyped.Payload("tip", np.timedelta64(3, "s")),
        "mass of a payload is '3 seconds'",
    ),
    "span of time as a count": (lambda: untyped.agree(arm(), samples=np.timedelta64(3, "s")), "samples"),
    "list that holds itself": (lambda: untyped.quat_from_rpy(_list_of_itself()), "nested more than 64 times"),
    "list that holds itself as a seed": (
        lambda: arm().random(rng=_untyped_list()),
        "rng is .*wanted a NumPy generator",
    ),
    "class without numbers": (
        lambda: untyped.rotation_from_rpy(NoNumbers()),
        "rpy is .*no array: call detach",
    ),
    "array without an axis as parts": (lambda: untyped.Scene(robots=np.array(1.0)), "robots of a scene is"),
    "array without an axis as pushes": (
        lambda: untyped.Scenario(arm(), pushes=np.array(1.0)),
        "pushes is '1.0'",
    ),
    "more of anything than a call can make": (
        lambda: dynx.trajectory.excitation(arm(), 1.0, harmonics=10**15),
        "at most 10000",
    ),
    "more samples than a call can make": (lambda: dynx.agree(arm(), samples=10**15), "at most 1000000000"),
    "name of a file with NUL": (lambda: dynx.world.write_scene(scene(), "a\0b.toml"), "a path is 'a"),
    "name of a file that cannot be encoded": (lambda: OBJECTS["world"]().write("\ud800"), "a path is '"),
    "object whose text cannot be asked for": (
        lambda: untyped.Noise(0.1, 0.1, seed=Unwritable()).deviations(3),
        "seed is 'Unwritable, whose text raises RuntimeError'",
    ),
}


def _untyped_list() -> Any:
    """Return a list that holds itself, without a type."""
    return _list_of_itself()


@pytest.mark.parametrize("case", HARD)
def test_what_looks_right_to_python_and_is_not_is_named(case: str) -> None:
    call, message = HARD[case]
    with pytest.raises(ArgumentError, match=message):
        call()
