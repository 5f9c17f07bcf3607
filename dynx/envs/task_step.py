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
from numpy.typing import NDArray

from dynx.compiled.array_dynamics import ArrayDynamics
from dynx.compiled.parametric import ParametricDynamics
from dynx.compiled.step import BoundSteps, StepText, compiled
from dynx.envs import hooks
from dynx.envs.library import spaces
from dynx.envs.own_tasks import refuse_irreproducible
from dynx.envs.stops import LimitWatch, StopsText
from dynx.envs.task import Move, RobotTask, State, StepFriction, free_move
from dynx.envs.variation import VariedRobot
from dynx.errors import ArgumentError, NotFiniteError, UnsupportedFeatureError
from dynx.model.numbers import DIVERGENCE_SPEED
from dynx.rbd.joint_friction import FrictionLaw, damped_equation
from dynx.simd.kernel import Kernel
from dynx.simd.target import host
from dynx.simd.user_code.arrays import symbol_array, traced_array
from dynx.simd.user_code.numbers import select
from dynx.spatial.scalar import Array, Floats, sign
from dynx.steppers.implicit_joints import BLOCK_CORRECTIONS, MAX_SOLUTIONS

TERMINATED, TRUNCATED, INVALID, DIVERGED, UNSETTLED, AT_LIMIT = (1 << 8 * k for k in range(6))
"""Bits of the output ``flags``, an integer of 64 bits: one byte for each flag, so that the bytes are arrays
of bool without any conversion. A kernel writes doubles; these have the bit patterns of the integers."""

NOT_FINITE = {"torque": 2 * INVALID, "reward": 4 * INVALID, "observation": 8 * INVALID}
"""Bits of hooks of the task that returned numbers that are not finite, in the byte of `INVALID`."""

