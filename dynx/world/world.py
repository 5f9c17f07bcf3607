"""`World`: a scene that moves, on any engine."""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types, described, takes
from dynx.errors import ArgumentError, DTypeError, UnknownNameError, nearest, shown
from dynx.model import Model, Pose
from dynx.model.geometry import Mesh
from dynx.model.numbers import MAX_INDEX, checked_bool, positive_seconds, whole_number
from dynx.model.package_search import StrPath
from dynx.option_names import ANSWERS, as_object, checks_option_names, refuse_options, right_name
from dynx.rbd.jacobians import LOCAL, checked_reference
from dynx.registry import door, explains_names
from dynx.spatial.scalar import Floats
from dynx.steppers.clock import MAX_STEPS, refuse_too_many_steps, step_count, steps_to
from dynx.steppers.forces import ExternalForce
from dynx.steppers.layout import ConstraintLayout, Layout, RobotLayout
from dynx.steppers.materials import InexactMaterial, inexact_materials, open_engine
from dynx.steppers.registry import renderer_of, world_class
from dynx.steppers.settings import changed_settings, checked_settings, ineffective_settings
from dynx.steppers.state import BodyState, RobotState, WorldState
from dynx.steppers.stepper import Stepper
from dynx.world.boxes import owner_pose
from dynx.world.commands import Commands, MotorsOf, RobotLoads, with_scene_motors
from dynx.world.contacts import MAX_RAY_LENGTH, ClosestPoints, Contact, MeanContact, RayHits
from dynx.world.motion import Motion, apply_state, checked_state
from dynx.world.notes import (
    Overlap,
    notes_on_angles,
    notes_on_engine,
    notes_on_gravity,
    notes_on_start,
    overlaps_of,
)
from dynx.world.preparation import JointDynamics, acting_layout, checked_options, layout_for, prepare
from dynx.world.scene.scene import MARGIN, Scene
from dynx.world.snapshot import Snapshot, read_snapshot, write_snapshot

if TYPE_CHECKING:
    from dynx.distance.avoidance import Avoidance
    from dynx.steppers.camera import Camera
    from dynx.world.camera import Picture
    from dynx.world.constraint_wrenches import ConstraintWrench, Reactions
    from dynx.world.contact_interval import ContactInterval
    from dynx.world.last_step import LastStep
    from dynx.world.queries import Queries
    from dynx.world.sensing import WorldSensors
    from dynx.world.sensors.readings import SensorReading


def scene_at(scene: Scene, state: WorldState) -> Scene:
    """Return the scene with its robots and bodies where they are at a state, at rest."""
    robots = [replace(robot, q=tuple(state.robots[robot.name].q.tolist()), v=None) for robot in scene.robots]
    bodies = [
        body
        if body.fixed
        else replace(body, pose=Pose.from_matrix(state.bodies[body.name].T_world_body), twist=(0.0,) * 6)
        for body in scene.bodies
    ]
    return replace(scene, robots=tuple(robots), bodies=tuple(bodies))


def run_for(
    duration: float,
    dt: float,
    step: Callable[..., None],
    fixed: Mapping[str, Any],
    loads: Callable[[], object] | None,
    *,
    real_time: bool,
) -> None:
    """Take steps for `duration` [s], rounded up to a multiple of `dt`, with the loads of a function or fixed
    ones."""
    refuse_too_many_steps("duration", positive_seconds("duration", duration), dt)
    n = steps_to(duration, dt)
    if loads is None and not real_time:
        step(n, **fixed)
        return
    began = time.perf_counter()
    for k in range(n):
        step(1, **(fixed if loads is None else _loads_of(loads, fixed)))
        if real_time:
            time.sleep(max(0.0, began + (k + 1) * dt - time.perf_counter()))


