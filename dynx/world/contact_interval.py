"""The contacts of the last steps of the engine of a world, and their means."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Sequence

import numpy as np

from dynx.spatial.plain import cross
from dynx.spatial.scalar import Floats
from dynx.steppers.forces import Forces
from dynx.steppers.stepper import Stepper
from dynx.world.commands import Act
from dynx.world.contacts import MeanContact

StepSums = dict[tuple[int, int], Floats]
"""For each pair of colliders that touch in a step, the lower number first: force (3,) and moment (3,) on the
first, and normal force."""


class ContactInterval:
    """Sums of the contacts in each of the last steps of the engine, at most `steps` of them."""

    def __init__(self, names: Sequence[str], steps: int) -> None:
        """`names` are those of the colliders."""
        self._names = names
        self._sums: deque[StepSums] = deque(maxlen=steps)
        self._taken = False
        """True if a step was taken whose contacts have not been summed yet: they are read before the next."""

    def forget(self) -> None:
        """Begin a new interval: the state was set."""
        self._sums.clear()
        self._taken = False

    def watched(self, act: Act) -> Act:
        """Return `act`, which sums the contacts of each step of the engine before the next one."""

        def sum_and_act(engine: Stepper) -> Forces | None:
            self._sum(engine)
            self._taken = True
            return act(engine)

        return sum_and_act

    def means(self, engine: Stepper, colliders: Collection[int] | None) -> tuple[MeanContact, ...]:
        """Return the means of the pairs that touched in the interval, of these colliders or all, ordered by
        the parts of the scene."""
        self._sum(engine)
        pairs = sorted({pair for sums in self._sums for pair in sums})
        if colliders is not None:
            pairs = [(a, b) for a, b in pairs if a in colliders or b in colliders]
        found = []
        for a, b in pairs:
            rows = [sums[a, b] for sums in self._sums if (a, b) in sums]
            mean = np.sum(rows, axis=0) / len(self._sums)
            share = len(rows) / len(self._sums)
            found.append(
                MeanContact(self._names[a], self._names[b], mean[:3], mean[3:6], float(mean[6]), share)
            )
        return tuple(found)

    def _sum(self, engine: Stepper) -> None:
        """Sum the contacts of the step that was taken last, once."""
        if self._taken:
            self._taken = False
            self._sums.append(summed_contacts(engine))


def summed_contacts(engine: Stepper) -> StepSums:
    """Return the sums of the contacts of the last step of an engine."""
    sums: StepSums = {}
    for point in engine.contacts():
        force = point.normal_force * point.normal
        if point.friction_force is not None:
            force = force + point.friction_force
        middle = 0.5 * (point.point_a + point.point_b)
        sign = 1.0 if point.a <= point.b else -1.0
        moment = cross(middle.tolist(), force.tolist())
        row = np.array([*(sign * force), *(sign * x for x in moment), point.normal_force])
        pair = min(point.a, point.b), max(point.a, point.b)
        sums[pair] = sums[pair] + row if pair in sums else row
    return sums
