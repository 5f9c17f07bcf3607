"""All solutions of a pose, or of a batch of poses, with the names of their branches."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dynx.errors import ArgumentError
from dynx.files.notebook import html_table
from dynx.ik.result import IKResult
from dynx.spatial.scalar import Floats


@dataclass(frozen=True, eq=False, repr=False)
class IKSolutions(IKResult):
    """All configurations that reach a pose.

    For one pose, q (k, nq) holds the k solutions, and `branches` their names; k may be 0. For a batch of
    poses (...), q (..., 8, nq) has one row for each branch; `success` (..., 8) says which rows are solutions,
    and rows that are none hold the initial configuration (`q0`).
    """

    branches: tuple[str, ...]
    """Name of the branch of each row (`dynx.ik.closed_form.branches` defines them)."""
    arbitrary: NDArray[np.bool_]
    """Coordinates (..., nq) that can have any value at a singular pose, if another follows: infinitely many
    configurations reach the pose, of which q is one."""

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

    def rows(self, numbers: NDArray[np.intp]) -> IKSolutions:
        """Return some of the solutions of one pose."""
        return IKSolutions(
            self.q[numbers],
            self.success[numbers],
            self.position_error[numbers],
            self.rotation_error[numbers],
            self.iterations[numbers],
            self.restarts[numbers],
            tuple(self.branches[k] for k in numbers),
            self.arbitrary[numbers],
        )

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
        return text

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
