"""Loops over the bodies of large robots: each step compiled once for all robots, each robot a table of calls.

The code of a matrix of a large robot is too long to compile, and reading it from memory would take longer
than computing. `TableLoops` runs the algorithms of `dynx.rbd` on places of a workspace instead of numbers. A
step is traced once for each type of joint, with the numbers of the body as inputs; where it is called, a call
is appended to the table of the robot (`dynx.simd.call_table`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from math import prod
from typing import Any, NamedTuple

import numpy as np

from dynx.model.mechanism import ROOT, Body, BodyFrame, Mechanism
from dynx.rbd.aba import ArticulatedInertia
from dynx.rbd.base_parameters import Z_AXIS
from dynx.rbd.loops import Columns, Loops, moving_frames
from dynx.rbd.placement import Placement
from dynx.simd.call_table import CallTable
from dynx.simd.program import Port, Program, scalar_ranges
from dynx.simd.routines import Place, Routine, RoutineSet
from dynx.simd.trace import trace
from dynx.spatial.inertia import (
    RigidInertia,
    inertia_from_parameters,
    parameters_from_inertia,
    symmetric_from_upper,
)
from dynx.spatial.scalar import Array

Step = Callable[..., Any]
Output = tuple[int, int]
"""Number of an array of the caller and a column of its rows."""

_UPPER = np.triu_indices(3)
MASSLESS = RigidInertia(np.asarray(0.0), np.zeros(3), np.zeros((3, 3)))
"""Inertia of a body whose numbers do not matter."""


# -- values as consecutive numbers --------------------------------------------------------------------


class Packing(NamedTuple):
    """Representation of the values of a class by numbers in order."""

    size: int
    pack: Callable[[Any], Array]
    unpack: Callable[[Array], Any]


def _symmetric(upper: Array) -> Array:
    """Return the symmetric matrix (3, 3) with this upper triangle (6,)."""
    full = np.zeros((3, 3), dtype=upper.dtype)
    full[_UPPER] = upper
    return symmetric_from_upper(full)


def _placement(numbers: Array) -> Placement:
    R = numbers[:9].reshape(3, 3)
    return Placement(R, numbers[9:], R, None)


PACKINGS: Mapping[type, Packing] = {
    RigidInertia: Packing(10, parameters_from_inertia, inertia_from_parameters),
    Placement: Packing(12, lambda x: np.concatenate([x.R.ravel(), x.p]), _placement),
    ArticulatedInertia: Packing(
        21,
        lambda x: np.concatenate([x.M[_UPPER], x.C.ravel(), x.J[_UPPER]]),
        lambda n: ArticulatedInertia(_symmetric(n[:6]), n[6:15].reshape(3, 3), _symmetric(n[15:])),
    ),
}
"""Classes whose values are kept in fewer numbers than their fields have."""


@dataclass(frozen=True)
class Structure:
    """Structure of a value: an array of this `shape`, or an object of a class with these `parts`."""

    kind: type = np.ndarray
    shape: tuple[int, ...] = ()
    parts: tuple[Structure, ...] = ()

    @classmethod
    def of(cls, value: Any) -> Structure:
        """Return the structure of arrays, tuples, dataclasses and None."""
        kind = type(value)
        if kind in PACKINGS:
            return cls(kind, (PACKINGS[kind].size,))
        if isinstance(value, (tuple, list)) or is_dataclass(value):
            return cls(kind, parts=tuple(map(cls.of, _parts(value))))
        return cls(shape=(0,)) if value is None else cls(shape=np.shape(value))

    @property
    def size(self) -> int:
        """Number of numbers."""
        return sum(part.size for part in self.parts) if self.parts else prod(self.shape)

    def numbers(self, value: Any) -> Array:
        """Return the numbers (size,) of a value."""
        if value is None:
            return np.zeros(0)
        if self.kind in PACKINGS:
            return PACKINGS[self.kind].pack(value)
        if self.parts:
            parts = [p.numbers(x) for p, x in zip(self.parts, _parts(value), strict=True)]
            return np.concatenate([np.asarray(part, dtype=object) for part in parts])
        return np.asarray(value, dtype=object).ravel()

    def value(self, numbers: Array) -> Any:
        """Return the value with these numbers (size,)."""
        if self.kind in PACKINGS:
            return PACKINGS[self.kind].unpack(numbers)
        if not self.parts:
            return numbers.reshape(self.shape)
        parts, start = [], 0
        for part in self.parts:
            parts.append(part.value(numbers[start : start + part.size]))
            start += part.size
        return tuple(parts) if self.kind is tuple else self.kind(*parts)

    def names(self) -> tuple[str, ...]:
        """Return the names of the parts."""
        if is_dataclass(self.kind):
            return tuple(field.name for field in fields(self.kind))
        return getattr(self.kind, "_fields", ())


def _parts(value: Any) -> Sequence[Any]:
    if is_dataclass(value):
        return [getattr(value, field.name) for field in fields(value)]
    parts: Sequence[Any] = value
    return parts


def _leaves(value: Any) -> list[Array]:
    """Return the arrays in nested tuples and lists."""
    if isinstance(value, (tuple, list)):
        return [leaf for part in value for leaf in _leaves(part)]
    return [] if value is None else [np.asarray(value)]


# -- arguments of steps -------------------------------------------------------------------------------


class Argument:
    """An argument of a step, by its recipe: ports of the routine, and the value made of their numbers."""

    @property
    def ports(self) -> tuple[tuple[Place, int], ...]:
        """Place and size of each port."""
        raise NotImplementedError

    def value(self, numbers: Iterator[Array]) -> Any:
        """Return the argument from the numbers of its ports."""
        raise NotImplementedError


@dataclass(frozen=True)
class Kept(Argument):
    """A value in the workspace."""

    structure: Structure

    @property
    def ports(self) -> tuple[tuple[Place, int], ...]:
        return (("vectors", self.structure.size),)

    def value(self, numbers: Iterator[Array]) -> Any:
        return self.structure.value(next(numbers))


@dataclass(frozen=True)
class Zeros(Argument):
    """Zeros of this shape."""

    shape: tuple[int, ...]

    @property
    def ports(self) -> tuple[tuple[Place, int], ...]:
        return ()

    def value(self, numbers: Iterator[Array]) -> Any:
        return np.zeros(self.shape)


@dataclass(frozen=True)
class BodyNumbers(Argument):
    """A body with this type of joint: pose of the joint, inertia, and the axis, which is z if revolute."""

    revolute: bool

    @property
    def ports(self) -> tuple[tuple[Place, int], ...]:
        return (("constants", 25),)

    def value(self, numbers: Iterator[Array]) -> Body:
        x = next(numbers)
        axis = Z_AXIS if self.revolute else x[22:]
        R, inertia = x[:9].reshape(3, 3), inertia_from_parameters(x[12:22])
        return Body("", ROOT, self.revolute, R, x[9:12], axis, inertia)


@dataclass(frozen=True)
class RootNumbers(Argument):
    """A mechanism of its root alone: gravity and inertia."""

    floating: bool

    @property
    def ports(self) -> tuple[tuple[Place, int], ...]:
        return (("constants", 13),)

    def value(self, numbers: Iterator[Array]) -> Mechanism:
        x = next(numbers)
        return Mechanism("", self.floating, x[:3], inertia_from_parameters(x[3:]), (), (), None)


@dataclass(frozen=True)
class FrameNumbers(Argument):
    """The pose of a frame in its body."""

    @property
    def ports(self) -> tuple[tuple[Place, int], ...]:
        return (("constants", 12),)

    def value(self, numbers: Iterator[Array]) -> BodyFrame:
        x = next(numbers)
        return BodyFrame("", ROOT, x[:9].reshape(3, 3), x[9:])


@dataclass(frozen=True)
class Evaluated(Argument):
    """The result of a step that is evaluated where it is used."""

    step: Step
    arguments: tuple[Argument, ...]

    @property
    def ports(self) -> tuple[tuple[Place, int], ...]:
        return tuple(port for argument in self.arguments for port in argument.ports)

    def value(self, numbers: Iterator[Array]) -> Any:
        return self.step(*[argument.value(numbers) for argument in self.arguments])


class Operand(NamedTuple):
    """An argument in a call: its recipe, and the places of its ports."""

    argument: Argument
    places: tuple[int, ...]


class Held:
    """A value of the workspace, which stands for numbers in the text of an algorithm.

    It has the parts of the value as attributes, or in order if the value is a tuple.
    """

    def __init__(self, structure: Structure, place: int) -> None:
        self._structure, self._place = structure, place
        self._output: Output | None = None
        """Place in the caller's arrays, if the value is written there."""
        self._read = False

    def __getattr__(self, name: str) -> Held:
        try:
            number = self._structure.names().index(name)
        except ValueError:
            raise AttributeError(name) from None
        return list(self)[number]

    def __iter__(self) -> Iterator[Held]:
        place = self._place
        self._read = True
        for part in self._structure.parts:
            yield Held(part, place)
            place += part.size


