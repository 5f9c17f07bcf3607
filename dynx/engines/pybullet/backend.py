"""The backend `pybullet`: Bullet's inverse dynamics, mass matrix, Jacobian, kinematics and stepper.

The modules beside this one make Bullet's results agree with those of other engines: `inertia` (principal
inertias, ballast), `canonical_urdf` (the file that Bullet loads), `client` (loading and engine calls),
`robot` (conventions).

**Conventions.** At every instant, Bullet's world is the inertial frame C of the root (centre of mass,
principal axes): the base never moves in Bullet, gravity is rotated instead, and the pose of the base is
composed in NumPy. Unlike Bullet's own decoding of the attitude, that is exact at every attitude, and one
conversion X serves every quantity:

    (angular, linear) of C  =  X (linear, angular) of the base frame.

With a fixed base C is the base frame and there is nothing to convert.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isfinite
from threading import RLock
from types import ModuleType
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.backends.base import Backend
from dynx.engines.pybullet.canonical_urdf import Ballast, PrincipalBody, ballast_for, bullet_tree
from dynx.engines.pybullet.client import CanonicalClient, refuse_many_joints
from dynx.engines.pybullet.library import bullet, bullet_version
from dynx.errors import ArgumentError, ClosedError, EngineError
from dynx.model import Model
from dynx.model.configuration import checked_q
from dynx.model.mechanism import ROOT, BodyFrame, Mechanism, float64
from dynx.model.numbers import checked_array, positive_number, whole_number
from dynx.rbd.jacobians import LOCAL_WORLD_ALIGNED, Reference
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import cross, quat_from_rotation, skew

_IDENTITY = np.eye(4)

MAX_ITERATIONS = 10**6
"""Largest number of iterations of Bullet's inverse kinematics, which no signal interrupts."""


