"""The text of one control step of a task, and of the start of an episode.

The kernel evaluates one environment in each lane of a vector register. Dynamics, integrator, observation,
reward, the end of an episode and the start of the next are traced together; where an episode starts, all are
computed and the start is selected. One kernel serves vectors of environments, whatever their autoreset and
their time limit, and single environments: all have the same bits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np

from dynx.compiled.array_dynamics import ArrayDynamics
from dynx.compiled.parametric import ParametricDynamics
from dynx.compiled.step import BoundSteps, StepText, compiled
from dynx.envs.library import spaces
from dynx.envs.task import Move, RobotTask, State, StepFriction, control_step, free_move
from dynx.envs.variation import VariedRobot
from dynx.errors import ArgumentError, ShapeError, UnsupportedFeatureError
from dynx.model.numbers import DIVERGENCE_SPEED
from dynx.rbd.joint_friction import FrictionLaw, damped_equation
from dynx.simd.kernel import Kernel
from dynx.simd.target import host
from dynx.simd.user_code.arrays import symbol_array, traced_array
from dynx.simd.user_code.numbers import select
from dynx.spatial.scalar import Array, Floats, sign
from dynx.steppers.implicit_joints import BLOCK_CORRECTIONS, MAX_SOLUTIONS

TERMINATED, TRUNCATED, INVALID, DIVERGED, UNSETTLED = 1, 1 << 8, 1 << 16, 1 << 24, 1 << 32
"""Bits of the output ``flags``, an integer of 64 bits: one byte for each flag, so that the bytes are arrays
of bool without any conversion. A kernel writes doubles; these have the bit patterns of the integers."""

STARTED_AT_ONCE = 16
"""Number of episodes that start together; more are a power of it, so that few lanes are made."""

ENDED = -1.0
"""Number of steps of an episode that ended: the next step starts another and makes it 0."""


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
    """A control step of one task."""

    diverged = DIVERGED
    """Flag of an environment that diverged: its step was not taken, and its episode is truncated."""

    def __init__(self, task: RobotTask, varied: VariedRobot | None = None) -> None:
        """`varied` are the parameters of the motion, of which each environment may have drawn ones for
        itself; by default the joint dynamics of the description."""
        space = task.action_space
        if not isinstance(space, spaces.Discrete | spaces.Box):
            raise UnsupportedFeatureError(
                f"a vector environment takes actions of a Discrete or a Box space, not of {space}"
            )
        self._task = task
        self._varied = varied = VariedRobot(task, None) if varied is None else varied
        self._friction: JointFrictionText | None = None
        self._parametric: ParametricDynamics | None = None
        if varied.parameters.names:
            self._parametric = ParametricDynamics(varied.parameters)
            if varied.parameters.joint_dynamics:
                law = FrictionLaw.of(task.model, varied.dry_joints)
                self._friction = JointFrictionText(task, law, self._parametric)
        self._starters: dict[int, TaskLanes] = {}
        self.layout = RowLayout.of(task)
        self._robot = ArrayDynamics(task.model)
        self._robot.joints = varied.nominal_joints
        shape = task.observation_space.shape
        if shape is None or len(shape) != 1:
            raise UnsupportedFeatureError(
                f"a vector environment has observations of shape (n,); those of {type(task).__name__} have "
                f"{shape}"
            )
        self.observations = shape[0]
        self.actions = 1 if isinstance(space, spaces.Discrete) else math.prod(space.shape)

    @property
    def modes(self) -> int:
        """Number of modes of dry friction in all steps of the integrator."""
        return 0 if self._friction is None else self._friction.size * self._task.substeps

    @cached_property
    def kernel(self) -> Kernel:
        """The kernel of a step. Raises UnsupportedFeatureError for a task that cannot be compiled."""
        return compiled(self.text())

    def starts(self, random: Floats, options: Mapping[str, Any]) -> tuple[Floats, Floats]:
        """Return the states and the observations (n, size) at the start of episodes, from numbers
        (n, random_size); `options` are those of `reset`. The next call overwrites them.

        Without options the kernel of the steps is evaluated, so that episodes start with the bits of those
        that a step starts.
        """
        n = len(random)
        if options:
            found = np.empty((n, self.layout.size)), np.empty((n, self.observations))
            compiled(self.text(options))([random], [*found])
            return found
        size = STARTED_AT_ONCE
        while size < n:
            size *= STARTED_AT_ONCE
        if size not in self._starters:
            self._starters[size] = TaskLanes(self, size)
        lanes = self._starters[size]
        lanes.arrays["random"][:n] = random
        lanes.now["steps"][...] = ENDED
        lanes.evaluate()
        return lanes.end["state"][:n], lanes.arrays["observation"][:n]

    def text(self, start: Mapping[str, Any] | None = None) -> StepText:
        """Return the text of a step, or of the start of episodes with the options `start`.

        Inputs of a step: ``state`` (layout), the number of ``steps`` and its ``limit``, ``action``, and
        ``random`` for the start of the next episode; where they are drawn, ``parameters`` of the motion,
        ``earlier`` actions that may still act, and the ``modes`` of dry friction with which a step is
        repeated. Outputs: ``state``, ``steps``, ``observation``, ``reward``, ``flags``, ``earlier`` if it is
        an input, and ``next_modes``. A step that diverges is not taken: the episode ends in the state before
        it, truncated, without a reward. A start has ``state`` and ``observation`` of ``random``.
        """
        sizes = {"random": self._task.random_size}
        evaluate: Callable[..., dict[str, Any]] = self._step if start is None else self._start
        if start is None:
            sizes = {"state": self.layout.size, "steps": 1, "limit": 1, "action": self.actions, **sizes}
            if self._varied.drawn_parameters:
                sizes["parameters"] = len(self._varied.drawn_parameters)
                if self._varied.delayed_actions:
                    sizes["earlier"] = self._varied.delayed_actions * self.actions
            if self.modes:
                sizes |= {"modes": self.modes, "one_by_one": 1}

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
        action, random, (count,), (limit,) = (inputs[each] for each in ("action", "random", "steps", "limit"))
        before, space = layout.state(inputs["state"]), task.action_space
        results: dict[str, Any] = {}
        actions: list[Array] = [action] * task.substeps
        move: Move = partial(free_move, task, robot.forward_dynamics)
        drawn: Array = inputs.get("parameters", np.zeros(0))
        move = self._move(drawn, inputs, move)
        if "earlier" in inputs:
            actions, results["earlier"] = self._delayed(drawn, count, action, inputs["earlier"])
        moved = control_step(task, robot, move, before, [self._shaped(each) for each in actions])
        given = self._shaped(action)
        after = task.settle(moved)
        reward = _number(task.reward(robot, before, given, after))
        taken = count + 1.0
        terminated, truncated = _mask(task.terminated(robot, after)), _mask(taken >= limit)
        flags = _flags(terminated, truncated)
        if self._friction is not None and self.modes:
            results["next_modes"], changes = self._friction.results()
            flags = select(changes > 0.0, _bits(UNSETTLED), flags)
        finite = np.sum(moved.v * moved.v) < DIVERGENCE_SPEED**2
        flags = select(finite, flags, _bits(DIVERGED | TRUNCATED))
        flags = select(_is_valid(space, action), flags, _bits(INVALID))
        ends = select(finite, np.maximum(terminated, truncated), 1.0)
        after, reward = _selected(finite, after, before), select(finite, reward, 0.0)
        ended = count < 0.0
        reward, flags = select(ended, 0.0, reward), select(ended, 0.0, flags)
        taken = select(ended, 0.0, select(ends, ENDED, taken))
        after = _selected(ended, task.start(random), after)
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

    def _move(self, drawn: Array, inputs: Mapping[str, Array], free: Move) -> Move:
        """Return the steps of the integrator of a robot with parameters; those `free` for one without."""
        if self._parametric is None:
            return free
        dynamics, values = self._parametric, self._varied.values(symbol_array(drawn))
        if self._friction is not None:
            return self._friction.moves(values, inputs)

        def forward_dynamics(q: Array, v: Array, tau: Array) -> Array:
            return traced_array(dynamics.acceleration(values, *map(symbol_array, (q, v, tau))))

        return partial(free_move, self._task, forward_dynamics)

    def _delayed(self, drawn: Array, count: Any, action: Array, earlier: Array) -> tuple[list[Array], Array]:
        """Return the action that acts in each step of the integrator, and the actions before the next."""
        varied = self._varied
        # Before the first action of an episode there was none; it acts from the beginning.
        rows = [
            np.where(count == 0.0, action, row)
            for row in earlier.reshape(varied.delayed_actions, self.actions)
        ]
        acting = varied.acting_actions(drawn, action, rows)
        return acting, np.concatenate([action, *rows[:-1]])

    def _observation(self, state: State) -> Array:
        found = np.asarray(self._task.observation(self._robot, state))
        if found.shape != (self.observations,):
            raise ShapeError(
                f"the observation of {type(self._task).__name__} has shape {found.shape}; "
                f"its observation space has {(self.observations,)}"
            )
        return found


class JointFrictionText(StepFriction):
    """Joint friction on symbols, with coefficients that are inputs of the kernel.

    A step whose modes of dry friction are not settled is repeated with those in ``next_modes``.
    """

    def __init__(self, task: RobotTask, law: FrictionLaw, dynamics: ParametricDynamics) -> None:
        super().__init__(task, law.joints)
        self._law, self._dynamics, self._h = law, dynamics, task.step_dt
        self._shifts: list[Array] = []
        self.size = len(law.joints)
        """Number of modes in a step of the integrator."""

    def moves(self, values: Array, inputs: Mapping[str, Array]) -> Move:
        """Return the steps of the integrator of a control step, with the values of the parameters (n,)."""
        self._values = values
        self._shifts.clear()
        self._given = symbol_array(inputs["modes"]) if self.size else np.zeros(0)
        self._one_by_one = symbol_array(inputs["one_by_one"])[0] if self.size else 0.0
        self._changes: Any = 0.0
        return self.move

    def results(self) -> tuple[Array, Any]:
        """Return the modes (substeps n,) with which an unsettled step is repeated, and the sum of their
        corrections."""
        return np.concatenate(self._shifts), traced_array([self._changes])[0]

    def solve(self, q: Array, v: Array, tau: Array) -> tuple[Array, Array]:
        q, v, tau = map(symbol_array, (q, v, tau))
        A, r, friction = self._equation(q, v, tau, v)
        first = len(self._shifts) * self.size
        shift = self._given[first : first + self.size]
        _, found, following = self._law.step(A, r, v, friction, self._h, shift, self._one_by_one)
        self._shifts.append(following)
        self._changes = self._changes + found.changes
        dry = self._joints
        modes = sign(v[dry] + self._h * found.a[dry]) * found.moves[dry] if dry else np.zeros(0)
        return traced_array(found.a), traced_array(modes)

    def held(self, q: Array, v: Array, tau: Array, start: Array, modes: Array) -> Array:
        q, v, tau, start, modes = map(symbol_array, (q, v, tau, start, modes))
        A, r, friction = self._equation(q, v, tau, start)
        return traced_array(self._law.solve(A, r, start, friction, self._h, modes, 0.0).a)

    def _equation(self, q: Array, v: Array, tau: Array, start: Array) -> tuple[Array, Array, Array]:
        """Return A and r of the law, and the dry friction of its joints."""
        M, r, joints = self._dynamics.equation(self._values, q, v, tau)
        assert joints is not None
        h, at = (self._h, start) if self.damps_implicitly else (0.0, v)
        A, r = damped_equation(M, r, at, h, joints.damping, np.zeros(len(v)))
        return A, r, joints.friction[self._joints]


class TaskLanes:
    """Environments of a task in the lanes of its kernel, with the arrays that it reads and writes.

    The state is read from one set of arrays and written to another, in turn.
    """

    def __init__(self, step: TaskStep, count: int, max_steps: int | None = None) -> None:
        """`max_steps` is the number of steps after which an episode is truncated."""
        kernel, rows = step.kernel, max(count, host().lanes)
        sizes = {port.name: port.size for port in kernel.inputs + kernel.outputs}
        state = {
            name: np.zeros((2, rows, sizes[name])) for name in ("state", "steps", "earlier") if name in sizes
        }
        self.arrays: dict[str, Floats] = {name: np.zeros((rows, size)) for name, size in sizes.items()}
        """Inputs and outputs by name (rows, size), but for the state."""
        self.arrays["limit"][...] = math.inf if max_steps is None else max_steps
        turns = np.arange(2)
        known = {name: (array[None], 0 * turns) for name, array in self.arrays.items()}
        steps = BoundSteps(
            [kernel],
            0 * turns,
            known | {name: (array, turns) for name, array in state.items()},
            {name: (array, 1 - turns) for name, array in state.items()},
            first=0,
            lanes=rows,
            status=None,
        )
        self._calls = [steps.single(turn) for turn in range(2)]
        self._sets: list[dict[str, Floats]] = [
            {name: array[turn] for name, array in state.items()} for turn in range(2)
        ]
        self._turn = 0
        self.flags = self.arrays["flags"][:count, 0].view(np.int64)
        """Flags (count,) of the last step."""
        self._every_flag = self.arrays["flags"][:, 0].view(np.int64)
        self._settles = bool(step.modes)

    @property
    def now(self) -> dict[str, Floats]:
        """The present ``state``, ``steps`` and ``earlier`` actions (rows, size)."""
        return self._sets[self._turn]

    @property
    def end(self) -> dict[str, Floats]:
        """``state``, ``steps`` and ``earlier`` actions (rows, size) at the end of the evaluated step."""
        return self._sets[1 - self._turn]

    def evaluate(self) -> None:
        """Evaluate a step from the present state; `accept` makes its end the present state."""
        self._calls[self._turn]()
        if self._settles and self._every_flag.max() >= UNSETTLED:
            self._settle()

    def accept(self) -> None:
        """Go on from the end of the step that was evaluated."""
        self._turn = 1 - self._turn

    def _settle(self) -> None:
        """Repeat the step with corrected modes of dry friction until they are right."""
        arrays = self.arrays
        for count in range(1, MAX_SOLUTIONS):
            unsettled = self._every_flag >= UNSETTLED
            if not unsettled.any():
                break
            arrays["modes"][unsettled] = arrays["next_modes"][unsettled]
            arrays["one_by_one"][...] = float(count >= BLOCK_CORRECTIONS)
            self._calls[self._turn]()
        arrays["modes"][...], arrays["one_by_one"][...] = 0.0, 0.0
        self._every_flag[self._every_flag >= UNSETTLED] = 0


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
