"""Random calls of public functions, classes and methods, reproducible from a seed and a number.

A call takes each argument from what is valid for it, or from one of the kinds that are not: another type,
shape or dtype, NaN, None, empty, huge, a foreign object. It may return, or raise an error of dynx; Python's
TypeError is right only for a call that does not fit the signature.
"""

from __future__ import annotations

import inspect
import pkgutil
import signal
import traceback
from collections import UserDict, deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime, timedelta
from decimal import Decimal
from enum import Enum
from fractions import Fraction
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from types import FrameType, ModuleType
from typing import Any, cast

import numpy as np

import dynx
from dynx.errors import DynxError, NotInstalledError
from tests.random_calls.objects import BY_NAME, OBJECTS, arm, by_annotation, engine

SECONDS = 20
"""Longest time that a call may take [s]."""

NOT_CALLED = {
    "inside": "dynx calls it with times that it has checked; users call the trajectory",
    "acceleration": "dynx calls it with symbols in a trace",
    "equation": "dynx calls it with symbols in a trace",
    "inertia": "dynx calls it with symbols in a trace",
    "root": "dynx calls it with symbols in a trace",
    "dry_friction": "dynx calls it with parameters that it has checked",
    "<momentum observer>.update": "dynx calls it with symbols in a trace",
    "<momentum observer>.residual": "its argument is a state of `update`",
    "<momentum observer>.with_dynamics": "dynx calls it with functions of its own",
    "torque_for": "dynx calls it with symbols in a trace",
    "<joint friction>.__call__": "dynx calls it with symbols in a trace",
    "command": "a plant calls it with a measurement and a setpoint of its own",
    "<contact case>.measure": "`conform` calls it with the run of the case",
    "<external force>.share": "dynx calls it with times that it has checked",
    "<external force>.at_origin": "dynx calls it with symbols in a trace",
    "<external force>.at_frame": "dynx calls it with an engine of its own",
    "<external force>.at_center": "dynx calls it with poses of its own",
    "<IK solutions>.measured": "dynx calls it with errors of its own",
    "<rule>": "`diagnose` calls the methods of rules with cases of its own",
    "<task>": "an environment calls the methods of tasks with states of its own",
    "<sensor": "a world calls the methods of sensors with parts and motions of its own",
    "unregister": "changes what later calls find",
    "unregister_case": "changes what later calls find",
    "unregister_controller": "changes what later calls find",
    "unregister_world": "changes what later calls find",
    "measure_machine": "times for seconds",
    "wait": "waits for the end of a page",
    "screenshot": "waits for a browser",
    "run_case": "times for seconds",
    "conform": "runs for minutes",
    "dynx.testing.strategies": "arguments are strategies of Hypothesis, which raises its own errors",
}


class Foreign:
    """Object of a class that dynx does not know."""

    def __repr__(self) -> str:
        return "<foreign object>"


class Unwritable:
    """Object whose text cannot be asked for."""

    def __repr__(self) -> str:
        raise RuntimeError("no text")


class NoNumbers:
    """Object that looks like an array and has no numbers, as a tensor of PyTorch with a gradient."""

    def __array__(self, *_: Any, **__: Any) -> Any:
        raise RuntimeError("call detach first")

    def __len__(self) -> int:
        return 3


class Text(str):
    """Text of a class of its own."""

    def __new__(cls) -> Text:
        """Make a text that is in no list of names."""
        return super().__new__(cls, "no such text")


class Colour(Enum):
    """A choice that is no text."""

    RED = "red"


def _list_of_itself() -> list[Any]:
    found: list[Any] = []
    found.append(found)
    return found


