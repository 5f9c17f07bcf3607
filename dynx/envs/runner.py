"""Episodes of tasks on an engine: `RobotEpisodes` on a backend, `WorldEpisodes` in a world.

They have no integrator, friction law or noise of their own: the task's methods run on floats over the
dynamics of a backend, or over `World.step`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.backends.base import Backend
from dynx.backends.registry import backend
from dynx.compiled.parametric import ParametricDynamics, parametric
from dynx.control.dynamics import EngineDynamics
from dynx.envs.library import spaces
from dynx.envs.randomization import Parameter, Randomization
from dynx.envs.task import (
    Episode,
    Episodes,
    ForwardDynamics,
    Outcome,
    RobotTask,
    State,
    WorldTask,
    control_step,
)
from dynx.envs.variation import VariedRobot, VariedScene
from dynx.errors import DivergedError, ShapeError
from dynx.model.numbers import DIVERGENCE_SPEED
from dynx.spatial.scalar import Array, Floats
from dynx.steppers.state import RobotState, WorldState
from dynx.world.scene import Scene, SceneRobot
from dynx.world.snapshot import Snapshot
from dynx.world.world import World

ROBOT = "robot"
"""Name of the robot in the scene that is drawn."""


class RobotEpisodes(Episodes):
    """Episodes of a task of one robot, whose dynamics a backend evaluates."""

    def __init__(self, task: RobotTask, engine: str) -> None:
        self._task = task
        self._backend = backend(engine, task.model, validate=False)
        self._robot = EngineDynamics(self._backend)
        self._forward: ForwardDynamics = self._robot.forward_dynamics
        self._variation: RobotVariation | None = None
        self._discrete = isinstance(task.action_space, spaces.Discrete)
        self._dtype, self._shape = task.observation_space.dtype, task.observation_space.shape
        self._viewer: Any = None
        self._steps = 0

    def vary(self, randomization: Randomization) -> tuple[Parameter, ...]:
        """Return the parameters of this robot that episodes draw."""
        self._variation = RobotVariation(VariedRobot(self._task, randomization), self._backend)
        return self._variation.robot.parameters

    def set_parameters(self, values: Floats) -> None:
        """Give the robot of the next episode the values (k,) of the parameters that `vary` returned."""
        assert self._variation is not None, "vary was not called"
        self._forward = self._variation.forward_dynamics(values)

    @property
    def state(self) -> State:
        """The present state."""
        return self._state

    @state.setter
    def state(self, state: State) -> None:
        self._state = State(*(np.array(each, dtype=np.float64) for each in state))

    def start(self, rng: np.random.Generator, options: Mapping[str, Any]) -> tuple[Any, dict[str, Any]]:
        self._task.require_start_options(options)
        self.state = self._task.start(rng.random(self._task.random_size), **options)
        self._steps = 0
        return self._observation(), self._task.info(self._robot, self._state)

    def step(self, action: Any) -> Outcome:
        task, robot, before = self._task, self._robot, self._state
        given = np.asarray(float(action) if self._discrete else action, dtype=np.float64)
        if self._variation is None:
            actions: Sequence[Array] = [given] * task.substeps
        else:
            actions = self._variation.acting_actions(given, first=self._steps == 0)
        moved = control_step(task, robot, self._forward, before, actions)
        self._steps += 1
        self._refuse_divergence(moved.q, moved.v)
        after = self._state = task.settle(moved)
        reward = float(task.reward(robot, before, given, after))
        terminated = bool(task.terminated(robot, after))
        return Outcome(self._observation(), reward, terminated, task.info(robot, after))

    def _observation(self) -> Array:
        observation = np.array(self._task.observation(self._robot, self._state), dtype=self._dtype)
        if observation.shape != self._shape:
            raise ShapeError(
                f"the observation of {type(self._task).__name__} has shape {observation.shape}; "
                f"its observation space has {self._shape}"
            )
        return observation

    def _refuse_divergence(self, q: Floats, v: Floats) -> None:
        if not v @ v < DIVERGENCE_SPEED**2:
            dt = self._task.control_dt
            raise DivergedError(
                f"the velocity after step {self._steps} ({self._steps * dt:.6g} s) is not finite or beyond "
                f"{DIVERGENCE_SPEED:g}; smaller steps (substeps) or actions may help",
                time=self._steps * dt,
                step=self._steps,
                state=(q, v),
            )

    def picture(self, width: int, height: int) -> NDArray[np.uint8]:
        """Draw the robot by rays through the shapes of its description."""
        return draw_robot(self._task, self._state, width, height)

    def view(self) -> None:
        """Show the robot in the browser."""
        if self._viewer is None:
            self._viewer = self._task.model.view(q=self._state.q)
            print(f"{type(self._task).__name__} is shown at {self._viewer.url}", flush=True)
        self._viewer.view.put(self._state.q)

    def close(self) -> None:
        if self._variation is not None:
            self._variation.close()
        self._backend.close()
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None


COMPILED = "compiled"


class RobotVariation:
    """Forward dynamics of a robot with drawn parameters, and the actions that act after a delay.

    An engine loads the robot anew for each episode in which masses differ; the backend `compiled`, which
    would compile it anew, has a kernel with masses as inputs.
    """

    def __init__(self, robot: VariedRobot, nominal: Backend) -> None:
        self.robot = robot
        """The parameters and what they change."""
        self._nominal = nominal
        self._own: Backend | None = None
        self._parametric: ParametricDynamics | None = None
        if robot.changes_masses and nominal.name == COMPILED:
            self._parametric = parametric(
                nominal.model, links=robot.link_names, point_payload=robot.payload_frame
            )
        self._values: Floats = np.zeros(0)
        self._earlier: list[Array] = []

    def forward_dynamics(self, values: Floats) -> ForwardDynamics:
        """Return the acceleration of q, v, tau with these values (k,), which hold until the next call."""
        self._values = values
        rigid = self._rigid_dynamics(values)
        robot = self.robot
        return lambda q, v, tau: rigid(q, v, tau + robot.joint_torque(values, v))

    def _rigid_dynamics(self, values: Floats) -> Callable[..., Any]:
        if not self.robot.changes_masses:
            return EngineDynamics(self._nominal).forward_dynamics
        if self._parametric is not None:
            dynamics = self._parametric
            parameters = self.robot.parametric_values(values, dynamics.parameters.defaults)
            return lambda q, v, tau: dynamics.forward_dynamics(q, v, tau, parameters)
        self.close()
        self._own = backend(self._nominal.name, self.robot.model(values), validate=False)
        return EngineDynamics(self._own).forward_dynamics

    def acting_actions(self, action: Array, *, first: bool) -> list[Array]:
        """Return the action that acts in each step of the integrator; the `first` of an episode acts until
        a later one does."""
        if first:
            self._earlier = [action] * self.robot.delayed_actions
        acting = self.robot.acting_actions(self._values, action, self._earlier)
        self._earlier = [action, *self._earlier][: self.robot.delayed_actions]
        return acting

    def close(self) -> None:
        """Release the engine of the last episode."""
        if self._own is not None:
            self._own.close()
            self._own = None


class WorldEpisodes(Episodes):
    """Episodes of a task in a world, which is opened once, or anew for an episode with a scene of its own."""

    def __init__(self, task: WorldTask, engine: str) -> None:
        self._task, self._engine = task, engine
        self._options = {"dt": task.control_dt, "substeps": task.substeps, **task.settings.get(engine, {})}
        self._varied: VariedScene | None = None
        self._values: NDArray[np.float64] = np.zeros(0)
        self._waiting: deque[Any] = deque()
        self._world = self._open(task.scene())
        self._start: Snapshot | None = None
        self._viewer: Any = None
        self._episode: Episode | None = None

    @property
    def world(self) -> World:
        """The world of the present episode."""
        return self._world

    @property
    def episode(self) -> Episode:
        """The present episode, of which the first `start` begins one."""
        assert self._episode is not None, "no episode was started"
        return self._episode

    def vary(self, randomization: Randomization) -> tuple[Parameter, ...]:
        """Return the parameters of the scene that episodes draw, and the delay.

        Raises the error of the engine for what it does not have, such as dry friction of joints in Drake.
        """
        varied = self._varied = VariedScene(self._task.scene(), randomization, self._task.control_dt)
        if varied.joint_friction:
            self._options["joint_friction"] = True
        if varied.changes_scene:
            greatest = np.array([each.distribution.bounds[1] for each in varied.parameters])
            self._open(varied.scene(self._task.scene(), greatest)).close()
        return varied.parameters

    def set_parameters(self, values: NDArray[np.float64]) -> None:
        """Give the scene of the next episode the values (k,) of the parameters that `vary` returned."""
        self._values = values

    def start(self, rng: np.random.Generator, options: Mapping[str, Any]) -> tuple[Any, dict[str, Any]]:
        task = self._task
        task.require_start_options(options)
        memory = SimpleNamespace()
        scene = self._scene_of_episode(rng, memory)
        if scene is None:
            self._return_to_start()
        else:
            world = self._open(scene)
            self._world.close()
            self._world = world
        self._episode = episode = Episode(self._world, rng, memory)
        task.start(episode, **options)
        return task.observation(episode), task.info(episode)

    def step(self, action: Any) -> Outcome:
        task, episode = self._task, self.episode
        if self._waiting.maxlen:
            if not self._waiting:
                # Before the first action there was none; it acts from the beginning.
                self._waiting.extend([action] * self._waiting.maxlen)
            acting = self._waiting.popleft()
            self._waiting.append(action)
            action = acting
        self._world.step(**task.loads(episode, action))
        task.settle(episode, action)
        terminated = bool(task.terminated(episode))
        return Outcome(
            task.observation(episode), float(task.reward(episode, action)), terminated, task.info(episode)
        )

    def picture(self, width: int, height: int) -> NDArray[np.uint8]:
        """Draw the world by the task's camera."""
        return self._world.camera(replace(self._task.camera, size=(width, height))).rgb

    def view(self) -> None:
        """Show the world in the browser, on one page for all worlds of these episodes."""
        if self._viewer is None:
            self._viewer = self._world.view(steps=False)
            print(f"{type(self._task).__name__} is shown at {self._viewer.url}", flush=True)
        elif self._viewer.view.world is not self._world and not self._viewer.view.replace(self._world):
            self._viewer.show(self._world, steps=False)
        self._viewer.view.draw()

    def close(self) -> None:
        self._world.close()
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None

    def _open(self, scene: Scene) -> World:
        return World(scene, self._engine, **self._options)

    def _scene_of_episode(self, rng: np.random.Generator, memory: SimpleNamespace) -> Scene | None:
        """Return the scene of the next episode with the drawn parameters, or None for that of the task."""
        task, varied = self._task, self._varied
        scene = task.scene_of_episode(rng, memory)
        if varied is None:
            return scene
        self._waiting = deque(maxlen=varied.delayed_actions(self._values, task.control_dt))
        if not varied.changes_scene:
            return scene
        return varied.scene(task.scene() if scene is None else scene, self._values)

    def _return_to_start(self) -> None:
        """Return the world to the start of its scene, from where it takes the same steps, bit for bit."""
        if self._start is None:
            self._start = self._world.save()
        else:
            self._world.restore(self._start)


def draw_robot(task: RobotTask, state: State, width: int, height: int) -> NDArray[np.uint8]:
    """Draw the robot (height, width, 3), seen by the camera of the task."""
    # Imported here, because most environments draw no picture.
    from dynx.world.camera import cast_rays, draw_picture

    scene = Scene(robots=(SceneRobot(ROBOT, task.model),))
    seen = WorldState(0.0, {ROBOT: RobotState(state.q, state.v)}, {})
    camera = replace(task.camera, size=(width, height))
    return draw_picture(scene, seen, camera, cast_rays).rgb