class ArgumentRow:
    """An argument of the algorithm, q (nq,) or v, a, tau (nv,), in the workspace."""

    def __init__(self, place: int, size: int) -> None:
        self.place, self.shape = place, (size,)


# -- routines -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class TracedStep:
    """A step traced with arguments of some types: its program, and the structure of each result."""

    program: Program
    results: tuple[Structure, ...]
    ports: tuple[int, ...]
    """Number of output ports of each result: none if it is an argument that the step returns unchanged."""


class StepRoutines:
    """Routines of the steps of an algorithm, which all robots share."""

    def __init__(self, routines: Mapping[str, Routine]) -> None:
        self.routines = dict(routines)
        self.complete = False
        """True when robots are evaluated: then no step may be new."""
        self._traced: dict[object, TracedStep] = {}
        self._names: dict[object, str] = {}
        self._routine_names: dict[Routine, str] = {}

    def traced(
        self, step: Step, arguments: tuple[Argument, ...], apart: tuple[bool, ...]
    ) -> tuple[object, TracedStep]:
        """Return the key of a step and its trace; results marked in `apart` have a port for each array."""
        key = step, arguments, apart
        found = self._traced.get(key)
        if found is None:
            assert not self.complete, f"{step.__qualname__} was not traced with the robots that stand for all"
            found = self._traced[key] = _trace(step, arguments, apart)
        return key, found

    def name(self, key: object, places: tuple[tuple[Place, ...], ...]) -> str:
        """Return the name of the routine of a traced step that writes each output port to `places`."""
        name = self._names.get((key, places))
        if name is None:
            assert isinstance(key, tuple)
            routine = _routine(self._traced[key].program, key[1], places)
            # A step that does not use the body gives the same routine for each type of joint.
            name = self._routine_names.setdefault(routine, f"step {len(self._routine_names)}")
            self._names[key, places] = name
            self.routines[name] = routine
        return name