class BulletQuantities:
    """A mechanism, with `times` copies of the ballast, in a Bullet client. Each call takes one sample."""

    def __init__(
        self, engine: ModuleType, mechanism: Mechanism, ballast: tuple[Ballast, ...], times: int
    ) -> None:
        """`mechanism` was merged in long double, and is rounded only once, when Bullet gets it."""
        tree = bullet_tree(mechanism, ballast, times)
        self._floating = mechanism.floating
        self._gravity: Floats = float64(mechanism.gravity)
        self._gravity_numbers: list[float] = self._gravity.tolist()
        self._T_base_C = float64(homogeneous(tree.root.axes, tree.root.center))
        self._X = float64(base_conversion(tree.root.axes, tree.root.center))
        self._X_inverse = float64(inverse_base_conversion(tree.root.axes, tree.root.center))
        # Bullet's unit of mass, a power of two, so that conversions are exact.
        self._unit = tree.unit
        self._inertias = [link.inertia for link in tree.links]
        # Frames in the inertial frames of their bodies, whose poses Bullet reports.
        self._frame_body = [frame.body for frame in mechanism.frames]
        self._offsets = np.array([self._offset(frame) for frame in mechanism.frames])
        self._points = [self._point(frame, tree.root) for frame in mechanism.frames]
        self._frame_in_body = [float64(homogeneous(frame.R, frame.p)) for frame in mechanism.frames]
        self._client = CanonicalClient(engine, tree, mechanism.name)

    def close(self) -> None:
        """Disconnect the client."""
        self._client.close()

    # -- kinematics ---------------------------------------------------------------------------

    def frame_placements(self, q: Floats) -> Floats:
        """Return T_world_frame of all frames (n, 4, 4)."""
        joints = self._joints(q)
        T_world_base, T_world_C = self._base(q)
        # The root comes last, so that the index ROOT = -1 selects it.
        T = np.zeros((len(joints) + 1, 4, 4))
        T[-1] = T_world_base
        if joints:
            T[:-1] = T_world_C @ pose_matrices(*self._client.com_poses(joints))
        return np.asarray(T[self._frame_body] @ self._offsets)

    def frame_placement(self, q: Floats, frame: int) -> Floats:
        """Return T_world_frame of one frame (4, 4)."""
        body = self._frame_body[frame]
        if body == ROOT:
            return np.asarray(self._base(q)[0].dot(self._offsets[frame]))
        T_C_frame = pose_matrix(*self._client.com_pose(self._joints(q), body)).dot(self._offsets[frame])
        return np.asarray(self._base(q)[1].dot(T_C_frame) if self._floating else T_C_frame)

    def jacobian(self, q: Floats, frame: int, reference: Reference) -> Floats:
        """Return J (6, nv) of one frame, linear rows first."""
        J = self._jacobian_in_C(q, frame)
        if reference == LOCAL_WORLD_ALIGNED and not self._floating:
            return J
        R_world_C = self._base(q)[1][:3, :3]
        if reference == "local":
            R_frame_C = self.frame_placement(q, frame)[:3, :3].T @ R_world_C
            return np.concatenate([R_frame_C @ J[:3], R_frame_C @ J[3:]])
        linear, angular = R_world_C @ J[:3], R_world_C @ J[3:]
        if reference == "world":
            linear = linear + skew(self.frame_placement(q, frame)[:3, 3]) @ angular
        return np.concatenate([linear, angular])

    # -- dynamics -----------------------------------------------------------------------------

    def inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        """Return tau (nv,)."""
        if not self._floating:
            joints = q.tolist()
            if not joints:
                return np.zeros(0)
            tau = self._client.inverse_dynamics(joints, v.tolist(), a.tolist(), self._gravity_numbers)
            return tau if self._unit == 1.0 else self._unit * tau
        gravity = self._gravity_in_C(q)
        v_C, a_C = self._X @ v[:6], self._X @ a[:6]
        # dv/dt in rotating axes to the classical acceleration of the centre of mass.
        a_C[3:] += cross(v_C[:3], v_C[3:])
        tau = self._client.inverse_dynamics(
            self._joints(q), [*v_C.tolist(), *v[6:].tolist()], [*a_C.tolist(), *a[6:].tolist()], gravity
        )
        # Bullet returns the force first.
        tau[:6] = self._X.T @ np.concatenate([tau[3:6], tau[:3]])
        return self._unit * tau

    def mass_matrix(self, q: Floats) -> Floats:
        """Return M (nv, nv), symmetric."""
        joints = self._joints(q)
        if not (joints or self._floating):
            return np.zeros((0, 0))
        M = self._client.mass_matrix(joints)
        if not self._floating:
            # Bullet copies one triangle to the other.
            return M if self._unit == 1.0 else self._unit * M
        M[:6] = self._X.T @ M[:6]
        M[:, :6] = M[:, :6] @ self._X
        return np.asarray(0.5 * self._unit * (M + M.T))

    def forward_dynamics(self, q: Floats, v: Floats, tau: Floats, *, weightless: bool = False) -> Floats:
        """Return a (nv,): the change of velocity in one step of Bullet's articulated-body algorithm, with
        `weightless` without gravity."""
        if not v.size:
            return np.zeros(0)
        gravity = [0.0, 0.0, 0.0] if weightless else self._gravity_in_C(q)
        if self._unit != 1.0:
            tau = tau / self._unit
        if not self._floating:
            return self._client.velocity_step(q.tolist(), v.tolist(), tau.tolist(), gravity)
        v_C = self._X @ v[:6]
        tau_C = self._X_inverse.T @ tau[:6]
        a = self._client.velocity_step(
            self._joints(q), [*v_C.tolist(), *v[6:].tolist()], [*tau_C.tolist(), *tau[6:].tolist()], gravity
        )
        if not isfinite(sum(a.tolist())):
            return a
        a[3:6] -= cross(v_C[:3], v_C[3:])
        a[:6] = self._X_inverse @ a[:6]
        return a

    # -- inverse kinematics -------------------------------------------------------------------

    def inverse_kinematics(
        self,
        T_world_target: Floats,
        frame: int,
        q: Floats,
        limits: tuple[Floats, Floats] | None,
        iterations: int,
        residual: float,
    ) -> Floats:
        """Return the joints (n,) at which Bullet's solver stopped, from `q` on; the base does not move."""
        body = self._frame_body[frame]
        if body == ROOT:
            return np.array(self._joints(q))
        T_world_C = self._base(q)[1]
        R_C_world = T_world_C[:3, :3].T
        T_world_body = T_world_target @ np.linalg.inv(self._frame_in_body[frame])
        position = R_C_world @ (T_world_body[:3, 3] - T_world_C[:3, 3])
        axes = R_C_world @ T_world_body[:3, :3] @ float64(self._inertias[body].axes)
        return self._client.inverse_kinematics(
            self._joints(q),
            body,
            position.tolist(),
            quat_from_rotation(axes).tolist(),
            None if limits is None else (limits[0].tolist(), limits[1].tolist()),
            iterations,
            residual,
        )

    # -- frames -------------------------------------------------------------------------------

    def _joints(self, q: Floats) -> list[float]:
        joints: list[float] = (q[7:] if self._floating else q).tolist()
        return joints

    def _base(self, q: Floats) -> tuple[Floats, Floats]:
        """Return T_world_base and T_world_C, (4, 4) each."""
        if not self._floating:
            return _IDENTITY, _IDENTITY
        T = pose_matrix(q[:3].tolist(), q[3:7].tolist())
        return T, np.asarray(T.dot(self._T_base_C))

    def _gravity_in_C(self, q: Floats) -> list[float]:
        if not self._floating:
            return self._gravity_numbers
        numbers: list[float] = (self._base(q)[1][:3, :3].T @ self._gravity).tolist()
        return numbers

    def _jacobian_in_C(self, q: Floats, frame: int) -> Floats:
        """Return J (6, nv) of the velocity of the frame's origin, in the axes of C."""
        joints = self._joints(q)
        body = self._frame_body[frame]
        if body != ROOT:
            J = self._client.jacobian(joints, body, self._points[frame])
            if self._floating:
                J[:, :6] = J[:, :6] @ self._X
            return J
        J = np.zeros((6, len(q) - 1 if self._floating else len(q)))
        if self._floating:
            # A frame fixed to the base: the velocity of C, shifted to the frame's origin.
            angular, linear = self._X[:3], self._X[3:]
            J[:3, :6] = linear - skew(np.array(self._points[frame])) @ angular
            J[3:, :6] = angular
        return J

    def _offset(self, frame: BodyFrame) -> Floats:
        T = homogeneous(frame.R, frame.p)
        if frame.body != ROOT:
            inertia = self._inertias[frame.body]
            R = inertia.axes.T @ frame.R
            T = homogeneous(R, inertia.axes.T @ (frame.p - inertia.center))
        return float64(T)

    def _point(self, frame: BodyFrame, root: PrincipalBody) -> list[float]:
        """Return the frame's origin relative to its body's (for the root: to C), along the principal axes."""
        if frame.body == ROOT:
            point = root.axes.T @ (frame.p - root.center)
        else:
            point = self._inertias[frame.body].axes.T @ frame.p
        numbers: list[float] = float64(point).tolist()
        return numbers


