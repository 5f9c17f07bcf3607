"""Tasks: what is observed, done and rewarded, without an engine; `Episodes`: a task on one engine.

An environment (`dynx.envs.environment`) is made of a task and the name of an engine: it checks actions and
the order of calls, and leaves the motion to the `Episodes` that the task opens on the engine
(`dynx.envs.runner`).
"""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from functools import cached_property
from importlib import import_module
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dynx.backends.dynamics import Dynamics
from dynx.backends.registry import backend_names
from dynx.envs.library import Space
from dynx.envs.randomization import Parameter, Randomization
from dynx.errors import ArgumentError, UnknownNameError, UnsupportedFeatureError, nearest, shown
from dynx.model import Model
from dynx.model.numbers import MAX_MAGNITUDE, is_real
from dynx.option_names import right_name
from dynx.rbd.integration import Accelerate, ExplicitEuler, RungeKutta4, SemiImplicitEuler
from dynx.rbd.parameters import SPRING
from dynx.registry import DEFAULT_ENGINE
from dynx.spatial.scalar import Array
from dynx.steppers.registry import world_names
from dynx.steppers.settings import checked_switches

if TYPE_CHECKING:
    from dynx.steppers.camera import Camera
    from dynx.steppers.state import WorldState
    from dynx.world import Scene
    from dynx.world.world import World

Kind = TypeVar("Kind", bound="Task")

DEFAULT_WORLD_ENGINE = "pybullet"
"""Engine that runs a task in a world unless another is named."""

XYZ = ("x", "y", "z")
"""Names of the components of a vector."""


@dataclass(frozen=True)
class JointOptions:
    """Joint dynamics and limits of the description that an environment's joints have, as in a `dynx.World`.

    Raises ArgumentError for an option that is neither True nor False.
    """

    joint_damping: bool = True
    """Viscous damping."""
    joint_friction: bool = True
    """Dry friction."""
    joint_armature: bool = True
    """Rotor inertia."""
    joint_springs: bool = True
    """Springs."""
    joint_limits: bool = True
    """Stops at the position limits."""

    def __post_init__(self) -> None:
        checked_switches(**vars(self))

    def has(self, coefficient: str) -> bool:
        """Check whether joints have a coefficient of the description: damping, friction, armature, or one of
        their springs."""
        return bool(getattr(self, "joint_springs" if coefficient in SPRING else f"joint_{coefficient}"))

    @property
    def switched_off(self) -> dict[str, bool]:
        """The options that are False, as arguments of `dynx.World`."""
        return {name: False for name, value in vars(self).items() if not value}


DESCRIBED = JointOptions()
"""All joint dynamics and limits of the description."""

ENVIRONMENT_OPTIONS = ("engine", "render_mode", "randomize", "width", "height", *vars(DESCRIBED))
"""Options of every environment, beside those of its task."""


class Outcome(NamedTuple):
    """The outcome of one step, as `gymnasium.Env.step` returns it, without ``truncated``, which the time
    limit sets."""

    observation: Any
    reward: float
    terminated: bool
    """True where the task itself ends the episode: it succeeded or failed, so no reward can follow."""
    info: dict[str, Any]


