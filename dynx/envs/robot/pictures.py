"""Pictures of the robot of a task."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dynx.envs.robot.array_task import ArrayTask
from dynx.envs.robot.state import State
from dynx.steppers.state import RobotState, WorldState
from dynx.world import Scene, SceneRobot
from dynx.world.camera import cast_rays, draw_picture

ROBOT = "robot"
"""Name of the robot in the scene that is drawn."""


def draw_robot(task: ArrayTask, state: State, width: int, height: int) -> NDArray[np.uint8]:
    """Draw the robot (height, width, 3), seen by the camera of the task."""
    scene = Scene(robots=(SceneRobot(ROBOT, task.model),))
    seen = WorldState(0.0, {ROBOT: RobotState(state.q, state.v)}, {})
    camera = replace(task.camera, size=(width, height))
    return draw_picture(scene, seen, camera, cast_rays).rgb
