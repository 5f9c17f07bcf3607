"""Episodes of tasks on an engine: `RobotEpisodes` on a backend, `WorldEpisodes` in a world.

They have no integrator, friction law or noise of their own: the task's methods run on floats over the
dynamics of a backend, or over `World.step`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from dynx.backends.base import Backend
from dynx.backends.dynamics import EngineDynamics
from dynx.backends.registry import backend
from dynx.envs import hooks
from dynx.envs.library import spaces
from dynx.envs.randomization import Parameter, Randomization
from dynx.envs.task import (
    DESCRIBED,
    Episode,
    Episodes,
    JointOptions,
    Move,
    Outcome,
    RobotTask,
    State,
    StepFriction,
    WorldTask,
    free_move,
)
from dynx.envs.variation import VariedGround, VariedRobot, VariedScene, WaitingActions
from dynx.errors import DivergedError, UnsupportedFeatureError
from dynx.model.elements import JointCoefficients
from dynx.model.numbers import DIVERGENCE_SPEED
from dynx.rbd.joint_friction import FrictionLaw
from dynx.spatial.scalar import Array, Floats
from dynx.steppers.forces import ExternalForce
from dynx.steppers.state import RobotState, WorldState

if TYPE_CHECKING:
    from dynx.envs.ground_step import GroundContacts
    from dynx.envs.ground_task import GroundTask
    from dynx.envs.task_step import TaskStep
    from dynx.world import Scene
    from dynx.world.snapshot import Snapshot
    from dynx.world.world import World

COMPILED = "compiled"
"""Name of the engine whose kernels take whole steps."""

ROBOT = "robot"
"""Name of the robot in the scene that is drawn."""


def robot_episodes(task: RobotTask, engine: str, joints: JointOptions = DESCRIBED) -> RobotEpisodes:
    """Return the episodes of a task of one robot: on `compiled` in a lane of its kernel, otherwise, and for a
    task that cannot be compiled, on floats."""
    if engine == COMPILED:
        try:
            return CompiledEpisodes(task, engine, joints)
        except UnsupportedFeatureError:
            pass
    return RobotEpisodes(task, engine, joints)


class RobotEpisodes(Episodes):
    """Episodes of a task of one robot on floats, whose dynamics a backend evaluates."""

    def __init__(self, task: RobotTask, engine: str, joints: JointOptions = DESCRIBED) -> None:
        self._task, self._joints = task, joints
        self._backend = backend(engine, task.model, validate=False)
        self._robot = EngineDynamics(self._backend)
        self._variation: RobotVariation | None = None
        varied = VariedRobot(task, None, joints)
        self._robot.joints = varied.nominal_joints
        self._move: Move = partial(free_move, task, self._robot.forward_dynamics)
        if varied.stops:
            self._move = _stopped(task, self._move, self._robot)
        if varied.parameters.names:
            self._variation = RobotVariation(task, varied, self._backend)
            self._move = self._variation.move(np.zeros(0))
        self._discrete = isinstance(task.action_space, spaces.Discrete)
        self._dtype, self._shape = task.observation_space.dtype, task.observation_space.shape
        self._viewer: Any = None
        self._steps = 0
        self._last: tuple[State, Array] | None = None
        """The state before the last step, and its action."""

    def vary(self, randomization: Randomization) -> tuple[Parameter, ...]:
        """Return the parameters of this robot that episodes draw."""
        varied = VariedRobot(self._task, randomization, self._joints)
        self._robot.joints = varied.nominal_joints
        self._variation = RobotVariation(self._task, varied, self._backend)
        return varied.drawn_parameters

    def set_parameters(self, values: Floats) -> None:
        """Give the robot of the next episode the values (k,) of the parameters that `vary` returned."""
        assert self._variation is not None, "vary was not called"
        self._move = self._variation.move(values)

    @property
    def state(self) -> State:
        """The present state."""
        return self._state

    @state.setter
    def state(self, state: State) -> None:
        self._state = State(*(np.array(each, dtype=np.float64) for each in state))

    def start(self, rng: np.random.Generator, options: Mapping[str, Any]) -> tuple[Any, dict[str, Any]]:
        self._task.require_start_options(options)
        self.state = hooks.start(self._task, rng.random(self._task.random_size), options)
        self._steps = 0
        return self._observation(), self._task.info(self._robot, self._state)

    def step(self, action: Any) -> Outcome:
        task, robot, before = self._task, self._robot, self._state
        given = np.asarray(float(action) if self._discrete else action, dtype=np.float64)
        if self._variation is None:
            actions: Sequence[Array] = [given] * task.substeps
        else:
            actions = self._variation.acting_actions(given, first=self._steps == 0)
        moved = hooks.control_step(task, robot, self._move, before, actions)
        self._steps += 1
        self._refuse_divergence(moved.q, moved.v)
        after = self._state = hooks.settle(task, moved)
        self._last = before, given
        reward = float(hooks.number(task, "reward", task.reward(robot, before, given, after)))
        terminated = bool(hooks.number(task, "terminated", task.terminated(robot, after)))
        return Outcome(self._observation(), reward, terminated, task.info(robot, after))

    def _observation(self) -> Array:
        return hooks.observation(self._task, self._robot, self._state).astype(self._dtype)

    def _refuse_divergence(self, q: Floats, v: Floats) -> None:
        if not v @ v < DIVERGENCE_SPEED**2:
            self._raise_divergence(q, v)

    def _raise_divergence(self, q: Floats, v: Floats) -> NoReturn:
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

    def scene_and_state(self) -> tuple[Scene, WorldState]:
        """Return a scene of the robot alone, and its state."""
        return self._scene, _state_of_robot(self._state)

    @cached_property
    def _scene(self) -> Scene:
        return _scene_of_robot(self._task)

    def reward_terms(self) -> Mapping[str, float]:
        if self._last is None:
            return {}
        before, action = self._last
        terms = self._task.reward_terms(self._robot, before, action, self._state)
        return {name: float(value) for name, value in terms.items()}

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


class CompiledEpisodes(RobotEpisodes):
    """Episodes of a task of one robot in one lane of the kernel of `dynx.envs.vector`, with its bits."""

    def __init__(self, task: RobotTask, engine: str, joints: JointOptions = DESCRIBED) -> None:
        """Raises UnsupportedFeatureError for a task that cannot be compiled."""
        super().__init__(task, engine, joints)
        self._varied = VariedRobot(task, None, joints)
        self._open_lane()

    def _open_lane(self) -> None:
        # Imported here, because other engines need no compiler.
        from dynx.envs.task_step import TaskStep

        self._use(TaskStep(self._task, self._varied))

    def _use(self, step: TaskStep) -> None:
        self._step = step
        self._lanes = step.lanes(1)
        self._action = self._lanes.arrays["action"][0]
        self._shaped_action = self._action.reshape(self._task.action_space.shape)
        self._row: Floats = np.zeros(0)
        self._state_of_row: State | None = None
        """The state that the last step made, of views of the row."""

    def vary(self, randomization: Randomization) -> tuple[Parameter, ...]:
        """Return the parameters of this robot that episodes draw."""
        self._varied = VariedRobot(self._task, randomization, self._joints)
        self._open_lane()
        return self._varied.drawn_parameters

    def set_parameters(self, values: Floats) -> None:
        """Give the robot of the next episode the values (k,) of the parameters that `vary` returned."""
        if "parameters" in self._lanes.arrays:
            self._lanes.arrays["parameters"][0] = values

    def start(self, rng: np.random.Generator, options: Mapping[str, Any]) -> tuple[Any, dict[str, Any]]:
        self._task.require_start_options(options)
        states, observations = self._step.starts(rng.random((1, self._task.random_size)), options)
        self.state = self._step.layout.state(states[0])  # its setter copies
        self._steps = 0
        return self._shaped(observations[0]), self._task.info(self._robot, self._state)

    def step(self, action: Any) -> Outcome:
        lanes, task = self._lanes, self._task
        now, arrays = lanes.now, lanes.arrays
        before, layout = self._state, self._step.layout
        now["state"][0] = self._row if self._state_of_row is before else layout.row(before)
        now["steps"][0] = self._steps
        self._action[...] = action if np.ndim(action) == 1 else np.ravel(action)
        lanes.evaluate()
        if lanes.flags[0] >= self._step.invalid:
            self._step.refuse_not_finite(lanes.flags)
        self._steps += 1
        row = lanes.end["state"][0].copy()
        after, flags = layout.state(row), int(lanes.flags[0])
        if flags >= self._step.diverged:
            self._raise_divergence(after.q, after.v)
        lanes.accept()
        self._last, self._state = (before, self._shaped_action), after
        self._row, self._state_of_row = row, after
        observation, reward = self._shaped(arrays["observation"][0]), float(arrays["reward"][0, 0])
        return Outcome(observation, reward, flags != 0, task.info(self._robot, after))

    def _shaped(self, observation: Floats) -> Array:
        return observation.astype(self._dtype).reshape(self._shape)


def ground_episodes(task: GroundTask, engine: str, joints: JointOptions = DESCRIBED) -> Episodes:
    """Return the episodes of a task on the ground: in a lane of the kernels of `dynx.envs.ground_step`, or in
    a world where they do not have all that the task needs."""
    # Imported here, because other engines need no compiler.
    from dynx.envs.ground_step import GroundContacts

    try:
        contacts = GroundContacts.of(task, joints)
    except UnsupportedFeatureError:
        return WorldEpisodes(task, engine, joints)
    return GroundEpisodes(task, contacts, joints)


class GroundEpisodes(CompiledEpisodes):
    """Episodes of a `GroundTask` in one lane of the kernels of its vectors of environments, with their
    bits."""

    _varied: VariedGround

    def __init__(self, task: GroundTask, contacts: GroundContacts, joints: JointOptions = DESCRIBED) -> None:
        """Raises UnsupportedFeatureError for a task that cannot be compiled."""
        # Imported here, because other engines need no compiler.
        from dynx.envs.ground_step import motion_of

        self._ground, self._contacts = task, contacts
        self._randomization: Randomization | None = None
        self._motion = motion_of(task, contacts)
        super().__init__(self._motion, COMPILED, joints)

    def _open_lane(self) -> None:
        from dynx.envs.ground_step import GroundStep

        varied = VariedGround(self._motion, self._randomization, self._joints, self._contacts.touching.shapes)
        self._varied = varied
        self._use(GroundStep(self._motion, self._contacts, varied))
        longest = varied.delayed_actions
        self._waiting = WaitingActions(1, self._step.actions, longest) if longest else None
        self._delays = np.zeros(1, dtype=np.int64)

    def vary(self, randomization: Randomization) -> tuple[Parameter, ...]:
        """Return the parameters of this robot that episodes draw."""
        self._randomization = randomization
        self._open_lane()
        return self._varied.drawn_parameters

    def set_parameters(self, values: Floats) -> None:
        """Give the robot of the next episode the values (k,) of the parameters that `vary` returned."""
        super().set_parameters(values)
        if self._waiting is not None:
            self._delays = self._varied.delays(values[None])

    def push(self, acceleration: Floats) -> None:
        """Push the robot during the next step, with an acceleration (2,) [m/s^2]."""
        self._lanes.arrays["push"][0] = acceleration

    def step(self, action: Any) -> Outcome:
        if self._waiting is None:
            return super().step(action)
        flat, steps = np.reshape(action, (1, -1)), np.array([self._steps])
        (acting,) = self._waiting.acting(flat, steps, self._delays)
        outcome = super().step(acting)
        self._waiting.accept()
        return outcome

    @cached_property
    def _world(self) -> World:
        """A world that is only drawn."""
        from dynx.world.world import World

        return World(self._ground.scene(), "dynx")

    def scene_and_state(self) -> tuple[Scene, WorldState]:
        """Return the scene and its present state."""
        world, state = self._world, self._state
        (name,) = world.state.robots
        world.set_state(robots={name: (state.q, state.v)})
        return world.scene, world.state

    def picture(self, width: int, height: int) -> NDArray[np.uint8]:
        """Draw the scene by the task's camera."""
        return _draw(self._ground, *self.scene_and_state(), width, height)

    def view(self) -> None:
        """Show the scene in the browser."""
        self.scene_and_state()
        if self._viewer is None:
            self._viewer = self._world.view(steps=False)
            print(f"{type(self._task).__name__} is shown at {self._viewer.url}", flush=True)
        self._viewer.view.draw()

    def close(self) -> None:
        """Release engine and viewer. Closing twice is harmless."""
        super().close()
        if "_world" in self.__dict__:
            self._world.close()


