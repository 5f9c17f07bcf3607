"""A checked problem of inverse kinematics: what `inverse_kinematics` passes to a solver of many targets."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dynx.backends.base import Backend
from dynx.ik.axes import AxisRequirement
from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.search import SearchLimits
from dynx.ik.secondary import Secondary
from dynx.ik.tasks import AxisTask, FrameTask, SeveralTasks, Task
from dynx.model.targets import Targets
from dynx.spatial.scalar import Floats

if TYPE_CHECKING:
    from dynx.distance.avoidance import Avoidance


@dataclass(frozen=True, eq=False)
class Requirement:
    """Targets of one frame, and how they are to be reached."""

    frame: str
    targets: Targets
    point: Floats | None
    """Point (3,) of the frame that is placed, in its axes [m], or None for its origin."""
    axes: AxisRequirement | None
    """Weights and tolerances per axis, or None for bounds on both errors."""
    tolerances: SearchLimits
    """Bounds on the errors."""

    def task(
        self,
        backend: Backend,
        coordinates: FrameCoordinates,
        position: Floats | None,
        rotation: Floats | None,
    ) -> Task:
        """Return the task of one target: a position (3,) [m] and a rotation (3, 3)."""
        arguments = (
            backend, self.frame, self.point, coordinates, self.tolerances, position, rotation
        )  # fmt: skip
        return FrameTask(*arguments) if self.axes is None else AxisTask(*arguments, self.axes)


@dataclass(frozen=True, eq=False)
class Problem:
    """Requirements on one frame or several, the starts, and the limits of the search, all checked."""

    requirements: tuple[Requirement, ...]
    coordinates: FrameCoordinates
    """The coordinates that move a frame, with their limits."""
    margin: Floats | None
    """Least distance (nq,) from the position limits [rad or m], or None."""
    q0: Floats
    """Configurations (..., nq) within limits."""
    begins_at_q0: bool
    """Whether the first start is q0, and not a start of the solver."""
    batch: tuple[int, ...]
    """Leading axes of targets and q0, broadcast."""
    limits: SearchLimits
    rng: np.random.Generator | int | None
    secondary: Secondary | None = None
    """What solutions are chosen by, if there is a choice."""
    avoidance: Avoidance | None = None
    """What solutions keep away from, or None."""

    @property
    def count(self) -> int:
        """Number of samples."""
        return math.prod(self.batch)

    @property
    def frame(self) -> str:
        """The first frame."""
        return self.requirements[0].frame

    @property
    def targets(self) -> Targets:
        """Targets of the first frame."""
        return self.requirements[0].targets

    @property
    def point(self) -> Floats | None:
        """Point of the first frame."""
        return self.requirements[0].point

    @property
    def is_plain(self) -> bool:
        """Whether there is one frame, without requirements per axis."""
        return len(self.requirements) == 1 and self.requirements[0].axes is None

    def starts(self) -> Floats:
        """Return the starts (count, nq) of all samples."""
        q0 = self.q0
        if not self.batch:
            return q0[None]
        return np.broadcast_to(q0, (*self.batch, q0.shape[-1])).reshape(self.count, q0.shape[-1])

    def tasks(self, backend: Backend) -> Iterator[tuple[int, Task]]:
        """Yield the index of each sample, and what it has to reach."""
        rows: list[Iterable[tuple[Floats | None, Floats | None]]]
        if self.batch:
            rows = [requirement.targets.rows(self.batch) for requirement in self.requirements]
        else:
            targets = [requirement.targets for requirement in self.requirements]
            rows = [((each.positions, each.rotations),) for each in targets]
        for k, sample in enumerate(zip(*rows, strict=True)):
            tasks = [
                requirement.task(backend, self.coordinates, position, rotation)
                for requirement, (position, rotation) in zip(self.requirements, sample, strict=True)
            ]
            yield k, tasks[0] if len(tasks) == 1 else SeveralTasks(tasks)
