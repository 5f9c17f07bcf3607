"""`GroundTask`: a task of one robot with position motors on the ground, whose hooks are array code.

The hooks run on floats in the worlds of all engines, and on symbols in a compiled kernel
(`dynx.envs.ground_step`), which steps many environments.
"""

from __future__ import annotations

import inspect
from abc import abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dynx.envs.task import DESCRIBED, NO_MEMORY, Episode, Episodes, JointOptions, State, WorldTask, opened
from dynx.errors import ArgumentError, UnknownNameError, UnsupportedFeatureError, nearest, shown
from dynx.model import Model
from dynx.spatial.scalar import Array, Floats

if TYPE_CHECKING:
    from dynx.world import SceneRobot
    from dynx.world.world import World

KERNEL_ENGINE = "dynx"
"""World engine whose episodes step in a compiled kernel, where it has all that a task needs."""

WORLD_METHODS = ("start", "loads", "settle", "observation", "reward", "reward_terms", "terminated", "info")
"""Methods of `WorldTask` that `GroundTask` implements by its hooks."""


NO_FORCES: Array = np.zeros((0, 3))
NO_FORCES.setflags(write=False)


class GroundState(State):
    """Configuration and velocity of a robot on the ground, the memory of the task, and contact forces."""

    forces: Array = NO_FORCES
    """Contact force (n, 3) on each of the task's `contact_links` in the axes of the world, mean over the last
    control step [N]; 0 before the first."""

    def __new__(cls, q: Array, v: Array, memory: Array = NO_MEMORY, forces: Array = NO_FORCES) -> GroundState:
        """Return a state; `forces` are (n, 3) [N]."""
        made = super().__new__(cls, q, v, memory)
        made.forces = forces
        return made


