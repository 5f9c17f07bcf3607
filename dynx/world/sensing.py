"""Sensors of a scene: what they sense in it, and their samples in the steps of a world."""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from dynx.backends import backend
from dynx.errors import ArgumentError, UnknownNameError, UnsupportedFeatureError, nearest, shown
from dynx.spatial.scalar import Floats
from dynx.steppers.forces import Forces
from dynx.steppers.layout import Layout
from dynx.steppers.state import BodyState, RobotState, WorldState
from dynx.steppers.stepper import Stepper
from dynx.world.boxes import OwnerPoses
from dynx.world.commands import Act
from dynx.world.contacts import Contact
from dynx.world.last_step import LastStep
from dynx.world.queries import first_hits
from dynx.world.sensors.errors import SampleNumbers
from dynx.world.sensors.kinds import ContactSensor, RaySensor
from dynx.world.sensors.motion import RobotMotion, SensedBody, SensedFrame, SensedMotion
from dynx.world.sensors.places import SensedParts, SensorPlace
from dynx.world.sensors.readings import SAME_SAMPLE, SensorReading, read_sensor, sample_numbers
from dynx.world.sensors.sensor import Sensor


@dataclass(frozen=True, eq=False)
class SceneInstants:
    """Where everything in a scene is at n instants, and the contacts in the steps that begin there."""

    layout: Layout
    configurations: Mapping[str, Floats]
    """Configurations (n, nq) of all robots."""
    bodies: Mapping[str, Floats]
    """Poses (n, 4, 4) of the bodies that move."""
    force_on: Callable[[str], Floats]
    """Sum (n, 3) of the contact forces on a part, in world axes [N]."""
    body_motion: Callable[[str], SensedBody | None] = lambda _: None
    """Velocity and acceleration of a body; None where they are not recorded."""


class SceneMotion(SensedMotion):
    """Robots among the parts of a scene, at the instants `t` (n,) [s]."""

    def __init__(
        self, t: Floats, h: float, robots: Mapping[str, RobotMotion], around: SceneInstants, alone: str | None
    ) -> None:
        super().__init__(t, h, robots, alone)
        self._around = around
        parts = parts_of(around.layout, alone)
        moving = {name: robot.model for name, robot in robots.items()}
        self.parts = parts._replace(robots={**parts.robots, **moving})

    def pose(self, place: SensorPlace) -> Floats:
        around, n = self._around, len(self.t)
        moving = None if place.robot is None else self.robots.get(place.robot)
        if moving is not None:
            return moving.pose(place.name)
        for robot in around.layout.robots:
            if robot.name == place.robot:
                with backend("reference", robot.model) as engine:
                    return engine.forward_kinematics(around.configurations[robot.name], place.name)
        return np.broadcast_to(self._bodies[place.name], (n, 4, 4))

    def frame_motion(self, place: SensorPlace) -> SensedFrame:
        moved = None if place.robot is not None else self._around.body_motion(place.name)
        if moved is None:
            return super().frame_motion(place)
        return SensedFrame(self.pose(place), moved.velocity, moved.acceleration, self._around.layout.gravity)

    def contact_force(self, place: SensorPlace) -> Floats:
        require_shapes(place, self._around.layout, own=True)
        return self._around.force_on(_part(place))

    def ray_distances(self, place: SensorPlace, origins: Floats, directions: Floats, length: float) -> Floats:
        layout = self._around.layout
        require_shapes(place, layout, own=False)
        others = tuple(each for each in layout.colliders if each.name != _part(place))
        seen, found = replace(layout, colliders=others), np.empty(len(self.t))
        for k in range(len(self.t)):
            rays = slice(k, k + 1)
            (hit,) = first_hits(seen, self._poses(k), origins[rays], directions[rays], length)
            found[k] = np.inf if hit.collider is None else hit.distance
        return found

    @property
    def _bodies(self) -> dict[str, Floats]:
        """Poses of all bodies, of those that are fixed without the axis of the instants."""
        return {body.name: body.T for body in self._around.layout.bodies} | dict(self._around.bodies)

    def _poses(self, k: int) -> OwnerPoses:
        """Return the poses of all rigid bodies at instant k."""
        still = np.zeros(6)
        robots = {
            name: RobotState(rows[k], np.zeros(0)) for name, rows in self._around.configurations.items()
        }
        bodies = {name: BodyState(T[k] if T.ndim == 3 else T, still) for name, T in self._bodies.items()}
        return OwnerPoses(self._around.layout, WorldState(float(self.t[k]), robots, bodies))


def parts_of(layout: Layout, alone: str | None = None) -> SensedParts:
    """Return the robots and bodies of a scene; `alone` is the robot whose parts are named without it, by
    default the only one."""
    robots = {robot.name: robot.model for robot in layout.robots}
    if alone is None and len(robots) == 1:
        (alone,) = robots
    return SensedParts(robots, tuple(body.name for body in layout.bodies), alone)