class Task(ABC):
    """A task of reinforcement learning: a frozen dataclass without state, whose fields are its options.

    Derive your task from the subclass for its kind of motion: `dynx.envs.RobotTask` (a robot without
    contacts, on any backend) or `dynx.envs.WorldTask` (a scene with contacts, on any world engine).
    """

    control_dt: ClassVar[float]
    """Time between two actions [s]."""
    max_episode_steps: ClassVar[int | None] = None
    """Number of steps after which an episode is truncated; None for a task without a time limit."""
    reward_threshold: ClassVar[float | None] = None
    """Mean return at which the task counts as solved."""

    @property
    @abstractmethod
    def observation_space(self) -> Space[Any]:
        """Space of the observations."""

    @property
    def observation_names(self) -> tuple[str, ...]:
        """Names of the entries of the observation; empty where a task does not name them."""
        return ()

    @property
    @abstractmethod
    def action_space(self) -> Space[Any]:
        """Space of the actions."""

    @classmethod
    @abstractmethod
    def engines(cls) -> tuple[str, ...]:
        """Return the names of the engines on which tasks of this kind run, the default first."""

    @abstractmethod
    def open(self, engine: str, joints: JointOptions = DESCRIBED) -> Episodes:
        """Return the episodes of this task on an engine, which is one of `engines`, with joint dynamics."""

    @classmethod
    def with_options(cls: type[Kind], options: Mapping[str, Any]) -> Kind:
        """Return the task with these options. Raises UnknownNameError for an option that the task does not
        have."""
        kind: Any = cls
        known = [each.name for each in fields(kind) if each.init] if is_dataclass(kind) else []
        for name in options:
            if name not in known:
                names = [*known, *ENVIRONMENT_OPTIONS]
                raise UnknownNameError(f"{cls.__name__} has no option {shown(name)}{right_name(name, names)}")
        return cls(**options)

    def require_start_options(self, options: Mapping[str, Any]) -> None:
        """Raise UnknownNameError for an option of `reset` that `start` does not take."""
        start: Any = getattr(self, "start", None)
        known = list(inspect.signature(start).parameters)[1:]
        for name in options:
            if name not in known:
                raise UnknownNameError(
                    f"{type(self).__name__} has no option {shown(name)} of reset{nearest(name, known)}"
                )


class Episodes(ABC):
    """Episodes of a task on one engine, one after another. Arguments were checked by the environment."""

    def vary(self, randomization: Randomization) -> tuple[Parameter, ...]:
        """Return the parameters of the motion that later episodes draw: those of `randomization` that are
        neither noise of observations nor of actions, nor pushes.

        Raises UnsupportedFeatureError by default, UnknownNameError for a part that the task does not have.
        """
        raise UnsupportedFeatureError(f"{type(self).__name__} has no parameters that episodes can draw")

    def set_parameters(self, values: NDArray[np.float64]) -> None:
        """Set the values (k,) of the parameters that `vary` returned, before the next episode starts."""
        raise UnsupportedFeatureError(f"{type(self).__name__} has no parameters that episodes can draw")

    def push(self, acceleration: NDArray[np.float64]) -> None:
        """Push the robots during the next step: a force that is proportional to its mass acts on every link.

        `acceleration` (2,) [m/s^2] is that of a robot on which nothing else acts, along x and y of the world.
        """
        raise UnsupportedFeatureError(f"{type(self).__name__} has no pushes")

    @abstractmethod
    def start(self, rng: np.random.Generator, options: Mapping[str, Any]) -> tuple[Any, dict[str, Any]]:
        """Start an episode whose random numbers are those of `rng`; return observation and info.

        Raises UnknownNameError for an option that the task does not have.
        """

    @abstractmethod
    def step(self, action: Any) -> Outcome:
        """Act for `Task.control_dt` seconds. `action` is an element of the action space."""

    @abstractmethod
    def picture(self, width: int, height: int) -> NDArray[np.uint8]:
        """Draw the present state (height, width, 3), seen by the task's camera."""

    @abstractmethod
    def view(self) -> None:
        """Show the present state in the browser; the first call opens a viewer."""

    def scene_and_state(self) -> tuple[Scene, WorldState] | None:
        """Return what is drawn and its present state; None, the default, for episodes with pictures only."""
        return None

    def reward_terms(self) -> Mapping[str, float]:
        """Return the terms of the reward of the last step by name; empty where the task names none."""
        return {}

    @abstractmethod
    def close(self) -> None:
        """Release engine and viewer. Closing twice is harmless."""


NO_MEMORY: Array = np.zeros(0)
NO_MEMORY.setflags(write=False)


class State(NamedTuple):
    """Configuration and velocity of the robot, and what else the task keeps during an episode.

    The arrays hold floats, or in a compiled kernel symbols.
    """

    q: Array
    """Configuration (nq,) [rad or m]."""
    v: Array
    """Velocity (nv,) [rad/s or m/s]."""
    memory: Array = NO_MEMORY
    """Numbers (k,) that the task keeps, such as the goal of the episode."""


SCHEMES: dict[str, Callable[[Model, float], Any]] = {
    "euler": ExplicitEuler,
    "semi_implicit": SemiImplicitEuler,
    "rk4": RungeKutta4,
}
"""Integration schemes by name, made of a model and a step [s]."""