REPEATED = frozenset({"modes", "one_by_one", "released"})
"""Inputs with which a step that is not settled is repeated; at first they are 0."""

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
        state = hooks.start(task, np.zeros(task.random_size), {})
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

    invalid = INVALID
    """Smallest flag of a step that is refused, or that diverged."""

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
        self._prepare_motion()
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

    def _prepare_motion(self) -> None:
        """Prepare the steps of the integrator."""
        task, varied = self._task, self._varied
        if varied.parameters.names:
            self._parametric = ParametricDynamics(varied.parameters)
            if varied.parameters.joint_dynamics:
                law = FrictionLaw.of(task.model, varied.dry_joints)
                self._friction = JointFrictionText(task, law, self._parametric)

    def lanes(self, count: int, max_steps: int | None = None) -> TaskLanes:
        """Return lanes of environments; `max_steps` is the number of steps after which an episode is
        truncated."""
        return TaskLanes(self, count, max_steps)

    @property
    def stops(self) -> bool:
        """True if joints stop at limits."""
        return self._varied.stops

    @property
    def delayed_actions(self) -> int:
        """Number of actions before the present one that are inputs of a step."""
        found: int = self._varied.delayed_actions
        return found

    @property
    def modes(self) -> int:
        """Number of modes of dry friction in all steps of the integrator."""
        return 0 if self._friction is None else self._friction.size * self._task.substeps

    @cached_property
    def kernel(self) -> Kernel:
        """The kernel of a step, which flags lanes in which a joint passed a limit.

        Raises UnsupportedFeatureError for a task that cannot be compiled, ArgumentError for one with a hook
        that depends on more than its arguments.
        """
        return compiled(self.text())

    @cached_property
    def kernel_with_stops(self) -> Kernel:
        """The kernel of a step of these lanes; compiled when a joint first passes a limit."""
        return compiled(self.text(stops=True))

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
            hooks.refuse_not_finite(self._task, "observation", found[1])
            return found
        size = STARTED_AT_ONCE
        while size < n:
            size *= STARTED_AT_ONCE
        if size not in self._starters:
            self._starters[size] = self.lanes(size)
        lanes = self._starters[size]
        lanes.arrays["random"][:n] = random
        lanes.now["steps"][...] = ENDED
        lanes.evaluate_starts()
        self.refuse_not_finite(lanes.flags[:n])
        return lanes.end["state"][:n], lanes.arrays["observation"][:n]

    def refuse_not_finite(self, flags: NDArray[np.int64]) -> None:
        """Raise NotFiniteError if flags say that a hook of the task returned numbers that are not finite."""
        for hook, bit in NOT_FINITE.items():
            rows = np.flatnonzero(flags & bit)
            if len(rows):
                where = f" in environment {rows[0]}" if len(flags) > 1 else ""
                raise NotFiniteError(f"{hook} of {type(self._task).__name__} is not finite{where}")

    def text(self, start: Mapping[str, Any] | None = None, *, stops: bool = False) -> StepText:
        """Return the text of a step, without or with `stops`, or of the start of episodes with the options
        `start`.

        Inputs of a step: ``state`` (layout), the number of ``steps`` and its ``limit``, ``action``, and
        ``random`` for the start of the next episode; where they are drawn, ``parameters`` of the motion,
        ``earlier`` actions that may still act, and the ``modes`` of dry friction, and stops that are
        ``released``, with which a step is repeated. Outputs: ``state``, ``steps``, ``observation``,
        ``reward``, ``flags``, ``earlier`` if it is an input, ``next_modes`` and ``next_released``. A step
        that diverges is not taken: the episode ends in the state before it, truncated, without a reward. A
        start has ``state`` and ``observation`` of ``random``.
        """
        sizes = {"random": self._task.random_size}
        evaluate: Callable[..., dict[str, Any]] = self._start
        limits: LimitWatch | StopsText | None = None
        if start is None and self._varied.stops:
            limits = (StopsText if stops else LimitWatch)(self._task.model)
        if start is None:
            evaluate = partial(self._step, limits=limits)
        if start is None:
            sizes = {"state": self.layout.size, "steps": 1, "limit": 1, "action": self.actions, **sizes}
            if self._varied.drawn_parameters:
                sizes["parameters"] = len(self._varied.drawn_parameters)
                if self.delayed_actions:
                    sizes["earlier"] = self.delayed_actions * self.actions
            if self.modes:
                sizes |= {"modes": self.modes, "one_by_one": 1}
            if isinstance(limits, StopsText):
                sizes["released"] = limits.size * self._task.substeps
            sizes |= self._sizes_of_motion()

        def traced(**inputs: Array) -> dict[str, Array]:
            given = {name: traced_array(array) for name, array in inputs.items()}
            results = evaluate(given, **(start or {}))
            if not stops:
                refuse_irreproducible(self._task, self.layout, self._robot.joints, start)
            # Entries that do not depend on an input are numbers.
            return {name: symbol_array(entries) for name, entries in results.items()}

        purpose = "step" if start is None else "start"
        return StepText(traced, sizes, f"the {purpose} of {type(self._task).__name__} cannot be compiled")

    def _sizes_of_motion(self) -> dict[str, int]:
        """Return the sizes of further inputs of a step."""
        return {}

    def _start(self, inputs: Mapping[str, Array], **options: Any) -> dict[str, Any]:
        state = hooks.start(self._task, inputs["random"], options)
        return {"state": self.layout.row(state), "observation": self._observation(state)}

    def _step(
        self, inputs: Mapping[str, Array], limits: LimitWatch | StopsText | None = None
    ) -> dict[str, Any]:
        task, robot, layout = self._task, self._robot, self.layout
        action, random, (count,), (limit,) = (inputs[each] for each in ("action", "random", "steps", "limit"))
        before, space = layout.state(inputs["state"]), task.action_space
        results: dict[str, Any] = {}
        overflow: list[Any] = []
        moved = self._moved(inputs, before, results, overflow, limits)
        given = self._shaped(action)
        after = hooks.settle(task, moved)
        reward = hooks.number(task, "reward", task.reward(robot, before, given, after))
        taken = count + 1.0
        over = hooks.number(task, "terminated", task.terminated(robot, after))
        terminated, truncated = _mask(over), _mask(_number(taken >= limit))
        flags = select(_are_finite([reward]), _flags(terminated, truncated), _bits(NOT_FINITE["reward"]))
        repeats: Any = 0.0
        if self._friction is not None and self.modes:
            results["next_modes"], changes = self._friction.results()
            repeats = select(changes > 0.0, 1.0, repeats)
            flags = select(changes > 0.0, _bits(UNSETTLED), flags)
        if isinstance(limits, StopsText):
            results["next_released"] = limits.released
            repeats = select(limits.changes > 0.0, 1.0, repeats)
            flags = select(limits.changes > 0.0, _bits(UNSETTLED), flags)
        finite = np.sum(moved.v * moved.v) < DIVERGENCE_SPEED**2
        unsettled = select(finite, flags == _bits(UNSETTLED), 0.0)
        flags = select(finite, flags, _bits(DIVERGED | TRUNCATED))
        for each in overflow:
            flags = select(each, _bits(NOT_FINITE["torque"]), flags)
        if isinstance(limits, LimitWatch):
            repeats = select(limits.excess > 0.0, 1.0, repeats)
            # What follows without the stop is not what happens, be it a divergence.
            flags = select(limits.excess > 0.0, select(unsettled, flags, _bits(AT_LIMIT)), flags)
        valid = _is_valid(space, action)
        flags, repeats = select(valid, flags, _bits(INVALID)), select(valid, repeats, 1.0)
        ends = select(finite, np.maximum(terminated, truncated), 1.0)
        after, reward = _selected(finite, after, before), select(finite, reward, 0.0)
        ended = count < 0.0
        reward, flags, repeats = (select(ended, 0.0, each) for each in (reward, flags, repeats))
        taken = select(ended, 0.0, select(ends, ENDED, taken))
        after = _selected(ended, hooks.start(task, random, {}), after)
        observation = self._observation(after)
        shown = select(_are_finite(observation), flags, _bits(NOT_FINITE["observation"]))
        # The observation of an invalid step, or of one that is repeated, is not returned.
        flags = select(repeats > 0.0, flags, shown)
        return {
            "state": layout.row(after),
            "steps": [taken],
            "observation": observation,
            "reward": [reward],
            "flags": [flags],
            **results,
        }

    def _moved(
        self,
        inputs: Mapping[str, Array],
        before: State,
        results: dict[str, Any],
        overflow: list[Any],
        limits: LimitWatch | StopsText | None,
    ) -> State:
        """Return the state at the end of a control step; add further `results`, and the conditions that a
        torque is not finite."""
        task, robot, action = self._task, self._robot, inputs["action"]
        actions: list[Array] = [action] * task.substeps
        move: Move = partial(free_move, task, robot.forward_dynamics)
        drawn: Array = inputs.get("parameters", np.zeros(0))
        move = self._move(drawn, inputs, move)
        if limits is not None:
            move = limits.moves(move, partial(self._mass_matrix, drawn), inputs)
        if "earlier" in inputs:
            actions, results["earlier"] = self._delayed(drawn, inputs["steps"][0], action, inputs["earlier"])
        return hooks.control_step(
            task, robot, partial(_watched, move, overflow), before, [self._shaped(each) for each in actions]
        )

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

    def _mass_matrix(self, drawn: Array, q: Array) -> Array:
        """Return the mass matrix of the robot that moves, with its armature, as symbols."""
        if self._parametric is None:
            return symbol_array(self._robot.mass_matrix(q))
        return self._parametric.inertia(self._varied.values(symbol_array(drawn)), symbol_array(q))

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
        return hooks.observation(self._task, self._robot, state)


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

    threads = 1
    """Largest number of threads of an evaluation."""

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
        self._settles, self._stops, self._step = bool(step.modes), step.stops, step

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
        if self._stops and self.flags.max() >= AT_LIMIT:
            self._stop(np.flatnonzero(self.flags >= AT_LIMIT))

    def evaluate_starts(self) -> None:
        """Evaluate a step of environments whose episodes have ended."""
        self.evaluate()

    def accept(self) -> None:
        """Go on from the end of the step that was evaluated."""
        self._turn = 1 - self._turn

    def _settle(self) -> None:
        """Repeat the step with corrected modes of dry friction until they are right."""
        arrays = self.arrays
        for count in range(1, MAX_SOLUTIONS):
            unsettled = self._every_flag == UNSETTLED
            if not unsettled.any():
                break
            arrays["modes"][unsettled] = arrays["next_modes"][unsettled]
            arrays["one_by_one"][...] = float(count >= BLOCK_CORRECTIONS)
            self._calls[self._turn]()
        arrays["modes"][...], arrays["one_by_one"][...] = 0.0, 0.0
        self._every_flag[self._every_flag == UNSETTLED] = 0

    def _stop(self, rows: NDArray[np.intp]) -> None:
        """Evaluate the step again with stops, in lanes in which a joint passed a limit."""
        kernel, n = self._step.kernel_with_stops, len(rows)
        before, after = {**self.arrays, **self.now}, {**self.arrays, **self.end}
        inputs = {
            port.name: np.zeros((n, port.size)) if port.name in REPEATED else before[port.name][rows]
            for port in kernel.inputs
        }
        outputs = {port.name: np.empty((n, port.size)) for port in kernel.outputs}
        flags = outputs["flags"][:, 0].view(np.int64)
        for count in range(1, MAX_SOLUTIONS + 1):
            kernel([*inputs.values()], [*outputs.values()])
            unsettled = flags == UNSETTLED
            if not unsettled.any():
                break
            for name in inputs.keys() & {"modes", "released"}:
                inputs[name][unsettled] = outputs[f"next_{name}"][unsettled]
            if "one_by_one" in inputs:
                inputs["one_by_one"][...] = float(count >= BLOCK_CORRECTIONS)
        flags[flags == UNSETTLED] = 0
        for name, found in outputs.items():
            if name in after and not name.startswith("next_"):
                after[name][rows] = found


def _watched(move: Move, overflow: list[Any], q: Array, v: Array, tau: Array) -> tuple[Array, Array]:
    """Return `move` of a torque; add the condition that it is not finite at a state that is."""
    slow = np.sum(v * v) < DIVERGENCE_SPEED**2
    overflow.append(select(slow, select(_are_finite(tau), 0.0, 1.0), 0.0) > 0.0)
    return move(q, v, tau)


def _are_finite(values: Any) -> Any:
    """Return the condition that all of some numbers are finite."""
    return np.sum(np.abs(traced_array(values))) < math.inf


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
    return select(condition, 1.0, 0.0)


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