class RobotVariation:
    """Steps of a robot with joint dynamics and drawn parameters, and the actions that act after a delay.

    The engine loads the robot anew for each episode in which masses differ.
    """

    def __init__(self, task: RobotTask, robot: VariedRobot, nominal: Backend) -> None:
        self.robot = robot
        """The parameters and what they change."""
        self._task, self._nominal = task, nominal
        self._own: Backend | None = None
        self._drawn: Floats = np.zeros(0)
        self._earlier: list[Array] = []

    def move(self, drawn: Floats) -> Move:
        """Return the steps of the integrator with these values (k,), which hold until the next call."""
        self._drawn = drawn
        parameters, values = self.robot.parameters, self.robot.values(drawn)
        self.close()
        if parameters.scaled or parameters.point_payload is not None:
            self._own = backend(self._nominal.name, parameters.model_of(values), validate=False)
        dynamics = EngineDynamics(self._nominal if self._own is None else self._own)
        joints = parameters.joints(values)
        dynamics.joints = joints
        move: Move = partial(free_move, self._task, dynamics.forward_dynamics)
        if joints is not None:
            move = EngineFriction(self._task, dynamics, joints).move
        return _stopped(self._task, move, dynamics) if self.robot.stops else move

    def acting_actions(self, action: Array, *, first: bool) -> list[Array]:
        """Return the action that acts in each step of the integrator; the `first` of an episode acts until
        a later one does."""
        if first:
            self._earlier = [action] * self.robot.delayed_actions
        acting = self.robot.acting_actions(self._drawn, action, self._earlier)
        self._earlier = [action, *self._earlier][: self.robot.delayed_actions]
        return acting

    def close(self) -> None:
        """Release the engine of the last episode."""
        if self._own is not None:
            self._own.close()
            self._own = None