class RobotTask(Task):
    """A task of one robot without contacts, whose dynamics a backend of dynx evaluates.

    The robot that moves has the joint dynamics and limits of its description, unless options of the
    environment switch them off. The methods compute with rigid bodies alone, and ``robot.joints`` has the
    coefficients.

    All methods are array code for one environment: they compute with NumPy's functions on arrays of floats,
    and in a vector environment on symbols, from which one kernel is compiled. So they must not branch on a
    value (write ``np.where``) and must return the same result for the same arguments. Use only the random
    numbers that `start` receives. A kernel refuses other random numbers with an ArgumentError. `robot`
    evaluates quantities of the robot at a configuration: ``robot.forward_kinematics(q, frame)``,
    ``robot.bias_torque(q, v)`` and the others of `dynx.backends.dynamics.Dynamics`.
    """

    substeps: ClassVar[int] = 1
    """Steps of the integrator in a control step; the torque is evaluated at the start of each."""
    integrator: ClassVar[str] = "semi_implicit"
    """Name of the integration scheme: ``semi_implicit``, ``rk4`` or ``euler`` (explicit)."""
    random_size: ClassVar[int] = 0
    """Number of random numbers that `start` takes."""
    hook_names: ClassVar[Mapping[str, str]] = {}
    """Names of hooks in messages, where they are others than those of the methods."""

    @property
    def described(self) -> Task:
        """The task that the user wrote."""
        return self

    @property
    @abstractmethod
    def model(self) -> Model:
        """The robot; write it as a `functools.cached_property`."""

    @abstractmethod
    def start(self, random: Array) -> State:
        """Return the state at the start of an episode, from numbers (random_size,) uniform in [0, 1).

        Keyword arguments after `random` are the options of `reset`; they need defaults.
        """

    @abstractmethod
    def torque(self, robot: Dynamics, state: State, action: Array) -> Array:
        """Return the torque (nv,) [N m or N] of an action: an array of the action space's shape, or for a
        `Discrete` space one number, as a float."""

    @abstractmethod
    def observation(self, robot: Dynamics, state: State) -> Array:
        """Return the observation, an array of the observation space's shape."""

    @abstractmethod
    def reward(self, robot: Dynamics, before: State, action: Array, after: State) -> Any:
        """Return the reward of a control step, one number."""

    def reward_terms(
        self, robot: Dynamics, before: State, action: Array, after: State
    ) -> Mapping[str, float]:
        """Return the terms whose sum is the reward, by name; by default none.

        The terms are only for display. They do not determine the reward: `reward` does, and it has to compute
        the sum itself.
        """
        return {}

    def terminated(self, robot: Dynamics, state: State) -> Any:
        """Check whether the episode is over in a state; by default it never is."""
        return False

    def settle(self, state: State) -> State:
        """Return the state with which the task goes on after a control step: clamped, or with angles wrapped.

        By default it is unchanged.
        """
        return state

    def advance(self, accelerate: Accelerate, q: Array, v: Array) -> tuple[Array, Array]:
        """Return q and v after one step of the integrator; by default by the scheme `integrator`."""
        q, v, _ = self._scheme(accelerate, q, v)
        return q, v

    def info(self, robot: Dynamics, state: State) -> dict[str, Any]:
        """Return the info of a step; by default it is empty. Only single environments have it."""
        return {}

    @cached_property
    def camera(self) -> Camera:
        """Camera of the pictures; the environment replaces its size."""
        return camera_at((0.0, -3.0, 0.6), (0.0, 0.0, 0.4))

    @property
    def step_dt(self) -> float:
        """Step of the integrator [s]."""
        return self.control_dt / self.substeps

    @cached_property
    def _scheme(self) -> Any:
        scheme = self.integrator.replace("-", "_")  # as the command line spells it
        if scheme not in SCHEMES:
            raise ArgumentError(f"integrator is {shown(self.integrator)}{nearest(self.integrator, SCHEMES)}")
        if scheme == "semi_implicit" and self.model.floating:
            # Its compiled step of a base on floats is imported only where there is one.
            from dynx.steppers.integrators import CompiledBaseEuler

            return CompiledBaseEuler(self.model, self.step_dt)
        return SCHEMES[scheme](self.model, self.step_dt)

    @classmethod
    def engines(cls) -> tuple[str, ...]:
        """Return the names of all backends, the default first."""
        return tuple(dict.fromkeys((DEFAULT_ENGINE, *backend_names())))

    def open(self, engine: str, joints: JointOptions = DESCRIBED) -> Episodes:
        """Return the episodes of this task on a backend."""
        return opened("robot_episodes", self, engine, joints)


