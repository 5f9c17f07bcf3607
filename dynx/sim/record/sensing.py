"""Readings of sensors along a rollout."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from dynx.errors import UnknownNameError, UnsupportedFeatureError, nearest, shown
from dynx.model import Model
from dynx.sim.plants.scene_plant import ScenePlant
from dynx.sim.record.rollout import Rollout
from dynx.sim.scenario.scenario import Scenario
from dynx.sim.setup import refuse_unknown
from dynx.spatial.scalar import Floats
from dynx.steppers.layout import Layout
from dynx.world import Scene
from dynx.world.preparation import prepare
from dynx.world.sensing import SceneInstants, SceneMotion, parts_of, require_shapes
from dynx.world.sensors.kinds import ContactSensor, RaySensor
from dynx.world.sensors.motion import RobotMotion, SensedMotion
from dynx.world.sensors.places import SensedParts
from dynx.world.sensors.readings import Readings, read_sensor
from dynx.world.sensors.sensor import Sensor, checked_sensors

SHORT_STEP = 1e-6
"""Length [s] of a step for a log without steps, in which no sensor takes a sample."""


def read_sensors(rollout: Rollout, sensors: Sensor | Iterable[Sensor]) -> Mapping[str, Readings]:
    """Return the readings of sensors along the recorded motion, by their names.

    Samples are taken as steps begin. Random numbers are those of the rollout's number in the scenario's
    `noise`, 0 without one. Raises ArgumentError and UnknownNameError for sensors that the robot cannot have,
    UnsupportedFeatureError for one that senses what the rollout does not record.
    """
    motion = sensed_motion(rollout)
    number = _number(rollout)
    read = checked_sensors(sensors, motion.parts)
    return OwnReadings({each.name: read_sensor(each, motion, number) for each in read})


def read_own_sensors(rollout: Rollout) -> Mapping[str, Readings]:
    """Return the readings of the sensors of a rollout's scenario."""
    sensors = () if rollout.scenario is None else sensors_of(rollout.scenario)
    motion = sensed_motion(rollout) if sensors else None
    number = _number(rollout)
    return OwnReadings({} if motion is None else {each.name: _read(each, motion, number) for each in sensors})


def _read(sensor: Sensor, motion: SensedMotion, number: int) -> Readings | UnsupportedFeatureError:
    try:
        return read_sensor(sensor, motion, number)
    except UnsupportedFeatureError as error:
        return error


class OwnReadings(Mapping[str, Readings]):
    """Readings by the names of sensors; a sensor that cannot be read raises its error."""

    def __init__(self, found: Mapping[str, Readings | UnsupportedFeatureError]) -> None:
        self._found = {name: each for name, each in found.items() if isinstance(each, Readings)}
        self._reasons = {
            name: each for name, each in found.items() if isinstance(each, UnsupportedFeatureError)
        }

    def __getitem__(self, name: str) -> Readings:
        if name in self._reasons:
            raise self._reasons[name]
        if name not in self._found:
            raise UnknownNameError(f"the rollout has no sensor {shown(name)}{nearest(name, self._found)}")
        return self._found[name]

    def __contains__(self, name: object) -> bool:
        # A mapping asks for the item, and expects a KeyError.
        return name in self._found

    def get(self, name: str, default: Any = None) -> Any:
        """Return the readings of a sensor, or `default` where there is no such sensor."""
        return self[name] if name in self._found or name in self._reasons else default

    def __iter__(self) -> Iterator[str]:
        return iter(self._found)

    def __len__(self) -> int:
        return len(self._found)

    def __repr__(self) -> str:
        return f"<Readings of {', '.join(self._found) or 'no sensor'}>"


def sensors_of(scenario: Scenario) -> tuple[Sensor, ...]:
    """Return the sensors of a scenario, then those of its scene.

    Raises ArgumentError for one that was read from a file and cannot be rebuilt.
    """
    own = scenario.sensors if isinstance(scenario.sensors, tuple) else (scenario.sensors,)
    refuse_unknown(*own)
    scene = _scene_of(scenario)
    return (*own, *(() if scene is None else scene.sensors))


def check_sensors(scenario: Scenario, model: Model) -> None:
    """Raise the errors of the sensors of a scenario whose plant moves `model`: two of one name, a place that
    does not exist, a rate above that of the steps, contacts and rays without a scene."""
    scene, sensors = _scene_of(scenario), sensors_of(scenario)
    if scene is None:
        parts, layout = SensedParts({model.name: model}, (), model.name), None
    else:
        layout = _layout(scene)
        parts = parts_of(layout, _robot_name(scenario, model))
    for sensor in checked_sensors(sensors, parts):
        sensor.period(scenario.dt)
        if isinstance(sensor, ContactSensor | RaySensor):
            place = sensor.place(parts)
            if layout is None:
                raise place.without_scene
            require_shapes(place, layout, own=sensor.touches)


def sensed_motion(rollout: Rollout) -> SensedMotion:
    """Return what the sensors of a rollout sense as each step begins."""
    plant = None if rollout.scenario is None else rollout.scenario.plant
    unknown = [plant.unrecorded(base) if isinstance(plant, ScenePlant) else "" for base in (False, True)]
    robot = RobotMotion(
        rollout.model, rollout.q[:-1], rollout.v[:-1], rollout.a, rollout.external_forces, *unknown
    )
    if len(rollout):
        h = float(np.median(np.diff(rollout.t)))
    else:
        h = SHORT_STEP if rollout.scenario is None else rollout.scenario.dt
    name = _robot_name(rollout.scenario, rollout.model)
    scene, around = _scene_of(rollout.scenario), rollout.surroundings
    if scene is None or around is None:
        return SensedMotion(rollout.t[:-1], h, {name: robot}, name)
    others: dict[str, Floats] = {other: q[:-1] for other, q in around.robots.items()}
    bodies = {body: T[:-1] for body, T in around.bodies.items()}
    instants = SceneInstants(_layout(scene), {name: robot.q, **others}, bodies, around.contacts.force_on)
    return SceneMotion(rollout.t[:-1], h, {name: robot}, instants, name)


def _number(rollout: Rollout) -> int:
    noise = None if rollout.scenario is None else rollout.scenario.noise
    refuse_unknown(noise)
    return 0 if noise is None else noise.rollout


def _scene_of(scenario: Scenario | None) -> Scene | None:
    plant = None if scenario is None else scenario.plant
    return plant.scene if isinstance(plant, ScenePlant) else None


def _robot_name(scenario: Scenario | None, model: Model) -> str:
    plant = None if scenario is None else scenario.plant
    return plant.robot if isinstance(plant, ScenePlant) and plant.robot is not None else model.name


def _layout(scene: Scene) -> Layout:
    return prepare(
        scene,
        collisions=True,
        joint_limits=False,
        joint_damping=False,
        joint_friction=False,
        joint_armature=False,
        joint_springs=False,
    )
