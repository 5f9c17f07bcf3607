"""Loops over the bodies of a mechanism, in which the algorithms of `dynx.rbd` are steps.

An algorithm says what happens at a joint. The order of the joints is given here: a parent before its children
(`outward`), children before their parent (`inward`), or a joint and then its ancestors (`to_root`).
`PythonLoops` calls the steps on numbers or symbols. `dynx.compiled.table_loops` compiles each step once and
makes a table of calls for each robot, so that the same text also evaluates robots of any size.

A step is a function without captured variables. Its first argument is a `Body`, or the `Mechanism` in a step
at the root, of which it may use gravity, the inertia of the root and `floating`. Further arguments come from
*columns*. A column is an array q (..., nq) or v, a, tau (..., nv), of which a step at a body gets the entry
(...,) of its joint and a step at the root the whole; or it is a sequence with one value for each body,
which may begin with that of the root.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

import numpy as np

from dynx.model.mechanism import ROOT, BodyFrame, Mechanism, joint_entries
from dynx.spatial.scalar import Array, append_axis

State = TypeVar("State")
Total = TypeVar("Total")
Result = TypeVar("Result")

Columns = Sequence[Any]


class Loops(ABC):
    """Loops over the bodies of `mechanism`, and the assembly of what the steps compute."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism

    @abstractmethod
    def root(self, step: Callable[..., Result], *arguments: Any, stored: bool = True) -> Result:
        """Return ``step(mechanism, *arguments)``.

        If not `stored`, compiled loops evaluate the step anew wherever its result is used. For a short step
        with a long result that takes less time than reading the result from memory.
        """

    @abstractmethod
    def each(self, step: Callable[..., Result], *columns: Any, stored: bool = True) -> Sequence[Result]:
        """Return ``step(body, *values)`` of every body; `stored` as in `root`."""

    @abstractmethod
    def combined(self, kind: Callable[..., Result], *columns: Any) -> Sequence[Result]:
        """Return ``kind(*values)`` of every body, which compiled loops do not store a second time."""

    @abstractmethod
    def outward(
        self, step: Callable[..., tuple[State, Result]], root: State, *columns: Any
    ) -> tuple[Sequence[State], Sequence[Result]]:
        """Carry a state from the root to the tips by ``step(body, state of the parent, *values)``.

        The step returns the state of the body and a result. Return all states, the root's first, and the
        results of every body.
        """

    @abstractmethod
    def inward(
        self, step: Callable[..., tuple[Total, Result]], totals: Sequence[Total], *columns: Any
    ) -> tuple[Sequence[Total], Sequence[Result]]:
        """Sum from the tips to the root by ``step(body, total, total of the parent, *values)``.

        The step returns the parent's new total and a result. `totals` are at first those of single bodies,
        the root's first; the sequence must not be used again. Return the final totals, and the result of
        every body.
        """

    @abstractmethod
    def subtrees(self, step: Callable[..., Total], totals: Sequence[Total], *columns: Any) -> Sequence[Total]:
        """Sum as `inward` does, by a step that returns the parent's new total alone.

        On a fixed base nothing is added to the root, of which no algorithm needs the total.
        """

    @abstractmethod
    def matrices(self, n: int, like: Array, *, blocks: int | None = None, width: int = 1) -> Any:
        """Return `n` matrices of zeros with nv rows, for `to_root`, `base_block` and `assembled`.

        They have nv columns, or `blocks` of `width` columns. Their leading axes are those of `like` (..., n).
        """

    @abstractmethod
    def to_root(
        self,
        matrices: Any,
        start: Callable[..., tuple[State, Any]],
        pair: Callable[..., tuple[State, Any, Any]],
        base: Callable[..., tuple[Any, Any]],
        *,
        own: Columns = (),
        below: Columns = (),
        here: Columns = (),
        at_base: Columns = (),
    ) -> None:
        """Carry the response of each joint to its ancestors, and enter their products in `matrices`.

        - ``start(body, *own)`` returns the response, and the entry on the diagonal of each matrix.
        - ``pair(body, response, *below, *here)`` continues at an ancestor, `body`. It returns the response
          there, the entries in the row of the starting joint and the ancestor's column, and those in the
          ancestor's row. `below` are columns of the body before it on the path, `here` of the ancestor.
        - ``base(response, *below, *at_base)`` continues at a floating base. It returns for each matrix the
          entries (..., 6) of a row, and six entries of a column. `at_base` are values of the root.
        """

    @abstractmethod
    def frames_to_root(
        self,
        matrices: Any,
        frames: Sequence[int],
        start: Callable[..., Any],
        entry: Callable[..., Any],
        base: Callable[..., Any],
        *,
        own: Columns,
        here: Columns,
        at_base: Columns,
    ) -> None:
        """Carry the response of each of `frames` to the joints that move it, and enter it in their rows.

        The columns are the block of the frame. ``start(frame, *own)`` returns the response; `own` are columns
        of the frame's body, which begin with the root's value. ``entry(body, response, *here)`` returns the
        entries of each matrix, and ``base(response, *at_base)`` six of each for a floating base.
        """

    @abstractmethod
    def base_block(self, matrices: Any, step: Callable[..., Any], *arguments: Any) -> None:
        """Enter the rows and columns of a floating base: ``step(mechanism, *arguments)`` returns six rows
        (..., 6) for each matrix."""

    @abstractmethod
    def assembled(self, matrices: Any) -> tuple[Array, ...]:
        """Return the matrices (..., nv, columns)."""

    @abstractmethod
    def vector(self, base: Any, joints: Sequence[Array], like: Array) -> Array:
        """Return the vector (..., nv) of the entries of the joints, after those of a floating base.

        `base` is the pair of its linear and angular entries, and unused on a fixed base. `like` (..., nv)
        has the leading axes.
        """