Move = Callable[..., tuple[Array, Array]]
"""Function of q (nq,), v (nv,) and tau (nv,) at the beginning of a step of the integrator that returns q and
v at its end."""


def free_move(
    task: RobotTask, forward_dynamics: Callable[..., Any], q: Array, v: Array, tau: Array
) -> tuple[Array, Array]:
    """Return q and v after a step of the integrator without joint friction."""
    return task.advance(lambda q, v: forward_dynamics(q, v, tau), q, v)


class StepFriction(ABC):
    """Joint friction in the steps of a task, by the law of `dynx.rbd.joint_friction`, for any scalar.

    Which joints stick is found by the law at the beginning of a step, and held to its end.
    """

    def __init__(self, task: RobotTask, joints: Sequence[int]) -> None:
        """`joints` are the numbers of the coordinates with dry friction."""
        self._task, self._joints = task, list(joints)
        self.damps_implicitly = task.integrator != "rk4"
        """True if damping acts on the velocity at the end of a step, as the law has it."""

    @abstractmethod
    def solve(self, q: Array, v: Array, tau: Array) -> tuple[Array, Array]:
        """Return the acceleration (nv,), and the modes (n,) of the joints: 0 for one that sticks, otherwise
        the sign of its velocity after the step."""

    @abstractmethod
    def held(self, q: Array, v: Array, tau: Array, start: Array, modes: Array) -> Array:
        """Return the acceleration (nv,) in given modes; joints that stick lose the velocity `start`."""

    def move(self, q: Array, v: Array, tau: Array) -> tuple[Array, Array]:
        """Return q and v after a step of the integrator; joints that stick are at rest after it."""
        a, modes = self.solve(q, v, tau)

        def accelerate(at: Array, velocity: Array) -> Array:
            return a if at is q and velocity is v else self.held(at, velocity, tau, v, modes)

        q_next, v_next = self._task.advance(accelerate, q, v)
        v_next, joints = v_next.copy(), self._joints
        v_next[joints] = np.where(modes * v_next[joints] > 0.0, v_next[joints], 0.0)
        return q_next, v_next


@dataclass
class Episode:
    """One episode: a world, its random numbers, and what else the task keeps between two steps."""

    world: World
    rng: np.random.Generator
    memory: SimpleNamespace
    """Values that the task keeps, as attributes, such as the goal of the episode."""


class WorldTask(Task):
    """A task in a scene with contacts, which an engine steps through `dynx.world.World`.

    The order of calls: `start` sets the state of an episode and its memory. Then, for each action, `loads`
    returns the torques, motors and forces, the world takes a step of `control_dt`, and `settle` updates the
    memory. Then `observation`, `reward`, `terminated` and `info` read the world and the memory.
    """

    substeps: ClassVar[int] = 1
    """Steps of the engine in a control step."""
    settings: ClassVar[Mapping[str, Mapping[str, Any]]] = {}
    """Options of `World` by engine, such as ``{"pybullet": {"solver_iterations": 50}}``."""

    @property
    def contact_interval(self) -> float | None:
        """Interval [s] over which `World.mean_contacts` sums contacts; by default None, without sums."""
        return None

    @abstractmethod
    def scene(self) -> Scene:
        """Return the scene in which episodes start."""

    def scene_of_episode(self, rng: np.random.Generator, memory: SimpleNamespace) -> Scene | None:
        """Return the scene of an episode that differs from the others in more than the state, or None.

        `memory` is the memory of the episode. dynx opens a returned scene in the engine anew, which takes
        milliseconds. With None the world returns to its start.
        """
        return None

    @abstractmethod
    def start(self, episode: Episode) -> None:
        """Set the state of the world, which is at the start of the scene, and the memory.

        Keyword arguments after `episode` are the options of `reset`; they need defaults.
        """

    @abstractmethod
    def loads(self, episode: Episode, action: Any) -> Mapping[str, Any]:
        """Return what acts during a control step, as arguments of `World.step`: ``torques``, ``motors``,
        ``forces``."""

    def settle(self, episode: Episode, action: Any) -> None:
        """Update the memory after a control step; by default it is unchanged."""
        return

    @abstractmethod
    def observation(self, episode: Episode) -> NDArray[Any]:
        """Return the observation, of the observation space's shape and dtype."""

    @abstractmethod
    def reward(self, episode: Episode, action: Any) -> float:
        """Return the reward of a control step."""

    def reward_terms(self, episode: Episode, action: Any) -> Mapping[str, float]:
        """Return the terms whose sum is the reward, by name; by default none.

        The terms are only for display. They do not determine the reward: `reward` does, and it has to compute
        the sum itself.
        """
        return {}

    def terminated(self, episode: Episode) -> bool:
        """Check whether the task ended the episode; by default it never does."""
        return False

    def info(self, episode: Episode) -> dict[str, Any]:
        """Return the info of a step; by default it is empty."""
        return {}

    @cached_property
    def camera(self) -> Camera:
        """Camera of the pictures; the environment replaces its size."""
        return camera_at((1.5, -1.5, 1.0), (0.0, 0.0, 0.2))

    @classmethod
    def engines(cls) -> tuple[str, ...]:
        """Return the names of the engines that run worlds with contacts, the default first."""
        return tuple(dict.fromkeys((DEFAULT_WORLD_ENGINE, *world_names())))

    def open(self, engine: str, joints: JointOptions = DESCRIBED) -> Episodes:
        """Return the episodes of this task in a world of an engine."""
        return opened("WorldEpisodes", self, engine, joints)