def require_shapes(place: SensorPlace, layout: Layout, *, own: bool) -> None:
    """Raise UnsupportedFeatureError for a sensor in a scene without shapes, or with `own` on a part without
    any."""
    if not layout.colliders:
        raise UnsupportedFeatureError(
            f"{place.sensor} is on {shown(_part(place))}; wanted a scene whose parts have collision shapes, "
            "in a world without collisions=False"
        )
    if own and _part(place) not in {each.name for each in layout.colliders}:
        raise UnsupportedFeatureError(
            f"{place.sensor} is on {shown(_part(place))}, which has no collision shape"
        )


def _part(place: SensorPlace) -> str:
    return place.name if place.robot is None else f"{place.robot}/{place.name}"


class _Pending(NamedTuple):
    """A step in which sensors take samples, until it is complete."""

    t: float
    sensors: Sequence[Sensor]
    robots: Mapping[str, RobotState]
    bodies: Mapping[str, BodyState]
    """States of the bodies that move."""


@dataclass(eq=False)
class _TakenSample:
    """One sample of a sensor, taken at the time `t` [s], which is evaluated when it is read."""

    t: float
    motion: SceneMotion | None
    """What it senses; None of one that was restored."""
    reading: SensorReading | None = None


class LastReadings(dict[str, SensorReading]):
    """Last readings by the names of sensors; one that has none, or does not exist, is answered by the
    reason."""

    time: float = 0.0
    waiting: Sequence[Sensor] = ()
    """The sensors without a reading at that time [s]."""

    def __missing__(self, name: object) -> SensorReading:
        for sensor in self.waiting:
            if sensor.name == name:
                later = f" and its delay of {sensor.delay:g} s" if sensor.delay else ""
                raise ArgumentError(
                    f"{sensor} has no reading at {self.time:g} s; a sample can be read after the step of the "
                    f"engine in which it is taken{later}; get({shown(name)}) is None until then"
                )
        names = [*self, *(sensor.name for sensor in self.waiting)]
        raise UnknownNameError(f"the world has no sensor {shown(name)}{nearest(name, names)}")