class PythonLoops(Loops):
    """Loops in Python, over arrays of any scalar with any leading axes."""

    def root(self, step: Callable[..., Result], *arguments: Any, stored: bool = True) -> Result:
        return step(self.mechanism, *arguments)

    def each(self, step: Callable[..., Result], *columns: Any, stored: bool = True) -> Sequence[Result]:
        return [
            step(body, *values)
            for body, values in zip(self.mechanism.bodies, self._rows(columns), strict=True)
        ]

    def combined(self, kind: Callable[..., Result], *columns: Any) -> Sequence[Result]:
        return [kind(*values) for values in self._rows(columns)]

    def outward(
        self, step: Callable[..., tuple[State, Result]], root: State, *columns: Any
    ) -> tuple[Sequence[State], Sequence[Result]]:
        states, results = [root], list[Result]()
        for body, values in zip(self.mechanism.bodies, self._rows(columns), strict=True):
            state, result = step(body, states[body.parent + 1], *values)
            states.append(state)
            results.append(result)
        return states, results

    def inward(
        self, step: Callable[..., tuple[Total, Result]], totals: Sequence[Total], *columns: Any
    ) -> tuple[Sequence[Total], Sequence[Result]]:
        bodies, rows = self.mechanism.bodies, self._rows(columns)
        sums, results = list(totals), list[Result]()
        for k in reversed(range(len(bodies))):
            parent = bodies[k].parent + 1
            sums[parent], result = step(bodies[k], sums[k + 1], sums[parent], *rows[k])
            results.append(result)
        return sums, results[::-1]

    def subtrees(self, step: Callable[..., Total], totals: Sequence[Total], *columns: Any) -> Sequence[Total]:
        bodies, rows = self.mechanism.bodies, self._rows(columns)
        sums = list(totals)
        for k in reversed(range(len(bodies))):
            parent = bodies[k].parent + 1
            if parent or self.mechanism.floating:
                sums[parent] = step(bodies[k], sums[k + 1], sums[parent], *rows[k])
        return sums

    def matrices(self, n: int, like: Array, *, blocks: int | None = None, width: int = 1) -> _Matrices:
        zero = 0 * np.sum(like, axis=-1)
        columns = self.mechanism.nv if blocks is None else blocks
        return _Matrices(n, (self.mechanism.nv, columns), zero, like.shape[:-1], width)

    def to_root(
        self,
        matrices: _Matrices,
        start: Callable[..., tuple[State, Any]],
        pair: Callable[..., tuple[State, Any, Any]],
        base: Callable[..., tuple[Any, Any]],
        *,
        own: Columns = (),
        below: Columns = (),
        here: Columns = (),
        at_base: Columns = (),
    ) -> None:
        bodies = self.mechanism.bodies
        first = self.mechanism.nv - len(bodies)
        own, below, here = (self._rows(columns) for columns in (own, below, here))
        for index, body in enumerate(bodies):
            column = first + index
            response, entries = start(body, *own[index])
            matrices.put(column, column, entries)
            last, row = index, body.parent
            while row != ROOT:
                response, by, of = pair(bodies[row], response, *below[last], *here[row])
                matrices.put(column, first + row, by)
                matrices.put(first + row, column, of)
                last, row = row, bodies[row].parent
            if self.mechanism.floating:
                by, of = base(response, *below[last], *at_base)
                for k in range(6):
                    matrices.put(column, k, [row_entries[..., k] for row_entries in by])
                    matrices.put(k, column, [entries[k] for entries in of])

    def frames_to_root(
        self,
        matrices: _Matrices,
        frames: Sequence[int],
        start: Callable[..., Any],
        entry: Callable[..., Any],
        base: Callable[..., Any],
        *,
        own: Columns,
        here: Columns,
        at_base: Columns,
    ) -> None:
        bodies = self.mechanism.bodies
        first, rows = self.mechanism.nv - len(bodies), self._rows(here)
        for column, frame in moving_frames(self.mechanism, frames):
            row = frame.body
            response = start(frame, *(column[row - len(bodies)] for column in own))
            while row != ROOT:
                entries = entry(bodies[row], response, *rows[row])
                matrices.put(first + row, column, entries)
                row = bodies[row].parent
            if self.mechanism.floating:
                of_base = base(response, *at_base)
                for k in range(6):
                    matrices.put(k, column, [entries[k] for entries in of_base])

    def base_block(self, matrices: _Matrices, step: Callable[..., Any], *arguments: Any) -> None:
        if self.mechanism.floating:
            for i, rows in enumerate(zip(*step(self.mechanism, *arguments), strict=True)):
                for j in range(6):
                    matrices.put(i, j, [row[..., j] for row in rows])

    def assembled(self, matrices: _Matrices) -> tuple[Array, ...]:
        return matrices.assembled()

    def vector(self, base: Any, joints: Sequence[Array], like: Array) -> Array:
        if self.mechanism.floating:
            return np.concatenate([*base, *(append_axis(joint) for joint in joints)], axis=-1)
        return np.stack(joints, axis=-1) if joints else np.zeros(like.shape)

    def _rows(self, columns: Columns) -> Sequence[Sequence[Any]]:
        """Return the values of columns for every body; arrays are configurations or velocities."""
        n = len(self.mechanism.bodies)
        if not columns:
            return [()] * n
        values = []
        for column in columns:
            if isinstance(column, np.ndarray):
                values.append(joint_entries(self.mechanism, column))
            else:
                values.append(column[len(column) - n :])
        return list(zip(*values, strict=True))