BAD: Mapping[str, tuple[Callable[[], Any], ...]] = {
    "none": (lambda: None,),
    "type": (
        lambda: True,
        lambda: 3,
        lambda: -1,
        lambda: 0,
        lambda: 1.5,
        lambda: "no such name",
        lambda: b"bytes",
        lambda: {"a": 1},
        lambda: {1: "a"},
        lambda: {1, 2},
        lambda: ["a", 3],
        lambda: (3, None),
        lambda: 1j,
        lambda: Decimal("1.5"),
        lambda: Fraction(1, 3),
        lambda: Path("no/such"),
        lambda: int,
        lambda: (x for x in range(3)),
        lambda: range(3),
        lambda: lambda *_: 3,
        lambda: np.float32(1.5),
        lambda: np.int8(3),
        lambda: np.datetime64("2020-01-01"),
        lambda: [[1.0, 2.0], [3.0]],
        lambda: {"box": np.eye(4)},
    ),
    "shape": (
        lambda: np.zeros(7),
        lambda: np.zeros((3, 3)),
        lambda: np.zeros((2, 3, 4)),
        lambda: np.array(1.0),
        lambda: np.zeros((1, 1)),
        lambda: np.zeros((2, 3)),
        lambda: np.eye(4),
        lambda: [0.0],
        lambda: np.zeros((0, 3)),
    ),
    "dtype": (
        lambda: np.array(["a", "b", "c"]),
        lambda: np.array([None, 1.0, 2.0]),
        lambda: np.ones(3, complex),
        lambda: np.ones(3, bool),
        lambda: np.ones(3, np.float16),
        lambda: np.ones(3, np.int64),
        lambda: np.ma.masked_array(np.ones(3), np.eye(3, dtype=bool)[1]),
        lambda: np.zeros(3, [("x", float)]),
        lambda: np.longdouble(1),
    ),
    "nan": (
        lambda: np.nan,
        lambda: np.inf,
        lambda: -np.inf,
        lambda: np.full(3, np.nan),
        lambda: np.full((4, 4), np.nan),
        lambda: [0.0, np.inf, 0.0],
        lambda: (np.nan, np.nan, np.nan),
        lambda: {"box": np.nan},
    ),
    "empty": (
        lambda: "",
        lambda: (),
        list,
        dict,
        lambda: np.zeros(0),
        lambda: b"",
        lambda: set(),
    ),
    "huge": (
        lambda: 10**400,
        lambda: -(10**400),
        lambda: 2**63,
        lambda: 1e300,
        lambda: -1e300,
        lambda: np.full(3, 1e200),
        lambda: "x" * 10_000,
        lambda: 10**15,
    ),
    "foreign": (
        Foreign,
        arm,
        engine,
        lambda: dynx,
        lambda: ValueError("no"),
        lambda: [Foreign()],
        lambda: np.array(Foreign()),
    ),
    "hostile": (
        Unwritable,
        lambda: [Unwritable()],
        NoNumbers,
        lambda: [NoNumbers()],
        Text,
        lambda: Colour,
        lambda: Colour.RED,
        _list_of_itself,
        lambda: "a\0b",
        lambda: "\ud800",
        lambda: "two\nlines\x1b[31m",
        lambda: "{name} %s %n",
        lambda: Path("a\0b"),
        lambda: memoryview(b"bytes"),
        lambda: bytearray(b"bytes"),
        lambda: frozenset({"a"}),
        lambda: np.str_("box"),
        lambda: np.array("box"),
        lambda: np.bytes_(b"box"),
        lambda: np.array([[1.0], [2.0, 3.0]], object),
        lambda: np.array([10**400], object),
        lambda: [10**400, 1.0, 1.0],
        lambda: np.void(b"abc"),
        lambda: np.timedelta64(3, "s"),
        lambda: np.zeros(3, ">f8"),
        lambda: np.broadcast_to(np.float64(1.0), (3,)),
        lambda: np.zeros((3, 0, 3)),
        lambda: datetime(2020, 1, 1),
        lambda: timedelta(seconds=1),
        lambda: slice(3),
        lambda: Ellipsis,
        lambda: NotImplemented,
        lambda: {None: None},
        lambda: {(1, 2): [3]},
        lambda: UserDict(box=1.0),
        lambda: deque([1.0, 2.0, 3.0]),
        lambda: iter(["a", 3]),
        lambda: map(str, range(3)),
        lambda: -0.0,
        lambda: 5e-324,
    ),
}
"""Kinds of wrong arguments."""


@dataclass(frozen=True)
class Door:
    """Something public that is called: a function, a class or a method of an object."""

    name: str
    find: Callable[[], Callable[..., Any]]


def public_modules() -> Iterator[ModuleType]:
    """Yield dynx and its public packages; a door to a foreign library is none."""
    yield dynx
    for each in pkgutil.iter_modules(dynx.__path__, "dynx."):
        if each.ispkg and each.name not in ("dynx.engines", "dynx.cli"):
            try:
                yield import_module(each.name)
            except NotInstalledError:
                continue


@cache
def doors() -> tuple[Door, ...]:
    """Return everything public that can be called."""
    found: dict[str, Door] = {}
    seen: set[int] = set()
    for module in public_modules():
        for name in getattr(module, "__all__", ()):
            full = f"{module.__name__}.{name}"
            try:
                value = getattr(module, name)
            except NotInstalledError:
                continue
            if not isinstance(value, type) and not inspect.isroutine(inspect.unwrap(value)):
                continue
            if id(value) in seen:
                continue
            if isinstance(value, type) and (issubclass(value, BaseException) or inspect.isabstract(value)):
                continue
            seen.add(id(value))
            found[full] = Door(full, partial(getattr, module, name))
    for label, make in OBJECTS.items():
        kind = type(make())
        for name in dir(kind):
            member = inspect.getattr_static(kind, name)
            function = getattr(member, "__func__", member)
            if (name.startswith("_") and name != "__call__") or not callable(function):
                continue
            if getattr(function, "__module__", "").startswith("dynx"):
                full = f"<{label}>.{name}"
                found[full] = Door(full, partial(_method, make, name))
    return tuple(
        door
        for door in found.values()
        if not any(
            door.name == each
            or door.name.split(".")[-1] == each
            or door.name.startswith((each + ".", f"{each} "))
            for each in NOT_CALLED
        )
    )