def _trace(step: Step, arguments: tuple[Argument, ...], apart: tuple[bool, ...]) -> TracedStep:
    sizes = [size for argument in arguments for _, size in argument.ports]
    structures: list[Structure] = []
    ports: list[int] = []

    def outputs(**inputs: Array) -> dict[str, Array]:
        numbers = iter(inputs.values())
        values = [argument.value(numbers) for argument in arguments]
        found = step(*values)
        arrays: list[Array] = []
        for result, split in zip(found if len(apart) > 1 else (found,), apart, strict=True):
            structures.append(Structure.of(result))
            pieces = _leaves(result) if split else [structures[-1].numbers(result)]
            unchanged = any(result is value for value in values)
            pieces = [] if unchanged else [piece for piece in pieces if piece.size]
            ports.append(len(pieces))
            arrays += pieces
        return {f"result{k}": array for k, array in enumerate(arrays)}

    program = trace(outputs, {f"argument{k}": (size,) for k, size in enumerate(sizes)})
    return TracedStep(program, tuple(structures), tuple(ports))


def _routine(
    program: Program, arguments: tuple[Argument, ...], places: tuple[tuple[Place, ...], ...]
) -> Routine:
    inputs = [place for argument in arguments for place, _ in argument.ports]
    outputs, results, written = [], list[int](), list[Place]()
    for (port, scalars), targets in zip(scalar_ranges(program.outputs), places, strict=True):
        for target in targets:
            outputs.append(Port(f"{port.name} in {target}", port.shape))
            results += [program.results[scalar] for scalar in scalars]
            written.append(target)
    nodes = Program(program.nodes, program.inputs, tuple(outputs), tuple(results))
    return Routine(nodes, (*inputs, *written))


