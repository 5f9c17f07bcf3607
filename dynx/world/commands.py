"""What acts during the steps of one call of `World.step`: torques, external forces and motors, checked and
evaluated before each step of the engine, or torques that it holds."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from math import hypot, isfinite
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from dynx.backends import Backend, backend
from dynx.backends.hooks import cholesky_solver
from dynx.errors import ArgumentError, ShapeError, UnknownNameError, UnsupportedFeatureError, nearest, shown
from dynx.model.numbers import checked_entries, real_array
from dynx.registry import DEFAULT_ENGINE
from dynx.spatial.scalar import Floats
from dynx.steppers.forces import NO_COMMANDS, NO_MOTORS, EngineCommand, ExternalForce, Forces, JointLaw
from dynx.steppers.layout import Layout, RobotLayout
from dynx.steppers.stepper import Feature, Stepper
from dynx.world.motors import Motor, combine
from dynx.world.notes import LastLoads, RobotLoad
from dynx.world.preparation import may_be_reached

if TYPE_CHECKING:
    from dynx.steppers.implicit_joints import OutsideJoints

_FLOAT64 = np.dtype(np.float64)


class RobotLoads:
    """The generalised force on one robot: given torques, external forces on its links, and its motors."""

    def __init__(self, robot: RobotLayout, in_engine: RobotLayout, h: float, *, reached: bool) -> None:
        """`in_engine` is the robot with the joint dynamics that the engine has, `h` its step [s]; with
        `reached` contacts or constraints may act on the robot."""
        self.name = robot.name
        self._robot, self._in_engine, self._reached = robot, in_engine, reached
        self._armature = np.diag(robot.coefficients().armature) if robot.armature.any() else None
        self.model = robot.model
        self._base = 6 if robot.model.floating else 0
        self._places: list[int] | None = None
        """Index of each coordinate in the positions of the joints, in a robot with ball joints, on which no
        motor acts."""
        if robot.model.ball_joints:
            skipped = 7 if self._base else 0
            self._places = [place - skipped for place in robot.model.mechanism.places[self._base :]]
        self._h = h
        self._nothing = np.zeros(robot.model.nv)
        self._motors: tuple[Motor, ...] = ()
        self.motor_torque: Floats = self._nothing[self._base :]
        """Torque (n,) of the motors on the joints in the last step in which they acted."""
        self.motor_memory: tuple[Floats, Floats] | None = None
        """Velocity and generalised force (nv,) of the step before, on which motors at the end of a step
        depend; None if there was no such step."""
        self.target_notes: list[str] = []
        """Sentences on targets of motors that are far beyond the limits of their joints."""
        self.gain_notes: list[str] = []
        """Sentence on gains of motors that are unstable in steps of the engine."""

    @cached_property
    def dynamics(self) -> Backend:
        """The backend that computes mass matrices and Jacobians."""
        return backend(DEFAULT_ENGINE, self.model, validate=False)

    def mass_matrix(self, q: Floats) -> Floats:
        """Return M (nv, nv) at q with the armature of the joints."""
        M = self.dynamics.mass_matrix(q)
        return M if self._armature is None else M + self._armature

    @cached_property
    def joints(self) -> OutsideJoints | None:
        """Joint dynamics that the engine does not have; None where it has all."""
        if self._robot is self._in_engine:
            return None
        # Imported here, because engines have most joint dynamics.
        from dynx.backends.dynamics import EngineDynamics
        from dynx.steppers.implicit_joints import OutsideJoints

        dynamics = EngineDynamics(self.dynamics)
        return OutsideJoints(self._robot, self._in_engine, dynamics, self._h, reached=self._reached)

    def notes(self, engine: type[Stepper]) -> Iterator[str]:
        """Yield one sentence for joint dynamics outside of the engine that are not exact, and for each of the
        engine's own that has an error."""
        ours, theirs = self._robot, self._in_engine
        limited = ours.limited
        if self.joints is not None and not self.joints.only_springs and (self._reached or limited):
            names = ("damping", "friction", "armature")
            outside = [name for name in names if (getattr(ours, name) != getattr(theirs, name)).any()]
            acts = "act" if outside[1:] else "acts"
            forces = (
                "contacts, constraints and reached joint limits" if self._reached else "reached joint limits"
            )
            yield (
                f"{', '.join(outside)} of the joints of {shown(self.name)} {acts} outside of the engine, "
                f"which does not have all of it exactly, with the forces of {forces} as they were in the "
                "step before"
            )
        present = {
            Feature.DAMPING: theirs.damping.any(),
            Feature.DRY_FRICTION: theirs.friction.any(),
            Feature.ARMATURE: theirs.armature.any(),
            Feature.SPRINGS: theirs.stiffness.any(),
        }
        for feature, error in engine.inexact.items():
            if present[feature]:
                yield f"{feature.value} of {shown(self.name)} in {engine.name}: {error}"
        yield from self.notes_on_springs()

    def notes_on_springs(self) -> Iterator[str]:
        """Yield one sentence for springs that are unstable at the start in steps of the engine."""
        springs = self._robot.springs
        if springs is not None:
            from dynx.steppers.stability import notes_on_springs  # most robots have none

            M = self.mass_matrix(self._robot.q)
            yield from notes_on_springs(self.model, springs, M, self._h, robot=f"{self.name}/")

    @property
    def has_motors(self) -> bool:
        """True if the robot has a motor in this call."""
        return bool(self._motors)

    @property
    def depends_on_joints(self) -> bool:
        """True if the motors depend on positions and velocities of joints alone, not on the whole motion."""
        return bool(self._motors) and not self._law.implicit

    @property
    def end_motors(self) -> JointLaw | None:
        """Motors whose law holds at the end of a step, for an engine that solves for it; None without any."""
        return self._end_motors if self._motors and self._law.implicit else None

    @property
    def law(self) -> tuple[JointLaw | None, Floats | None]:
        """Law of the motors, and 1 for the joints where it holds at the end of a step, else 0."""
        return (self._law, self._implicit_joints) if self._motors else (None, None)

    @property
    def memory(self) -> Floats | None:
        """All that is kept of the step before: `motor_memory` (2, nv), NaN without it, and (4, nv) with that
        of joint dynamics outside of the engine; None for nothing."""
        kept = None if self.motor_memory is None else np.array(self.motor_memory)
        outside = None if self.joints is None else self.joints.memory
        if outside is None:
            return kept
        absent = np.full((2, len(self._nothing)), np.nan)
        return np.concatenate([absent if kept is None else kept, np.array(outside)])

    @memory.setter
    def memory(self, rows: Floats | None) -> None:
        known = rows is not None and not np.isnan(rows[0]).any()
        self.motor_memory = None if rows is None or not known else (rows[0].copy(), rows[1].copy())
        if self.joints is not None:
            outside = None if rows is None or len(rows) < 4 else (rows[2].copy(), rows[3].copy())
            self.joints.memory = outside

    def changed_law(self, motors: Sequence[Motor]) -> tuple[JointLaw, Floats] | None:
        """Return the law of motors and the joints where it is implicit; None for those in use.

        Raises the errors of `combine`.
        """
        return None if [*map(id, motors)] == [*map(id, self._motors)] else combine(self.model, motors)

    def set_motors(self, motors: Sequence[Motor], changed: tuple[JointLaw, Floats] | None) -> None:
        """Use these motors in the next calls of `torque`; `changed` is their `changed_law`."""
        if changed is not None:
            law, implicit = self._law, self._implicit_joints = changed
            self._motors = tuple(motors)
            # At the end of the step: q + h v+ in place of q, v+ = v + h a in place of v.
            self._ahead = implicit * self._h * law.kp
            self._inertia = implicit * self._h * (law.kd + self._h * law.kp)
            self._metric = np.diag(np.concatenate([np.zeros(self._base), self._inertia]))
            self._end_motors = law._replace(
                kp=implicit * law.kp,
                kd=implicit * law.kd,
                torque=implicit * law.torque,
                max_force=np.where(implicit > 0.0, law.max_force, np.inf),
            )
            self._saturates = bool(np.isfinite(law.max_force).any())
            joints = slice(self.model.nq - len(law.kp), None)
            far = (
                np.maximum(self.model.lower[joints] - law.target, law.target - self.model.upper[joints]) > 1.0
            )
            if not self.target_notes and (far & (law.kp > 0.0)).any():
                from dynx.model.unlikely_inputs import target_notes

                self.target_notes += target_notes(self.model, self.name, law.kp, law.target)
            if not self.gain_notes:
                self._note_gains()

    @cached_property
    def _mobility(self) -> Floats:
        """Acceleration of each joint (n,) at the start for a unit of its own torque."""
        from dynx.steppers.stability import mobility_of

        return mobility_of(self.mass_matrix(self._robot.q))[self._base :]

    def _note_gains(self) -> None:
        """Keep a sentence on motors that are unstable at the start; contacts may keep their motion finite."""
        law, implicit = self._law, self._implicit_joints
        if ((1.0 - implicit) * (law.kp + law.kd) > 0.0).any():
            from dynx.steppers.stability import notes_on_gains  # a world without motors needs none

            names = self.model.coordinate_names
            self.gain_notes += notes_on_gains(self.name, names, law, implicit, self._mobility, self._h)

    def torque(
        self,
        q: Floats,
        v: Floats,
        tau: Floats | None,
        forces: Sequence[tuple[str, ExternalForce, float]],
        *,
        solved: bool = False,
    ) -> Floats:
        """Return the generalised force (nv,) in a step from q, v: `tau`, external forces on frames with their
        shares of the step, motors; with `solved` without `end_motors`, for which the engine solves."""
        total = self._pushed(q, tau, forces)
        if self._motors:
            total = self._with_motors(q, v, total, solved=solved)
        return total if self.joints is None else self.joints.torque(q, v, total)

    def torque_beside_motors(
        self,
        q: Floats,
        v: Floats,
        tau: Floats | None,
        forces: Sequence[tuple[str, ExternalForce, float]],
    ) -> Floats:
        """Return `torque` beside the engine's own motors, whose torque is known after the step only."""
        total = self._pushed(q, tau, forces)
        return total if self.joints is None else total + self.joints.explicit_torque(q, v)

    def refuse_engine_motors(self, motors: str) -> None:
        """Raise UnsupportedFeatureError for joint dynamics that the engine's own motors cannot have."""
        if self.joints is not None and self._robot.armature.any():
            raise UnsupportedFeatureError(
                f"{motors} is a motor inside the engine, without armature: give joint_armature=False, "
                "or use a torque controller"
            )
        if self._robot.friction.any():
            raise UnsupportedFeatureError(
                f"{motors} is a motor inside the engine, whose torque is unknown before the step, so that "
                "joints cannot stick: give joint_friction=False, in a simulation friction_slip above 0, "
                "or use a torque controller"
            )

    def _pushed(
        self, q: Floats, tau: Floats | None, forces: Sequence[tuple[str, ExternalForce, float]]
    ) -> Floats:
        """Return the torque `tau` plus that of external forces on frames."""
        total = self._nothing if tau is None else tau
        for frame, force, share in forces:
            J, wrench = force.at_frame(self.dynamics, frame, q, share)
            total = total + J.T @ wrench
        return total

    def torque_of_joints(self, positions: Floats, rates: Floats, tau: Floats | None) -> Floats:
        """Return `torque` without external forces where the motors depend on the joints alone.

        `positions` and `rates` (n,) are those of the joints."""
        total: Floats = (self._nothing if tau is None else tau).copy()
        total[self._base :] += self._saturated(self._motor_torque(positions, rates))
        return total

    def _motor_torque(self, positions: Floats, rates: Floats) -> Floats:
        law = self._law
        if self._places is not None:
            positions = positions[self._places]
        return law.torque + law.kp * (law.target - positions) + law.kd * (law.velocity - rates)

    def _saturated(self, motor: Floats) -> Floats:
        if self._saturates:
            motor = np.minimum(np.maximum(motor, -self._law.max_force), self._law.max_force)
        self.motor_torque = motor
        return motor

    def _with_motors(self, q: Floats, v: Floats, tau: Floats, *, solved: bool) -> Floats:
        base = self._base
        rates = v[base:]
        motor = self._motor_torque(q[7:] if base else q, rates)
        predicted = self._law.implicit and not solved
        if predicted:
            motor = self._implicit(q, v, tau, motor - self._ahead * rates)
        elif self._law.implicit:
            motor = (1.0 - self._implicit_joints) * motor
        total: Floats = tau.copy()
        total[base:] += self._saturated(motor)
        if predicted:
            self.motor_memory = (v, total)
        return total

    def _implicit(self, q: Floats, v: Floats, tau: Floats, motor: Floats) -> Floats:
        """Return the torque of motors whose law holds at the end of the step.

        With the torque `motor` for the acceleration 0, that for the acceleration a is motor - K a, where
        (M + K) a = motor + all other forces. The other forces, except `tau`, are those of the step before.
        """
        M = self.mass_matrix(q)
        if self.motor_memory is None:
            others = -self.dynamics.bias_torque(q, v)
        else:
            v_before, tau_before = self.motor_memory
            others = M.dot((v - v_before) / self._h) - tau_before
        others += tau
        others[self._base :] += motor
        return np.asarray(motor - self._inertia * _acceleration(M + self._metric, others)[self._base :])