def _method(make: Callable[[], Any], name: str) -> Callable[..., Any]:
    return cast(Callable[..., Any], getattr(make(), name))


@dataclass(frozen=True)
class Call:
    """One call: what is called, with which arguments, of which kinds."""

    door: Door
    function: Callable[..., Any]
    given: dict[str, Any]
    kinds: dict[str, str]

    def __str__(self) -> str:
        shown = ", ".join(
            f"{name}={_short(value)} [{self.kinds[name]}]" for name, value in self.given.items()
        )
        return f"{self.door.name}({shown})"


def _short(value: object) -> str:
    if isinstance(value, int) and abs(value) > 10**20:
        return "<huge int>"
    try:
        text = repr(value)
    except (RuntimeError, ValueError):
        return f"<{type(value).__name__} without a text>"
    return text if len(text) < 60 else text[:57] + "..."


def valid_argument(parameter: inspect.Parameter) -> Any:
    """Return an argument that fits the name or the annotation of a parameter, or its default."""
    annotation = str(parameter.annotation)
    if parameter.name in BY_NAME and (
        "Array" in annotation or "str" in annotation or "float" in annotation or "int" in annotation
    ):
        return BY_NAME[parameter.name]()
    if parameter.default is not parameter.empty:
        return parameter.default
    for word, make in by_annotation().items():
        if word in annotation:
            return make()
    return BY_NAME.get(parameter.name, lambda: np.zeros(3))()


def _fitting(parameter: inspect.Parameter, value: Any) -> Any:
    """Return a wrong argument; a number for a class where a callable is wanted: its own errors are right."""
    called = "Callable" in str(parameter.annotation) or parameter.name == "loads"
    return 3 if isinstance(value, type) and called else value


def random_call(seed: int, number: int, among: tuple[Door, ...] | None = None) -> Call | None:
    """Return call `number` of a seed; None for a class or function whose signature nobody knows."""
    rng = np.random.default_rng((seed, number))
    all_doors = doors() if among is None else among
    door = all_doors[rng.integers(len(all_doors))]
    function = door.find()
    try:
        parameters = inspect.signature(function).parameters.values()
    except ValueError:
        return None
    usable = [each for each in parameters if each.kind not in (each.VAR_POSITIONAL, each.VAR_KEYWORD)]
    given: dict[str, Any] = {}
    kinds: dict[str, str] = {}
    wrong = 1 + int(rng.integers(2)) if usable else 0
    chosen = {usable[i].name for i in rng.permutation(len(usable))[:wrong]}
    for each in usable:
        if each.name in chosen:
            kind = list(BAD)[rng.integers(len(BAD))]
            given[each.name] = _fitting(each, BAD[kind][rng.integers(len(BAD[kind]))]())
            kinds[each.name] = kind
        elif each.default is each.empty or rng.random() < 0.2:
            given[each.name] = valid_argument(each)
            kinds[each.name] = "valid"
    return Call(door, function, given, kinds)


class TooLong(BaseException):
    """A call took more than `SECONDS`."""


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raise TooLong in the block after some seconds."""

    def stop(_: int, __: FrameType | None) -> None:
        raise TooLong

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def positional(call: Call) -> tuple[list[Any], dict[str, Any]]:
    """Return the arguments of a call, those without a name by place."""
    parameters = inspect.signature(call.function).parameters
    by_place = [
        value
        for name, value in call.given.items()
        if parameters[name].kind is inspect.Parameter.POSITIONAL_ONLY
    ]
    by_name = {
        name: value
        for name, value in call.given.items()
        if parameters[name].kind is not inspect.Parameter.POSITIONAL_ONLY
    }
    return by_place, by_name


def _close(result: object) -> None:
    """End the server of a page that a call opened."""
    if type(result).__name__ == "Viewer":
        cast(Any, result).close()


def outcome(call: Call) -> tuple[str | None, DynxError | None]:
    """Make a call; return what is wrong with its outcome, if anything, and the error of dynx, if one."""
    places, names = positional(call)
    try:
        with time_limit(SECONDS):
            _close(call.function(*places, **names))
    except DynxError as error:
        if not str(error).strip():
            return f"{type(error).__name__} without a message", error
        return None, error
    except TooLong:
        return f"takes more than {SECONDS} s\n{traceback.format_exc(limit=-3)}", None
    except BaseException as error:
        return f"{type(error).__name__}: {str(error)[:200]}\n{traceback.format_exc(limit=-2)}", None
    return None, None
