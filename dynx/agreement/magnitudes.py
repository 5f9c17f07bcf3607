"""Magnitudes of a robot's motion, inertia and torques at given states, from which errors are scaled.

An error relative to the value itself means little where the value is small because large terms cancel (the
gravity torque of an upright arm, a torque about an axis through the centre of mass). The error of each
quantity is therefore divided by a bound on the terms of its sum. The bounds follow from the model, the sample
and the reference mass matrix, never from the compared results.

Torques use the Cauchy-Schwarz inequality in the metric of the mass matrix. The torque on coordinate i is
``sum over bodies of <J_i, A>``, with J_i the body's twist for a unit velocity of coordinate i and A its
proper acceleration (acceleration minus gravity), weighted by inertia, so ``|tau_i| <= |J_i|_M |A|_M`` with
``|J_i|_M = sqrt(M_ii)``, and ``|A|_M`` is at most ``sqrt(a'Ma)`` for the accelerations of the joints, ``|g|
sqrt(m)`` for gravity. For the velocity products c the bound is ``max |c_i| / sqrt(M_ii)`` plus the angular
speed times ``sqrt(v'Mv)``, because their terms may cancel too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from dynx.agreement.sampling import FrameSamples, Samples
from dynx.model.mechanism import ROOT, joint_entries
from dynx.rbd.kinematics import ancestry, body_poses
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import skew

EPS = float(np.finfo(np.float64).eps)

MIN_INERTIA_RATIO = 1e-2
"""Lower bound on M_ii of a rotating coordinate i, relative to the largest entry of the inertia tensor of
everything it moves. It is needed because rounding errors of the other entries reach M_ii (a rod that spins
about its axis). Where a link's inertia is not physical, M_ii may be the difference of large terms, zero or
negative; the bound is then that entry itself."""


class Magnitudes:
    """Magnitudes at each sample: arrays (n,), (n, nv), (n, nv, nv) for n samples."""

    def __init__(self, samples: Samples) -> None:
        self.samples = samples
        self._model = samples.model
        self._mechanism = samples.model.mechanism
        coupling = self._mechanism.coupling
        self._S = np.eye(self._mechanism.nv) if coupling is None else coupling.matrix()
        self._q_tree = samples.q if coupling is None else coupling.expand_q(samples.q)
        self._joint_q = joint_entries(self._mechanism, self._q_tree)
        base = [False] * 3 + [True] * 3 if samples.model.floating else []
        self._rotates = np.array(base + [body.revolute for body in self._mechanism.bodies], dtype=bool)

    # -- the robot ------------------------------------------------------------------------------

    @cached_property
    def depth(self) -> int:
        """Largest number of moving joints between the root and a body."""
        bodies = range(len(self._mechanism.bodies))
        return max((len(ancestry(self._mechanism, body)) for body in bodies), default=0)

    @cached_property
    def mass(self) -> float:
        """Moving mass [kg]."""
        masses = [float(abs(body.inertia.mass)) for body in self._mechanism.bodies]
        return sum(masses) + (abs(float(self._mechanism.root.mass)) if self._model.floating else 0.0)

    @cached_property
    def rotational_inertia(self) -> float:
        """Sum over the links of the largest entry of the central inertia tensor [kg m^2]."""
        return sum(
            float(np.max(np.abs(link.inertial.tensor)))
            for link in self._model.links
            if link.inertial is not None
        )

    @cached_property
    def gravity(self) -> float:
        """Strength of gravity [m/s^2]."""
        return float(np.linalg.norm(self._model.gravity))

    @cached_property
    def length(self) -> Floats:
        """(n,) Longest path [m] along the links from the world's origin to a frame or a centre of mass."""
        mechanism, n = self._mechanism, len(self.samples)
        start = np.linalg.norm(self.samples.q[:, :3], axis=-1) if self._model.floating else np.zeros(n)
        path = {ROOT: start}
        for index, body in enumerate(mechanism.bodies):
            slide = 0.0 if body.revolute else np.abs(self._joint_q[index])
            path[index] = path[body.parent] + float(np.linalg.norm(body.p)) + slide
        ends = [path[frame.body] + float(np.linalg.norm(frame.p)) for frame in mechanism.frames]
        inertias = [(ROOT, mechanism.root)]
        inertias += [(index, body.inertia) for index, body in enumerate(mechanism.bodies)]
        for index, inertia in inertias:
            if inertia.mass != 0.0:
                ends.append(path[index] + float(np.linalg.norm(inertia.first_moment) / abs(inertia.mass)))
        return np.asarray(np.max(np.stack(ends), axis=0))

    # -- motion -----------------------------------------------------------------------------------

    @cached_property
    def linear_column(self) -> Floats:
        """(n, nv) Bound on the speed of any point at a unit velocity of each coordinate."""
        tree = np.where(self._rotates, self.length[:, None], 1.0)
        return np.asarray(tree @ np.abs(self._S))

    @cached_property
    def angular_column(self) -> Floats:
        """(n, nv) Bound on the angular velocity of any body at a unit velocity of each coordinate."""
        return np.asarray(np.ones((len(self.samples), len(self._rotates))) @ np.abs(self._S))

    @cached_property
    def angular_speed(self) -> Floats:
        """(n,) Bound on the angular velocity of any body [rad/s]."""
        return self._fastest(np.where(self._rotates, self._tree_speed, 0.0))

    @cached_property
    def speed(self) -> Floats:
        """(n,) Bound on the speed of any point [m/s]."""
        return self._fastest(np.where(self._rotates, self.length[:, None], 1.0) * self._tree_speed)

    @cached_property
    def frequency(self) -> Floats:
        """(n,) Highest angular frequency [rad/s] of a pose along a motion at constant v.

        A pose is a product of sines and cosines of the joint angles between it and the root, whose
        frequencies add up; a prismatic joint counts with its speed over the length of the robot.
        """
        length = np.where(self.length > 0.0, self.length, 1.0)
        return self._fastest(np.where(self._rotates, 1.0, 1.0 / length[:, None]) * self._tree_speed)

    @cached_property
    def linear_column_rate(self) -> Floats:
        """(n, nv) Bound on the time derivative of the linear part of a Jacobian's column."""
        revolute = self.angular_speed * self.length + self.speed
        tree = np.where(self._rotates, revolute[:, None], self.angular_speed[:, None])
        return np.asarray(tree @ np.abs(self._S))

    @cached_property
    def angular_column_rate(self) -> Floats:
        """(n, nv) Bound on the time derivative of the angular part of a Jacobian's column."""
        return np.asarray(self.angular_column * self.angular_speed[:, None])

    # -- inertia and torque -----------------------------------------------------------------------

    @cached_property
    def mass_matrix(self) -> Floats:
        """(n, nv, nv)"""
        return np.asarray(self._reference.mass_matrix(self.samples.q))

    @cached_property
    def sqrt_diagonal(self) -> Floats:
        """(n, nv) sqrt(M_ii), with the lower bound `MIN_INERTIA_RATIO` on M_ii.

        M_ii is also at least the rounding error of the largest M_jj.
        """
        diagonal = np.abs(np.diagonal(self.mass_matrix, axis1=-2, axis2=-1))
        lower = self._min_diagonal @ (self._S * self._S)
        largest = np.max(diagonal, axis=-1, initial=0.0, keepdims=True)
        return np.asarray(np.sqrt(np.maximum(np.maximum(diagonal, lower), EPS * largest)))

    @cached_property
    def lowest_eigenvalue(self) -> Floats:
        """(n,) Lowest eigenvalue of the mass matrix at unit diagonal; infinite without coordinates."""
        scale = np.where(self.sqrt_diagonal > 0.0, self.sqrt_diagonal, 1.0)
        scaled = self.mass_matrix / (scale[:, :, None] * scale[:, None, :])
        return np.asarray(np.min(np.linalg.eigvalsh(scaled), axis=-1, initial=np.inf))

    @cached_property
    def inertia_bound(self) -> Floats:
        """(n, nv, nv) Bound on |M_ij| over all configurations, from the length of the robot."""
        L, A = self.linear_column, self.angular_column
        linear = self.mass * L[:, :, None] * L[:, None, :]
        return np.asarray(linear + self.rotational_inertia * A[:, :, None] * A[:, None, :])

    @cached_property
    def gravity_torque(self) -> Floats:
        """(n, nv)"""
        return np.asarray(self.sqrt_diagonal * (self.gravity * np.sqrt(self.mass)))

    @cached_property
    def bias_torque(self) -> Floats:
        """(n, nv)"""
        products = self._bias - self._reference.gravity_torque(self.samples.q)
        scale = np.where(self.sqrt_diagonal > 0.0, self.sqrt_diagonal, 1.0)
        largest = np.max(np.abs(products) / scale, axis=-1, initial=0.0)
        Mv = np.einsum("nij,nj->ni", self.mass_matrix, self.samples.v)
        vMv = np.abs(np.sum(Mv * self.samples.v, axis=-1))
        rotating = self.angular_speed * np.sqrt(vMv)
        # The moment v x m v of a translating body is zero, but it is computed as a difference of terms this
        # large.
        sliding = self.angular_column * vMv[:, None]
        return np.asarray(self.gravity_torque + self.sqrt_diagonal * (largest + rotating)[:, None] + sliding)

    @cached_property
    def torque(self) -> Floats:
        """(n, nv) Torque of inverse dynamics at the sample's acceleration."""
        Ma = np.einsum("nij,nj->ni", self.mass_matrix, self.samples.a)
        accelerating = np.sqrt(np.abs(np.sum(Ma * self.samples.a, axis=-1)))
        return np.asarray(self.bias_torque + self.sqrt_diagonal * accelerating[:, None])

    def solved_torque(self, a: Floats) -> Floats:
        """Return the largest entry (n,) of |M| |a| + |bias| + |tau|, to which rounding errors of solving for
        `a` are proportional; M_ii is bounded from below as in `sqrt_diagonal`."""
        M = np.abs(self.mass_matrix)
        diagonal = np.einsum("nii->ni", M)
        terms = np.einsum("nij,nj->ni", M, np.abs(a))
        terms = terms + np.maximum(self.sqrt_diagonal**2 - diagonal, 0.0) * np.abs(a)
        terms = terms + np.abs(self._bias) + np.abs(self.samples.tau) + self.bias_torque
        return np.asarray(np.max(terms, axis=-1, initial=0.0))

    @cached_property
    def wrench_torque(self) -> Floats:
        """(n, nv) Bound on the torque of the sample's wrench, whichever frame it acts on."""
        force = np.linalg.norm(self.samples.wrench[:, :3], axis=-1)[:, None]
        moment = np.linalg.norm(self.samples.wrench[:, 3:], axis=-1)[:, None]
        return np.asarray(self.linear_column * force + self.angular_column * moment)

    @cached_property
    def kinetic_energy(self) -> Floats:
        """(n,) (sum of sqrt(M_ii) |v_i|)^2 / 2, at least v'Mv / 2."""
        return np.asarray(0.5 * np.sum(self.sqrt_diagonal * np.abs(self.samples.v), axis=-1) ** 2)

    @cached_property
    def potential_energy(self) -> Floats:
        """(n,) Potential energy with all the mass at the point farthest from the world's origin."""
        whole = max(self.mass, abs(self._model.total_mass))
        return np.asarray(whole * self.gravity * self.length)

    @cached_property
    def _tree_speed(self) -> Floats:
        """(n, nv of the tree) Speed of every moving joint."""
        return np.asarray(np.abs(self.samples.v @ self._S.T))

    def _fastest(self, speeds: Floats) -> Floats:
        """Return the largest sum (n,) of `speeds` (n, nv of the tree) over the joints that carry a body."""
        bodies, first = len(self._mechanism.bodies), 6 if self._model.floating else 0
        between = np.zeros((bodies + 1, len(self._rotates)))
        between[:, :first] = 1.0
        for index in range(bodies):
            between[index + 1, [first + k for k in ancestry(self._mechanism, index)]] = 1.0
        return np.asarray(np.max(speeds @ between.T, axis=-1))

    @cached_property
    def _reference(self) -> ReferenceBackend:
        return ReferenceBackend(self._model)

    @cached_property
    def _bias(self) -> Floats:
        return self._reference.bias_torque(self.samples.q, self.samples.v)

    @cached_property
    def _min_diagonal(self) -> Floats:
        """(n, nv of the tree) Lower bound on M_ii of rotating coordinates, see `MIN_INERTIA_RATIO`."""
        mechanism, n = self._mechanism, len(self.samples)
        inertias = [mechanism.root, *(body.inertia for body in mechanism.bodies)]
        below: list[list[int]] = [[] for _ in inertias]
        below[0].append(0)
        for index in range(len(mechanism.bodies)):
            for ancestor in [*ancestry(mechanism, index), ROOT]:
                below[ancestor + 1].append(index + 1)
        mass = np.array([float(abs(inertia.mass)) for inertia in inertias])
        largest = np.array([float(np.max(np.abs(inertia.rotational_inertia))) for inertia in inertias])
        ratio = np.array([MIN_INERTIA_RATIO if _is_physical(inertia) else 1.0 for inertia in inertias])
        poses = body_poses(mechanism, self._q_tree)
        origin = np.stack([np.broadcast_to(p, (n, 3)) for p in poses.p], axis=1)
        first = 6 if self._model.floating else 0
        lower = np.zeros((n, mechanism.nv))
        for body, moved in enumerate(below):
            arms = np.linalg.norm(origin[:, moved] - origin[:, [body]], axis=-1)
            inertia = np.max(ratio[moved]) * np.sum(largest[moved] + mass[moved] * arms**2, axis=-1)
            if body > 0 and mechanism.bodies[body - 1].revolute:
                lower[:, first + body - 1] = inertia
            elif body == 0 and self._model.floating:
                lower[:, 3:6] = inertia[:, None]
        return lower