# -- loops --------------------------------------------------------------------------------------------


class _Call(NamedTuple):
    """A call that is not yet in the table: where results are written is known at the end."""

    step: object
    """Key of the traced step, or the name of a routine."""
    operands: tuple[int, ...]
    results: list[Held | Output]


class _ResultMatrices(NamedTuple):
    """Matrices of the caller: numbers of arrays, columns of each, and columns of a block."""

    arrays: range
    columns: int
    width: int

    def at(self, row: int, column: int) -> list[Output]:
        """Return the places of an entry or block in each."""
        return [(array, row * self.columns + column * self.width) for array in self.arrays]


class TableLoops(Loops):
    """Loops that make the calls of one robot; without a table they only trace the routines.

    `first_output` is the number of the first result among the arrays of the caller.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        routines: StepRoutines,
        table: CallTable | None,
        first_output: int,
        *,
        keeps_solution: bool = False,
    ) -> None:
        super().__init__(mechanism)
        self._routines, self._first_output = routines, first_output
        self._appends = table is not None
        self.table = table or CallTable(RoutineSet(routines.routines, 0))
        self._calls: list[_Call] = []
        constants = self.table.constants
        self._bodies = [
            Operand(
                BodyNumbers(body.revolute),
                (constants(body.R, body.p, parameters_from_inertia(body.inertia), body.axis),),
            )
            for body in mechanism.bodies
        ]
        root = self.table.constants(mechanism.gravity, parameters_from_inertia(mechanism.root))
        self._root = Operand(RootNumbers(mechanism.floating), (root,))
        self._first = mechanism.nv - len(mechanism.bodies)
        self._keeps_solution = keeps_solution
        self.solution: list[int] = []
        """Places of the entries of the vector of results, which is kept in the workspace on request."""

    # -- calls ------------------------------------------------------------------------------------

    def call(self, routine: str, *operands: int) -> None:
        """Append a call of a routine that is no step."""
        self._calls.append(_Call(routine, operands, []))

    def _call(
        self, step: Step, operands: Sequence[Operand], *targets: Held | Sequence[Output] | None
    ) -> list[Any]:
        """Append a call. Each result goes to a held place, to places of arrays, or to a new place (None).

        Return the held results, and None for the others.
        """
        apart = tuple(isinstance(target, list) for target in targets)
        key, traced = self._routines.traced(step, tuple(x.argument for x in operands), apart)
        results: list[Held | Output] = []
        returned: list[Any] = []
        for target, structure, ports in zip(targets, traced.results, traced.ports, strict=True):
            if isinstance(target, list):
                assert len(target) == ports
                results += target
                returned.append(None)
                continue
            if not isinstance(target, Held):
                target = Held(structure, self.table.reserve(structure.size))
            assert target._structure == structure, f"{step.__qualname__} returns another structure"
            results += [target] * ports
            returned.append(target)
        self._calls.append(_Call(key, tuple(p for x in operands for p in x.places), results))
        return returned

    def _operand(self, value: Any, entry: int | None = None) -> Operand:
        """Return an operand for a value; of an argument of the algorithm, the entry counted from its end."""
        if isinstance(value, ArgumentRow):
            size = value.shape[0]
            if entry is not None:
                return Operand(Kept(Structure()), (value.place + size + entry,))
            base = size - len(self.mechanism.bodies)
            return (
                Operand(Kept(Structure(shape=(base,))), (value.place,)) if base else Operand(Zeros((0,)), ())
            )
        if isinstance(value, np.ndarray):
            assert not value.any(), "an array that is no argument is zero"
            return Operand(Zeros(() if entry is not None else (self._first,)), ())
        if isinstance(value, Operand):
            return value
        value._read = True
        return Operand(Kept(value._structure), (value._place,))

    def _values(self, columns: Columns, index: int) -> list[Operand]:
        entry = index - len(self.mechanism.bodies)
        return [
            self._operand(column, entry)
            if isinstance(column, (ArgumentRow, np.ndarray))
            else self._operand(column[entry])
            for column in columns
        ]

    # -- loops ------------------------------------------------------------------------------------

    def root(self, step: Step, *arguments: Any, stored: bool = True) -> Any:
        return self._result(step, [self._root, *map(self._operand, arguments)], stored)

    def each(self, step: Step, *columns: Any, stored: bool = True) -> Sequence[Any]:
        return [
            self._result(step, [body, *self._values(columns, k)], stored)
            for k, body in enumerate(self._bodies)
        ]

    def combined(self, kind: Step, *columns: Any) -> Sequence[Any]:
        return [self._result(kind, self._values(columns, k), False) for k in range(len(self._bodies))]

    def _result(self, step: Step, operands: Sequence[Operand], stored: bool) -> Any:
        if stored:
            return self._call(step, operands, None)[0]
        evaluated = Evaluated(step, tuple(operand.argument for operand in operands))
        return Operand(evaluated, tuple(place for operand in operands for place in operand.places))

    def outward(self, step: Step, root: Any, *columns: Any) -> tuple[Sequence[Any], Sequence[Any]]:
        states, results = [root], []
        for k, body in enumerate(self.mechanism.bodies):
            operands = self._bodies[k], self._operand(states[body.parent + 1]), *self._values(columns, k)
            state, result = self._call(step, operands, None, None)
            states.append(state)
            results.append(result)
        return states, results

    def inward(self, step: Step, totals: Sequence[Any], *columns: Any) -> tuple[Sequence[Any], Sequence[Any]]:
        results = []
        for k in reversed(range(len(self._bodies))):
            parent = totals[self.mechanism.bodies[k].parent + 1]
            own = self._operand(totals[k + 1]), self._operand(parent)
            _, result = self._call(step, [self._bodies[k], *own, *self._values(columns, k)], parent, None)
            results.append(result)
        return totals, results[::-1]

    def subtrees(self, step: Step, totals: Sequence[Any], *columns: Any) -> Sequence[Any]:
        for k in reversed(range(len(self._bodies))):
            parent = self.mechanism.bodies[k].parent
            if parent != ROOT or self.mechanism.floating:
                own = self._operand(totals[k + 1]), self._operand(totals[parent + 1])
                self._call(step, [self._bodies[k], *own, *self._values(columns, k)], totals[parent + 1])
        return totals

    # -- results ----------------------------------------------------------------------------------

    def matrices(self, n: int, like: Any, *, blocks: int | None = None, width: int = 1) -> _ResultMatrices:
        columns = self.mechanism.nv if blocks is None else blocks * width
        return _ResultMatrices(range(self._first_output, self._first_output + n), columns, width)

    def to_root(
        self,
        matrices: _ResultMatrices,
        start: Step,
        pair: Step,
        base: Step,
        *,
        own: Columns = (),
        below: Columns = (),
        here: Columns = (),
        at_base: Columns = (),
    ) -> None:
        bodies, first = self.mechanism.bodies, self._first
        place: Held | None = None
        for index, body in enumerate(bodies):
            column = first + index
            operands = self._bodies[index], *self._values(own, index)
            # Each path may overwrite the response of the one before.
            place, _ = self._call(start, operands, place, matrices.at(column, column))
            last, row = index, body.parent
            while row != ROOT:
                operands = (
                    self._bodies[row],
                    self._operand(place),
                    *self._values(below, last),
                    *self._values(here, row),
                )
                by, of = matrices.at(column, first + row), matrices.at(first + row, column)
                self._call(pair, operands, place, by, of)
                last, row = row, bodies[row].parent
            if self.mechanism.floating:
                operands = self._operand(place), *self._values(below, last), *map(self._operand, at_base)
                self._call(base, operands, matrices.at(column, 0), _rows_of_base(matrices, column))

    def frames_to_root(
        self,
        matrices: _ResultMatrices,
        frames: Sequence[int],
        start: Step,
        entry: Step,
        base: Step,
        *,
        own: Columns,
        here: Columns,
        at_base: Columns,
    ) -> None:
        place: Held | None = None
        for column, frame in moving_frames(self.mechanism, frames):
            fixed = Operand(FrameNumbers(), (self.table.constants(frame.R, frame.p),))
            row = frame.body
            (place,) = self._call(start, [fixed, *self._values(own, row)], place)
            response = self._operand(place)
            while row != ROOT:
                operands = self._bodies[row], response, *self._values(here, row)
                self._call(entry, operands, matrices.at(self._first + row, column))
                row = self.mechanism.bodies[row].parent
            if self.mechanism.floating:
                operands = response, *map(self._operand, at_base)
                self._call(base, operands, _rows_of_base(matrices, column))

    def base_block(self, matrices: _ResultMatrices, step: Step, *arguments: Any) -> None:
        if self.mechanism.floating:
            self._call(step, [self._root, *map(self._operand, arguments)], _rows_of_base(matrices, 0))

    def assembled(self, matrices: _ResultMatrices) -> Any:
        return tuple(matrices.arrays)

    def vector(self, base: Any, joints: Sequence[Any], like: Any) -> Any:
        if self.mechanism.floating:
            (copy,) = self._call(_copy, [self._operand(base)], None)
            copy._output, copy._read = (self._first_output, 0), self._keeps_solution
            self.solution += range(copy._place, copy._place + 6)
        for k, joint in enumerate(joints):
            joint._output = self._first_output, self._first + k
            joint._read |= self._keeps_solution
            self.solution.append(joint._place)

    def append_calls(self) -> None:
        """Append the calls to the table."""
        for call in self._calls:
            places = tuple(map(_places, call.results))
            targets = [x._place if isinstance(x, Held) else x[1] for x in call.results]
            operands = [
                x._output[1] if isinstance(place, int) and isinstance(x, Held) and x._output else target
                for x, target, written in zip(call.results, targets, places, strict=True)
                for place in written
            ]
            name = call.step if isinstance(call.step, str) else self._routines.name(call.step, places)
            if self._appends:
                self.table.call(name, *call.operands, *operands)


def _rows_of_base(matrices: _ResultMatrices, column: int) -> list[Output]:
    entries = [matrices.at(k, column) for k in range(6)]
    return [row[k] for k in range(len(matrices.arrays)) for row in entries]


def _places(result: Held | Output) -> tuple[Place, ...]:
    """Return the places to which an output port is written."""
    if not isinstance(result, Held):
        return (result[0],)
    if result._output is None:
        return ("vectors",)
    return ("vectors", result._output[0]) if result._read else (result._output[0],)


def _copy(pair: Any) -> Any:
    linear, angular = pair
    return linear, angular
