"""Observability of differences of inertial parameters: what of them no motion and no torque shows.

The torque is linear in the inertial parameters. A difference of two robots of the same kinematics is seen in
no state if and only if it lies in the null space of the regressor. Most of the null space is known in closed
form (`dynx.rbd.base_parameters`): parameters that may belong to the parent of a joint. The rest of it, on a
fixed base or through mimic joints, is found from the regressor at random states: an analytic function that
vanishes there vanishes everywhere, with probability 1.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from dynx.model.mechanism import ROOT, BodyFrame, Mechanism
from dynx.rbd.base_parameters import align_frames, split_inertia
from dynx.rbd.regressor import inertial_regressor_at
from dynx.same.decimals import rounded
from dynx.same.scales import inertia_ratio
from dynx.same.skeleton import Skeleton, float_inertia
from dynx.spatial.inertia import RigidInertia, parameters_from_inertia
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import skew

STATES, SEED = 24, 0
"""Number of random states at which the regressor is evaluated, and their seed."""

NULL = 1e-8
"""Singular value, relative to columns of length 1, below which a direction is in the null space."""

Ints = NDArray[np.int64]

Differences = Mapping[int, RigidInertia]
"""Difference of the inertia of some bodies, by the number of the body in the mechanism."""


@lru_cache(maxsize=1)
def observability_of(skeleton: Skeleton) -> Observability:
    """Return the observability of a robot's inertias; the last one is kept, with what it has evaluated."""
    return Observability(skeleton)