def _stopped(task: RobotTask, move: Move, dynamics: EngineDynamics) -> Move:
    from dynx.envs.stops import stopped_move  # most robots of tasks have no limits

    return stopped_move(task.model, move, dynamics)


class EngineFriction(StepFriction):
    """Joint dynamics on floats, with the mass matrix and the bias of an engine."""

    def __init__(self, task: RobotTask, dynamics: EngineDynamics, joints: JointCoefficients) -> None:
        # Imported here, because its kernel needs the compiler.
        from dynx.steppers.implicit_joints import ImplicitJoints

        law = FrictionLaw.of(task.model, joints.friction)
        super().__init__(task, law.joints)
        self._dynamics, self._damping, self._springs = dynamics, joints.damping, joints.springs
        damping = joints.damping if self.damps_implicitly else None
        self._solver = ImplicitJoints(
            law, joints.friction, task.step_dt, damping=damping, armature=joints.armature
        )

    def solve(self, q: Floats, v: Floats, tau: Floats) -> tuple[Floats, Floats]:
        M, bias = self._dynamics.mass_matrix_and_bias(q, v)
        a, moves = self._solver.step(M, bias, self._slowed(tau, q, v), v)
        after = v + self._task.step_dt * a
        return a, np.sign(after[self._joints]) * moves[self._joints]

    def held(self, q: Floats, v: Floats, tau: Floats, start: Floats, modes: Floats) -> Floats:
        M, bias = self._dynamics.mass_matrix_and_bias(q, v)
        return self._solver.with_modes(M, bias, self._slowed(tau, q, v), start, modes)

    def _slowed(self, tau: Floats, q: Floats, v: Floats) -> Floats:
        if self._springs is not None:
            tau = tau + self._springs.torque(q)
        return tau if self.damps_implicitly else tau - self._damping * v


