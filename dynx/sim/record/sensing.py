"""Readings of sensors along a rollout."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from dynx.sim.plants.scene_plant import ScenePlant
from dynx.sim.record.rollout import Rollout
from dynx.world.sensors.motion import RobotMotion, SensedMotion
from dynx.world.sensors.readings import Readings, read_sensor
from dynx.world.sensors.sensor import Sensor, checked_sensors


def sensed_motion(rollout: Rollout) -> SensedMotion:
    """Return what the sensors of a rollout sense: the robot as each step begins."""
    robot = RobotMotion(rollout.model, rollout.q[:-1], rollout.v[:-1], rollout.a, rollout.external_forces)
    plant = None if rollout.scenario is None else rollout.scenario.plant
    name = plant.robot if isinstance(plant, ScenePlant) and plant.robot else rollout.model.name
    h = float(np.median(np.diff(rollout.t)))
    return SensedMotion(rollout.t[:-1], h, {name: robot}, name)


def read_sensors(rollout: Rollout, sensors: Sensor | Iterable[Sensor]) -> dict[str, Readings]:
    """Return the readings of sensors along the recorded motion, by their names.

    Samples are taken as steps begin. Random numbers are those of the rollout's number in the scenario's
    `noise`, 0 without one. Raises ArgumentError and UnknownNameError for sensors that the robot cannot have,
    UnsupportedFeatureError for one that senses what the rollout does not record.
    """
    motion = sensed_motion(rollout)
    noise = None if rollout.scenario is None else rollout.scenario.noise
    return {
        each.name: read_sensor(each, motion, 0 if noise is None else noise.rollout)
        for each in checked_sensors(sensors, motion.parts)
    }