def _is_physical(inertia: RigidInertia) -> bool:
    """Check whether a rigid body can have this inertia, to within rounding: no principal moment about the
    centre of mass is negative or larger than the other two together."""
    largest = float(np.max(np.abs(inertia.rotational_inertia)))
    if inertia.mass < 0.0:
        return False
    H = skew(inertia.first_moment)
    central = inertia.rotational_inertia + (H @ H / inertia.mass if inertia.mass > 0.0 else 0.0)
    least, middle, most = np.linalg.eigvalsh(central).tolist()
    return bool(min(least, least + middle - most) >= -4.0 * EPS * largest)


# Natural magnitudes: bounds on the terms of a quantity, by which its error is divided.
#
# The table of quantities (`dynx.backends.quantities`) names one of these for each quantity.


Layout = Literal["samples", "frames", "every_frame", "derivatives"]
"""Leading axes of an array of results: samples; samples, then frames; or the entries of one of the two lists
of `FrameSamples`, then the samples of each."""

Scale = Callable[[Magnitudes], Floats]


@dataclass(frozen=True)
class NaturalMagnitude:
    """Bounds at every sample.

    `scale` broadcasts against the results, whose leading axes are those of `layout`. `derived_scale`
    is for results that dynx derives, if the derivation loses digits: columns of a derived mass matrix are
    differences of torques that contain gravity.
    """

    scale: Scale
    layout: Layout = "samples"
    derived_scale: Scale | None = None