class WorldEpisodes(Episodes):
    """Episodes of a task in a world, which is opened once, or anew for an episode with a scene of its own."""

    def __init__(self, task: WorldTask, engine: str, joints: JointOptions = DESCRIBED) -> None:
        self._task, self._engine = task, engine
        self._options = {
            "dt": task.control_dt,
            "substeps": task.substeps,
            "contact_interval": task.contact_interval,
            **task.settings.get(engine, {}),
            **joints.switched_off,
        }
        self._varied: VariedScene | None = None
        self._values: NDArray[np.float64] = np.zeros(0)
        self._waiting: deque[Any] = deque()
        self._push: Floats | None = None
        self._world = self._open(task.scene())
        self._start: Snapshot | None = None
        self._viewer: Any = None
        self._episode: Episode | None = None
        self._action: Any = None

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
        """Return the parameters of the scene that episodes draw, and the delay. Raises the error of the
        engine for a scene that it cannot represent."""
        varied = self._varied = VariedScene(self._task.scene(), randomization, self._task.control_dt)
        if varied.changes_scene:
            greatest = np.array([each.distribution.bounds[1] for each in varied.parameters])
            self._open(varied.scene(self._task.scene(), greatest)).close()
        return varied.parameters

    def set_parameters(self, values: NDArray[np.float64]) -> None:
        """Give the scene of the next episode the values (k,) of the parameters that `vary` returned."""
        self._values = values

    def push(self, acceleration: Floats) -> None:
        """Push the robots during the next step, with an acceleration (2,) [m/s^2]."""
        self._push = acceleration if acceleration.any() else None

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
        if self._world.scene.sensors:
            # Otherwise their errors would be the same in all episodes and copies.
            self._world.rollout = int(rng.integers(2**53))
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
        loads = task.loads(episode, action)
        if self._varied is not None:
            loads = self._varied.loads(loads, self._values)
        if self._push is not None:
            pushes = pushing_forces(self._world.scene, self._push)
            loads = {**loads, "forces": [*loads.get("forces", ()), *pushes]}
        self._world.step(**loads)
        task.settle(episode, action)
        self._action = action
        terminated = bool(task.terminated(episode))
        return Outcome(
            task.observation(episode), float(task.reward(episode, action)), terminated, task.info(episode)
        )

    def picture(self, width: int, height: int) -> NDArray[np.uint8]:
        """Draw the world by the task's camera."""
        return _draw(self._task, *self.scene_and_state(), width, height)

    def scene_and_state(self) -> tuple[Scene, WorldState]:
        """Return the scene of the present episode, and its state."""
        return self._world.scene, self._world.state

    def reward_terms(self) -> Mapping[str, float]:
        if self._action is None:
            return {}
        return self._task.reward_terms(self.episode, self._action)

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
        # Imported here, because tasks of one robot need no world.
        from dynx.world.world import World

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