def _acceleration(M: Floats, tau: Floats) -> Floats:
    """Return the solution a of M a = tau for a symmetric, positive definite M."""
    if not len(tau):
        return tau
    # NumPy's solver takes four times as long for matrices of this size.
    _, a, failed = cholesky_solver()(M, tau)
    # A joint that moves no mass keeps its velocity.
    return np.asarray(np.linalg.lstsq(M, tau)[0] if failed else a)


def checked_torques(
    torques: Mapping[str, ArrayLike], robots: Mapping[str, tuple[int, tuple[int]]]
) -> list[tuple[int, Floats]]:
    """Return the torque of each robot named; `robots` has the number of each and the shape of its torque.

    Raises UnknownNameError, ShapeError, DTypeError or NotFiniteError, naming the robot.
    """
    if type(torques) is not dict and not isinstance(torques, Mapping):
        raise _not_by_robot("torques", torques, robots)
    checked: list[tuple[int, Floats]] = []
    for name, tau in torques.items():
        try:
            number, shape = robots[name]
        except KeyError:
            number, shape = found_robot(name, robots)
        if type(tau) is not ndarray or tau.dtype is not _FLOAT64 or tau.shape != shape:
            tau = real_array(f"torque of {name}", tau)
            if tau.shape != shape:
                raise ShapeError(f"torque of {name} has shape {tau.shape}; wanted {shape}")
        # Entries are below the bound where their norm is, which of few numbers Python computes fastest.
        if not hypot(*tau.tolist()) < 1e50:
            checked_entries(f"torque of {name}", tau)
        checked.append((number, tau))
    return checked