def pose_matrices(position: ArrayLike, quat_xyzw: ArrayLike) -> Floats:
    """Return the homogeneous matrices (..., 4, 4) from positions (..., 3) and unit quaternions (..., 4).

    The rotation is linear in the products of the quaternion's entries, so one small matrix product computes
    it about ten times as fast as entry by entry.
    """
    quat = np.asarray(quat_xyzw, dtype=np.float64)
    products = quat[..., :, None] * quat[..., None, :]
    T = (products.reshape(*quat.shape[:-1], 16) @ _FROM_PRODUCTS).reshape(*quat.shape[:-1], 4, 4)
    T += _IDENTITY
    T[..., :3, 3] = position
    return np.asarray(T)


def pose_matrix(position: Sequence[float], quat_xyzw: Sequence[float]) -> Floats:
    """Return the homogeneous matrix (4, 4) from one position and one unit quaternion.

    Written in plain Python, which takes a third of the time of `pose_matrices` for one pose.
    """
    px, py, pz = position
    x, y, z, w = quat_xyzw
    xx, yy, zz, xy, xz, yz = x * x, y * y, z * z, x * y, x * z, y * z
    wx, wy, wz = w * x, w * y, w * z
    return np.array(
        (
            (1.0 - 2.0 * (yy + zz), 2.0 * (xy - wz), 2.0 * (xz + wy), px),
            (2.0 * (xy + wz), 1.0 - 2.0 * (xx + zz), 2.0 * (yz - wx), py),
            (2.0 * (xz - wy), 2.0 * (yz + wx), 1.0 - 2.0 * (xx + yy), pz),
            (0.0, 0.0, 0.0, 1.0),
        )
    )


