"""Following of targets by configurations that keep bodies apart.

The samples of another follower are kept as long as they are clear. Where one is too close to something, the
descent to its target is repeated with the distances that are too small as further errors
(`dynx.ik.avoiding_descent`): redundant joints then move around what is in the way. Where that fails, the
sample is not reached and stays at the last configuration that is clear.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dynx.backends.base import Backend
from dynx.ik.avoiding_descent import AvoidingDescent
from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.problem import Requirement
from dynx.ik.tracking.descent import Followed, Follower, StepBounds, part_of
from dynx.model.targets import Targets
from dynx.spatial.scalar import Floats

if TYPE_CHECKING:
    from dynx.distance.avoidance import Avoidance

CHUNK = 64
"""Samples that the other follower solves before they are checked."""


class AvoidingFollower:
    """Follower whose samples, where they are reached, keep all margins."""

    def __init__(
        self,
        base: Follower,
        backend: Backend,
        requirement: Requirement,
        coordinates: FrameCoordinates,
        avoidance: Avoidance,
    ) -> None:
        self._base, self._backend, self._avoidance = base, backend, avoidance
        self._requirement, self._coordinates = requirement, coordinates

    def follow(self, q: Floats, targets: Targets, bounds: StepBounds, *, stop: bool) -> Followed:
        """Follow targets (n,) from q (nq,), each from the solution of the one before."""
        n, done = targets.batch[0], 0
        pieces: list[Followed] = []
        while done < n:
            part = part_of(targets, slice(done, min(n, done + CHUNK)))
            found = self._base.follow(q, part, bounds, stop=True)
            clear = 0
            while clear < len(found) and found.reached[clear] and self._is_clear(found.q[clear]):
                clear += 1
            if clear:
                pieces.append(found.part(slice(clear)))
                q, done = found.q[clear - 1], done + clear
            if clear < part.batch[0]:
                # The other follower ends with a sample that it does not reach.
                sample = found.part(slice(clear, clear + 1))
                if sample.reached[0] or not self._is_clear(sample.q[0]):
                    sample = self._avoid(q, part_of(part, slice(clear, clear + 1)), bounds)
                pieces.append(sample)
                q, done = sample.q[0], done + 1
                if stop and not sample.reached[0]:
                    break
        return Followed.joined(pieces)

    def descend(self, starts: Floats, targets: Targets, bounds: StepBounds) -> Followed:
        """Descend from starts (n, nq); a solution that is too close to something does not count."""
        found = self._base.descend(starts, targets, bounds)
        for k in np.flatnonzero(found.reached).tolist():
            found.reached[k] = self._is_clear(found.q[k])
        return found

    def _is_clear(self, q: Floats) -> bool:
        return self._avoidance.is_clear(self._backend, q)

    def _avoid(self, q: Floats, target: Targets, bounds: StepBounds) -> Followed:
        """Return the sample of a target (1,) that keeps the margins, or else stays clear, near q."""
        coordinates = self._coordinates
        ((position, rotation),) = target.rows((1,))
        task = self._requirement.task(self._backend, coordinates, position, rotation)
        around = bounds.around(np.array(coordinates.values(q)))
        descent = AvoidingDescent(task, self._avoidance, self._backend, coordinates, around)
        moved, steps, reached = descent.run(q)
        stays = not reached and not self._is_clear(moved)
        error = task.error(q if stays else moved)
        return Followed(
            (q if stays else moved)[None],
            np.array([error.position]),
            np.array([error.rotation]),
            np.array([reached], dtype=np.bool_),
            np.array([steps], dtype=np.int64),
        )