def checked_engine(kind: type[Task], engine: str | None) -> str:
    """Return the name of an engine on which a task runs, its default for None.

    Raises ArgumentError for an engine that tasks of this kind do not run on.
    """
    known = kind.engines()
    if engine is None:
        return known[0]
    if engine not in known:
        raise ArgumentError(f"{kind.__name__} does not run on engine {shown(engine)}{nearest(engine, known)}")
    return engine


def component_names(vector: str, components: Sequence[str] = XYZ) -> tuple[str, ...]:
    """Return the names of the components of a vector in an observation, such as ``goal x``."""
    return tuple(f"{vector} {component}" for component in components)


def refuse_unknown_choice(name: str, value: object, known: Sequence[str]) -> None:
    """Raise ArgumentError for an option that is not one of the `known` words."""
    if value not in known:
        raise ArgumentError(f"{name} is {shown(value)}{nearest(value, known)}")


def refuse_unphysical(name: str, value: object, unit: str, *, zero: bool = False) -> None:
    """Raise ArgumentError for an option that is no number above 0, or with `zero` of at least 0."""
    if not is_real(value) or not (value >= 0.0 if zero else value > 0.0) or not value < MAX_MAGNITUDE:
        wanted = "of at least 0" if zero else "above 0"
        raise ArgumentError(f"{name} is {shown(value)}; wanted a number {wanted} [{unit}]")


def opened(make: str, task: Task, engine: str, joints: JointOptions) -> Episodes:
    """Return the episodes of a task, made by `dynx.envs.runner`, which imports this module."""
    episodes: Episodes = getattr(import_module("dynx.envs.runner"), make)(task, engine, joints)
    return episodes


def camera_at(position: ArrayLike, target: ArrayLike, **options: Any) -> Camera:
    """Return the camera at a position [m] that looks at a target [m], with options of `Camera.look_at`.

    Cameras are imported here, because most environments draw no picture.
    """
    from dynx.steppers.camera import Camera

    return Camera.look_at(position, target, **options)


PAINTS = {
    "dark": (0.25, 0.27, 0.3),
    "white": (0.92, 0.92, 0.9),
    "stone": (0.5, 0.47, 0.44),
    "blue": (0.0, 0.447, 0.698),
    "orange": (0.902, 0.624, 0.0),
    "yellow": (0.941, 0.894, 0.259),
}
"""Colours of the parts of tasks, told apart with any colour vision (Okabe and Ito 2008)."""


def painted(paint: str) -> str:
    """Return the element of URDF that gives a visual one of the `PAINTS`."""
    red, green, blue = PAINTS[paint]
    return f'<material name="{paint}"><color rgba="{red} {green} {blue} 1"/></material>'