_T = TypeVar("_T")


def _not_by_robot(name: str, given: object, robots: Iterable[str]) -> ArgumentError:
    """Return the error for an argument that is no dict, with the dict that is perhaps meant."""
    one = next(iter(robots), None)
    such = "" if one is None else f", such as {{{one!r}: ...}}"
    return ArgumentError(f"{name} is of type {type(given).__name__}; wanted a dict by robot{such}")


def found_robot(name: str, robots: Mapping[str, _T]) -> _T:
    """Return the entry of a robot; UnknownNameError for another name."""
    try:
        return robots[name]
    except (KeyError, TypeError):
        raise UnknownNameError(f"no robot {shown(name)}{nearest(name, robots)}") from None


OnFrames = Sequence[tuple[str, ExternalForce, float]]
"""External forces on frames of a robot, each with the share of the step in which it acts."""

MotorsOf = Mapping[str, "Motor | EngineCommand | Sequence[Motor]"]

Act = Callable[[Stepper], Forces | None]
"""Return what acts in the next step of the engine; None if a force of it is not finite."""

_NOTHING: list[tuple[int, Floats]] = []


class Commands:
    """Loads on the robots and bodies of one world, and what the engine still holds of earlier ones."""

    def __init__(
        self,
        layout: Layout,
        in_engine: Layout,
        robots: Mapping[str, int],
        bodies: Mapping[str, int],
        h: float,
        engine: type[Stepper],
    ) -> None:
        """`in_engine` is the layout that the engine has (`layout_for`)."""
        self._engine, self._h = engine, h
        self._layout = layout
        self._robots = robots
        self._bodies = bodies
        pairs = enumerate(zip(layout.robots, in_engine.robots, strict=True))
        self._loads = [RobotLoads(*pair, h, reached=may_be_reached(layout, k)) for k, pair in pairs]
        self._outside = frozenset(k for k, loads in enumerate(self._loads) if loads.joints is not None)
        """Robots with joint dynamics that the engine does not have."""
        shapes: list[tuple[int]] = [(robot.model.nv,) for robot in layout.robots]
        self._torques = {name: (k, shapes[k]) for name, k in robots.items()}
        self._floating = [robot.model.floating for robot in layout.robots]
        self._no_wrench = np.zeros((len(layout.bodies), 6))
        self._held: Sequence[tuple[int, Floats]] = _NOTHING
        self._wrenches: Floats = self._no_wrench
        self._on_frames: dict[int, OnFrames] = {}
        self._engine_commands: Mapping[int, EngineCommand] = NO_COMMANDS
        self._end_motors: Mapping[int, JointLaw] = NO_MOTORS
        """Motors at the end of the last step for which the engine solved."""
        self._restored: Mapping[str, Floats] | None = None
        """Torques of robots in the step before the state was restored; None after the next step."""
        self.forget()

    def of_robot(self, name: str) -> RobotLoads:
        """Return the loads on a robot; UnknownNameError for another name."""
        return self._loads[found_robot(name, self._robots)]

    def forget(self) -> None:
        """Forget all earlier steps: the engine is new, or its state was set."""
        self._more_than_torques = True
        self.remember({})

    def on_frames(self, robot: int) -> OnFrames:
        """Return the external forces on the frames of a robot in the last step, with their shares of it."""
        return self._on_frames.get(robot, ())

    def driving(self, robot: int, engine: Stepper) -> Floats:
        """Return the torque (nv,) given for a robot plus that of its motors in the last step; zero if no step
        was taken since the state was set."""
        loads, total = self._loads[robot], np.zeros(self._layout.robots[robot].model.nv)
        if self._restored is not None:
            return total + self._restored.get(loads.name, 0.0)
        for k, tau in self._held:
            if k == robot:
                total += tau
        if loads.has_motors:
            total[len(total) - len(loads.motor_torque) :] += loads.motor_torque
        if robot in self._engine_commands or robot in self._end_motors:
            own = engine.motor_torque(robot)
            total += np.nan if own is None else own
        return total

    def notes(self) -> Iterator[str]:
        """Yield one sentence for each inexact feature of a robot's joints, and those on targets and gains
        of motors."""
        for loads in self._loads:
            yield from loads.notes(self._engine)
            yield from loads.target_notes
            yield from loads.gain_notes

    def notes_on_springs(self) -> Iterator[str]:
        """Yield one sentence for each robot with springs that are unstable in steps of the engine."""
        for loads in self._loads:
            yield from loads.notes_on_springs()

    def last(self) -> LastLoads:
        """Return the loads of the last step."""
        pushed = np.flatnonzero(self._wrenches.any(axis=1)).tolist()
        held = dict(self._held)
        return LastLoads(
            [
                RobotLoad(k, loads.mass_matrix, held.get(k), *loads.law)
                for k, loads in enumerate(self._loads)
                if loads.has_motors or k in held
            ],
            {k: self._wrenches[k] for k in pushed},
        )

    def memory(self) -> dict[str, Floats]:
        """Return velocities and generalised forces (2 or 4, nv) of the step before, by the robots whose
        motors or joint dynamics depend on them."""
        kept = {name: self._loads[k].memory for name, k in self._robots.items()}
        return {name: rows for name, rows in kept.items() if rows is not None}

    def remember(self, memory: Mapping[str, Floats], torques: Mapping[str, Floats] | None = None) -> None:
        """Restore what `memory` returned, and the torques (nv,) of robots in the step before."""
        self._restored = {} if torques is None else dict(torques)
        for name, k in self._robots.items():
            self._loads[k].memory = memory.get(name)
        self._more_than_torques = True

    def hold(self, torques: Mapping[str, ArrayLike] | None, count: int) -> Forces | None:
        """Return what acts in the next `count` steps where these torques alone act in them.

        Returns None, and does nothing, where the engine must get them again before each of the steps.
        """
        held = _NOTHING if torques is None else checked_torques(torques, self._torques)
        if self._outside:
            return None
        if count > 1 and any(self._floating[k] and any(tau[:6].tolist()) for k, tau in held):
            return None
        self._held = held
        if self._more_than_torques:
            self._more_than_torques = False
            self._restored, self._engine_commands, self._end_motors = None, NO_COMMANDS, NO_MOTORS
            for loads in self._loads:
                loads.set_motors((), loads.changed_law(()))
            self._wrenches, self._on_frames = self._no_wrench, {}
            self._forget_steps(frozenset())
        return Forces(held)

    def plan(
        self,
        torques: Mapping[str, ArrayLike] | None,
        motors: MotorsOf | None,
        forces: Sequence[ExternalForce],
        time: float,
    ) -> Act:
        """Check what acts in the next steps, the first of which begins at `time` [s], and return the function
        that returns it before each of them."""
        given_torques = checked_torques({} if torques is None else torques, self._torques)
        frames, pushes = self._sort_forces(forces)
        commands = self._set_motors({} if motors is None else motors)
        self._more_than_torques, self._restored = True, None
        self._held, self._engine_commands = given_torques, commands
        self._end_motors = NO_MOTORS
        held = dict(given_torques)
        motored = frozenset(k for k, loads in enumerate(self._loads) if loads.has_motors)
        repeated = motored | frames.keys() | self._outside
        of_joints = {k for k in motored - frames.keys() - self._outside if self._loads[k].depends_on_joints}
        constant = [(k, tau) for k, tau in self._held if k not in repeated]
        self._forget_steps(motored)
        self._on_frames = {}
        steps = itertools.count()
        at_end = {k: each.end_motors for k, each in enumerate(self._loads) if each.end_motors is not None}

        def act(engine: Stepper) -> Forces | None:
            acting, t = constant.copy(), time + next(steps) * self._h
            if engine.solves_motors:
                self._end_motors = at_end
            for k in repeated:
                loads, given = self._loads[k], held.get(k)
                if k in of_joints:
                    tau = loads.torque_of_joints(*engine.joint_state(k), given)
                else:
                    on_frames = [(name, force, force.share(t, self._h)) for name, force in frames.get(k, ())]
                    self._on_frames[k] = on_frames
                    state = engine.robot_state(k)
                    if k in commands:
                        tau = loads.torque_beside_motors(*state, given, on_frames)
                    else:
                        tau = loads.torque(*state, given, on_frames, solved=engine.solves_motors)
                # A finite sum has finite entries; of few numbers, Python's is the fastest.
                if not isfinite(sum(tau.tolist())) and not np.isfinite(tau).all():
                    return None
                acting.append((k, tau))
            self._wrenches = self._sum(engine, pushes, t) if pushes else self._no_wrench
            return Forces(acting, self._wrenches if pushes else None, commands, self._end_motors)

        return act

    def _set_motors(self, motors: MotorsOf) -> Mapping[int, EngineCommand]:
        """Give the motors to their robots; return the commands to the engine's own motors."""
        if not isinstance(motors, Mapping):
            raise _not_by_robot("motors", motors, self._robots)
        commands: dict[int, EngineCommand] = {}
        given: dict[int, list[Motor]] = {}
        for name, listed in motors.items():
            k = found_robot(name, self._robots)
            if isinstance(listed, EngineCommand):
                command = listed.checked(self._layout.robots[k].model)
                if not isinstance(listed, self._engine.commands):
                    raise UnsupportedFeatureError(
                        f"the engine {self._engine.name!r} has no motors of its own; use those of dynx.world"
                    )
                self._loads[k].refuse_engine_motors(type(listed).__name__)
                commands[k] = command
                continue
            several: Sequence[object] = listed if isinstance(listed, tuple | list) else [listed]
            given[k] = []
            for each in several:
                if not isinstance(each, Motor):
                    raise ArgumentError(
                        f"a motor of {name} is {shown(each)}; wanted a Motor or EngineCommand"
                    )
                given[k].append(each)
        # All are checked first, so that an error leaves the motors of the step before in place.
        motored = [(loads, given.get(k, ())) for k, loads in enumerate(self._loads)]
        laws = [loads.changed_law(each) for loads, each in motored]
        for (loads, each), law in zip(motored, laws, strict=True):
            loads.set_motors(each, law)
        return commands or NO_COMMANDS

    def _sort_forces(
        self, forces: Sequence[ExternalForce]
    ) -> tuple[dict[int, list[tuple[str, ExternalForce]]], dict[int, list[ExternalForce]]]:
        """Return the external forces on the frames of each robot, and on each body, by number."""
        frames: dict[int, list[tuple[str, ExternalForce]]] = {}
        pushes: dict[int, list[ExternalForce]] = {}
        for force in forces:
            if not isinstance(force, ExternalForce):
                raise ArgumentError(f"a force is {shown(force)}; wanted an ExternalForce")
            owner, slash, frame = force.on.partition("/")
            if owner in self._robots and slash:
                k = self._robots[owner]
                self._layout.robots[k].model.frame_index(frame)
                frames.setdefault(k, []).append((frame, force))
            elif owner in self._bodies and not slash:
                k = self._bodies[owner]
                if self._layout.bodies[k].fixed:
                    raise ArgumentError(f"a force acts on {shown(owner)}, which is fixed in the world")
                pushes.setdefault(k, []).append(force)
            elif len(self._robots) == 1 and force.on in self._layout.robots[0].model.frame_names:
                frames.setdefault(0, []).append((force.on, force))
            else:
                raise UnknownNameError(
                    f"a force acts on {shown(force.on)}; wanted a body, robot/link or robot/frame"
                    f"{nearest(force.on, self._targets(force.on))}"
                )
        return frames, pushes

    def _targets(self, name: str) -> list[str]:
        """Return the names of parts that may be meant by `name`: frames with that name, or else all parts."""
        frames = [
            (frame, f"{robot}/{frame}")
            for robot, layout in self._named_robots()
            for frame in layout.model.frame_names
        ]
        same = [full for frame, full in frames if frame == name]
        alone = [frame for frame, _ in frames] if len(self._robots) == 1 else []
        return same or [*self._bodies, *alone, *(full for _, full in frames)]

    def _named_robots(self) -> list[tuple[str, RobotLayout]]:
        return [(name, self._layout.robots[k]) for name, k in self._robots.items()]

    def _sum(self, engine: Stepper, pushes: Mapping[int, Sequence[ExternalForce]], t: float) -> Floats:
        """Return the force and the moment on every body (n_bodies, 6) in the step at `t`, in world axes."""
        total: Floats = self._no_wrench.copy()
        for k, forces in pushes.items():
            T, center = engine.body_state(k).T_world_body, self._layout.bodies[k].center
            total[k] = np.sum(
                [force.at_center(T, center, force.share(t, self._h)) for force in forces], axis=0
            )
        return total

    def _forget_steps(self, motored: frozenset[int]) -> None:
        """Forget the step before, of robots without motors in the next one."""
        for k, loads in enumerate(self._loads):
            if k not in motored:
                loads.motor_memory = None


def with_scene_motors(
    scene_motors: Mapping[str, Sequence[Motor]],
    torques: Mapping[str, ArrayLike] | None,
    motors: MotorsOf | None,
) -> MotorsOf:
    """Add the motors of the scene on robots that neither `torques` nor `motors` name."""
    for name, given in (("torques", torques), ("motors", motors)):
        if given is not None and not isinstance(given, Mapping):
            raise ArgumentError(f"{name} is of type {type(given).__name__}; wanted a dict by robot")
    driven = {*(motors or ()), *(torques or ())}
    return {**{name: own for name, own in scene_motors.items() if name not in driven}, **(motors or {})}