def frame_samples(layout: Layout, samples: Samples) -> tuple[FrameSamples, ...]:
    """Return the entries along the first axis of layout ``every_frame`` or ``derivatives``."""
    return samples.every_frame if layout == "every_frame" else samples.derivatives


def largest(scale: Floats) -> Floats:
    """Return the largest entry (n, 1) of each sample's scale (n, nv), for errors in the max norm."""
    return np.asarray(np.max(scale, axis=-1, initial=0.0, keepdims=True))


def pose_scale(magnitudes: Magnitudes) -> Floats:
    """Return the scale (n, 1, 4, 4) of poses: 1 for rotations, the length of the robot for positions."""
    scale = np.ones((len(magnitudes.samples), 1, 4, 4))
    scale[:, :, :3, 3] = magnitudes.length[:, None, None]
    return scale


def mass_scale(magnitudes: Magnitudes) -> Floats:
    """Return the scale (n, nv, nv) of mass matrices: sqrt(M_ii M_jj)."""
    return np.asarray(magnitudes.sqrt_diagonal[:, :, None] * magnitudes.sqrt_diagonal[:, None, :])


def _derived_mass_scale(magnitudes: Magnitudes) -> Floats:
    gravity = magnitudes.gravity_torque
    return mass_scale(magnitudes) + gravity[:, :, None] + gravity[:, None, :]


