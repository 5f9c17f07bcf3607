"""How large each quantity naturally is: what an error is divided by before it is judged.

An error relative to the value itself says nothing where the value is small because large terms
cancel (the gravity torque of an upright arm, a torque about an axis through the centre of mass).
Each quantity is therefore judged against a bound on the terms it is summed from, made here from the
model, the sample and the mass matrix, never from the answers under comparison.

Torques use the Cauchy-Schwarz inequality in the metric of the mass matrix. The torque on coordinate
i is ``sum over bodies of <J_i, A>``, with J_i the motion that coordinate i gives the body and A the
body's acceleration less gravity, weighted by inertia, so ``|tau_i| <= |J_i|_M |A|_M`` with
``|J_i|_M = sqrt(M_ii)``, and ``|A|_M`` is at most ``sqrt(a'Ma)`` for the accelerations of the
joints, ``|g| sqrt(m)`` for gravity. For the velocity products c it is at least ``max |c_i| / sqrt(M_ii)``,
to which the rate of turning times ``sqrt(v'Mv)`` is added, since they too may cancel.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from dynx.agreement.sampling import Samples
from dynx.model.mechanism import ROOT
from dynx.rbd.kinematics import ancestry, body_poses
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import skew

EPS = float(np.finfo(np.float64).eps)

SLENDER = 1e-2
"""M_ii is one component of the inertia tensor of all that joint i carries. Rounding in the others
reaches it, so it counts as at least this share of that tensor's size (a rod spun about its axis).
Where the file states an inertia that no body has, M_ii may be the difference of large terms and even
zero or negative; there it counts as the whole size."""


class Magnitudes:
    """Natural sizes at each sample: arrays (n,), (n, nv), (n, nv, nv) for n samples."""

    def __init__(self, samples: Samples) -> None:
        self.samples = samples
        self._model = samples.model
        self._mechanism = samples.model.mechanism
        coupling = self._mechanism.coupling
        self._S = np.eye(self._mechanism.nv) if coupling is None else coupling.matrix()
        self._q_tree = samples.q if coupling is None else coupling.expand_q(samples.q)
        self._joint_q = self._q_tree[:, 7 if samples.model.floating else 0 :]
        turning = [body.revolute for body in self._mechanism.bodies]
        base = [False] * 3 + [True] * 3 if samples.model.floating else []
        self._turning = np.array(base + turning, dtype=bool)

    # -- sizes of the robot ---------------------------------------------------------------------

    @cached_property
    def depth(self) -> int:
        """Most moving joints between the root and any body: how often rounding errors are handed on."""
        bodies = range(len(self._mechanism.bodies))
        return max((len(ancestry(self._mechanism, body)) for body in bodies), default=0)

    @cached_property
    def mass(self) -> float:
        """Moving mass [kg]."""
        masses = [float(abs(body.inertia.mass)) for body in self._mechanism.bodies]
        return sum(masses) + (abs(float(self._mechanism.root.mass)) if self._model.floating else 0.0)

    @cached_property
    def turning_inertia(self) -> float:
        """Sum of the sizes of the links' central inertia tensors [kg m^2]."""
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
        """(n,) Longest way [m] along the links from the world's origin to a frame or a mass centre."""
        mechanism, n = self._mechanism, len(self.samples)
        start = np.linalg.norm(self.samples.q[:, :3], axis=-1) if self._model.floating else np.zeros(n)
        way = {ROOT: start}
        for index, body in enumerate(mechanism.bodies):
            slide = 0.0 if body.revolute else np.abs(self._joint_q[:, index])
            way[index] = way[body.parent] + float(np.linalg.norm(body.p)) + slide
        ends = [way[frame.body] + float(np.linalg.norm(frame.p)) for frame in mechanism.frames]
        inertias = [(ROOT, mechanism.root)]
        inertias += [(index, body.inertia) for index, body in enumerate(mechanism.bodies)]
        for index, inertia in inertias:
            if inertia.mass != 0.0:
                ends.append(way[index] + float(np.linalg.norm(inertia.first_moment) / abs(inertia.mass)))
        return np.asarray(np.max(np.stack(ends), axis=0))

    # -- motion -----------------------------------------------------------------------------------

    @cached_property
    def linear_column(self) -> Floats:
        """(n, nv) Speed that a unit velocity of each coordinate can give a point of the robot."""
        tree = np.where(self._turning, self.length[:, None], 1.0)
        return np.asarray(tree @ np.abs(self._S))

    @cached_property
    def angular_column(self) -> Floats:
        """(n, nv) The same for angular velocity."""
        return np.asarray(np.ones((len(self.samples), len(self._turning))) @ np.abs(self._S))

    @cached_property
    def turning_speed(self) -> Floats:
        """(n,) Bound on the angular velocity of any body [rad/s]."""
        return self._fastest(np.where(self._turning, self._tree_speed, 0.0))

    @cached_property
    def speed(self) -> Floats:
        """(n,) Bound on the speed of any point [m/s]."""
        return self._fastest(np.where(self._turning, self.length[:, None], 1.0) * self._tree_speed)

    @cached_property
    def frequency(self) -> Floats:
        """(n,) Angular frequency [rad/s] to which poses are band-limited along a motion at constant v.

        A pose is a product of sines and cosines of the joint angles on its way to the root, whose
        frequencies add up; a sliding joint counts with its speed over the length of the robot.
        """
        length = np.where(self.length > 0.0, self.length, 1.0)
        return self._fastest(np.where(self._turning, 1.0, 1.0 / length[:, None]) * self._tree_speed)

    @cached_property
    def linear_column_rate(self) -> Floats:
        """(n, nv) Bound on the time derivative of the linear part of a Jacobian's column."""
        turned = self.turning_speed * self.length + self.speed
        tree = np.where(self._turning, turned[:, None], self.turning_speed[:, None])
        return np.asarray(tree @ np.abs(self._S))

    @cached_property
    def angular_column_rate(self) -> Floats:
        """(n, nv) The same for the angular part."""
        return np.asarray(self.angular_column * self.turning_speed[:, None])

    # -- inertia and torque -----------------------------------------------------------------------

    @cached_property
    def mass_matrix(self) -> Floats:
        """(n, nv, nv)"""
        return np.asarray(self._reference.mass_matrix(self.samples.q))

    @cached_property
    def root_inertia(self) -> Floats:
        """(n, nv) sqrt(M_ii): what torques are measured by, see `SLENDER` for its floor.

        M_ii also counts as at least the rounding error of the largest M_jj.
        """
        diagonal = np.abs(np.diagonal(self.mass_matrix, axis1=-2, axis2=-1))
        carried = self._carried @ (self._S * self._S)
        largest = np.max(diagonal, axis=-1, initial=0.0, keepdims=True)
        return np.asarray(np.sqrt(np.maximum(np.maximum(diagonal, carried), EPS * largest)))

    @cached_property
    def lowest_eigenvalue(self) -> Floats:
        """(n,) Of the mass matrix scaled to a unit diagonal; infinite for a robot that cannot move."""
        size = np.where(self.root_inertia > 0.0, self.root_inertia, 1.0)
        scaled = self.mass_matrix / (size[:, :, None] * size[:, None, :])
        return np.asarray(np.min(np.linalg.eigvalsh(scaled), axis=-1, initial=np.inf))

    @cached_property
    def inertia_bound(self) -> Floats:
        """(n, nv, nv) Bound on |M_ij| over all configurations of a robot this long."""
        L, A = self.linear_column, self.angular_column
        linear = self.mass * L[:, :, None] * L[:, None, :]
        return np.asarray(linear + self.turning_inertia * A[:, :, None] * A[:, None, :])

    @cached_property
    def gravity_torque(self) -> Floats:
        """(n, nv)"""
        return np.asarray(self.root_inertia * (self.gravity * np.sqrt(self.mass)))

    @cached_property
    def bias_torque(self) -> Floats:
        """(n, nv)"""
        products = self._bias - self._reference.gravity_torque(self.samples.q)
        size = np.where(self.root_inertia > 0.0, self.root_inertia, 1.0)
        strongest = np.max(np.abs(products) / size, axis=-1, initial=0.0)
        Mv = np.einsum("nij,nj->ni", self.mass_matrix, self.samples.v)
        vMv = np.abs(np.sum(Mv * self.samples.v, axis=-1))
        turned = self.turning_speed * np.sqrt(vMv)
        # The moment v x m v of a body that slides is zero, as the difference of terms of this size.
        slid = self.angular_column * vMv[:, None]
        return np.asarray(self.gravity_torque + self.root_inertia * (strongest + turned)[:, None] + slid)

    @cached_property
    def torque(self) -> Floats:
        """(n, nv) Of inverse dynamics with the sample's acceleration."""
        Ma = np.einsum("nij,nj->ni", self.mass_matrix, self.samples.a)
        strength = np.sqrt(np.abs(np.sum(Ma * self.samples.a, axis=-1)))
        return np.asarray(self.bias_torque + self.root_inertia * strength[:, None])

    def solved_torque(self, a: Floats) -> Floats:
        """(n,) Largest entry of |M| |a| + |bias| + |tau|: what rounding in solving for `a` scales with.

        M_ii counts as what it counts as in `root_inertia`.
        """
        M = np.abs(self.mass_matrix)
        diagonal = np.einsum("nii->ni", M)
        terms = np.einsum("nij,nj->ni", M, np.abs(a))
        terms = terms + np.maximum(self.root_inertia**2 - diagonal, 0.0) * np.abs(a)
        terms = terms + np.abs(self._bias) + np.abs(self.samples.tau) + self.bias_torque
        return np.asarray(np.max(terms, axis=-1, initial=0.0))

    @cached_property
    def wrench_torque(self) -> Floats:
        """(n, nv) Of the sample's wrench, wherever on the robot it acts."""
        force = np.linalg.norm(self.samples.wrench[:, :3], axis=-1)[:, None]
        moment = np.linalg.norm(self.samples.wrench[:, 3:], axis=-1)[:, None]
        return np.asarray(self.linear_column * force + self.angular_column * moment)

    @cached_property
    def kinetic_energy(self) -> Floats:
        """(n,) (sum of sqrt(M_ii) |v_i|)^2 / 2, at least v'Mv / 2."""
        return np.asarray(0.5 * np.sum(self.root_inertia * np.abs(self.samples.v), axis=-1) ** 2)

    @cached_property
    def potential_energy(self) -> Floats:
        """(n,) All the mass at the farthest point."""
        whole = max(self.mass, abs(self._model.total_mass))
        return np.asarray(whole * self.gravity * self.length)

    @cached_property
    def _tree_speed(self) -> Floats:
        """(n, nv of the tree) Speed of every moving joint."""
        return np.asarray(np.abs(self.samples.v @ self._S.T))

    def _fastest(self, speeds: Floats) -> Floats:
        """(n,) Largest sum of `speeds` (n, nv of the tree) on the way from a body to the root."""
        bodies, first = len(self._mechanism.bodies), 6 if self._model.floating else 0
        on_the_way = np.zeros((bodies + 1, len(self._turning)))
        on_the_way[:, :first] = 1.0
        for index in range(bodies):
            on_the_way[index + 1, [first + k for k in ancestry(self._mechanism, index)]] = 1.0
        return np.asarray(np.max(speeds @ on_the_way.T, axis=-1))

    @cached_property
    def _reference(self) -> ReferenceBackend:
        return ReferenceBackend(self._model)

    @cached_property
    def _bias(self) -> Floats:
        return self._reference.bias_torque(self.samples.q, self.samples.v)

    @cached_property
    def _carried(self) -> Floats:
        """(n, nv of the tree) What M_ii of a turning joint counts as at least: see `SLENDER`."""
        mechanism, n = self._mechanism, len(self.samples)
        inertias = [mechanism.root, *(body.inertia for body in mechanism.bodies)]
        below: list[list[int]] = [[] for _ in inertias]
        below[0].append(0)
        for index in range(len(mechanism.bodies)):
            for ancestor in [*ancestry(mechanism, index), ROOT]:
                below[ancestor + 1].append(index + 1)
        mass = np.array([float(abs(inertia.mass)) for inertia in inertias])
        spin = np.array([float(np.max(np.abs(inertia.rotational_inertia))) for inertia in inertias])
        share = np.array([SLENDER if _physical(inertia) else 1.0 for inertia in inertias])
        poses = body_poses(mechanism, self._q_tree)
        origin = np.stack([np.broadcast_to(p, (n, 3)) for p in poses.p], axis=1)
        first = 6 if self._model.floating else 0
        floor = np.zeros((n, mechanism.nv))
        for body, carried in enumerate(below):
            arms = np.linalg.norm(origin[:, carried] - origin[:, [body]], axis=-1)
            size = np.max(share[carried]) * np.sum(spin[carried] + mass[carried] * arms**2, axis=-1)
            if body > 0 and mechanism.bodies[body - 1].revolute:
                floor[:, first + body - 1] = size
            elif body == 0 and self._model.floating:
                floor[:, 3:6] = size[:, None]
        return floor


def _physical(inertia: RigidInertia) -> bool:
    """Whether some body has this inertia, to within rounding: no moment about the mass centre is negative,
    and none is larger than the other two together."""
    size = float(np.max(np.abs(inertia.rotational_inertia)))
    if inertia.mass < 0.0:
        return False
    H = skew(inertia.first_moment)
    central = inertia.rotational_inertia + (H @ H / inertia.mass if inertia.mass > 0.0 else 0.0)
    least, middle, most = np.linalg.eigvalsh(central).tolist()
    return bool(min(least, least + middle - most) >= -4.0 * EPS * size)
