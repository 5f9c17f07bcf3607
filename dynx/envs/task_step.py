"""The text of one control step of a task with autoreset, and of the start of an episode.

The kernel evaluates one environment in each lane of a vector register. Dynamics, integrator, observation,
reward, the end of an episode and the start of the next are traced together; where an episode starts, all are
computed and the start is selected.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from dynx.compiled.step import StepText
from dynx.control.array_dynamics import ArrayDynamics
from dynx.envs.library import AutoresetMode, spaces
from dynx.envs.task import RobotTask, State, control_step
from dynx.envs.variation import VariedRobot
from dynx.errors import ArgumentError, ShapeError, UnsupportedFeatureError
from dynx.model.numbers import DIVERGENCE_SPEED
from dynx.simd.user_code.arrays import symbol_array, traced_array
from dynx.simd.user_code.numbers import select
from dynx.spatial.scalar import Array

TERMINATED, TRUNCATED, INVALID, DIVERGED = 1, 1 << 8, 1 << 16, 1 << 24
"""Bits of the output ``flags``, an integer of 64 bits: one byte for each flag, so that the bytes are arrays
of bool without any conversion. A kernel writes doubles; these have the bit patterns of the integers."""

ENDED = -1.0
"""Number of steps of an episode that ended, in mode NEXT_STEP: the step that starts the next makes it 0."""


class RowLayout(NamedTuple):
    """Sizes of the parts of a row of numbers that keeps the state of one environment: q, v and memory."""

    nq: int
    nv: int
    memory: int

    @classmethod
    def of(cls, task: RobotTask) -> RowLayout:
        """Return the layout for a task."""
        state = task.start(np.zeros(task.random_size))
        return cls(len(state.q), len(state.v), len(state.memory))

    @property
    def size(self) -> int:
        """Number of entries of a row."""
        return self.nq + self.nv + self.memory

    def state(self, row: Array) -> State:
        """Return the state in a row, or in rows (..., size)."""
        first, second = self.nq, self.nq + self.nv
        return State(row[..., :first], row[..., first:second], row[..., second:])

    def row(self, state: State) -> list[Any]:
        """Return the entries of a row."""
        return [*state.q, *state.v, *state.memory]


class TaskStep:
    """A control step of one task, one autoreset mode and one time limit."""

    def __init__(
        self,
        task: RobotTask,
        mode: AutoresetMode,
        max_episode_steps: int | None,
        varied: VariedRobot | None = None,
        *,
        noisy_actions: bool = False,
    ) -> None:
        """`varied` are the parameters of the motion that each environment has for itself."""
        space = task.action_space
        if not isinstance(space, spaces.Discrete | spaces.Box):
            raise UnsupportedFeatureError(
                f"a vector environment takes actions of a Discrete or a Box space, not of {space}"
            )
        self._task, self._mode = task, mode
        self._varied, self._noisy_actions = varied, noisy_actions
        self._limit = math.inf if max_episode_steps is None else float(max_episode_steps)
        self.layout = RowLayout.of(task)
        self._robot = ArrayDynamics(task.model)
        shape = task.observation_space.shape
        if shape is None or len(shape) != 1:
            raise UnsupportedFeatureError(
                f"a vector environment has observations of shape (n,); those of {type(task).__name__} have "
                f"{shape}"
            )
        self.observations = shape[0]
        self.actions = 1 if isinstance(space, spaces.Discrete) else math.prod(space.shape)

    def text(self, start: Mapping[str, Any] | None = None) -> StepText:
        """Return the text of a step, or of the start of episodes with the options `start`.

        Inputs of a step: ``state`` (layout), the number of ``steps``, ``action``, and ``random`` for the
        start of the next episode; where they are drawn, ``parameters`` of the motion, ``noise`` on the
        action, and ``earlier`` actions that may still act. Outputs: ``state``, ``steps``, ``observation``,
        ``reward``, ``flags``, ``earlier`` if it is an input, and in mode SAME_STEP ``final``, the last
        observation of the episode. A start has ``state`` and ``observation`` of ``random``.
        """
        sizes = {"random": self._task.random_size}
        evaluate: Callable[..., dict[str, Any]] = self._step if start is None else self._start
        if start is None:
            sizes = {"state": self.layout.size, "steps": 1, "action": self.actions, **sizes}
            if self._varied is not None and self._varied.parameters:
                sizes["parameters"] = len(self._varied.parameters)
                if self._varied.delayed_actions:
                    sizes["earlier"] = self._varied.delayed_actions * self.actions
            if self._noisy_actions:
                sizes["noise"] = self.actions

        def traced(**inputs: Array) -> dict[str, Array]:
            given = {name: traced_array(array) for name, array in inputs.items()}
            results = evaluate(given, **(start or {}))
            # Entries that do not depend on an input are numbers.
            return {name: symbol_array(entries) for name, entries in results.items()}

        purpose = "step" if start is None else "start"
        return StepText(traced, sizes, f"the {purpose} of {type(self._task).__name__} cannot be compiled")

    def _start(self, inputs: Mapping[str, Array], **options: Any) -> dict[str, Any]:
        state = self._task.start(inputs["random"], **options)
        return {"state": self.layout.row(state), "observation": self._observation(state)}

    def _step(self, inputs: Mapping[str, Array]) -> dict[str, Any]:
        task, robot, layout = self._task, self._robot, self.layout
        action, random, (count,) = inputs["action"], inputs["random"], inputs["steps"]
        before, space = layout.state(inputs["state"]), task.action_space
        noisy = action
        if self._noisy_actions and isinstance(space, spaces.Box):
            low, high = (each.ravel().astype(np.float64) for each in (space.low, space.high))
            noisy = np.clip(action + inputs["noise"], low, high)
        results: dict[str, Any] = {}
        actions, forward_dynamics = [noisy] * task.substeps, robot.forward_dynamics
        if self._varied is not None and "parameters" in inputs:
            values = inputs["parameters"]
            forward_dynamics = partial(self._forward_dynamics, self._varied, values)
            if "earlier" in inputs:
                actions, results["earlier"] = self._delayed(
                    self._varied, values, count, noisy, inputs["earlier"]
                )
        moved = control_step(task, robot, forward_dynamics, before, [self._shaped(each) for each in actions])
        given = self._shaped(noisy)
        after = task.settle(moved)
        reward = _number(task.reward(robot, before, given, after))
        taken = count + 1.0
        terminated, truncated = _mask(task.terminated(robot, after)), _mask(taken >= self._limit)
        flags = _flags(terminated, truncated)
        flags = select(np.sum(moved.v * moved.v) < DIVERGENCE_SPEED**2, flags, _bits(DIVERGED))
        flags = select(_is_valid(space, action), flags, _bits(INVALID))
        ends = np.maximum(terminated, truncated)
        if self._mode is AutoresetMode.NEXT_STEP:
            ended = count < 0.0
            reward, flags = select(ended, 0.0, reward), select(ended, 0.0, flags)
            taken = select(ended, 0.0, select(ends, ENDED, taken))
            after = _selected(ended, task.start(random), after)
        elif self._mode is AutoresetMode.SAME_STEP:
            results["final"] = self._observation(after)
            taken = select(ends, 0.0, taken)
            after = _selected(ends, task.start(random), after)
        return {
            "state": layout.row(after),
            "steps": [taken],
            "observation": self._observation(after),
            "reward": [reward],
            "flags": [flags],
            **results,
        }

    def _shaped(self, action: Array) -> Any:
        """Return an action (n,) as the task takes it."""
        space = self._task.action_space
        return action[0] if isinstance(space, spaces.Discrete) else action.reshape(space.shape)

    def _forward_dynamics(self, varied: VariedRobot, values: Array, q: Array, v: Array, tau: Array) -> Array:
        total = tau + varied.joint_torque(values, v)
        if not varied.changes_masses:
            return np.asarray(self._robot.forward_dynamics(q, v, total))
        return traced_array(varied.forward_dynamics(*(symbol_array(each) for each in (values, q, v, total))))

    def _delayed(
        self, varied: VariedRobot, values: Array, count: Any, action: Array, earlier: Array
    ) -> tuple[list[Array], Array]:
        """Return the action that acts in each step of the integrator, and the actions before the next."""
        # Before the first action of an episode there was none; it acts from the beginning.
        rows = [
            np.where(count == 0.0, action, row)
            for row in earlier.reshape(varied.delayed_actions, self.actions)
        ]
        acting = varied.acting_actions(values, action, rows)
        return acting, np.concatenate([action, *rows[:-1]])

    def _observation(self, state: State) -> Array:
        found = np.asarray(self._task.observation(self._robot, state))
        if found.shape != (self.observations,):
            raise ShapeError(
                f"the observation of {type(self._task).__name__} has shape {found.shape}; "
                f"its observation space has {(self.observations,)}"
            )
        return found


def _selected(condition: Any, yes: State, no: State) -> State:
    """Return the state `yes` where the condition holds, otherwise `no`."""
    for name, one, other in zip(State._fields, yes, no, strict=True):
        if np.shape(one) != np.shape(other):
            raise ArgumentError(
                f"{name} of a state has shape {np.shape(one)} at the start and {np.shape(other)} after a step"
            )
    return State(
        *(
            traced_array([select(condition, a, b) for a, b in zip(one, other, strict=True)])
            for one, other in zip(yes, no, strict=True)
        )
    )


def _bits(integer: int) -> float:
    """Return the double with the bit pattern of an integer."""
    return float(np.array(integer, dtype=np.int64).view(np.float64))


def _flags(terminated: Any, truncated: Any) -> Any:
    # Selected and not added: a processor may be set to take numbers as small as these for 0 in arithmetic.
    both, one = select(truncated, _bits(TERMINATED | TRUNCATED), _bits(TERMINATED)), _bits(TRUNCATED)
    return select(terminated, both, select(truncated, one, 0.0))


def _number(value: Any) -> Any:
    """Return a number, also of an array with one entry."""
    return value.item() if isinstance(value, np.ndarray) else value


def _mask(condition: Any) -> Any:
    """Return 1.0 where a condition holds, otherwise 0.0."""
    return select(_number(condition), 1.0, 0.0)


def _is_valid(space: Any, action: Array) -> Any:
    """Return the condition that an action is in its space; False for NaN."""
    if isinstance(space, spaces.Discrete):
        low, high = np.array([float(space.start)]), np.array([float(space.start + space.n - 1)])
    else:
        # Numbers that the space's dtype rounds to a bound are within it.
        low, high = (each.ravel().astype(np.float64) for each in (space.low, space.high))
        slack = [0.5 * np.spacing(abs(each)).ravel() for each in (space.low, space.high)]
        low, high = low - slack[0], high + slack[1]
    conditions = [
        (x >= least) & (x <= most) for x, least, most in zip(action, low.tolist(), high.tolist(), strict=True)
    ]
    return np.logical_and.reduce(traced_array(conditions))