def _loads_of(loads: Callable[[], object], fixed: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments of the next step: those that `loads` gives, or else the fixed ones.

    Raises ArgumentError unless it gives a dict of torques, motors and forces.
    """
    given = loads()
    if not isinstance(given, Mapping):
        raise ArgumentError(f"loads returned {shown(given)}; wanted a dict of {', '.join(fixed)}")
    for name in given:
        if name not in fixed:
            clause = right_name(str(name), fixed, {"wrenches": "forces"})
            raise UnknownNameError(f"loads returned {shown(name)}{clause}")
    return {**fixed, **given}


def identity(layout: Layout, options: Mapping[str, Any]) -> str:
    """Return the SHA-256 of a layout and of the options of its world."""
    digest = hashlib.sha256()
    _feed(digest, layout)
    _feed(digest, sorted(options.items()))
    return digest.hexdigest()


_SPRING = ("stiffness", "spring_reference")
"""Fields of springs, of joints and of layouts of robots."""


def _feed(digest: Any, value: Any) -> None:
    digest.update(type(value).__name__.encode())
    if isinstance(value, np.ndarray):
        digest.update(repr(value.shape).encode() + np.ascontiguousarray(value).tobytes())
    elif isinstance(value, Model):
        for part in (value.name, value.base, value.base_pose, value.gravity, value.links, value.joints):
            _feed(digest, part)
    elif isinstance(value, Mesh):
        # The content of the file, not its place.
        _feed(digest, value.hull)
    elif is_dataclass(value):
        for field in fields(value):
            # Files of earlier versions have robots without armature and joints without springs, and all
            # constraints active.
            added = field.name in _SPRING or (isinstance(value, RobotLayout) and field.name == "armature")
            left_out = added and not np.any(getattr(value, field.name))
            if isinstance(value, ConstraintLayout) and field.name in _SWITCHES:
                left_out = getattr(value, field.name)
            if field.compare and not left_out:
                _feed(digest, getattr(value, field.name))
    elif isinstance(value, tuple | list):
        digest.update(repr(len(value)).encode())
        for each in value:
            _feed(digest, each)
    else:
        digest.update(repr(value).encode())


_SWITCHES = ("active", "collides")
"""Fields of constraints that are True in files of earlier versions."""

TorquesOf = Mapping[str, ArrayLike]
LoadsOf = Callable[["World"], Mapping[str, Any]]


@explains_names
@checks_types
class World:
    """The robots and bodies of a scene in motion, with contacts, in steps of `dt` [s].

    Each step consists of `substeps` steps of the engine.

    - `collisions`: whether there are contacts
    - `joint_limits`, `joint_damping`, `joint_friction`, `joint_armature`, `joint_springs`: whether the world
      has these properties of the robot descriptions. If the engine lacks a part of the joint dynamics, dynx
      computes this part
    - `settings`: settings of the engine (`World.settings`). The reference of worlds lists them
    - `keep_last_step`: whether the world keeps the state before each step of the engine, which
      `joint_wrenches` and `base_wrench` need. A world with sensors always keeps this state
    - `contact_interval` [s]: the time over which `mean_contacts` returns the mean of the contacts. The world
      then sums the contacts of each step of the engine

    With either of the last two options a step takes longer.

    Close a world by `close` or by a ``with`` block. dynx checks arguments before it calls the engine. A call
    that raises an error leaves the state unchanged.
    """

    def __init__(
        self,
        scene: Scene,
        engine: str = "pybullet",
        dt: float = 1e-3,
        *,
        substeps: int = 1,
        collisions: bool = True,
        joint_limits: bool = True,
        joint_damping: JointDynamics = True,
        joint_friction: JointDynamics = True,
        joint_armature: JointDynamics = True,
        joint_springs: JointDynamics = True,
        keep_last_step: bool = False,
        contact_interval: float | None = None,
        **settings: object,
    ) -> None:
        """Raises UnknownBackendError and NotInstalledError for an engine, UnknownNameError and ArgumentError
        for settings, DescriptionError for collision shapes, EngineLimitError for what the engine cannot
        represent."""
        self._kind = world_class(engine)
        self.scene = scene
        self.engine = engine
        """Name of the engine."""
        switches = {
            "collisions": collisions,
            "joint_limits": joint_limits,
            "joint_damping": joint_damping,
            "joint_friction": joint_friction,
            "joint_armature": joint_armature,
            "joint_springs": joint_springs,
        }
        self.options: Mapping[str, Any] = checked_options(dt, substeps, **switches)
        """Options of the world other than the engine's settings."""
        self.dt: float = self.options["dt"]
        self.substeps: int = self.options["substeps"]
        known = self._kind.settings
        self.settings: Mapping[str, Any] = checked_settings(
            engine, known, settings, ("engine", "substeps", *self.options)
        )
        """The engine's settings in use, by name."""
        self._layout = prepare(scene, **switches)
        self._scene_motors = {robot.name: robot.motors for robot in scene.robots if robot.motors}
        robots = {robot.name: k for k, robot in enumerate(self._layout.robots)}
        bodies = {body.name: k for k, body in enumerate(self._layout.bodies)}
        self._in_engine = layout_for(self._kind, self._layout)
        self._constraints = self._layout.constraints
        """The constraints of the scene as they are now."""
        self._commands = Commands(
            self._layout, self._in_engine, robots, bodies, self.dt / self.substeps, self._kind
        )
        self._identity: str | None = None
        self._motion = Motion(self._layout, self._commands, self._build, self.dt, self.substeps)
        self._last_step: LastStep | None = None
        self._sensors: WorldSensors | None = None
        self._rollout = 0
        if keep_last_step or scene.sensors:
            # Imported here, because most worlds do not need it.
            from dynx.world.last_step import LastStep

            layouts = self._with_constraints(self._layout), self._with_constraints(self._in_engine)
            self._last_step = LastStep(*layouts, self._commands, self.dt / self.substeps)
        if scene.sensors and self._last_step is not None:
            from dynx.world.sensing import WorldSensors

            self._sensors = WorldSensors(
                self._layout,
                scene.sensors,
                self.dt,
                self.substeps,
                self._last_step,
                lambda: self._motion.clock,
                lambda engine: self._queries.contacts(engine),
            )
        kept = {"keep_last_step": keep_last_step, "contact_interval": contact_interval}
        self._kept = {name: value for name, value in kept.items() if value is not None and value is not False}
        """Options on which no later step depends, as far as they are given."""
        self._contact_interval: ContactInterval | None = None
        if contact_interval is not None:
            from dynx.world.contact_interval import ContactInterval

            h = self.dt / self.substeps
            seconds = positive_seconds("contact_interval", contact_interval)
            refuse_too_many_steps("contact_interval", seconds, h)
            names = [collider.name for collider in self._layout.colliders]
            self._contact_interval = ContactInterval(names, steps_to(seconds, h))
        # Sensors read what the last step keeps before it keeps the next one.
        watchers = (self._last_step, self._sensors, self._contact_interval)
        self._watchers = [each for each in watchers if each is not None]
        """What is read around every step of the engine."""
        self._given = settings
        self._notes: tuple[str, ...] | None = self.notes_on_present_state()
        self._notes_at_start = self._notes
        self._notes_of_earlier_engines: tuple[str, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on parts that overlap at the start, constraints that the start violates, joints beyond
        their limits, robots whose accelerations have no bound, parts that are too fast for the step (after
        `set_state` and `set_active`, all of these at that state),
        coefficients of contact that the engine does not have, joint dynamics that are not exact, a step that
        is long, angles of the scene that look like degrees, and given settings that the engine changes.
        Targets of motors in later steps that look like degrees follow, gains of motors that are unstable at
        the start in steps of the engine, and faults that the engine found in its steps."""
        engine = self._motion.ready
        of_steps = () if engine is None else engine.notes()
        if self._notes is None:
            at_start = self._motion.notes_on_begin(notes_on_start)
            self._notes = (*at_start, *self._lasting_notes(self._given))
        earlier = self._notes_of_earlier_engines
        return tuple(dict.fromkeys((*self._notes, *self._commands.notes(), *earlier, *of_steps)))

    @property
    def version(self) -> str:
        """Version of the engine."""
        return self._motion.engine.version

    # -- motion -------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Time [s]."""
        return self._motion.time

    def step(
        self,
        n: int = 1,
        torques: TorquesOf | None = None,
        motors: MotorsOf | None = None,
        forces: Sequence[ExternalForce] = (),
        **wrong: NoReturn,
    ) -> None:
        """Take `n` steps of `dt`, during which torques, motors and external forces act.

        - `torques`: maps robots to generalised forces (nv,)
        - `motors`: maps robots to a motor or a list of motors. Every step of the engine evaluates the law of
          each motor. The motors of the scene act on robots that neither `torques` nor `motors` names
        - `forces`: each force acts from its start, a time of this world, for its duration

        Raises ArgumentError and its subclasses for invalid arguments, and DivergedError with the likely cause
        if the state is no longer finite. After DivergedError, and after Ctrl-C in a step, the world is at the
        last state that was read, or at a later state that is at most 1,000 steps old.
        """
        if wrong:  # checked here, because a decorator would take 4 % of a step of one body
            refuse_options("step", wrong, World.step, {"wrenches": "forces"})
        engine = self._motion.ready or self._motion.engine
        if type(forces) is not tuple and not isinstance(forces, tuple | list):
            raise ArgumentError(
                f"forces is of type {type(forces).__name__}; wanted a list of ExternalForce"
                f"{as_object(forces, 'ExternalForce')}"
            )
        if type(n) is not int or not 1 <= n <= MAX_STEPS:
            n = step_count(n, "run(duration) takes the time")
        if self._scene_motors:
            motors = with_scene_motors(self._scene_motors, torques, motors)
        no_motors = motors is None or (type(motors) is dict and not motors)
        if no_motors and not forces and not self._watchers:
            held = self._commands.hold(torques, n * self.substeps)
            if held is not None:
                self._motion.advance(engine, n, held)
                return
        act = self._commands.plan(torques, motors, forces, self._motion.time)
        for watcher in self._watchers:
            act = watcher.watched(act)
        try:
            self._motion.advance(engine, n, act=act)
            if self._sensors is not None:
                self._sensors.complete(engine)
        except BaseException:
            self._forget_steps()
            raise

    # It answers mistaken keywords itself.
    setattr(step, ANSWERS, True)

    @checks_option_names(wrenches="forces")
    def run(
        self,
        duration: float,
        *,
        torques: TorquesOf | None = None,
        motors: MotorsOf | None = None,
        forces: Sequence[ExternalForce] = (),
        loads: LoadsOf | None = None,
        real_time: bool = False,
    ) -> None:
        """Take steps for `duration` [s], rounded up to a multiple of `dt`.

        `loads(world)` is called before each step and returns a dict with the arguments of `step` that act
        during it (``torques``, ``motors``, ``forces``). Arguments that are not in the dict are those of
        `run`. With `real_time` no step is taken before its time has come on the clock of the machine.
        """
        _ = self._motion.engine
        real_time = checked_bool("real_time", real_time)
        if loads is not None and not takes(loads, 1):
            raise DTypeError(f"loads is {described(loads)}; wanted a function of the world")
        run_for(
            duration,
            self.dt,
            self.step,
            {"torques": torques, "motors": motors, "forces": forces},
            None if loads is None else lambda: loads(self),
            real_time=real_time,
        )

    def stepper_and_loads(self, robot: str) -> tuple[Stepper, RobotLoads]:
        """Return the stepper, and the loads of a robot, for a loop that steps without the checks of `step`;
        the time and the state of the world do not follow."""
        return self._motion.engine, self._commands.of_robot(robot)

    # -- what the joints transmit in a step ---------------------------------------------------

    def joint_wrenches(
        self, robot: str | None = None, *, frame: str | None = None, reference: str = LOCAL
    ) -> Floats:
        """Return the wrenches (n_joints, 6) [N, N m] that the parents of all joints of a robot exerted on
        their children in the last step of the engine.

        They follow from the state before the step, its acceleration, the external forces, the contacts and
        `constraint_wrenches`. The component along the axis of a joint is its `torque` plus its
        `limit_torque`, less the torque that damping, friction, armature and springs of the joint take.
        `Backend.joint_wrenches` describes the order, the signs and the options. `robot` may be left out if
        the scene has one.

        Raises ArgumentError without `keep_last_step`, or if no step was taken since the state was set.
        """
        return self._wrenches("joint_wrenches", robot, frame, reference)

    def base_wrench(
        self, robot: str | None = None, *, frame: str | None = None, reference: str = LOCAL
    ) -> Floats:
        """Return the wrench (6,) [N, N m] that the world exerted on the root link of a robot in the last step
        of the engine, besides external forces, contacts and constraints; see `joint_wrenches`."""
        return self._wrenches("base_wrench", robot, frame, reference)

    def torque(self, robot: str | None = None) -> Floats:
        """Return the sum (nv,) [N m or N] of the torque given for a robot and the torque of its motors in the
        last step of the engine (`WorldState.torques`), with the errors of `joint_wrenches`."""
        step = self._kept_step()
        step.require()
        return self.state.torques[self._layout.robots[step.number(robot)].name]

    @checks_types
    def constraint_wrenches(self, *, reference: str = LOCAL) -> tuple[ConstraintWrench, ...]:
        """Return the wrench of each constraint of the scene on both of its ends in the last step of the
        engine: force [N], then moment [N m].

        By default each is at the anchor of the constraint in the part, in the axes of the anchor;
        `reference` chooses other axes and points as for a Jacobian. They follow from the motion
        (`dynx.world.constraint_wrenches`), on every engine alike. Raises the errors of `joint_wrenches`.
        """
        axes = checked_reference(reference)
        return self._reactions().of_constraints(axes)

    def limit_torque(self, robot: str | None = None) -> Floats:
        """Return the torque (nv,) [N m or N] of the joint limits of a robot in the last step of the engine,
        with the errors of `joint_wrenches`."""
        k = self._kept_step().number(robot)
        found = self._reactions().limit_torques.get(k)
        return np.zeros(self._layout.robots[k].model.nv) if found is None else found

    def _reactions(self) -> Reactions:
        step, engine = self._kept_step(), self._motion.engine
        return step.reactions(engine, self.state, self.contacts())

    @property
    def rollout(self) -> int:
        """Number of the rollout, 0 at first. The random numbers of the sensors depend on it, like those of a
        simulation on `Noise.rollout`. Set it if the runs of a world shall have different noise."""
        return self._rollout

    @rollout.setter
    def rollout(self, number: int) -> None:
        self._rollout = whole_number("rollout", number, 0, MAX_INDEX)
        if self._sensors is not None:
            self._sensors.rollout = self._rollout

    def read_sensors(self) -> dict[str, SensorReading]:
        """Return the last reading of each sensor of the scene, by name.

        A sample is taken at the beginning of a step of the engine. You can read it after that step, or its
        delay later, until the next sample. A sensor without a reading since the state was set is absent, and
        ``readings["imu"]`` says so (ArgumentError; UnknownNameError for a sensor that the scene lacks).
        `save` keeps the samples that are held or delayed.
        """
        _ = self._motion.engine
        if self._sensors is None:
            from dynx.world.sensing import LastReadings

            return LastReadings()
        return self._sensors.readings(self.time)

    def _wrenches(self, quantity: str, robot: str | None, frame: str | None, reference: str) -> Floats:
        step, engine = self._kept_step(), self._motion.engine
        options = {"frame": frame, "reference": reference}
        return step.wrenches(robot, engine, self.state, self.contacts(), quantity, **options)

    def _kept_step(self) -> LastStep:
        if self._last_step is None:
            raise ArgumentError("this world does not keep its last step; make it with keep_last_step=True")
        return self._last_step

    # -- state --------------------------------------------------------------------------------

    @property
    def state(self) -> WorldState:
        """Time, q and v of each robot, pose and twist of each body.

        Raises DivergedError where they are not finite: the world is then at the state that was set, read or
        checked last.
        """
        return self._motion.state

    @checks_types
    def set_state(
        self,
        state: WorldState | None = None,
        *,
        robots: Mapping[str, RobotState | tuple[ArrayLike, ArrayLike | None]] | None = None,
        bodies: Mapping[str, BodyState | tuple[ArrayLike, ArrayLike | None]] | None = None,
    ) -> None:
        """Set the state of the world, or of the robots (q, v) and bodies (pose, twist) named.

            world.set_state(robots={"arm": (q, v)})         # (nq,), (nv,)
            world.set_state(bodies={"box": (dynx.Pose((0.4, 0.0, 0.3)), None)})  # at rest

        None for v or the twist means at rest. The pose is T_world_body (4, 4) or a `Pose`, the twist (6,) in
        the axes of the world. With `state` the time of the world becomes `state.time`; otherwise it does not
        change. dynx checks all arguments first.
        """
        _ = self._motion.engine
        if state is None and robots is None and bodies is None:
            raise ArgumentError("set_state was given nothing; wanted a state, robots= or bodies=")
        checked = checked_state(self._layout, state, robots or {}, bodies or {})
        self._forget_steps()
        clock = None if state is None else (checked.time, 0)
        self._motion.change(lambda engine: apply_state(engine, checked), clock)
        self._notes = None

    def reset(self) -> None:
        """Return to the initial state of the scene, at time 0, with the constraints that are active there."""
        self._forget_steps()
        self._use_constraints(self._layout.constraints)
        self._motion.reset()
        self._notes, self._notes_of_earlier_engines = self._notes_at_start, ()

    @checks_types
    def set_active(self, constraint: str | int, active: bool = True) -> None:
        """Switch a constraint of the scene on or off, by its name or its number.

            world.set_active("grip")         # Weld("arm/hand", "cup", name="grip", active=False)
            world.set_active("grip", False)

        A weld without `T_a_b` keeps the relative pose that its ends have when it is switched on. Other
        constraints pull their ends together. State and time stay the same. The scene goes on in a new
        engine, which takes as long as making the world. So `contacts` has no forces until the next step, and
        `joint_wrenches` needs a step first. Nothing happens to a constraint that is active already.

        Raises UnknownNameError, ArgumentError for a number, and the errors of making a world, after which
        everything is as before.
        """
        k = self._constraint_number(constraint)
        active = checked_bool("active", active)
        state, found = self._motion.state, self._constraints[k]
        if found.active == active:
            return
        if active and found.held:
            owners = (owner_pose(self._layout, end.owner, state) for end in (found.a, found.b))
            T_a, T_b = owners
            found = replace(found, a=found.a._replace(T=np.linalg.inv(T_a) @ T_b @ found.b.T))
        changed = list(self._constraints)
        changed[k] = replace(found, active=active)
        self._rebuild(tuple(changed))

    @checks_types
    def is_active(self, constraint: str | int) -> bool:
        """Check whether a constraint of the scene acts, by its name or its number.

        Raises UnknownNameError, and ArgumentError for a number."""
        return self._constraints[self._constraint_number(constraint)].active

    def _constraint_number(self, constraint: str | int) -> int:
        numbers = {each.name: k for k, each in enumerate(self._constraints) if each.name}
        if isinstance(constraint, str):
            if constraint not in numbers:
                known = nearest(constraint, numbers) if numbers else "; none of its constraints has a name"
                raise UnknownNameError(f"no constraint {shown(constraint)} in {self.scene.name}{known}")
            return numbers[constraint]
        if not self._constraints:
            raise ArgumentError(f"{self.scene.name} has no constraints")
        return whole_number("constraint", constraint, 0, len(self._constraints) - 1)

    def _rebuild(
        self,
        constraints: tuple[ConstraintLayout, ...],
        restore: Callable[[Stepper], object] | None = None,
    ) -> None:
        """Go on in a new engine with other constraints, at the present state or at one that is restored."""
        before, notes = self._constraints, tuple(self._motion.engine.notes())
        self._constraints = constraints
        try:
            self._motion.rebuild(restore)
        except BaseException:
            self._constraints = before
            raise
        self._use_constraints(constraints)
        self._notes_of_earlier_engines += notes
        self._forget_steps()
        self._notes = None

    def _use_constraints(self, constraints: tuple[ConstraintLayout, ...]) -> None:
        """Take constraints as the present ones."""
        self._constraints = constraints
        if self._last_step is not None:
            layouts = self._with_constraints(self._layout), self._with_constraints(self._in_engine)
            self._last_step.constrain(*layouts)

    def _with_constraints(self, layout: Layout) -> Layout:
        """Return a layout with the constraints that act now."""
        return acting_layout(replace(layout, constraints=self._constraints))

    def _switched(self) -> tuple[Floats | None, ...]:
        """Return the constraints as a snapshot has them."""
        if self._constraints == self._layout.constraints:
            return ()
        return tuple(each.a.T.copy() if each.active else None for each in self._constraints)

    def _forget_steps(self) -> None:
        """Forget what was read around the last steps: they did not lead to the present state."""
        for watcher in self._watchers:
            watcher.forget()

    def save(self) -> Snapshot:
        """Return everything that determines the later steps, which `restore` continues bit for bit."""
        engine = self._motion.engine
        return Snapshot(
            self.engine,
            engine.version,
            self.identity,
            self.time,
            *self._motion.clock,
            self._commands.memory(),
            engine.dump(),
            torques=dict(self.state.torques),
            samples={} if self._sensors is None else self._sensors.kept(),
            rollout=self._rollout,
            constraints=self._switched(),
        )

    def restore(self, snapshot: Snapshot) -> None:
        """Continue from a snapshot of this world, or of one with the same scene, engine and options.

        Raises ArgumentError for any other.
        """
        engine = self._motion.engine
        if not isinstance(snapshot, Snapshot):
            raise ArgumentError(f"snapshot is of type {type(snapshot).__name__}; wanted one of World.save")
        snapshot.require(self.engine, engine.version, self.identity)
        self._forget_steps()

        def load(engine: Stepper) -> None:
            engine.load(snapshot.data)
            self._commands.remember(snapshot.arrays, snapshot.torques)

        self.rollout = snapshot.rollout
        if self._sensors is not None:
            self._sensors.restore(snapshot.samples)
        constraints = self._layout.constraints
        if snapshot.constraints:
            constraints = tuple(
                replace(each, active=False)
                if T is None
                else replace(each, active=True, a=each.a._replace(T=T))
                for each, T in zip(constraints, snapshot.constraints, strict=True)
            )
        if self._switched() or snapshot.constraints:
            self._rebuild(constraints)
        self._motion.change(load, (snapshot.start, snapshot.steps))

    @checks_types
    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the world and its state to a file, from which `read` continues bit for bit; its suffix is
        .world, or it has none. The world that is read has `keep_last_step` and `contact_interval` of this
        one, and begins a new interval.

        Raises DescriptionError for a collision shape that a file cannot have, and ArgumentError for another
        suffix and for a file that cannot be written.
        """
        from dynx.world.scene.documents import scene_document

        options = {**self.options, **self._kept}
        given = {"engine": self.engine, "options": options, "settings": dict(self.settings)}
        write_snapshot(path, self.save(), {"scene": scene_document(self.scene), **given})

    def to_mjcf(self, **settings: object) -> str:
        """Return the world at the start of its scene as an MJCF document (`scene_to_mjcf`), with its options.

        For a world in MuJoCo it is the model that runs. For one in another engine it has the step, gravity,
        joint dynamics and coefficients of contact of the world, under the laws of MuJoCo, with `settings` of
        MuJoCo. Comments in it name the laws, the settings and the coefficients in effect of that engine.

        Raises the errors of `scene_to_mjcf`, and ArgumentError for settings of a world in MuJoCo, which has
        its own.
        """
        from dynx.world.mjcf import OtherEngine, layout_to_mjcf

        if self.engine == "mujoco":
            if settings:
                raise ArgumentError(
                    f"{next(iter(settings))} is given to to_mjcf of a world in mujoco, whose document has "
                    "the settings of the world; give it to World"
                )
            return layout_to_mjcf(self.scene, self._layout, self.options, self.settings)
        engine = OtherEngine(self._motion.engine, self.settings, tuple(self._commands.notes()))
        return layout_to_mjcf(self.scene, self._layout, self.options, settings, engine)

    @classmethod
    @checks_types
    def read(cls, path: StrPath, *, package_dirs: Iterable[StrPath] = ()) -> World:
        """Return the world of a file that `write` wrote, in its state, without the notes on its start.

        Robots and meshes are read in the libraries of robots and in `package_dirs` only. Read files that you
        trust: a changed state can end the process inside an engine, and a robot in a ``.xacro`` file is
        expanded, which evaluates expressions of it as Python code. Raises ArgumentError for a file that is
        damaged, of another version of the engine, or whose meshes changed.
        """
        from dynx.world.scene.documents import scene_from_document
        from dynx.world.scene.paths import ScenePaths

        snapshot, given = read_snapshot(path)
        scene = scene_from_document(given["scene"], ScenePaths(None, package_dirs))
        # Worlds of earlier versions had neither armature nor springs.
        options = {"joint_armature": False, "joint_springs": False, **given["options"]}
        world = cls(scene, given["engine"], **options, **given["settings"])
        try:
            world.restore(snapshot)
            defaults = {name: setting.default for name, setting in world._kind.settings.items()}
            chosen = {name: value for name, value in world.settings.items() if value != defaults[name]}
            world._notes = tuple(world._lasting_notes(chosen))
        except BaseException:
            world.close()
            raise
        return world

    @property
    def identity(self) -> str:
        """Hash of the scene, the options and the settings: worlds of one engine with the same identity take
        the same steps."""
        if self._identity is None:
            options = {**self.options, **self.settings}
            # Its effect is in the layout.
            del options["joint_springs"]
            # Files of earlier versions do not have these.
            added = {"joint_armature": False, "link_damping": 0.0, "friction_anchors": False}
            for name in added.keys() & options.keys():
                if options[name] == added[name]:
                    del options[name]
            self._identity = identity(self._layout, options)
        return self._identity

    # -- queries ------------------------------------------------------------------------------

    @checks_types
    def contacts(self, part: str | None = None) -> tuple[Contact, ...]:
        """Return the contacts of the last step of the engine, with their forces: all, or those of a part.

        A part is a body, ``robot/link``, or a robot for all its links. After the state was set, the contacts
        are those of the new state, without forces.
        """
        return self._queries.contacts(self._motion.engine, part)

    @checks_types
    def mean_contacts(self, part: str | None = None) -> tuple[MeanContact, ...]:
        """Return the mean force of each pair of parts that touched in the last `contact_interval`: of all
        pairs, or those of a part, which is named as in `contacts`.

        The interval begins anew where the state is set, and the mean is over the time since then if that is
        shorter; before the first step there is none. Raises ArgumentError without `contact_interval`.
        """
        if self._contact_interval is None:
            raise ArgumentError("this world sums no contacts; make it with contact_interval=, in seconds")
        colliders = None if part is None else self._queries.colliders(part)
        return self._contact_interval.means(self._motion.engine, colliders)

    def touching_pairs(self) -> frozenset[tuple[str, str]]:
        """Return the parts that have a contact in `contacts`, as pairs of names in the order of `Contact`.

        This takes a fraction of the time of `contacts`, because it reads neither points nor forces.
        """
        return self._queries.touching_pairs(self._motion.engine)

    def overlaps(self) -> tuple[Overlap, ...]:
        """Return the parts that may touch and overlap at the present state by more than bodies at rest do,
        the deepest first; an engine pushes them apart, often violently."""
        return overlaps_of(self._motion.engine)

    def inexact_materials(self) -> tuple[InexactMaterial, ...]:
        """Return the coefficients of contact that the engine does not have as the scene states them."""
        return inexact_materials(self._motion.engine)

    @checks_types
    def closest_points(
        self, a: str, b: str, within: float = 1.0, *, native: bool = False
    ) -> tuple[ClosestPoints, ...]:
        """Return the nearest points of two parts (a body, ``robot/link``, a robot), nearest first. There is
        one entry for each pair of their links at most `within` [m] apart, by `dynx.distance` or, if `native`,
        by the engine."""
        return self._queries.closest_points(self._motion.engine, self.state, a, b, within, native)

    @cached_property
    def _queries(self) -> Queries:
        """Questions about the scene, imported when the first is asked."""
        from dynx.world.queries import Queries

        return Queries(self.scene, self._layout)

    @checks_types
    def avoidance(
        self, robot: str | None = None, *, margin: float = MARGIN, self_margin: float | None = None
    ) -> Avoidance:
        """Return the obstacles of a robot at the present state, with their margins (`Scene.avoidance`)."""
        return self._scene_now().avoidance(robot, margin=margin, self_margin=self_margin)

    @checks_types
    def avoidance_for(self, model: Model) -> Avoidance:
        """Return what the robot that is `model` keeps away from now, with the default margin."""
        return self._scene_now().avoidance_for(model)

    def _scene_now(self) -> Scene:
        """Return the scene at the present state, with the constraints that act now."""
        scene, now = scene_at(self.scene, self.state), self._constraints
        if now is self._layout.constraints:
            return scene
        constraints = tuple(
            replace(each, active=each_now.active)
            for each, each_now in zip(scene.constraints, now, strict=True)
        )
        return replace(scene, constraints=constraints)

    @checks_types
    def aabb(self, name: str) -> tuple[Floats, Floats]:
        """Return the lower and upper corner (3,) of the box around a part, along the axes of the world."""
        return self._queries.aabb(self.state, name)

    def overlapping(self, lower: ArrayLike, upper: ArrayLike) -> tuple[str, ...]:
        """Return the names of the links and bodies whose `aabb` overlaps the box between two corners."""
        return self._queries.overlapping(self.state, lower, upper)

    @checks_types
    def cast_rays(self, origins: ArrayLike, directions: ArrayLike, length: float = MAX_RAY_LENGTH) -> RayHits:
        """Return what rays from `origins` (n, 3) along `directions` (n, 3) hit first within `length` [m]."""
        return self._queries.cast_rays(self._motion.engine, self.state, origins, directions, length)

    @checks_types
    def camera(self, camera: Camera, renderer: str | None = None) -> Picture:
        """Return what a camera sees, drawn by dynx or by the renderer of an engine: ``"pybullet"``, or
        ``"mujoco"`` with EGL or OSMesa."""
        # Imported here, because few worlds are drawn.
        from dynx.world.camera import cast_rays, draw_picture

        draw = cast_rays if renderer is None else renderer_of(renderer)
        return draw_picture(self.scene, self.state, camera, draw)

    @door("dynx.viewer.viewer:view")
    def view(self, **options: Any) -> Any:
        """Show the world in the browser, which steps it; return the `dynx.viewer.Viewer`, which takes the
        options.

        Raises NotInstalledError without the extra ``viewer``.
        """
        raise NotImplementedError

    # -- end ----------------------------------------------------------------------------------

    def close(self) -> None:
        """Release the engine; further calls raise ClosedError. Closing twice is harmless."""
        self._motion.close()

    def __enter__(self) -> World:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        notes = f", {len(self.notes)} notes" if self.notes else ""
        return f"<World {self.scene.name} in {self.engine} at {self.time:.6g} s{notes}>"

    def notes_on_present_state(self) -> tuple[str, ...]:
        """Return the `notes` that the world would have if it started at the present state."""
        at_start = notes_on_start(self._motion.engine, self._motion.state)
        return (*at_start, *self._lasting_notes(self._given))

    def _lasting_notes(self, given: Mapping[str, object]) -> Iterator[str]:
        """Yield the notes that hold at every state, with those on the settings `given`."""
        yield from map(str, self.scene.notes)
        yield from notes_on_gravity(self.scene)
        yield from notes_on_engine(self._motion.engine)
        if self.scene.gravity[2] > 0.0:
            # Imported here, because gravity hardly ever points up.
            from dynx.model.unlikely_inputs import gravity_notes

            yield from gravity_notes(self.scene.gravity)
        yield from notes_on_angles(self.scene)
        yield from self._commands.notes()
        in_effect = self._kind.settings_in_effect(self.settings, self.dt / self.substeps)
        yield from changed_settings(given, self.settings, in_effect)
        yield from ineffective_settings(self._kind.settings, self.settings)

    def _build(self) -> Stepper:
        layout = self._with_constraints(self._in_engine)
        return open_engine(self._kind, layout, self.dt / self.substeps, self.settings)
