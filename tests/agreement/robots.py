"""Small robots and deliberately broken backends for the tests of agreement."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from dynx.model import Inertial, Joint, Limits, Link, Mimic, Model, Pose
from dynx.model.elements import JointDynamics
from dynx.model.tree import Base
from dynx.rbd.jacobians import Reference
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats

BODY = Inertial(1.5, Pose((0.1, -0.05, 0.2), (0.3, -0.2, 0.1)), 0.02, 0.001, -0.002, 0.03, 0.0015, 0.025)
ASKEW = Pose((0.1, 0.2, 0.3), (0.4, 0.1, -0.3))


def arm(base: Base = "fixed") -> Model:
    """Return two revolute joints, a sliding one, a follower, a fixed tip; axes and origins are askew."""
    links = [Link(name, BODY) for name in ("foot", "upper", "lower", "slide", "finger")] + [Link("tip")]
    joints = [
        Joint(
            "shoulder", "revolute", "foot", "upper", Pose((0.1, 0.2, 0.3), (0.4, 0.1, -0.3)), (0.6, 0.0, 0.8)
        ),
        Joint(
            "elbow",
            "revolute",
            "upper",
            "lower",
            Pose((0.0, 0.3, 0.1), (-0.2, 0.5, 0.7)),
            (0.0, 1.0, 0.0),
            Limits(-2.0, 1.0),
            JointDynamics(0.3, 0.2, 0.1),
        ),
        Joint(
            "slider", "prismatic", "lower", "slide", Pose((0.2, 0.0, 0.1)), (0.0, 0.0, 1.0), Limits(0.0, 0.3)
        ),
        Joint("grip", "revolute", "slide", "finger", mimic=Mimic("elbow", -0.5, 0.1)),
        Joint("weld", "fixed", "finger", "tip", Pose((0.0, 0.1, 0.2), (0.1, 0.2, 0.3))),
    ]
    return Model.build("arm", links, joints, base=base, gravity=(0.3, -0.7, -9.81))


def pendulum(mass: float, length: float) -> Model:
    """Return a point mass on a massless rod about the y axis, hanging down at 0."""
    bob = Inertial(mass, Pose((0.0, 0.0, -length)))
    joint = Joint("hinge", "continuous", "world", "rod", axis=(0.0, 1.0, 0.0))
    return Model.build("pendulum", [Link("world"), Link("rod", bob)], [joint])


def massless_finger() -> Model:
    """Return a joint that moves no inertia: M is singular everywhere."""
    links = [Link("foot", BODY), Link("arm", BODY), Link("finger")]
    joints = [Joint("swing", "continuous", "foot", "arm"), Joint("point", "continuous", "arm", "finger")]
    return Model.build("massless_finger", links, joints)


def massless_chain(n_joints: int) -> Model:
    """Joints in series that move no inertia."""
    links = [Link("foot", BODY), *(Link(f"link{k}") for k in range(n_joints))]
    ends = pairwise(links)
    joints = [Joint(f"joint{k}", "continuous", a.name, b.name) for k, (a, b) in enumerate(ends)]
    return Model.build("massless_chain", links, joints)


def rock(base: Base = "fixed") -> Model:
    """Return a robot of one link and no joint."""
    return Model.build("rock", [Link("rock", BODY)], [], base=base)


class Broken(ReferenceBackend):
    """The reference under another name, for one defect at a time."""

    name: ClassVar[str] = "broken"


class GravityUpsideDown(Broken):
    """Gravity torque with the opposite sign."""

    def _gravity_torque(self, q: Floats) -> Floats:
        return -super()._gravity_torque(q)


class WrongTorque(Broken):
    """Inverse dynamics with the last velocity zero."""

    def _inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        slow = np.array(v)
        slow[..., -1] = 0.0
        return super()._inverse_dynamics(q, slow, a)


class TransposedRotation(Broken):
    """Transposed rotations."""

    def _frame_placements(self, q: Floats) -> Floats:
        T = super()._frame_placements(q)
        T[..., :3, :3] = np.swapaxes(T[..., :3, :3], -1, -2).copy()
        return T


class LocalMeansWorld(Broken):
    """Jacobians in ``world`` where ``local`` is requested."""

    def _jacobian(self, q: Floats, frame: int, reference: Reference) -> Floats:
        return super()._jacobian(q, frame, "world" if reference == "local" else reference)


class UndampedMass(Broken):
    """A mass matrix too large by one part in 10^9."""

    def _mass_matrix(self, q: Floats) -> Floats:
        return super()._mass_matrix(q) * (1.0 + 1e-9)


class DizzySolver(Broken):
    """Forward dynamics without velocity products."""

    def forward_dynamics(self, q: ArrayLike, v: ArrayLike, tau: ArrayLike, **options: Any) -> Floats:
        return super().forward_dynamics(q, 0.0 * np.asarray(v), tau, **options)


class Silent(Broken):
    """NaN in place of a result."""

    def _center_of_mass(self, q: Floats) -> Floats:
        return np.full((*q.shape[:-1], 3), np.nan)


DEFECTS: list[tuple[type[Broken], str]] = [
    (GravityUpsideDown, "gravity_torque"),
    (WrongTorque, "inverse_dynamics"),
    (TransposedRotation, "forward_kinematics"),
    (LocalMeansWorld, "jacobian"),
    (UndampedMass, "mass_matrix"),
    (DizzySolver, "forward_dynamics"),
    (Silent, "center_of_mass"),
]
"""Each defect, and a quantity that shows it."""
