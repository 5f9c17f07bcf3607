"""Damping, dry friction and armature of joints in one step of a robot, which `ImplicitJoints` solves.

`OutsideJoints` are those and the springs of a robot in an engine that does not have them: a torque that the
engine applies has their effect.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dynx.backends.dynamics import EngineDynamics
from dynx.rbd.joint_friction import TOLERANCE, FrictionLaw, damped_equation
from dynx.spatial.manifold import integrate
from dynx.spatial.scalar import Floats
from dynx.steppers.layout import RobotLayout

MAX_COMPILED_OPERATIONS = 8000
"""Number of products in one solution above which NumPy takes less time than compilation is worth."""

BLOCK_CORRECTIONS = 8
"""Number of solutions after which modes are corrected one at a time."""

MAX_SOLUTIONS = 256
"""Number of solutions in one step; only a mass matrix that is not positive definite may need more."""


class ImplicitJoints:
    """Velocities at the end of a step under joint friction, by solutions of the law in a compiled kernel.

    The equation of motion is (M + armature) a = tau - bias - damping w - f, where w = v + h a is the velocity
    at the end of the step and f the torque of dry friction. Results depend on the arguments alone. Not safe
    for several threads at a time.
    """

    def __init__(
        self,
        law: FrictionLaw,
        friction: Floats,
        h: float,
        *,
        damping: Floats | None = None,
        armature: Floats | None = None,
    ) -> None:
        """`friction` [N m or N], `damping` [N m s/rad or N s/m] and `armature` [kg m^2 or kg] (nv,) of the
        coordinates, `h` [s] the length of a step."""
        self.law = law
        self._joints = list(law.joints)
        nv = len(law.below)
        self._friction: Floats = friction[self._joints]
        self._h = h
        self._inertia = np.array(law.inertia)
        self.damping: Floats = np.zeros(nv) if damping is None else damping
        self._armature: Floats = np.zeros(nv) if armature is None else armature
        self.torque: Floats = np.zeros(len(law.joints))
        """Torque (n,) of dry friction on the joints of the law in the last step."""
        self.net_torque: Floats = np.zeros(nv)
        """Torque (nv,) that the robot without armature needed for the acceleration of the last step."""
        self._kernel = None
        if law.operations <= MAX_COMPILED_OPERATIONS:
            # Imported here, because robots without joint friction need no compiler.
            from dynx.steppers.step_kernels import friction_kernel

            # The workspace is kept because its calls do not keep it.
            space = self._workspace = friction_kernel(law.joints, law.below).workspace()
            self._kernel = space.run
            slices = space.input_slices
            self._M, self._bias, self._tau, self._v, self._shift, self._single = slices[:6]
            self._inputs: Any = space.inputs
            constants = (self._friction, self._inertia, self.damping, self._armature, np.array([h]))
            for rows, value in zip(space.input_rows[6:], constants, strict=True):
                rows[:] = value
            self._motion: Floats = space.results[0]
            self.torque, self.net_torque, self._next_shift = space.results[1:4]
            self._first_a: Floats = space.results[4]
            self._unsettled: Any = space.output_rows[5][:1, 0].data
            self._no_shift = np.zeros(len(law.joints))

    def step(self, M: Floats, bias: Floats, tau: Floats, v: Floats) -> Floats:
        """Return the acceleration from velocity `v`, and 1 for coordinates that move, 0 for those that stick,
        (2, nv).

        `M` (nv, nv) is the symmetric mass matrix, `bias` (nv,) the torque without acceleration, `tau` (nv,)
        that of everything but joint friction.
        """
        if self._kernel is None:
            return self._step_densely(M, bias, tau, v)
        self._write(M, bias, tau, v)
        self._kernel()
        if self._unsettled[0] > 0.0:  # not where it is NaN, because the simulation diverged
            self._settle()
        return np.array(self._motion)

    def _write(self, M: Floats, bias: Floats, tau: Floats, v: Floats) -> None:
        """Write the arguments of a step into the inputs of the kernel."""
        inputs = self._inputs
        inputs[self._M] = M.ravel("K")
        inputs[self._bias], inputs[self._tau], inputs[self._v] = bias, tau, v

    def _settle(self) -> None:
        """Repeat the last solution with corrected modes until they are right."""
        assert self._kernel is not None
        inputs = self._inputs
        for count in range(1, MAX_SOLUTIONS):
            inputs[self._shift] = self._next_shift.copy()
            inputs[self._single.start] = float(count >= BLOCK_CORRECTIONS)
            self._kernel()
            if not self._unsettled[0] > 0.0:
                break
        inputs[self._shift], inputs[self._single.start] = self._no_shift, 0.0

    def with_modes(self, M: Floats, bias: Floats, tau: Floats, v: Floats, modes: Floats) -> Floats:
        """Return the acceleration (nv,) with modes (n,) that are not corrected; joints that stick reach
        velocity 0 from `v` after h."""
        if self._kernel is None:
            return self._solution(M, bias, tau, v, modes)[0]
        self._write(M, bias, tau, v)
        self._inputs[self._shift] = modes - np.sign(v[self._joints])
        self._kernel()
        self._inputs[self._shift] = self._no_shift
        return np.array(self._first_a)

    def _solution(
        self, M: Floats, bias: Floats, tau: Floats, v: Floats, modes: Floats
    ) -> tuple[Floats, Floats]:
        """Return the acceleration (nv,) for given modes (n,), and what is left of the torque (nv,)."""
        joints, h = self._joints, self._h
        A, rest = damped_equation(M, tau - bias, v, h, self.damping, self._armature)
        rest[joints] -= modes * self._friction
        stuck = np.zeros(len(v), dtype=bool)
        stuck[joints] = modes == 0.0
        free = ~stuck
        a = np.where(stuck, -v / h, 0.0)
        rest -= A @ a
        a[free] = np.linalg.solve(A[np.ix_(free, free)], rest[free])
        rest[stuck] -= A[np.ix_(stuck, free)] @ a[free]
        return a, rest

    def _step_densely(self, M: Floats, bias: Floats, tau: Floats, v: Floats) -> Floats:
        """Take a step by NumPy."""
        joints, h, friction = self._joints, self._h, self._friction
        modes = np.sign(v[joints])
        for count in range(MAX_SOLUTIONS):
            a, left = self._solution(M, bias, tau, v, modes)
            moves = np.ones(len(v))
            moves[joints] = np.abs(modes)
            self.torque = np.where(modes == 0.0, left[joints], modes * friction)
            speed = moves[joints] * (v + h * a)[joints]
            wanted = self.torque + speed * self._inertia / h
            bound = friction * (1.0 + TOLERANCE)
            change = np.sign(wanted - np.clip(wanted, -bound, bound)) - modes
            wrong = np.flatnonzero(change)
            if not wrong.size or not np.isfinite(a).all():
                break
            single = float(count >= BLOCK_CORRECTIONS)
            corrected = modes + np.clip(change, single - 2.0, 2.0 - single)
            if single:
                corrected[wrong[:-1]] = modes[wrong[:-1]]
            modes = corrected
        self.net_torque = tau - self.damping * (v + h * a) - self._armature * a
        self.net_torque[joints] -= self.torque
        return np.array([a, moves])


class OutsideJoints:
    """Joint dynamics of a robot that its engine does not have, as a torque in each of the engine's steps.

    The torque is exact where nothing but it acts on the robot. Forces that the engine alone knows, of
    contacts, constraints, and of joint limits where a joint reaches one, count as those of the step before,
    as they do for motors at the end of a step.
    """

    def __init__(
        self, robot: RobotLayout, in_engine: RobotLayout, dynamics: EngineDynamics, h: float, *, reached: bool
    ) -> None:
        """`in_engine` is the robot with the coefficients that the engine has, `dynamics` computes its mass
        matrix and bias, `h` [s] is the step of the engine; with `reached` contacts or constraints may act on
        the robot."""
        own, has = robot.coefficients(), in_engine.coefficients()
        self._dynamics, self._h, self._reached = dynamics, h, reached
        self._robot, self._limited = robot, robot.limited
        self._inertia = np.diag(has.armature)
        self._damping = has.damping
        friction = own.friction - has.friction
        law = FrictionLaw.of(robot.model, friction)
        # The equation is solved with all coefficients; what the engine has is not in the torque.
        self._solver = ImplicitJoints(law, friction, h, damping=own.damping, armature=own.armature)
        self._friction_only = all(
            map(np.array_equal, (has.damping, has.armature), (own.damping, own.armature))
        )
        self._joints = list(law.joints)
        self.moves: Floats = np.ones(len(own.damping))
        """1 for the coordinates that moved in the last step, 0 for those that stuck (nv,)."""
        self._springs = robot.springs if robot.stiffness is not in_engine.stiffness else None
        self.only_springs = self._friction_only and not friction.any()
        """True if the engine has all but the springs, whose torque depends on the configuration alone."""
        self.memory: tuple[Floats, Floats] | None = None
        """Velocity and torque (nv,) of the step before; None if there was no such step."""

    def torque(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        """Return what the engine is to apply (nv,) in a step from q, v in place of `tau` (nv,)."""
        if self._springs is not None:
            tau = tau + self._springs.torque(q)
        if self.only_springs:
            return tau
        M, bias = self._dynamics.mass_matrix_and_bias(q, v)
        if self.memory is not None and self._is_touched(q, v):
            before, applied = self.memory
            bias = applied - (M + self._inertia).dot((v - before) / self._h) - self._damping * v
        _, self.moves = self._solver.step(M, bias, tau, v)
        total: Floats = (tau if self._friction_only else self._solver.net_torque).copy()
        if self._friction_only:
            total[self._joints] -= self._solver.torque
        if self._reached or self._limited:
            self.memory = v, total
        return total

    def explicit_torque(self, q: Floats, v: Floats) -> Floats:
        """Return the torque (nv,) of springs at q and of damping at velocity `v`, beside motors whose torque
        is not known before the step."""
        damping = (self._damping - self._solver.damping) * v
        return damping if self._springs is None else damping + self._springs.torque(q)

    def _is_touched(self, q: Floats, v: Floats) -> bool:
        """Check whether the engine may have forces in a step from q, v that only it knows."""
        return self._reached or (self._limited and self._is_at_limit(q, v))

    def _is_at_limit(self, q: Floats, v: Floats) -> bool:
        """Check whether a joint is at a limit or beyond it, or reaches one in a step with its velocity."""
        robot, ahead = self._robot, self._h * v
        ahead[: 6 * robot.model.floating] = 0.0
        now, lower, upper = robot.joint_positions(q)
        # Unchecked: the world notices that a motion has diverged, and names its cause.
        floating, balls = robot.model.floating, robot.model.ball_places
        then, _, _ = robot.joint_positions(integrate(q, ahead, floating=floating, balls=balls))
        below, above = np.minimum(now, then) <= lower, np.maximum(now, then) >= upper
        return bool(below.any() or above.any())