def coriolis_scale(magnitudes: Magnitudes) -> Floats:
    """Return a bound (n, nv, nv) on m (Jp' dJp + dJp' Jp) + Jr' I dJr, from bounds on each factor.

    The bound on M times an angular speed would be too small: the lever arms of a robot that translates
    without rotating change with its speed, and these terms cancel (a point mass on the axis of a joint on a
    translating base).
    """
    L, rate, A = magnitudes.linear_column, magnitudes.linear_column_rate, magnitudes.angular_column
    linear = magnitudes.mass * (L[:, :, None] * rate[:, None, :] + rate[:, :, None] * L[:, None, :])
    angular = (
        magnitudes.rotational_inertia
        * _angular_velocity(magnitudes)[:, None, None]
        * A[:, :, None]
        * A[:, None, :]
    )
    return np.asarray(linear + angular)


def _regressor_scale(magnitudes: Magnitudes) -> Floats:
    """Return a bound (n, nv, 10 n_links) on the torque of a unit of each parameter, anywhere on the robot.

    With lever arm L, proper acceleration p and angular terms w = |alpha| + omega^2, a mass requires L p, a
    first moment L w + p, and a second moment w.
    """
    L, A = magnitudes.linear_column, magnitudes.angular_column
    p = (_linear_acceleration(magnitudes) + magnitudes.gravity)[:, None]
    w = (_angular_acceleration(magnitudes) + _angular_velocity(magnitudes) ** 2)[:, None]
    ten = [L * p] + [L * w + A * p] * 3 + [A * w] * 6
    return np.tile(np.stack(ten, axis=-1), len(magnitudes.samples.model.links))