def pushing_forces(scene: Scene, acceleration: Floats) -> list[ExternalForce]:
    """Return the forces that accelerate every link of the robots of a scene by (2,) [m/s^2] along x and y."""
    ax, ay = acceleration.tolist()
    return [
        ExternalForce(
            f"{robot.name}/{link.name}",
            (link.inertial.mass * ax, link.inertial.mass * ay, 0.0, 0.0, 0.0, 0.0),
            point=link.inertial.origin.xyz,
        )
        for robot in scene.robots
        for link in robot.model.links
        if link.inertial is not None and link.inertial.mass > 0.0
    ]


def draw_robot(task: RobotTask, state: State, width: int, height: int) -> NDArray[np.uint8]:
    """Draw the robot (height, width, 3), seen by the camera of the task."""
    return _draw(task, _scene_of_robot(task), _state_of_robot(state), width, height)


def draw_on_ground(
    task: GroundTask, states: Iterable[State], width: int, height: int
) -> Iterator[NDArray[np.uint8]]:
    """Draw the scene (height, width, 3) with the robot in each of some states, seen by the task's camera."""
    # Imported here, because most environments draw no picture.
    from dynx.world.world import World

    with World(task.scene(), "dynx") as world:
        (name,) = world.state.robots
        for state in states:
            world.set_state(robots={name: (state.q, state.v)})
            yield _draw(task, world.scene, world.state, width, height)


def _draw(
    task: RobotTask | WorldTask, scene: Scene, state: WorldState, width: int, height: int
) -> NDArray[np.uint8]:
    # Imported here, because most environments draw no picture.
    from dynx.world.camera import cast_rays_smoothly, draw_picture

    return draw_picture(scene, state, replace(task.camera, size=(width, height)), cast_rays_smoothly).rgb


def _scene_of_robot(task: RobotTask) -> Scene:
    from dynx.world import Scene, SceneRobot

    return Scene(type(task).__name__, robots=(SceneRobot(ROBOT, task.model),))


def _state_of_robot(state: State) -> WorldState:
    return WorldState(0.0, {ROBOT: RobotState(state.q, state.v)}, {})
