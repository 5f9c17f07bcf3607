"""All solutions of a pose, or of a batch of poses, with the names of their branches and their full turns."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.errors import ArgumentError
from dynx.files.pages import html_table
from dynx.ik.coordinates import FULL_TURN
from dynx.ik.result import NOT_FOUND, REACHED, IKResult
from dynx.model import Model
from dynx.spatial.scalar import Floats

AT_LIMIT = 1e-12
"""Fraction of a turn by which an angle may exceed a limit, by rounding; it is moved to the limit."""

MAX_CONFIGURATIONS = 1_000_000
"""Most configurations that are listed."""

Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class FullTurns:
    """Angles with two limits, which may take several values that differ by full turns."""

    columns: tuple[int, ...]
    """Indices in q."""
    lower: Floats
    upper: Floats
    """Limits [rad]."""

    @classmethod
    def of(cls, model: Model, columns: Sequence[int]) -> FullTurns:
        """Select the limited angles among the coordinates `columns`. Joints without limits take one value."""
        kinds = [joint.type for joint in model.coordinate_joints]
        chosen = [
            k
            for k in columns
            if kinds[k] != "prismatic" and np.isfinite(model.lower[k]) and np.isfinite(model.upper[k])
        ]
        return cls(tuple(chosen), model.lower[chosen], model.upper[chosen])

    def counts(self, q: Floats) -> Integers:
        """Return the number (...,) of configurations within the limits for each q (..., nq), itself
        included."""
        first, last = self._turns(q)
        return np.asarray(np.prod(np.maximum(last - first + 1, 0), axis=-1))

    def configurations(self, q: Floats) -> Floats:
        """Return all configurations (m, nq) for q (k, nq), those of the first row first.

        Raises ArgumentError for more than `MAX_CONFIGURATIONS`.
        """
        count = int(self.counts(q).sum())
        if count > MAX_CONFIGURATIONS:
            raise ArgumentError(
                f"{count} configurations differ by full turns within the limits; at most "
                f"{MAX_CONFIGURATIONS} are listed"
            )
        found, row = np.empty((count, q.shape[-1])), 0
        for one, first, last in zip(q, *self._turns(q), strict=True):
            for turns in product(*(range(a, b + 1) for a, b in zip(first, last, strict=True))):
                found[row] = one
                moved = one[list(self.columns)] + FULL_TURN * np.array(turns)
                found[row, self.columns] = np.clip(moved, self.lower, self.upper)
                row += 1
        return found

    def _turns(self, q: Floats) -> tuple[Integers, Integers]:
        """Return the least and the greatest number of turns (..., n) that may be added to each angle."""
        angles = q[..., list(self.columns)]
        first = np.ceil((self.lower - angles) / FULL_TURN - AT_LIMIT)
        last = np.floor((self.upper - angles) / FULL_TURN + AT_LIMIT)
        return first.astype(np.int64), last.astype(np.int64)


Mask = NDArray[np.bool_]


class IKSolutions(IKResult):
    """All configurations that reach a pose.

    For one pose, q (k, nq) holds the k solutions, and `branches` their names; k may be 0. For a batch of
    poses (...), q (..., 8, nq) has eight rows. `success` (..., 8) is True for rows that are solutions. The
    other rows hold the initial configuration (`q0`).

    dynx computes an attribute only when it is first used, so a pose takes a few microseconds.
    """

    by_frame: Mapping[str, tuple[Floats, Floats]] = MappingProxyType({})
    """Empty, because the solutions are for one frame."""
    _errors: Floats
    _named: tuple[tuple[str, ...], int | None]
    _full_turns: FullTurns | None

    def __init__(
        self,
        q: Floats,
        errors: Floats,
        branches: tuple[str, ...],
        bits: int | None = None,
        *,
        success: Mask | None = None,
        arbitrary: Mask | None = None,
        full_turns: FullTurns | None = None,
    ) -> None:
        """`errors` (..., 2) are those of position [m] and rotation [rad]. `branches` name the rows of q; if
        `bits` are given, only the branches whose bits are set do. Without `success` all rows are solutions,
        and without `arbitrary` no coordinate is arbitrary.
        """
        found = self.__dict__
        found["q"], found["_errors"], found["_named"] = q, errors, (branches, bits)
        found["_full_turns"] = full_turns
        if success is not None:
            found["success"] = success
        if arbitrary is not None:
            found["arbitrary"] = arbitrary

    @cached_property
    def branches(self) -> tuple[str, ...]:
        """Name of the branch of each row (`dynx.ik.closed_forms.candidates` defines them)."""
        names, bits = self._named
        return names if bits is None else tuple(name for k, name in enumerate(names) if bits >> k & 1)

    @cached_property
    def success(self) -> Mask:
        """True for the rows of q that are solutions (...,)."""
        return np.ones(self.q.shape[:-1], dtype=np.bool_)

    @cached_property
    def position_error(self) -> Floats:
        """Distance from the target (...,) [m]."""
        return self._errors[..., 0]

    @cached_property
    def rotation_error(self) -> Floats:
        """Angle to the target (...,) [rad], between 0 and pi."""
        return self._errors[..., 1]

    @cached_property
    def iterations(self) -> NDArray[np.int64]:
        """Number of solver steps: 0 (...,)."""
        return np.zeros(self.q.shape[:-1], dtype=np.int64)

    @cached_property
    def restarts(self) -> NDArray[np.int64]:
        """Number of restarts: 0 (...,)."""
        return np.zeros(self.q.shape[:-1], dtype=np.int64)

    @cached_property
    def arbitrary(self) -> Mask:
        """Coordinates (..., nq) that can have any value at a singular pose, if another coordinate follows:
        infinitely many configurations reach the pose, of which q is one."""
        return np.zeros(self.q.shape, dtype=np.bool_)

    @cached_property
    def multiplicity(self) -> NDArray[np.int64]:
        """Number (...,) of configurations within the limits that differ from each solution by full turns,
        itself included: more than 1 where limits span more than a turn; 0 for rows that are no solutions.
        Joints without limits count with one value."""
        if self._full_turns is None:
            return self.success.astype(np.int64)
        return np.where(self.success, self._full_turns.counts(self.q), 0)

    def with_full_turns(self) -> Floats:
        """Return all configurations (m, nq) that reach one pose: every solution, with every full turn that
        its limits allow (`multiplicity`), those of the first solution first.

        Raises ArgumentError for a batch, and for more than a million configurations.
        """
        if self.success.ndim > 1:
            raise ArgumentError("these are solutions of several poses; full turns are listed for one")
        return self.q.copy() if self._full_turns is None else self._full_turns.configurations(self.q)

    def __len__(self) -> int:
        """Return the number of rows of q: the solutions of one pose, or the poses of a batch."""
        return len(self.q)

    def __iter__(self) -> Iterator[tuple[Floats, str]]:
        """Yield each solution of one pose, with the name of its branch; ArgumentError for a batch."""
        if self.success.ndim > 1:
            raise ArgumentError("these are solutions of several poses; iterate over q and success")
        return iter(zip(self.q, self.branches, strict=True))

    @property
    def counts(self) -> NDArray[np.int64]:
        """Number of solutions of each pose (...,)."""
        return np.asarray(self.success.sum(axis=-1))

    def measured(self, errors: Floats, success: Mask) -> IKSolutions:
        """Return these solutions with other `errors` (..., 2); only rows in `success` (...,) remain
        solutions."""
        if success.ndim > 1:
            return IKSolutions(
                self.q,
                errors,
                self.branches,
                success=success,
                arbitrary=self.arbitrary,
                full_turns=self._full_turns,
            )
        names = tuple(name for name, remains in zip(self.branches, success.tolist(), strict=True) if remains)
        return IKSolutions(
            self.q[success],
            errors[success],
            names,
            arbitrary=self.arbitrary[success],
            full_turns=self._full_turns,
        )

    @property
    def status(self) -> Any:
        """``"REACHED"`` for poses that have a solution, otherwise ``"NOT_FOUND"``; an array (...,) for a
        batch."""
        found = np.where(self.success.any(axis=-1), REACHED, NOT_FOUND)
        return found if found.ndim else str(found)

    @property
    def message(self) -> str:
        """One sentence that summarises the solutions."""
        if self.success.ndim > 1:
            reached = int(np.count_nonzero(self.counts))
            return f"{int(self.success.sum())} solutions; {reached} of {self.counts.size} poses have one"
        count = len(self.q)
        text = "no solution" if not count else "1 solution" if count == 1 else f"{count} solutions"
        if self.arbitrary.any():
            return f"{text}, which stand for infinitely many (singular pose)"
        multiplicity = int(self.multiplicity.sum())
        return text if multiplicity == count else f"{text}, {multiplicity} with full turns within the limits"

    def __repr__(self) -> str:
        if self.success.ndim > 1:
            return f"<IKSolutions {self.message}>"
        rows = [
            f"\n  [{', '.join(f'{x:.6g}' for x in q)}]  {branch}"
            for q, branch in zip(self.q, self.branches, strict=True)
        ]
        return f"<IKSolutions {self.message}{''.join(rows)}>"

    def _repr_html_(self) -> str:
        if self.success.ndim > 1:
            return html_table("inverse kinematics", {"result": self.message, "q": self.q.shape})
        rows = {
            branch: ", ".join(f"{x:.6g}" for x in q) for q, branch in zip(self.q, self.branches, strict=True)
        }
        return html_table("inverse kinematics", {"result": self.message, **rows})

    def __bool__(self) -> bool:
        """Return whether every pose has a solution."""
        return bool(self.success.any(axis=-1).all())