class _Matrices:
    """Matrices by their entries (...,), or their blocks (..., width) of columns; all others are zero.

    A robot of many separate branches has a mass matrix of which few entries are not zero.
    """

    def __init__(
        self, n: int, shape: tuple[int, int], zero: Array, batch: tuple[int, ...], width: int
    ) -> None:
        self._zero = zero if width == 1 else append_axis(zero) * np.zeros(width, dtype=int)
        self._shape = (*batch, shape[0], shape[1] * width)
        self._width = width
        self._tables: list[dict[tuple[int, int], Array]] = [{} for _ in range(n)]

    def put(self, row: int, column: int, entries: Sequence[Array]) -> None:
        """Enter one entry or block in each matrix."""
        for table, entry in zip(self._tables, entries, strict=True):
            table[row, column] = entry + self._zero

    def assembled(self) -> tuple[Array, ...]:
        """Return the matrices as arrays."""
        if 0 in self._shape[-2:]:
            return tuple(np.zeros(self._shape) for _ in self._tables)
        return tuple(self._assembled(table) for table in self._tables)

    def _assembled(self, table: dict[tuple[int, int], Array]) -> Array:
        entries = [self._zero, *table.values()]
        shape = np.broadcast_shapes(*{getattr(entry, "shape", ()) for entry in entries})
        batch = shape if self._width == 1 else shape[:-1]
        kinds = {getattr(entry, "dtype", np.dtype(object)) for entry in entries}
        found = np.empty((*batch, *self._shape[-2:]), dtype=np.result_type(*kinds))
        blocks = found.reshape(*batch, self._shape[-2], self._shape[-1] // self._width, self._width)
        # Of width 1, entries have no axis of their own.
        inside = 0 if self._width == 1 else slice(None)
        zero = append_axis(self._zero) if self._width == 1 else self._zero
        blocks[...] = zero[..., None, None, :]
        for (row, column), entry in table.items():
            blocks[..., row, column, inside] = entry
        return found


def moving_frames(mechanism: Mechanism, frames: Sequence[int]) -> Iterator[tuple[int, BodyFrame]]:
    """Yield those of `frames` that a coordinate moves, each with its place among them."""
    for place, number in enumerate(frames):
        frame = mechanism.frames[number]
        if frame.body != ROOT or mechanism.floating:
            yield place, frame