def _products_to_rotation() -> Floats:
    """Return the matrix (16, 16) from the products of x, y, z, w to the entries of [[R - 1, 0], [0, 0]]."""
    K = np.zeros((4, 4, 4, 4))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        K[j, j, i, i] = K[k, k, i, i] = -2.0
        K[j, k, j, k] = K[j, k, k, j] = 2.0
        K[i, 3, k, j], K[i, 3, j, k] = 2.0, -2.0
    return K.reshape(16, 16)


_FROM_PRODUCTS = _products_to_rotation()


def base_conversion(axes: Array, center: Array) -> Array:
    """Return X (6, 6), for axes (3, 3) and origin (3,) of C in the base frame; see the module docstring."""
    X = np.zeros((6, 6), dtype=axes.dtype)
    X[:3, 3:] = X[3:, :3] = axes.T
    X[3:, 3:] = -axes.T @ skew(center)
    return X


def inverse_base_conversion(axes: Array, center: Array) -> Array:
    """Return the inverse of `base_conversion`."""
    X = np.zeros((6, 6), dtype=axes.dtype)
    X[3:, :3] = X[:3, 3:] = axes
    X[:3, :3] = skew(center) @ axes
    return X


MIN_RESIDUAL_TO_REFINE = 1e-13
"""Residual, relative to the largest torque, below which an acceleration needs no refinement: a tenth of the
tolerance of `dynx agree`. Of most robots it is some 1e-14, of iCub 1e-11."""

MAX_REFINEMENT = 1e-6
"""Relative change above which a refinement corrects more than rounding."""

MAX_RESIDUAL = 1e-9
"""Residual of an acceleration, relative to the largest term, above which it is an error."""


