"""Starts of the solver: configurations whose poses are near the target, then random ones.

A table is made once for a frame from the poses of random configurations, and kept in the cache on disk. Poses
are divided into cells: boxes of the frame's position, times the 24 rotations of a cube, of which one is
nearest to the frame's axes. Each cell has a few starts; a target begins at those of its own cell. Finding a
cell takes a few comparisons.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dynx.backends.base import Backend
from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.problem import Problem
from dynx.spatial.scalar import Floats

BOXES = 8
"""Number of boxes along each axis of the world."""

LAST_BOX = BOXES - 1

ROTATIONS = 24
"""Number of rotations of a cube."""

STARTS_OF_CELL = 4
"""Number of starts of each cell."""

SAMPLES = 100_000
"""Number of configurations from which the table is made."""

Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Cells:
    """Cells of poses: the corner of the boxes [m], and their number per metre, along each axis."""

    corner: Floats
    per_metre: Floats

    @classmethod
    def around(cls, positions: Floats) -> Cells:
        """Make cells that hold positions (n, 3)."""
        low, high = positions.min(axis=0), positions.max(axis=0)
        extent = np.where(high - low > 0.0, high - low, 1.0)
        return cls(low, BOXES / extent)

    @cached_property
    def _axes(self) -> tuple[list[float], list[float]]:
        return self.corner.tolist(), self.per_metre.tolist()

    def number(self, positions: Floats, rotations: Floats) -> Integers:
        """Return the number (n,) of the cell of each pose (n, 3), (n, 3, 3)."""
        box = np.clip((positions - self.corner) * self.per_metre, 0.0, float(LAST_BOX)).astype(np.int64)
        x, z = rotations[:, :, 0], rotations[:, :, 2]
        rows = np.arange(len(z))
        up = np.abs(z).argmax(axis=1)
        across = np.abs(x)
        across[rows, up] = -1.0
        along = across.argmax(axis=1)
        # The x axis is along the next or the one after the next axis of the world.
        turn = 2 * ((along - up) % 3 - 1) + (x[rows, along] < 0.0)
        face = 2 * up + (z[rows, up] < 0.0)
        return np.asarray(((box[:, 0] * BOXES + box[:, 1]) * BOXES + box[:, 2]) * ROTATIONS + 4 * face + turn)

    def number_of_one(self, rows: list[list[float]]) -> int:
        """Return the cell of one pose, as the first three rows of its matrix; faster than for arrays."""
        x, y, z = rows[0], rows[1], rows[2]
        (x_corner, y_corner, z_corner), (x_scale, y_scale, z_scale) = self._axes
        # Written out, which takes half the time of a loop.
        at = (x[3] - x_corner) * x_scale
        cell = 0 if at < 0.0 else LAST_BOX if at >= LAST_BOX else int(at)
        at = (y[3] - y_corner) * y_scale
        cell = cell * BOXES + (0 if at < 0.0 else LAST_BOX if at >= LAST_BOX else int(at))
        at = (z[3] - z_corner) * z_scale
        cell = cell * BOXES + (0 if at < 0.0 else LAST_BOX if at >= LAST_BOX else int(at))
        a, b, c = abs(x[2]), abs(y[2]), abs(z[2])
        # Of equal magnitudes the lower axis counts, as in `numpy.argmax`.
        up = (0 if a >= c else 2) if a >= b else (1 if b >= c else 2)
        first, second = (y[0], z[0]) if up == 0 else (z[0], x[0]) if up == 1 else (x[0], y[0])
        closer = abs(first) - abs(second)
        along_first = closer > 0.0 or (closer == 0.0 and up != 1)
        turn = (first < 0.0) if along_first else 2 + (second < 0.0)
        return cell * ROTATIONS + 4 * (2 * up + (rows[up][2] < 0.0)) + turn


@dataclass(frozen=True, eq=False)
class StartTable:
    """Starts near every pose of a frame."""

    cells: Cells
    rows: Floats
    """Starts (cells * STARTS_OF_CELL, n), those of a cell one after the other."""

    @classmethod
    def of(cls, coordinates: FrameCoordinates, backend: Backend, frame: str) -> StartTable:
        """Make the table of a frame; a cell that no sample is in has random starts."""
        rng = np.random.default_rng(SAMPLES)
        samples = coordinates.starts(rng, SAMPLES)
        q = np.tile(coordinates.initial(), (SAMPLES, 1))
        q[:, coordinates.indices] = samples
        poses = backend.forward_kinematics(q, frame)
        positions, rotations = poses[:, :3, 3], poses[:, :3, :3]
        cells = Cells.around(positions)
        cell = cells.number(positions, rotations)
        order = np.argsort(cell, kind="stable")
        first = np.searchsorted(cell[order], cell[order])
        place = np.arange(SAMPLES) - first
        kept = place < STARTS_OF_CELL
        rows = coordinates.starts(rng, BOXES**3 * ROTATIONS * STARTS_OF_CELL)
        rows[cell[order][kept] * STARTS_OF_CELL + place[kept]] = samples[order][kept]
        return cls(cells, rows)

    @classmethod
    def from_content(cls, content: bytes, joints: int) -> StartTable | None:
        """Return the table that `content` made, for a number of joints; None if it is of another size."""
        if len(content) != 8 * (6 + BOXES**3 * ROTATIONS * STARTS_OF_CELL * joints):
            return None
        numbers = np.frombuffer(content)
        return cls(Cells(numbers[:3], numbers[3:6]), numbers[6:].reshape(-1, joints))

    @property
    def content(self) -> bytes:
        """All numbers, as the cache on disk keeps them."""
        return np.concatenate([self.cells.corner, self.cells.per_metre, self.rows.ravel()]).tobytes()


@dataclass(frozen=True, eq=False)
class Starts:
    """Starts of one seed: of each target, `near` starts of its cell, then random ones.

    Start number k below `near` is row ``first + (k + offset) % near``, where `first` is the first row of the
    cell; another is row ``base + k``.
    """

    near_rows: Floats
    """Rows of the table; none without one."""
    random: Floats
    """Random starts (count, n)."""
    cells: Cells | None
    near: int
    offset: int

    @classmethod
    def of(
        cls, coordinates: FrameCoordinates, table: StartTable | None, rng: np.random.Generator, count: int
    ) -> Starts:
        """Draw the random starts, of which `count` numbers are used, and the offset."""
        offset = int(rng.integers(STARTS_OF_CELL))
        random = coordinates.starts(rng, count)
        if table is None:
            return cls(random[:0], random, None, 0, 0)
        return cls(table.rows, random, table.cells, STARTS_OF_CELL, offset)

    @property
    def base(self) -> int:
        """Row of the first random start."""
        return len(self.near_rows)

    @cached_property
    def rows(self) -> Floats:
        """All starts, copied: megabytes that a single target does not need."""
        return np.concatenate([self.near_rows, self.random])

    @property
    def constants(self) -> Floats:
        """Numbers that the kernel finds the row of a start with (`dynx.ik.step`)."""
        return np.array([self.near, self.offset, self.base], dtype=np.float64)

    def first_rows(self, problem: Problem) -> Integers:
        """Return the first row (n,) of the cell of each target; zeros without a table."""
        targets = problem.targets
        if self.cells is None or targets.positions is None or targets.rotations is None:
            return np.zeros(problem.count, dtype=np.int64)
        cell = self.cells.number(targets.positions.reshape(-1, 3), targets.rotations.reshape(-1, 3, 3))
        found = np.broadcast_to(cell.reshape(targets.batch), problem.batch).reshape(-1)
        return np.asarray(STARTS_OF_CELL * found)

    def copy_near(self, x: memoryview, first: int) -> None:
        """Write the starts of a cell, in order, given its first row, to the first rows of a flat x (k n,)."""
        size, rows = self.random.shape[1], self._flat
        turned = size * (self.near - self.offset)
        start, end = size * first, size * (first + self.near)
        room = len(x)
        if room >= size * self.near:
            x[:turned] = rows[end - turned : end]
            x[turned : end - start] = rows[start : end - turned]
        else:
            found = np.concatenate([rows[end - turned : end], rows[start : end - turned]])
            x[:] = found[:room].data

    @cached_property
    def _flat(self) -> memoryview:
        return self.near_rows.reshape(-1).data