class WorldSensors:
    """Samples of the sensors of a scene, taken as steps of the engine begin.

    A sample needs the acceleration and the contacts of its step, so it can be read after that step. Those
    that a delay still holds back are kept.
    """

    def __init__(
        self,
        layout: Layout,
        sensors: Sequence[Sensor],
        dt: float,
        substeps: int,
        last_step: LastStep,
        clock: Callable[[], tuple[float, int]],
        contacts: Callable[[Stepper], Sequence[Contact]],
    ) -> None:
        """A step of the world takes `dt` [s] and is `substeps` steps of the engine; `clock` returns the time
        [s] from which the world's steps are counted, and their number, `contacts` those of the engine's last
        step.

        Raises ArgumentError for a rate above that of the steps, UnsupportedFeatureError for a sensor of
        contacts where nothing can be touched."""
        self._layout, self._sensors = layout, sensors
        self._dt, self._substeps, self._h = dt, substeps, dt / substeps
        self._last_step, self._clock, self._contacts = last_step, clock, contacts
        parts = parts_of(layout)
        for sensor in sensors:
            sensor.period(self._h)
            if isinstance(sensor, ContactSensor | RaySensor):
                require_shapes(sensor.place(parts), layout, own=sensor.touches)
        self._rollout = 0
        self._draw_for(0)
        self.forget()

    @property
    def rollout(self) -> int:
        """Number of the rollout, on which the random numbers depend."""
        return self._rollout

    @rollout.setter
    def rollout(self, number: int) -> None:
        self.kept()  # samples that were taken have the numbers of their own rollout
        self._draw_for(number)

    def _draw_for(self, rollout: int) -> None:
        self._rollout = rollout
        self._numbers = {
            each.name: SampleNumbers(each.name, each.seed, rollout, each.size) for each in self._sensors
        }

    def forget(self) -> None:
        """Forget all samples: the state was set."""
        self._pending: _Pending | None = None
        self._samples: dict[str, deque[_TakenSample]] = {each.name: deque() for each in self._sensors}

    def kept(self) -> dict[Sensor | str, Floats]:
        """Return the samples (k, 1 + size) of sensors that are held or delayed, each after its time [s]."""
        return {
            sensor: np.array(
                [[each.t, *self._read(sensor, each).values] for each in self._samples[sensor.name]]
            )
            for sensor in self._sensors
            if self._samples[sensor.name]
        }

    def restore(self, samples: Mapping[Sensor | str, Floats]) -> None:
        """Continue with the samples of `kept`, by sensors or by their names.

        Raises ArgumentError for samples of another size.
        """
        self.forget()
        for sensor in self._sensors:
            rows = samples.get(sensor, samples.get(sensor.name))
            if rows is None:
                continue
            if rows.ndim != 2 or rows.shape[1] != 1 + sensor.size or not np.isfinite(rows).all():
                raise ArgumentError(
                    f"the samples of {sensor} have shape {rows.shape}; wanted finite numbers (k, "
                    f"{1 + sensor.size})"
                )
            ends = np.cumsum([1, *(len(channel.components) for channel in sensor.channels)])
            names = [channel.name for channel in sensor.channels]
            for row in rows:
                values = dict(zip(names, np.split(row, ends)[1:-1], strict=True))
                taken = _TakenSample(float(row[0]), None, SensorReading(sensor, float(row[0]), values))
                self._samples[sensor.name].append(taken)

    def watched(self, act: Act) -> Act:
        """Return `act`, which begins the samples of each step, and takes those of the step before."""
        taken, (start, steps) = itertools.count(), self._clock()

        def act_and_sample(engine: Stepper) -> Forces | None:
            self.complete(engine)
            # The time of the world where a step of it begins, to the last bit.
            whole, part = divmod(next(taken), self._substeps)
            self._begin(engine, start + (steps + whole) * self._dt + part * self._h)
            return act(engine)

        return act_and_sample

    def _begin(self, engine: Stepper, t: float) -> None:
        due = [each for each in self._sensors if len(sample_numbers(each, np.array([t]), self._h)[0])]
        if not due:
            return
        robots = {robot.name: engine.robot_state(k) for k, robot in enumerate(self._layout.robots)}
        bodies = {
            body.name: engine.body_state(k) for k, body in enumerate(self._layout.bodies) if not body.fixed
        }
        self._pending = _Pending(t, due, robots, bodies)

    def complete(self, engine: Stepper) -> None:
        """Take the samples of the step that the engine has taken."""
        if self._pending is None:
            return
        t, due, before, bodies = self._pending
        self._pending = None
        contacts = self._contacts(engine) if any(each.touches for each in due) else None
        after = WorldState(
            t,
            {name: engine.robot_state(k) for k, name in enumerate(before)},
            {body.name: engine.body_state(k) for k, body in enumerate(self._layout.bodies)},
        )
        robots = {name: self._last_step.instant(k, engine, after, contacts) for k, name in enumerate(before)}
        around = SceneInstants(
            self._layout,
            {name: state.q[None] for name, state in before.items()},
            {name: state.T_world_body[None] for name, state in bodies.items()},
            lambda part: _force_on(part, contacts or ()),
            lambda name: self._motion_of(name, bodies, after),
        )
        motion = SceneMotion(np.array([t]), self._h, robots, around, None)
        for sensor in due:
            kept = self._samples[sensor.name]
            kept.append(_TakenSample(t, motion))
            # Of those that can be read at the end of the step, the last is enough.
            while len(kept) > 1 and self._is_available(sensor, kept[1], t + self._h):
                kept.popleft()

    def _motion_of(self, name: str, before: Mapping[str, BodyState], after: WorldState) -> SensedBody:
        """Return the motion of a body in a step, of one that is fixed at rest."""
        if name not in before:
            return SensedBody(np.zeros((1, 6)), np.zeros((1, 6)))
        body = next(each for each in self._layout.bodies if each.name == name)
        return SensedBody.of_step(body, before[name], after.bodies[name], self._h)

    def readings(self, time: float) -> LastReadings:
        """Return the last reading of each sensor that is available at `time` [s]."""
        found = LastReadings()
        for sensor in self._sensors:
            ready = [each for each in self._samples[sensor.name] if self._is_available(sensor, each, time)]
            if ready:
                found[sensor.name] = self._read(sensor, ready[-1])
        found.time, found.waiting = time, [each for each in self._sensors if each.name not in found]
        return found

    def _read(self, sensor: Sensor, sample: _TakenSample) -> SensorReading:
        """Return the reading of a sample, which is evaluated once."""
        if sample.reading is None:
            assert sample.motion is not None
            numbers = self._numbers[sensor.name]
            sample.reading = read_sensor(sensor, sample.motion, numbers=numbers).last
        return sample.reading

    def _is_available(self, sensor: Sensor, sample: _TakenSample, time: float) -> bool:
        return bool(sample.t + sensor.delay <= time + SAME_SAMPLE * self._h)


def _force_on(part: str, contacts: Sequence[Contact]) -> Floats:
    """Return the sum (1, 3) of the forces of contacts on a part."""
    total = np.zeros((1, 3))
    for contact in contacts:
        total += (contact.a == part) * contact.force - (contact.b == part) * contact.force
    return total