class Observability:
    """Which differences of inertias of one robot are seen in some state."""

    def __init__(self, skeleton: Skeleton) -> None:
        self._skeleton = skeleton
        # Differences are computed in 50 digits; what is seen of them needs no more than float64.
        self._mechanism = _rounded(skeleton.mechanism)
        self._aligned = align_frames(self._mechanism)
        self._frames = {frame.body: (frame.R, frame.p) for frame in self._aligned.frames}
        self._reduced_bodies: list[int] = []
        self._reduced: Floats = np.zeros((0, 0))
        self._own = self._scaling_inertias()

    def _scaling_inertias(self) -> dict[int, RigidInertia]:
        """Return the inertias of the bodies, of which differences have their scale: that of a body without
        one is what bodies below it share with it."""
        bodies = self._aligned.bodies
        inertias = [self._aligned.root, *(body.inertia for body in bodies)]
        own = {number: float_inertia(inertia) for number, inertia in enumerate(inertias, ROOT)}
        grouped = dict(own)
        for number in reversed(range(len(bodies))):
            joint = bodies[number]
            below = grouped[number]
            _, shared = split_inertia(below, joint.revolute, joint.ball is not None)
            if not joint.revolute and below.mass:
                # The tensor of a slide counts about its centre of mass.
                H = skew(below.first_moment)
                shared = replace(shared, rotational_inertia=below.rotational_inertia + H @ H / below.mass)
            grouped[joint.parent] = grouped[joint.parent] + shared.transform(joint.R, joint.p)
        return {
            number: inertia if inertia.mass or inertia.rotational_inertia.any() else grouped[number]
            for number, inertia in own.items()
        }

    def regrouped(self, body: int, difference: RigidInertia) -> Differences:
        """Move the parameters of a difference of one body of the skeleton to the bodies of the mechanism at
        which they are seen: those that may belong to the parent of a joint are the parent's."""
        aligned, frames = self._aligned, self._frames
        body = ROOT if body == ROOT else self._skeleton.numbers[body]
        found: dict[int, RigidInertia] = {}
        moved: RigidInertia = difference.transform(*frames[body])
        while body != ROOT:
            joint = aligned.bodies[body]
            found[body], redundant = split_inertia(moved, joint.revolute, joint.ball is not None)
            moved, body = redundant.transform(joint.R, joint.p), joint.parent
        found[ROOT] = moved
        return found

    def seen(self, regrouped: Iterable[Differences]) -> dict[int, float]:
        """Return, for each body of the skeleton in whose parameters the sum of some regrouped differences is
        seen, its size relative to the scale of the body (`inertia_ratio`)."""
        total: dict[int, RigidInertia] = {}
        for each in regrouped:
            for body, inertia in each.items():
                total[body] = total[body] + inertia if body in total else inertia
        remaining = {
            body: (inertia, inertia_ratio(inertia, self._own[body], self._skeleton.whole))
            for body, inertia in total.items()
        }
        if not self._skeleton.model.floating:
            remaining.pop(ROOT, None)
        ratios = {body: ratio for body, (_, ratio) in remaining.items() if ratio > 0.0}
        if ratios and not (self._skeleton.model.floating and self._mechanism.coupling is None):
            ratios = self._projected({body: remaining[body][0] for body in ratios}, ratios)
        return {self._skeleton.number_of[body]: ratio for body, ratio in ratios.items()}

    def _projected(self, inertias: Differences, ratios: dict[int, float]) -> dict[int, float]:
        """Remove the part in the null space of the regressor, which is taken at the bodies that differ."""
        bodies = list(inertias)
        parameters = np.concatenate([parameters_from_inertia(inertias[body]) for body in bodies])
        scales = np.concatenate([self._scales(body) for body in bodies])
        columns = self._columns(bodies) * scales
        lengths = np.linalg.norm(columns, axis=0)
        seen = lengths > NULL * float(np.max(lengths, initial=0.0))
        if not seen.any():
            return {}
        x = np.where(seen, parameters / scales, 0.0)
        unit = columns[:, seen] / lengths[seen]
        _, values, rows = np.linalg.svd(unit, full_matrices=False)
        kept = rows[values > NULL * values[0]]
        weighted = x[seen] * lengths[seen]
        x[seen] = kept.T @ (kept @ weighted) / lengths[seen]
        if float(np.linalg.norm(kept @ weighted)) <= NULL * float(np.linalg.norm(weighted)):
            return {}
        sizes = np.max(np.abs(x.reshape(-1, 10)), axis=1)
        before = np.max(np.abs((parameters / scales).reshape(-1, 10)), axis=1)
        return {
            body: ratios[body] * float(size / whole)
            for body, size, whole in zip(bodies, sizes, before, strict=True)
            if size > NULL * whole
        }

    def _scales(self, body: int) -> Floats:
        own, length = self._own[body], self._skeleton.reach
        mass = abs(float(own.mass)) or 1.0
        moment = float(np.max(np.abs(own.rotational_inertia))) or mass * length**2
        return np.array([mass] + [np.sqrt(mass * moment)] * 3 + [moment] * 6)

    def _columns(self, bodies: Sequence[int]) -> Floats:
        """Return the regressor of some bodies at all states, (m, 10 n), up to an orthogonal transform that
        leaves few rows: of all bodies that were wanted so far, since subsets of them are wanted next."""
        if not set(bodies) <= set(self._reduced_bodies):
            self._reduced_bodies = list(dict.fromkeys([*self._reduced_bodies, *bodies]))
            wanted = self._regressor[:, _columns_of(self._reduced_bodies)]
            self._reduced = np.asarray(np.linalg.qr(wanted, mode="r"))
        return self._reduced[:, _columns_of([self._reduced_bodies.index(body) - 1 for body in bodies])]

    @cached_property
    def _regressor(self) -> Floats:
        """The regressor of all aligned bodies, the root first, at all states: (m, 10 n)."""
        aligned = self._aligned
        frames = [frame.name for frame in aligned.frames]
        model, rng = self._skeleton.model, np.random.default_rng(SEED)
        q = rng.uniform(-1.5, 1.5, (STATES, aligned.nq))
        if model.floating:
            q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
        for first in aligned.ball_places:
            q[:, first : first + 4] /= np.linalg.norm(q[:, first : first + 4], axis=1, keepdims=True)
        q = _coupled_q(aligned, q)
        S = np.eye(aligned.nv) if aligned.coupling is None else aligned.coupling.matrix()
        v, a = (rng.standard_normal((STATES, S.shape[1])) @ S.T for _ in range(2))
        # A frame has the pose that it had before the bodies got other frames: those of the bodies are taken.
        aligned = replace(aligned, frames=_body_frames(aligned))
        bodies = range(ROOT, len(aligned.bodies))
        numbers = [frames.index(str(body)) for body in bodies]
        Y = inertial_regressor_at(aligned, q, v, a, numbers)
        return np.asarray((S.T @ Y).reshape(-1, 10 * len(bodies)))


def _columns_of(bodies: Sequence[int]) -> Ints:
    """Return the numbers of the columns of bodies, of which the root, number -1, has the first."""
    return np.concatenate([np.arange(10) + 10 * (body + 1) for body in bodies])


def _coupled_q(mechanism: Mechanism, q: Floats) -> Floats:
    """Return configurations in which mimic joints follow their drivers."""
    coupling = mechanism.coupling
    if coupling is None:
        return q
    base = 7 if coupling.floating else 0
    return coupling.expand_q(q[:, : base + coupling.n_joints])


def _rounded(mechanism: Mechanism) -> Mechanism:
    """Round a mechanism to float64, with one frame at each body."""
    return replace(
        mechanism,
        gravity=rounded(mechanism.gravity),
        root=float_inertia(mechanism.root),
        bodies=tuple(
            replace(
                body,
                R=rounded(body.R),
                p=rounded(body.p),
                axis=rounded(body.axis),
                inertia=float_inertia(body.inertia),
            )
            for body in mechanism.bodies
        ),
        frames=_body_frames(mechanism),
    )


def _body_frames(mechanism: Mechanism) -> tuple[BodyFrame, ...]:
    """Return a frame at each body, named for its number."""
    return tuple(
        BodyFrame(str(body), body, np.eye(3), np.zeros(3)) for body in range(ROOT, len(mechanism.bodies))
    )