class GroundTask(WorldTask):
    """A task of one robot whose joints follow target positions, on a ground that does not move.

    The hooks compute with NumPy's functions for one environment: on floats, and in a compiled kernel on
    symbols. So they must not branch on a value (write ``np.where``), and must return the same result for the
    same arguments. `State.memory` has the numbers that the task keeps during an episode.
    """

    kp: ClassVar[ArrayLike]
    """Position gain of the motors, one number or one for each joint [N m/rad or N/m]."""
    kd: ClassVar[ArrayLike]
    """Velocity gain of the motors [N m s/rad or N s/m]."""
    max_torque: ClassVar[ArrayLike]
    """Largest torque of the motors [N m or N]."""
    random_size: ClassVar[int] = 0
    """Number of random numbers that `initial_state` takes."""

    @property
    def contact_links(self) -> tuple[str, ...]:
        """Names of the links whose contact forces the hooks read as ``state.forces``; by default none."""
        return ()

    @abstractmethod
    def initial_state(self, random: Array) -> State:
        """Return the state at the start of an episode, from numbers (random_size,) uniform in [0, 1).

        Keyword arguments after `random` are the options of `reset`; they need defaults.
        """

    @abstractmethod
    def targets(self, state: GroundState, action: Array) -> Array:
        """Return the target positions (n joints,) of the motors during a control step."""

    def remember(self, state: GroundState, action: Array) -> Array:
        """Return the memory (k,) after a control step; by default it is unchanged."""
        return state.memory

    @abstractmethod
    def observe(self, state: GroundState) -> Array:
        """Return the observation, an array of the observation space's shape."""

    @abstractmethod
    def terms(self, before: GroundState, action: Array, after: GroundState) -> Mapping[str, Any]:
        """Return the terms whose sum is the reward of a control step, by name."""

    def is_over(self, state: GroundState) -> Any:
        """Check whether the episode is over; by default it never is."""
        return False

    def describe(self, state: GroundState) -> dict[str, Any]:
        """Return the info of a step; by default it is empty."""
        return {}

    # -- the robot --------------------------------------------------------------------------------

    @property
    def robot(self) -> SceneRobot:
        """The robot of the scene. Raises UnsupportedFeatureError for a scene with another number of them."""
        robots = self.scene().robots
        if len(robots) != 1:
            raise UnsupportedFeatureError(
                f"the scene of {type(self).__name__} has {len(robots)} robots; wanted one"
            )
        return robots[0]

    @property
    @abstractmethod
    def model(self) -> Model:
        """The robot; write it as a `functools.cached_property`."""

    # -- in a world -------------------------------------------------------------------------------

    def require_start_options(self, options: Mapping[str, Any]) -> None:
        """Raise UnknownNameError for an option of `reset` that `initial_state` does not take."""
        known = list(inspect.signature(self.initial_state).parameters)[1:]
        for name in options:
            if name not in known:
                raise UnknownNameError(
                    f"{type(self).__name__} has no option {shown(name)} of reset{nearest(name, known)}"
                )

    def require_contact_links(self) -> None:
        """Raise UnknownNameError for a name of `contact_links` that the robot does not have, ArgumentError
        for a link without a collision shape."""
        for name in self.contact_links:
            if not self.model.geometry.collisions(self.model.link(name).name):
                raise ArgumentError(f"{name} has no collision shape, so nothing touches it")

    def start(self, episode: Episode, **options: Any) -> None:
        """Set the state of the world and the memory to those of `initial_state`."""
        first = self.initial_state(episode.rng.random(self.random_size), **options)
        (name,) = episode.world.state.robots
        episode.world.set_state(robots={name: (first.q, first.v)})
        episode.memory.numbers = np.array(first.memory, dtype=np.float64)
        episode.memory.forces = np.zeros((len(self.contact_links), 3))

    @property
    def contact_interval(self) -> float | None:
        """Interval [s] over which a world sums contacts: a control step, if the task has `contact_links`."""
        return self.control_dt if self.contact_links else None

    def state(self, episode: Episode) -> GroundState:
        """Return the present state of the robot in a world."""
        ((q, v),) = episode.world.state.robots.values()
        return GroundState(q, v, episode.memory.numbers, episode.memory.forces)

    def loads(self, episode: Episode, action: Any) -> Mapping[str, Any]:
        """Return motors with the `targets`."""
        from dynx.world.motors import PositionMotor

        before = episode.memory.before = self.state(episode)
        target = self.targets(before, np.asarray(action, dtype=np.float64))
        (name,) = episode.world.state.robots
        return {"motors": {name: PositionMotor(target, kp=self.kp, kd=self.kd, max_force=self.max_torque)}}

    def settle(self, episode: Episode, action: Any) -> None:
        """Keep the contact forces, and the memory that `remember` returns."""
        memory, given = episode.memory, np.asarray(action, dtype=np.float64)
        if self.contact_links:
            memory.forces = np.array(
                [self._contact_force(episode.world, link) for link in self.contact_links]
            )
        memory.numbers = self.remember(self.state(episode), given)

    def _contact_force(self, world: World, link: str) -> Floats:
        """Return the mean contact force (3,) on a link in the last control step [N], in world axes."""
        (name,) = world.state.robots
        part = f"{name}/{link}"
        means = world.mean_contacts(part)
        return sum((each.force if each.a == part else -each.force for each in means), np.zeros(3))

    def observation(self, episode: Episode) -> NDArray[Any]:
        """Return what `observe` returns."""
        return np.asarray(self.observe(self.state(episode)), dtype=self.observation_space.dtype)

    def reward(self, episode: Episode, action: Any) -> float:
        """Return the sum of the terms."""
        return float(sum(self.reward_terms(episode, action).values()))

    def reward_terms(self, episode: Episode, action: Any) -> Mapping[str, float]:
        """Return the `terms` of the last step."""
        given = np.asarray(action, dtype=np.float64)
        terms = self.terms(episode.memory.before, given, self.state(episode))
        return {name: float(value) for name, value in terms.items()}

    def terminated(self, episode: Episode) -> bool:
        """Check `is_over`."""
        return bool(self.is_over(self.state(episode)))

    def info(self, episode: Episode) -> dict[str, Any]:
        """Return what `describe` returns."""
        return self.describe(self.state(episode))

    def open(self, engine: str, joints: JointOptions = DESCRIBED) -> Episodes:
        """Return the episodes of this task: on engine `dynx` in a lane of the kernel of vectors of
        environments, where it has all that the task needs; otherwise in a world."""
        self.require_contact_links()
        make = "ground_episodes" if engine == KERNEL_ENGINE else "WorldEpisodes"
        return opened(make, self, engine, joints)

    @final
    def refuse_other_hooks(self) -> None:
        """Raise UnsupportedFeatureError for a method of `WorldTask` that a subclass defines, which a kernel
        does not call."""
        for name in WORLD_METHODS:
            if getattr(type(self), name) is not getattr(GroundTask, name):
                raise UnsupportedFeatureError(
                    f"{type(self).__name__} has a method {name} of its own, which needs a world; a kernel "
                    "has the hooks of GroundTask"
                )
