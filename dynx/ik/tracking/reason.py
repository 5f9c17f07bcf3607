"""Sentences on why a sample of a path is not reached continuously."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dynx.backends.base import Backend
from dynx.distance.avoidance import pair_sentence
from dynx.ik.problem import Requirement
from dynx.ik.reach import proof_of
from dynx.ik.tracking.descent import Follower, part_of
from dynx.ik.tracking.path import AT_BOUND, PathTracker, TrackedPath, TrackLimits
from dynx.ik.tracking.result import TrackStatus
from dynx.spatial.scalar import Floats

if TYPE_CHECKING:
    from dynx.distance.avoidance import Avoidance

MAX_NAMES = 4
"""Most joints that are named."""

SINGULAR = 1e-3
"""Singular value of the Jacobian [m or rad] below which a configuration is called singular."""


@dataclass(frozen=True, eq=False)
class FailureExplainer:
    """What is needed to say why a sample of one path is not OK."""

    backend: Backend
    tracker: PathTracker
    follower: Follower
    """Follower that avoids nothing."""
    requirement: Requirement
    """Targets (n,) of the path, and how they are to be reached."""
    limits: TrackLimits
    avoidance: Avoidance | None

    def reason(self, path: TrackedPath) -> str:
        """Return why the first sample that is not OK is so; empty if all are."""
        k = path.leading
        if path.before_failure is None or k == len(path.status):
            return ""
        before, q = path.before_failure, path.q[k]
        proof = proof_of(self.backend.model, self.requirement, k)
        out_of_reach = f"out of reach: {proof}" if proof else ""
        if path.status[k] == TrackStatus.JUMPED:
            return f"no continuous configuration was found; a joint changes by {path.jump[k]:.3g}"
        if path.status[k] == TrackStatus.LIMITED:
            limited = self._limiting_joints(q, before, k)
            return f"{limited}; {out_of_reach}" if proof else limited
        return out_of_reach or self._collision(before, k) or self._singularity(q) + self._later_proof(path, k)

    def _later_proof(self, path: TrackedPath, k: int) -> str:
        """Return the proof for the sample that is off the most, if there is one: bounds on the reach are not
        exact, and the first sample that is out of reach may lie within them."""
        farthest = int(np.argmax(path.position_error + path.rotation_error))
        proof = proof_of(self.backend.model, self.requirement, farthest) if farthest > k else ""
        return f"; number {farthest} is out of reach: {proof}" if proof else ""

    def _limiting_joints(self, q: Floats, before: Floats, k: int) -> str:
        """Name the joints that the error presses against a limit."""
        coordinates, limits, model = self.tracker.coordinates, self.limits, self.backend.model
        pressed = self.tracker.limiting(q, before, self.requirement.targets, k)
        x = np.array(coordinates.values(q))
        at_position = (x <= limits.lower + AT_BOUND) | (x >= limits.upper - AT_BOUND)
        joint_offset = len(x) - len(coordinates.indices)
        base = model.nq - len(model.joint_names)
        position: list[str] = []
        velocity: list[str] = []
        for number in np.flatnonzero(pressed).tolist():
            index = number - joint_offset
            name = "the base" if index < 0 else model.joint_names[coordinates.indices[index] - base]
            (position if at_position[number] else velocity).append(name)
        found = [
            f"{', '.join(dict.fromkeys(names[:MAX_NAMES]))}{more} at {kind} limit"
            for names, kind in ((position, "the position"), (velocity, "the velocity"))
            if names
            for more in [f" and {len(names) - MAX_NAMES} more" if len(names) > MAX_NAMES else ""]
        ]
        return " and ".join(found)

    def _collision(self, before: Floats, k: int) -> str:
        """Say which bodies are too close where the target would be reached, or return an empty text."""
        if self.avoidance is None:
            return ""
        target = part_of(self.requirement.targets, slice(k, k + 1))
        found = self.follower.follow(before, target, self.limits.direct, stop=True)
        if not found.reached[0]:
            found = self.follower.descend(before[None], target, self.limits.unbounded_steps)
        violated = self.avoidance.violated(self.backend, found.q[0]) if found.reached[0] else []
        if not violated:
            return ""
        worst = max(violated, key=lambda each: each.pair.margin - each.separation.lower)
        return f"in collision: where the target is reached, {pair_sentence(self.avoidance, worst)}"

    def _singularity(self, q: Floats) -> str:
        """Say how close q is to a singular configuration, where no motion of the joints reduces the error."""
        coordinates, targets = self.tracker.coordinates, self.requirement.targets
        (position, rotation), *_ = part_of(targets, slice(1)).rows((1,))
        task = self.requirement.task(self.backend, coordinates, position, rotation)
        J = task.jacobian(q, task.error(q))
        if J.shape[1] < J.shape[0]:
            return f"the frame has {J.shape[0]} coordinates, and {J.shape[1]} joints move it"
        least = float(np.linalg.svd(J, compute_uv=False)[-1])
        value = f"least singular value of the Jacobian {least:.3g}"
        if least <= SINGULAR:
            return f"at a singular configuration ({value}), where no motion of the joints reduces the error"
        return f"no motion of the joints from the sample before reduces the error further ({value})"
