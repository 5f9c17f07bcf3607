"""What is trained: the task, the algorithm and everything else that a run depends on, as data."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Any, Final, Literal

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, shown
from dynx.files.documents import convert_document, to_json_values
from dynx.model.numbers import checked_seed, whole_number


@checks_types
@dataclass(frozen=True)
class TaskSpec:
    """A Gymnasium task: its identifier, the engine of a task of dynx, and options of `gymnasium.make`."""

    id: str
    engine: str | None = None
    options: dict[str, Any] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Words for it: the identifier, and the engine."""
        return self.id if self.engine is None else f"{self.id} on {self.engine}"

    def arguments(self) -> dict[str, Any]:
        """Return the keyword arguments of `gymnasium.make` for it."""
        return self.options if self.engine is None else {"engine": self.engine, **self.options}

    def on(self, engine: str | None) -> TaskSpec:
        """Return the task on another engine; on its own for None."""
        return self if engine is None else replace(self, engine=engine)


@checks_types
@dataclass(frozen=True)
class TrainingSpec:
    """All that a training run depends on; a run is resumed only with an equal one, or with
    more steps.

    `hyperparameters` are arguments of the algorithm of stable-baselines3; ``lin_0.001`` falls linearly to
    zero until the end. `envs` environments are stepped together, in as many processes with `processes`. With
    `normalize`, observations and rewards are scaled by their running mean and deviation.
    """

    task: TaskSpec
    algorithm: str
    steps: int
    envs: int
    seed: int
    normalize: bool = False
    processes: bool = False
    hyperparameters: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("steps", "envs"):
            whole_number(name, getattr(self, name), 1)
        object.__setattr__(self, "seed", checked_seed("seed", self.seed))

    @checks_types
    def first_difference(self, other: TrainingSpec) -> str | None:
        """Return a sentence about the first field in which two runs differ; None if they are equal."""
        for each in fields(self):
            mine, theirs = getattr(self, each.name), getattr(other, each.name)
            if mine != theirs:
                return f"{each.name} is {shown(mine, 200)}, there {shown(theirs, 200)}"
        return None

    @checks_types
    def obstacle_to_continuing(self, other: TrainingSpec) -> str | None:
        """Return a sentence about why this run cannot continue from what `other` learned; None if it can.

        It can if nothing but the number of steps differs, and that is not smaller.
        """
        if self.steps < other.steps:
            return f"steps is {self.steps}, there {other.steps}; a run goes on with as many steps or more"
        return self.first_difference(replace(other, steps=self.steps))


POLICY: Final = "dynx.policy/3"
"""Version of a policy's document in which the robot of a `RobotTask` has the joint dynamics and limits of its
description; in version 2 it had no limits, in version 1 it was one of rigid bodies."""


@dataclass(frozen=True)
class PolicyDocument:
    """What a file of a policy says about itself (member ``dynx.json``)."""

    schema: Literal["dynx.policy/1", "dynx.policy/2", "dynx.policy/3"]
    dynx: str
    spec: TrainingSpec
    steps_done: int
    observation_mean: list[float] | None = None
    observation_variance: list[float] | None = None
    return_variance: float | None = None
    samples: float | None = None


def spec_document(spec: TrainingSpec) -> dict[str, Any]:
    """Return a specification as a JSON document."""
    document: dict[str, Any] = to_json_values(spec)
    return document


def read_spec(document: object, source: str) -> TrainingSpec:
    """Read a specification. Raises ArgumentError that names the key, under the name of the file."""
    try:
        return convert_document(document, TrainingSpec)
    except ArgumentError as error:
        raise ArgumentError(f"{shown(source, 300)}: {error}") from error