def _derived_energy_scale(magnitudes: Magnitudes) -> Floats:
    v = np.abs(magnitudes.samples.v)
    return np.asarray(0.5 * np.einsum("ni,nij,nj->n", v, _derived_mass_scale(magnitudes), v))


def _momentum_scale(magnitudes: Magnitudes) -> Floats:
    linear = magnitudes.mass * magnitudes.speed
    angular = linear * magnitudes.length + magnitudes.rotational_inertia * _angular_velocity(magnitudes)
    return np.stack([linear] * 3 + [angular] * 3, axis=-1)


def wrench_scale(magnitudes: Magnitudes) -> Floats:
    """Return a bound (n, 6) on the wrench that moves all links, about any point within the robot's length of
    the world's origin."""
    links = [link.inertial for link in magnitudes.samples.model.links if link.inertial is not None]
    mass = sum(abs(inertial.mass) for inertial in links)
    force = mass * (_linear_acceleration(magnitudes) + magnitudes.gravity)
    spin = _angular_acceleration(magnitudes) + _angular_velocity(magnitudes) ** 2
    moment = force * magnitudes.length + magnitudes.rotational_inertia * spin
    return np.stack([force] * 3 + [moment] * 3, axis=-1)


def _twist(layout: Layout, linear: Scale, angular: Scale) -> NaturalMagnitude:
    """Return the bounds (entries, samples, 6 [, nv]) from bounds (n [, nv]) of linear and angular rows."""

    def scale(magnitudes: Magnitudes) -> Floats:
        rows = np.stack([linear(magnitudes)] * 3 + [angular(magnitudes)] * 3, axis=1)
        entries = frame_samples(layout, magnitudes.samples)
        return np.asarray(np.stack([rows[entry.samples] for entry in entries]))

    return NaturalMagnitude(scale, layout)


def _linear_acceleration(magnitudes: Magnitudes) -> Floats:
    a, v = np.abs(magnitudes.samples.a), np.abs(magnitudes.samples.v)
    return np.asarray(np.sum(magnitudes.linear_column * a + magnitudes.linear_column_rate * v, axis=-1))


def _angular_acceleration(magnitudes: Magnitudes) -> Floats:
    a, v = np.abs(magnitudes.samples.a), np.abs(magnitudes.samples.v)
    return np.asarray(np.sum(magnitudes.angular_column * a + magnitudes.angular_column_rate * v, axis=-1))


def _angular_velocity(magnitudes: Magnitudes) -> Floats:
    return np.asarray(np.sum(magnitudes.angular_column * np.abs(magnitudes.samples.v), axis=-1))


NATURAL_MAGNITUDES: dict[str, NaturalMagnitude] = {
    "pose": NaturalMagnitude(pose_scale, "frames"),
    "length": NaturalMagnitude(lambda s: s.length[:, None]),
    "jacobian": _twist("every_frame", lambda s: s.linear_column, lambda s: s.angular_column),
    "linear jacobian": NaturalMagnitude(lambda s: s.linear_column[:, None, :]),
    "jacobian rate": _twist("derivatives", lambda s: s.linear_column_rate, lambda s: s.angular_column_rate),
    "velocity": _twist("every_frame", lambda s: s.speed, _angular_velocity),
    "acceleration": _twist("derivatives", _linear_acceleration, _angular_acceleration),
    "torque": NaturalMagnitude(lambda s: largest(s.torque)),
    "bias torque": NaturalMagnitude(lambda s: largest(s.bias_torque)),
    "gravity torque": NaturalMagnitude(lambda s: largest(s.gravity_torque)),
    "inertia": NaturalMagnitude(mass_scale, derived_scale=_derived_mass_scale),
    "coriolis": NaturalMagnitude(coriolis_scale),
    "regressor": NaturalMagnitude(_regressor_scale),
    "joint wrenches": NaturalMagnitude(lambda s: wrench_scale(s)[:, None]),
    "base wrench": NaturalMagnitude(wrench_scale),
    "momentum": NaturalMagnitude(_momentum_scale),
    "kinetic energy": NaturalMagnitude(lambda s: s.kinetic_energy, derived_scale=_derived_energy_scale),
    "potential energy": NaturalMagnitude(lambda s: s.potential_energy),
}
"""Natural magnitudes by name."""
