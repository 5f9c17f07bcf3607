"""The backend `pybullet`: Bullet's inverse dynamics, mass matrix, Jacobian, kinematics and stepper.

The modules beside this one make Bullet's results agree with those of other engines: `inertia` (principal
inertias, ballast), `canonical_urdf` (the file that Bullet loads), `client` (loading and engine calls),
`robot` (conventions).
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from threading import RLock
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from dynx.backends.base import Backend
from dynx.engines.pybullet.inertia import Ballast, ballast_for
from dynx.engines.pybullet.library import bullet, bullet_version
from dynx.engines.pybullet.robot import BulletRobot
from dynx.errors import ArgumentError, ClosedError, EngineError
from dynx.model import Model
from dynx.model.numbers import checked_array
from dynx.rbd.jacobians import Reference
from dynx.spatial.scalar import Floats

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
    figure (``dynx bench ur5 --batch 65536 --threads 1``; other quantities are in docs/bench.md).
    """

    name: ClassVar[str] = "pybullet"

    def __init__(self, model: Model, *, validate: bool = True) -> None:
        super().__init__(model, validate=validate)
        engine = bullet()
        self._lock = RLock()
        mechanism = model.extended_mechanism
        self._ballast = ballast_for(mechanism)
        self._has_ballast = any(load != Ballast() for load in self._ballast)
        copies = (1, 2) if self._has_ballast else (0,)
        self._robots: list[BulletRobot] = []
        try:
            for times in copies:
                self._robots.append(BulletRobot(engine, mechanism, self._ballast, times))
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
        q0 = self._arguments.q(q0)
        index = self._index(frame)
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
                target, index, tree_q, bounds if bounded else None, int(iterations), float(residual)
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
        refined = self._robot().forward_dynamics(q, v, tau + residual)
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

    def _robot(self) -> BulletRobot:
        try:
            return self._robots[0]
        except IndexError:
            return self._all_robots()[0]

    def _all_robots(self) -> list[BulletRobot]:
        if not self._robots:
            raise ClosedError(f"this backend of {self.model.name} was closed; make a new one")
        return self._robots

    @staticmethod
    def _extrapolate(results: list[Floats]) -> Floats:
        once, twice = results
        return 2.0 * once - twice


_AT_ZEROS = {hook: getattr(PyBulletBackend, hook) for hook in ("_bias_torque", "_gravity_torque")}
"""Hooks that evaluate inverse dynamics where velocities or accelerations are zero."""