class PyBulletBackend(Backend):
    """PyBullet behind the interface of `Backend`; at most 121 moving joints.

    Forward dynamics is Bullet's own stepper: the change of velocity in one step, refined once where digits
    were lost. It is solved from mass matrix and bias instead if Bullet cannot represent an inertia (see
    `ballast`), or if the step left a velocity exactly unchanged, because the stepper does not move a joint
    with less than 2.2e-16 kg m^2 (or kg).

    Threads may share a backend; a lock admits one call at a time (Bullet would hold the GIL anyway). Each
    backend has its own Bullet client, or two with ballast. Bullet has at most 1,024 clients of about 30 MB
    each, so close a backend after use. A pickle holds the model and the options.

    A batch is a Python loop over the engine's calls. For batches the backend ``compiled`` gives the same
    numbers, to rounding, about 300 times as fast: inverse dynamics of UR5, one thread, to one significant
    figure (``dynx bench ur5 --batch 65536 --threads 1``, which measures the other quantities too).
    """

    name: ClassVar[str] = "pybullet"

    def __init__(self, model: Model, *, validate: bool = True) -> None:
        # Before the links are merged, which takes seconds for a robot of thousands.
        refuse_many_joints(model.name, sum(joint.moves for joint in model.joints))
        super().__init__(model, validate=validate)
        engine = bullet()
        self._lock = RLock()
        mechanism = model.extended_mechanism
        self._ballast = ballast_for(mechanism)
        self._has_ballast = any(load != Ballast() for load in self._ballast)
        copies = (1, 2) if self._has_ballast else (0,)
        self._robots: list[BulletQuantities] = []
        try:
            for times in copies:
                self._robots.append(BulletQuantities(engine, mechanism, self._ballast, times))
        except BaseException:
            self._release()
            raise

    @classmethod
    def require_engine(cls) -> None:
        """Raise NotInstalledError if PyBullet cannot be imported."""
        bullet()

    @property
    def engine_version(self) -> str:
        """``pybullet`` and the version of its distribution."""
        return f"pybullet {bullet_version()}".strip()

    @property
    def ballast(self) -> bool:
        """True if the model has an inertia that Bullet refuses, so that results are extrapolated.

        Inverse dynamics and mass matrix are then 2 f(I + s) - f(I + 2 s), exact because both are
        affine in the inertia, and forward dynamics is solved from them instead of by the stepper.
        """
        return self._has_ballast

    @checks_types
    def engine_inverse_kinematics(
        self,
        T_world_target: ArrayLike,
        frame: str,
        q0: ArrayLike,
        *,
        iterations: int = 200,
        residual: float = 1e-9,
        limits: bool = False,
    ) -> Floats:
        """Return the configuration (nq,) at which Bullet's own solver (damped least squares) stops.

        `T_world_target` (4, 4) is the wanted pose of `frame`, `q0` (nq,) the start; a floating base keeps its
        pose in `q0`. `residual` [m] ends the iteration; `limits` adds Bullet's null-space task. The result
        often misses the target and may violate the limits: check it by `forward_kinematics`, as
        `inverse_kinematics` does. Mimic joints are treated as independent, and the solution is projected to
        the nearest configuration (least squares).
        """
        q0 = checked_q(self.model, q0, "q0")
        index = self._index(frame)
        count = whole_number("iterations", iterations, 1, MAX_ITERATIONS)
        residual = positive_number("residual", residual)
        target = checked_array("T_world_target", T_world_target, 4)
        if target.shape != (4, 4) or q0.ndim != 1:
            raise ArgumentError(
                f"T_world_target has shape {target.shape} and q0 {q0.shape}; "
                f"wanted (4, 4) and ({self.model.nq},)"
            )
        coupling = self._mechanism.coupling
        base = 7 if self.model.floating else 0
        tree_q = q0 if coupling is None else coupling.expand_q(q0)
        # Null-space limits are for a tree without mimic joints, and must be finite.
        bounds = (self.model.lower[base:], self.model.upper[base:])
        bounded = limits and coupling is None and bool(np.isfinite(bounds).all())
        with self._lock:
            joints = self._robot().inverse_kinematics(
                target, index, tree_q, bounds if bounded else None, count, residual
            )
        if coupling is not None:
            S = coupling.matrix()[-len(joints) :, -coupling.n_joints :]
            joints = np.linalg.lstsq(S, joints - np.array(coupling.offset), rcond=None)[0]
        return np.concatenate([q0[:base], joints])

    # -- hooks --------------------------------------------------------------------------------

    def _frame_placements(self, q: Floats) -> Floats:
        with self._lock:
            return self._robot().frame_placements(q)

    def _frame_placement(self, q: Floats, frame: int) -> Floats:
        with self._lock:
            return self._robot().frame_placement(q, frame)

    def _jacobian(self, q: Floats, frame: int, reference: Reference) -> Floats:
        with self._lock:
            return self._robot().jacobian(q, frame, reference)

    def _inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        with self._lock:
            robots = self._robots or self._all_robots()
            if len(robots) == 1:
                return robots[0].inverse_dynamics(q, v, a)
            return self._extrapolate([robot.inverse_dynamics(q, v, a) for robot in robots])

    def _sample_hook(self, hook: str, arguments: int, details: tuple[Any, ...]) -> Callable[..., Any]:
        """Return the functions of bias and gravity torque with the zeros of inverse dynamics made once."""
        if getattr(type(self), hook) is not _AT_ZEROS.get(hook):
            return super()._sample_hook(hook, arguments, details)
        torque, zeros = type(self)._inverse_dynamics, np.zeros(self._mechanism.nv)
        if arguments == 1:
            return lambda backend, q: torque(backend, q, zeros, zeros)
        return lambda backend, q, v: torque(backend, q, v, zeros)

    def _mass_matrix(self, q: Floats) -> Floats:
        with self._lock:
            robots = self._robots or self._all_robots()
            if len(robots) == 1:
                return robots[0].mass_matrix(q)
            return self._extrapolate([robot.mass_matrix(q) for robot in robots])

    def _forward_dynamics(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        if self._has_ballast:
            return super()._forward_dynamics(q, v, tau)
        with self._lock:
            robot = self._robot()
            a = robot.forward_dynamics(q, v, tau)
            values = a.tolist()
            # Overflow in Bullet gives infinity or NaN, which the base class finds in the result.
            if not isfinite(sum(values)):
                return a
            if all(values):
                residual = (tau - robot.inverse_dynamics(q, v, a)).tolist()
                bound = MIN_RESIDUAL_TO_REFINE * max(map(abs, tau.tolist()), default=0.0)
                if max(map(abs, residual), default=0.0) <= bound:
                    return a
                return self._refine(q, v, tau, a, np.array(residual))
        return super()._forward_dynamics(q, v, tau)

    def _refine(self, q: Floats, v: Floats, tau: Floats, a: Floats, residual: Floats) -> Floats:
        """Refine `a`, which misses the torque by `residual`, by a step of iterative refinement, if its error
        is due to rounding.

        If the root is much lighter than the rest of the robot, Bullet's inversion of the base's inertia loses
        digits (ten at a ratio of 1e-6). A refinement that changes the result by more than `MAX_REFINEMENT` is
        not applied, because the error then has another cause, which refinement must not hide. Raises
        EngineError if too few digits are left.
        """
        # At rest and without gravity the rounding errors are relative to the residual.
        refined = a + self._robot().forward_dynamics(q, np.zeros_like(v), residual, weightless=True)
        if np.max(np.abs(refined - a)) <= MAX_REFINEMENT * np.max(np.abs(a)):
            return refined
        # Weight and velocity products may cancel, so a bound on them is used as the scale.
        speed, gravity = np.max(np.abs(v)), np.linalg.norm(self._mechanism.gravity)
        inertia = np.abs(self._mass_matrix(q))
        unbalanced = np.max(inertia) * (speed + speed**2 + gravity)
        terms = np.max(inertia @ np.abs(a)) + np.max(np.abs(tau)) + unbalanced
        if np.max(np.abs(residual)) > MAX_RESIDUAL * terms:
            raise EngineError(
                f"the stepper of pybullet loses too many digits on {self.model.name}: the acceleration found "
                f"misses the torque by {np.max(np.abs(residual)) / terms:.1g}, relative "
                "(are masses very unequal?)"
            )
        return a

    # -- life cycle ---------------------------------------------------------------------------

    def _release(self) -> None:
        with self._lock:
            while self._robots:
                self._robots.pop().close()

    def _robot(self) -> BulletQuantities:
        try:
            return self._robots[0]
        except IndexError:
            return self._all_robots()[0]

    def _all_robots(self) -> list[BulletQuantities]:
        if not self._robots:
            raise ClosedError(f"this backend of {self.model.name} was closed; make a new one")
        return self._robots

    @staticmethod
    def _extrapolate(results: list[Floats]) -> Floats:
        once, twice = results
        return 2.0 * once - twice


_AT_ZEROS = {hook: getattr(PyBulletBackend, hook) for hook in ("_bias_torque", "_gravity_torque")}
"""Hooks that evaluate inverse dynamics where velocities or accelerations are zero."""
