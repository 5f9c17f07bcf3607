"""Types of arguments, checked by the annotations of a function.

    @checks_types
    def closed_form(model: Model, frame: str, ...) -> ClosedForm: ...

A wrong argument raises DTypeError. Numbers and what may be any array (`ArrayLike`) are left to
`dynx.model.numbers`, which checks bounds, shape, dtype and entries. Annotations are read at the first call; a
class that is imported for types alone is known by its name until a value has another.
"""

from __future__ import annotations

import ast
import collections.abc
import inspect
import re
import sys
import typing
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import wraps
from importlib import import_module
from types import NoneType, UnionType
from typing import Any, Literal, TypeGuard, TypeVar, Union, cast

from dynx.errors import DTypeError, shown
from dynx.option_names import ANSWERS, answer

T = TypeVar("T", bound=Callable[..., Any])

Test = Callable[[object], bool]
"""Whether an annotation allows a value."""


def checks_types(target: T) -> T:
    """Decorate a function, or a class for the sake of its constructor, so that its arguments are checked, and
    keywords that it does not have are answered with the right name."""
    if isinstance(target, type):
        target.__init__ = _checked(target.__init__)  # type: ignore[misc]
        return target
    return cast(T, _checked(target))


def is_listed(value: object) -> TypeGuard[Iterable[Any]]:
    """Check whether a value has elements: what can be iterated, but no text, no bytes and no array without an
    axis, which has no elements though it looks iterable."""
    return (
        isinstance(value, Iterable)
        and not isinstance(value, str | bytes | bytearray)
        and getattr(value, "ndim", 1) > 0
    )


