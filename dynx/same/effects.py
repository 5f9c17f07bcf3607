"""Effect of one element: the change of poses, mass matrix and torque when it alone is as it was."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dynx.model import Model
from dynx.model.mechanism import Body, BodyFrame, Mechanism, build_mechanism
from dynx.rbd.kinematics import frame_placements
from dynx.rbd.rnea import inverse_dynamics
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Floats

STATES, SEED = 4, 0
"""Number of random states within limits, and their seed."""


@dataclass(frozen=True)
class ElementEffect:
    """Largest change over random states: of the position of a link [m], of its rotation (of an entry of the
    matrix), of an entry of the mass matrix relative to sqrt(M_ii M_jj), and of a torque relative to the
    largest one."""

    position: float
    rotation: float
    mass_matrix: float
    torque: float


@dataclass(frozen=True)
class Values:
    """Poses of the links, mass matrices and torques of a model at the states."""

    poses: Floats
    mass_matrix: Floats
    torque: Floats

    def effect_of(self, other: Values) -> ElementEffect | None:
        """Return the change to other values; None where the robots have other numbers of coordinates."""
        if self.torque.shape != other.torque.shape:
            return None
        diagonal = np.sqrt(np.abs(np.diagonal(self.mass_matrix, axis1=-2, axis2=-1)))
        scale = diagonal[:, :, None] * diagonal[:, None, :]
        apart = np.abs(other.mass_matrix - self.mass_matrix)
        largest = float(np.max(np.abs(self.torque), initial=0.0)) or 1.0
        poses = np.abs(other.poses - self.poses)
        return ElementEffect(
            float(np.max(np.linalg.norm(poses[..., :3, 3], axis=-1), initial=0.0)),
            float(np.max(poses[..., :3, :3], initial=0.0)),
            float(np.max(apart / np.where(scale > 0.0, scale, 1.0), initial=0.0)),
            float(np.max(np.abs(other.torque - self.torque), initial=0.0)) / largest,
        )


def values(model: Model, states: Model) -> Values:
    """Evaluate a model at random states within the limits of the model `states`."""
    from dynx.reference.backend import ReferenceBackend  # rarely needed

    q, v, a = _states(model, states)
    backend = ReferenceBackend(model)
    return Values(backend.forward_kinematics(q), backend.mass_matrix(q), backend.inverse_dynamics(q, v, a))


def values_of_variants(models: Sequence[Model], states: Model) -> list[Values]:
    """Evaluate models with the joints of the model `states`, whose numbers differ, at random states within
    its limits. They are evaluated together, which takes a tenth of the time of one by one."""
    mechanism = _stacked([build_mechanism(model) for model in models])
    q, v, a = (np.broadcast_to(x, (len(models), *x.shape)) for x in _states(states, states))
    tree_q, S = mechanism.tree_q(q), np.eye(mechanism.nv)
    if mechanism.coupling is not None:
        S = mechanism.coupling.matrix()
    poses = frame_placements(mechanism, tree_q)
    torque = inverse_dynamics(mechanism, tree_q, v @ S.T, a @ S.T) @ S
    # The columns of M are the torques of unit accelerations, at rest and without gravity.
    resting = replace(mechanism, gravity=np.zeros(3))
    units = np.broadcast_to(S.T[:, None, None], (S.shape[1], *q.shape[:-1], S.shape[0]))
    positions = np.broadcast_to(tree_q, (S.shape[1], *tree_q.shape))
    columns = inverse_dynamics(resting, positions, 0 * units, units)
    M = np.moveaxis(columns @ S, 0, -1)
    return [Values(*each) for each in zip(poses, M, torque, strict=True)]


def _states(model: Model, states: Model) -> tuple[Floats, Floats, Floats]:
    rng = np.random.default_rng(SEED)
    q = states.random(rng, STATES)
    v, a = (rng.uniform(-1.0, 1.0, (STATES, states.nv)) for _ in range(2))
    if model.nq != states.nq:
        q = model.random(rng, STATES)
        v, a = (rng.uniform(-1.0, 1.0, (STATES, model.nv)) for _ in range(2))
    return q, v, a


def _stacked(mechanisms: Sequence[Mechanism]) -> Mechanism:
    """Return a mechanism whose numbers are those of all, along an axis before that of the states."""

    def stack(numbers: Iterable[Floats]) -> Floats:
        return np.stack(list(numbers))[:, None]

    def inertia(each: Iterable[RigidInertia]) -> RigidInertia:
        # Inverse dynamics multiplies vectors by the masses, which therefore have one more axis.
        parts = [(one.mass.reshape(1), one.first_moment, one.rotational_inertia) for one in each]
        return RigidInertia(*(stack(numbers) for numbers in zip(*parts, strict=True)))

    def at(body: int) -> Body:
        every = [each.bodies[body] for each in mechanisms]
        return replace(
            every[0],
            R=stack(each.R for each in every),
            p=stack(each.p for each in every),
            axis=stack(each.axis for each in every),
            inertia=inertia(each.inertia for each in every),
        )

    def frame(number: int) -> BodyFrame:
        every = [each.frames[number] for each in mechanisms]
        return replace(every[0], R=stack(each.R for each in every), p=stack(each.p for each in every))

    first = mechanisms[0]
    return replace(
        first,
        root=inertia(each.root for each in mechanisms),
        bodies=tuple(map(at, range(len(first.bodies)))),
        frames=tuple(map(frame, range(len(first.frames)))),
    )
