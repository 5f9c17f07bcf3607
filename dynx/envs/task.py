"""`Task`: what is observed, done and rewarded, without an engine; `Episodes`: a task on one engine.

An environment (`dynx.envs.environment`) is made of a task and the name of an engine: it checks actions and
the order of calls, and leaves the motion to the `Episodes` that the task opens on the engine.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any, ClassVar, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from dynx.envs.library import Space
from dynx.envs.randomization import Parameter, Randomization
from dynx.errors import ArgumentError, UnknownNameError, UnsupportedFeatureError, nearest, shown

Kind = TypeVar("Kind", bound="Task")

XYZ = ("x", "y", "z")
"""Names of the components of a vector."""

ENVIRONMENT_OPTIONS = ("engine", "render_mode", "randomize", "width", "height")
"""Options of every environment, beside those of its task."""


class Outcome(NamedTuple):
    """The outcome of one step, as `gymnasium.Env.step` returns it but for ``truncated``, which is the time
    limit's."""

    observation: Any
    reward: float
    terminated: bool
    """True where the task itself ends the episode: it succeeded or failed, so no reward can follow."""
    info: dict[str, Any]


class Task(ABC):
    """A task, with its options as the fields of a frozen dataclass; it keeps no state.

    A subclass is a task of one kind of motion: `dynx.envs.RobotTask` (a robot without contacts, on any
    backend) or `dynx.envs.WorldTask` (a scene with contacts, on any world engine).
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
    def open(self, engine: str) -> Episodes:
        """Return the episodes of this task on an engine, which is one of `engines`."""

    @classmethod
    def with_options(cls: type[Kind], options: Mapping[str, Any]) -> Kind:
        """Return the task with these options. Raises UnknownNameError for one that it does not have."""
        kind: Any = cls
        known = [each.name for each in fields(kind) if each.init] if is_dataclass(kind) else []
        for name in options:
            if name not in known:
                names = [*known, *ENVIRONMENT_OPTIONS]
                raise UnknownNameError(f"{cls.__name__} has no option {shown(name)}{nearest(name, names)}")
        return cls(**options)


class Episodes(ABC):
    """Episodes of a task on one engine, one after another. Arguments were checked by the environment."""

    def vary(self, randomization: Randomization) -> tuple[Parameter, ...]:
        """Return the parameters of the motion that later episodes draw: those of `randomization` that are
        neither noise of observations nor of actions.

        Raises UnsupportedFeatureError by default, UnknownNameError for a part that the task does not have.
        """
        raise UnsupportedFeatureError(f"{type(self).__name__} has no parameters that episodes can draw")

    def set_parameters(self, values: NDArray[np.float64]) -> None:
        """Set the values (k,) of the parameters that `vary` returned, before the next episode starts."""
        raise UnsupportedFeatureError(f"{type(self).__name__} has no parameters that episodes can draw")

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

    @abstractmethod
    def close(self) -> None:
        """Release engine and viewer. Closing twice is harmless."""


def checked_engine(kind: type[Task], engine: str | None) -> str:
    """Return the name of an engine on which a task runs, its default for None.

    Raises ArgumentError for an engine that tasks of this kind do not run on.
    """
    known = kind.engines()
    if engine is None:
        return known[0]
    if engine not in known:
        raise ArgumentError(
            f"{kind.__name__} does not run on engine {shown(engine)}{nearest(str(engine), known)}"
        )
    return engine


def component_names(vector: str, components: Sequence[str] = XYZ) -> tuple[str, ...]:
    """Return the names of the components of a vector in an observation, such as ``goal x``."""
    return tuple(f"{vector} {component}" for component in components)