def _checked(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return the function with a check of its arguments before each call.

    An iterator is read once, by the function; its elements are checked as they are read.
    """
    by_name: dict[str, Test] = {}
    of_iterators: dict[str, Test] = {}
    parameters: list[str] = []
    by_place: list[Test | None] = []
    unread = True
    called = function.__qualname__.removesuffix(".__init__").rpartition(".")[2]

    def read() -> None:
        nonlocal unread
        by_name.update(_tests_of(function))
        of_iterators.update(
            {name: test.of_elements for name, test in by_name.items() if isinstance(test, _IterableTest)}
        )
        parameters.extend(inspect.signature(function).parameters)
        for each in inspect.signature(function).parameters.values():
            if each.kind not in (each.POSITIONAL_ONLY, each.POSITIONAL_OR_KEYWORD):
                break
            by_place.append(by_name.get(each.name))
        unread = False

    def watched(name: str, value: Any) -> Any:
        if name not in of_iterators or not isinstance(value, Iterator):
            return value
        return _elements(function, name, value, of_iterators[name])

    @wraps(function)
    def checked(*given: Any, **options: Any) -> Any:
        if unread:
            read()
        for place, (test, value) in enumerate(zip(by_place, given, strict=False)):
            if test is not None and not test(value):
                raise _wrong_type(function, place, value)
        for name in options:
            if name in by_name and not by_name[name](options[name]):
                raise _wrong_type(function, name, options[name])
        if of_iterators:
            given = tuple(map(watched, parameters, given)) + given[len(parameters) :]
            options = {name: watched(name, value) for name, value in options.items()}
        try:
            return function(*given, **options)
        except TypeError:
            answer(getattr(checked, "__called__", called), function, given, options)
            raise

    checked.__checks_types__ = True  # type: ignore[attr-defined]
    setattr(checked, ANSWERS, True)
    return checked


def _elements(function: Callable[..., Any], name: str, values: Iterator[Any], test: Test) -> Iterator[Any]:
    """Yield the elements of an iterator that is an argument; raise DTypeError at one of another type."""
    wanted = _written(inspect.signature(function).parameters[name].annotation)
    for index, each in enumerate(values):
        if not test(each):
            raise DTypeError(
                f"{name} yields {shown(each)} at place {index}, of type {type(each).__name__}; wanted "
                f"{wanted}"
            )
        yield each


def _wrong_type(function: Callable[..., Any], argument: str | int, value: object) -> DTypeError:
    """Return the error for an argument, which is known by its name or its place."""
    parameters = inspect.signature(function).parameters
    name = argument if isinstance(argument, str) else list(parameters)[argument]
    wanted = _written(parameters[name].annotation)
    for kind, maker in _MAKERS.items():
        if re.match(rf"{kind}\b", wanted):
            example = f"{maker}({shown(value) if isinstance(value, str) else '...'})"
            if kind == "Scene" and (type(value).__name__ == "Model" or str(value).endswith(".urdf")):
                model = f"dynx.load({shown(value)})" if isinstance(value, str) else "model"
                example = f"Scene('one robot', robots=(SceneRobot('robot', {model}),))"
            wanted = f"a {wanted}, such as {example}"
    if isinstance(value, list | tuple) and value and all(map(_tests_of(function)[name], value)):
        wanted += "; one at a time"
    annotation = _Names(inspect.unwrap(function)).value_of(parameters[name].annotation)
    if typing.get_origin(annotation) is Literal:
        *others, last = map(repr, typing.get_args(annotation))
        wanted = " or ".join(filter(None, (", ".join(others), last)))
    for each in (annotation, *typing.get_args(annotation)):
        count = _count_of_arguments(each)
        if count is not None and callable(value):
            many = f"{count} argument{'s' * (count != 1)}"
            return DTypeError(f"{name} is {described(value)}; wanted a function that is called with {many}")
    given = f"the class {value.__name__}" if isinstance(value, type) else shown(value)
    return DTypeError(f"{name} is {given}, of type {type(value).__name__}; wanted {wanted}")


_MAKERS = {"Model": "dynx.load", "Scene": "dynx.world.read_scene"}
"""Functions that make an object of a class from its name or file."""


def _written(annotation: object) -> str:
    """Return the text of an annotation, with arrays, robots and truth values as a reader knows them."""
    text = annotation if isinstance(annotation, str) else getattr(annotation, "__name__", str(annotation))
    text = re.sub(r"\b(Floats|Array|Integers)\b", "numpy.ndarray", text)
    text = re.sub(r"^JointDynamics$", "True (as described) or False; dynx.simulate takes numbers", text)
    text = re.sub(r"^Robot$", "a name, a path, URDF text or a Model", text)
    return re.sub(r"\bbool\b", "True or False", text)


def _tests_of(function: Callable[..., Any]) -> dict[str, Test]:
    """Return the tests of a function's annotations, by the names of its parameters."""
    names = _Names(inspect.unwrap(function))
    found = {}
    for each in inspect.signature(function).parameters.values():
        if each.kind in (each.VAR_KEYWORD, each.VAR_POSITIONAL) or each.annotation is each.empty:
            continue
        test = _test(names.value_of(each.annotation), names)
        if test is not None:
            found[each.name] = test
    return found


class _Absent:
    """Name that a module imports for types alone."""

    def __init__(self, name: str) -> None:
        self.name = name

    def __getitem__(self, _: object) -> _Absent:
        return self

    def __or__(self, other: Any) -> Any:
        return Union[self, other]  # noqa: UP007  # `self` is no type

    def __ror__(self, other: Any) -> Any:
        return Union[other, self]  # noqa: UP007

    def __call__(self) -> None:
        """Be callable, as `typing` requires of what stands for a type."""


class _Names(dict[str, Any]):
    """Names in the annotations of a function: those of its module, or `_Absent`."""

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__()
        self._module = sys.modules[function.__module__]

    def __missing__(self, name: str) -> Any:
        builtins = vars(sys.modules["builtins"])
        if name in vars(self._module):
            return vars(self._module)[name]
        return builtins[name] if name in builtins else _Absent(name)

    def value_of(self, annotation: object) -> object:
        """Return what an annotation stands for."""
        if not isinstance(annotation, str):
            return annotation

        def holder() -> None: ...

        holder.__annotations__ = {"value": annotation}
        return inspect.get_annotations(holder, locals=self, eval_str=True)["value"]

    def imported(self, name: str) -> object:
        """Import what the module imports for types alone; Any if that is not installed."""
        tree = ast.parse(inspect.getsource(self._module))
        for each in ast.walk(tree):
            if isinstance(each, ast.ImportFrom) and each.module is not None:
                for alias in each.names:
                    if name == (alias.asname or alias.name):
                        try:
                            return getattr(import_module(each.module), alias.name)
                        except ImportError:
                            return Any
        return Any


def _test(annotation: Any, names: _Names) -> Test | None:
    """Return the test of an annotation; None for one that allows anything, numbers or arrays."""
    if isinstance(annotation, str):
        annotation = names.value_of(annotation)
    if isinstance(annotation, typing.ForwardRef):
        annotation = names.value_of(annotation.__forward_arg__)
    if isinstance(annotation, _Absent):
        return _absent(annotation.name, names)
    if annotation is None or annotation is NoneType:
        return lambda value: value is None
    if annotation in _SCALARS:
        return _SCALARS[annotation]
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is None:
        return _class_test(annotation)
    if origin is Union or origin is UnionType:
        return _any_of([_test(each, names) for each in arguments])
    if origin is Literal:
        kinds = tuple({type(each) for each in arguments})
        return lambda value: isinstance(value, kinds)
    if origin is typing.Annotated:
        return _test(arguments[0], names)
    if origin is type:
        return _subclass_test(arguments[0])
    if not isinstance(origin, type):
        return None
    if origin.__module__.startswith("numpy"):
        return _is_array if origin.__name__ == "ndarray" else None
    if origin is collections.abc.Callable:  # type: ignore[comparison-overlap]  # a class at runtime
        count = _count_of_arguments(annotation)
        return callable if count is None else lambda value: takes(value, count)
    return _container_test(origin, arguments, names)


def _container_test(origin: type, arguments: tuple[Any, ...], names: _Names) -> Test | None:
    """Return the test of a container and its elements; None for a sequence of numbers, which is an array."""
    if issubclass(origin, Mapping):
        of_keys, of_values = (_test(each, names) or _anything for each in arguments)
        return lambda value: (
            isinstance(value, Mapping)
            and all(of_keys(each) for each in value)
            and all(of_values(each) for each in value.values())
        )
    if issubclass(origin, tuple) and arguments[-1] is not Ellipsis:
        parts = [_test(each, names) for each in arguments]
        if not any(parts):
            return None
        of_parts = [part or _anything for part in parts]
        return lambda value: (
            isinstance(value, tuple | list)
            and len(value) == len(of_parts)
            and all(test(each) for test, each in zip(of_parts, value, strict=True))
        )
    if not issubclass(origin, Iterable) or not arguments:
        return lambda value: isinstance(value, origin)
    of_elements = _test(arguments[0], names)
    if of_elements is None:
        return None
    return _IterableTest(Sequence if issubclass(origin, Sequence) else origin, of_elements)


def _count_of_arguments(annotation: object) -> int | None:
    """Return the number of arguments of a ``Callable[[A, B], R]``; None for what does not state it."""
    arguments = typing.get_args(annotation)
    is_function = typing.get_origin(annotation) is collections.abc.Callable
    return len(arguments[0]) if is_function and isinstance(arguments[0], list) else None


def takes(value: Any, count: int) -> bool:
    """Check whether a value can be called with `count` arguments by place."""
    try:
        inspect.signature(value).bind(*[None] * count)
    except (TypeError, ValueError) as error:
        # A ValueError is that of a function without a signature.
        return callable(value) and isinstance(error, ValueError)
    return True


def described(value: Any) -> str:
    """Write what is to be a function, with its parameters."""
    if not callable(value):
        return f"{shown(value)}, of type {type(value).__name__}"
    called = getattr(value, "__name__", type(value).__name__)
    return f"{'a lambda' if called == '<lambda>' else called}, which takes {inspect.signature(value)}"


class _IterableTest:
    """The test of an iterable and its elements."""

    def __init__(self, wanted: type, of_elements: Test) -> None:
        self.wanted, self.of_elements = wanted, of_elements

    def __call__(self, value: object) -> bool:
        return (
            isinstance(value, self.wanted)
            and getattr(value, "ndim", 1) > 0
            # An iterator is left for the function, which can read it once.
            and (not isinstance(value, Collection) or all(map(self.of_elements, value)))
        )


def _class_test(annotation: Any) -> Test | None:
    if (
        not isinstance(annotation, type)
        or annotation is object
        or annotation.__module__.startswith("numpy._")
    ):
        return None
    if typing.is_typeddict(annotation):
        return lambda value: isinstance(value, Mapping)
    if getattr(annotation, "_is_protocol", False):
        members = [name for name in vars(annotation) if not name.startswith("_") or name == "__call__"]
        return lambda value: all(hasattr(value, name) for name in members)
    return lambda value: isinstance(value, annotation)


def _subclass_test(base: Any) -> Test:
    """Return the test of a class that derives from another, which may be known by its name alone."""
    if isinstance(base, _Absent):
        return lambda value: (
            isinstance(value, type) and any(each.__name__ == base.name for each in value.__mro__)
        )
    kind = typing.get_origin(base) or base
    if not isinstance(kind, type):
        return lambda value: isinstance(value, type)
    return lambda value: isinstance(value, type) and issubclass(value, kind)


def _any_of(tests: Sequence[Test | None]) -> Test | None:
    if None in tests:
        return None
    return lambda value: any(test(value) for test in cast(Sequence[Test], tests))


def _absent(name: str, names: _Names) -> Test:
    """Return the test of a class or an alias that is imported at the first value of another name."""
    allowed: set[type] = set()
    imported: list[Test] = []

    def test(value: object) -> bool:
        kind = type(value)
        if kind in allowed:
            return True
        if any(each.__name__ == name for each in kind.__mro__):
            allowed.add(kind)
            return True
        if not imported:
            imported.append(_test(names.imported(name), names) or _anything)
        return imported[0](value)

    return test


def _anything(_: object) -> bool:
    return True


def _is_array(value: object) -> bool:
    """Check whether a value is an array of numbers, or of scalars such as symbols, with an axis."""
    dtype = getattr(value, "dtype", None)
    return getattr(dtype, "kind", "none") in "fiubO" and getattr(value, "ndim", 0) > 0


def _is_bool(value: object) -> bool:
    return isinstance(value, bool) or type(value).__name__ in ("bool", "bool_")


# A number is left to the function, which knows its bounds.
_SCALARS: dict[Any, Test | None] = {Any: None, bool: _is_bool, int: None, float: None}
