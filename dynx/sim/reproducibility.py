"""Code of a user that is traced several times: what its results must not depend on.

A trace keeps one value of a random number, of the time or of a variable. Compiled code would repeat it in all
steps, so code that depends on one is refused.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any, NamedTuple

import numpy as np

from dynx.backends.dynamics import MATRICES, Dynamics, Evaluation
from dynx.control.content import is_foreign_module
from dynx.model import Model
from dynx.simd.expr import Symbol
from dynx.simd.user_code.arrays import traced_array
from dynx.simd.user_code.reproducibility import LocatedGraph, first_difference
from dynx.spatial.scalar import Array

PACKAGE = Path(__file__).parents[1]
"""Folder of dynx."""

REPETITIONS = 16
"""Number of traces that are compared with the first one: a drawn coin shows one side in all by a chance of
2^-16."""

Difference = tuple[str, tuple[float, float] | None]
"""File and line of the first difference of two traces, empty where no code of the user is known, and both
values of a constant."""

Variables = Mapping[str, Any]
"""Variables that code of a user may change, by name."""


class UserTrace:
    """One trace of code of a user, with symbols for its arguments and for the results of the dynamics."""

    def __init__(self) -> None:
        self.graph = LocatedGraph()
        self._slots = 0
        self._values: list[Any] = []

    def symbols(self, *shape: int) -> Array:
        """Return an array of new inputs."""
        entries = np.empty(shape, dtype=object)
        for place in np.ndindex(*shape):
            entries[place] = Symbol(self.graph, self.graph.input(self._slots))
            self._slots += 1
        return entries

    def dynamics(self, model: Model) -> Dynamics:
        """Return the dynamics of a robot, whose results are new symbols."""
        return _SymbolicResults(model, self)

    def note(self, values: Any) -> None:
        """Count values among the results, such as the arguments of an evaluation of the dynamics."""
        self._values.append(values)

    def results(self) -> list[int]:
        """Return the nodes of the results."""
        return list(self._indices())

    def _indices(self) -> Iterator[int]:
        for value in self._values:
            for entry in np.asarray(value, dtype=object).ravel().tolist():
                if isinstance(entry, Symbol):
                    yield entry.index
                elif isinstance(entry, int | float | np.number | np.bool_):
                    yield self.graph.constant(float(entry))


class RepeatedTraces(NamedTuple):
    """Differences between traces of the same code."""

    difference: Difference | None
    """First difference from the first trace, if any."""
    changed: str | None
    """Name of a variable that changed after the first trace, if any."""

    @classmethod
    def of(
        cls,
        trace: Callable[[], UserTrace],
        variables: Callable[[], Variables],
        repetitions: int = REPETITIONS,
    ) -> RepeatedTraces:
        """Trace code once, and then `repetitions` times or until a trace differs."""
        first = trace()
        expected, before = first.results(), {name: _snapshot(value) for name, value in variables().items()}
        for _ in range(repetitions):
            again = trace()
            found = first_difference(first.graph, expected, again.graph, again.results())
            if found is not None:
                place, values = found
                # A number that meets no symbol in the user's code is noted by dynx.
                inside = Path(place.rpartition(":")[0]).is_relative_to(PACKAGE)
                return cls(("" if inside else place, values), None)
        after = variables()
        changed = (name for name, kept in before.items() if _snapshot(after.get(name))[1] != kept[1])
        return cls(None, next(changed, None))


def _snapshot(value: Any) -> tuple[Any, Hashable]:
    """Return an object, so that Python does not reuse its identity, and its identity with its entries."""
    entries: Hashable = None
    if isinstance(value, Mapping):
        entries = tuple((id(key), id(entry)) for key, entry in value.items())
        return (value, list(value.items())), (id(value), entries)
    if isinstance(value, list | set | deque):
        return (value, list(value)), (id(value), tuple(map(id, value)))
    if isinstance(value, np.ndarray) and value.dtype != object:
        entries = value.tobytes()
    return value, (id(value), entries)


def shown_values(values: tuple[float, float] | None) -> str:
    """Return the two values of a constant, as a part of a sentence."""
    return "" if values is None else f", {values[0]:.12g} in one call and {values[1]:.12g} in the next"


def variables_of(kinds: Iterable[type], attributes: Iterable[Any] = ()) -> dict[str, Any]:
    """Return the attributes of the user's classes `kinds`, and the variables of modules that their
    methods, and functions among the `attributes`, name."""
    found: dict[str, Any] = {}
    waiting = list(attributes)
    for kind in kinds:
        found |= {f"{kind.__qualname__}.{name}": value for name, value in vars(kind).items()}
        waiting += vars(kind).values()
    seen: set[CodeType] = set()
    while waiting:
        function = waiting.pop()
        if not isinstance(function, FunctionType) or function.__code__ in seen:
            continue
        seen.add(function.__code__)
        for name in _names(function.__code__) & function.__globals__.keys():
            found[name] = value = function.__globals__[name]
            if is_foreign_module(getattr(value, "__module__", "dynx")):
                waiting.append(value)
    return found


def _names(code: CodeType) -> set[str]:
    """Return the names that a code and the functions in it refer to."""
    inner = (each for each in code.co_consts if isinstance(each, CodeType))
    return {*code.co_names}.union(*map(_names, inner))


def _has_symbol(values: Any) -> bool:
    return any(isinstance(entry, Symbol) for entry in np.asarray(values, dtype=object).ravel().tolist())


class _SymbolicResults(Dynamics):
    """Dynamics whose results are symbols of their own."""

    def __init__(self, model: Model, trace: UserTrace) -> None:
        self._trace = trace
        super().__init__(model)

    def evaluation(self, quantity: str) -> Evaluation:
        """Return the function that notes its arguments and returns new symbols; numbers for numbers."""
        nv = self.model.nv
        shape = {
            **dict.fromkeys(MATRICES, (nv, nv)),
            "forward_kinematics": (4, 4),
            "jacobian": (6, nv),
            "jacobian_derivative": (6, nv),
            "frame_acceleration": (6,),
        }.get(quantity, (nv,))

        def evaluate(*arguments: Any, **options: Any) -> Any:
            if not any(map(_has_symbol, arguments)):
                # Imported here, because it loads the kernels, which most controllers do not need.
                from dynx.compiled.array_dynamics import ArrayDynamics

                return ArrayDynamics(self.model).evaluation(quantity)(*arguments, **options)
            for argument in (*arguments, *options.values()):
                if isinstance(argument, str):
                    continue
                self._trace.note(argument)
            return traced_array(self._trace.symbols(*shape))

        return evaluate
