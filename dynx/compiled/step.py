"""One traced step of something that moves, in lanes: a controller or a task with its robot.

The text of a step is array code (`dynx.sim.loop_step`, `dynx.envs.task_step`). It runs on symbols and becomes
one kernel. Where another engine evaluates the dynamics, it becomes pieces between the calls of that engine
(`dynx.simd.cuts`).
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, pi, sin
from typing import Any, NamedTuple

from dynx.compiled.status import Status
from dynx.errors import TraceError, UnsupportedFeatureError
from dynx.model import Model
from dynx.simd.cache import load_kernel, program_recipe
from dynx.simd.call_sequence import CallSequence, Integers, StridedRows
from dynx.simd.kernel import Kernel
from dynx.simd.repetition import load_repetition, trace_repetition
from dynx.simd.trace import trace
from dynx.simd.user_code.arrays import traced_array
from dynx.simd.user_code.numbers import as_symbol
from dynx.spatial.scalar import Array, Floats
from dynx.steppers.joint_stops import bounds_of_step
from dynx.steppers.layout import stop_positions

MAX_CACHED_KERNELS = 32
"""Number of kernels that this process keeps for later steps with an equal key."""

STATUS = "status"
"""Name of the output with the status of each lane."""


class Stop(NamedTuple):
    """The step and the lane at which steps ended before their end, and why."""

    step: int
    lane: int
    status: Status


@dataclass(frozen=True)
class StepText:
    """The text of a step: array code for one lane."""

    function: Callable[..., Mapping[str, Array]]
    """Function of the inputs by name, arrays of symbols, that returns outputs by name; it branches on no
    value. Outputs with the name of an input are that input of the next step."""
    inputs: Mapping[str, int]
    """Sizes of the inputs."""
    failure: str = "the step cannot be compiled"
    """Beginning of the error where it cannot be traced."""
    key: Hashable | None = None
    """Content that finds the kernel in this process without tracing; None: trace."""
    repeats: bool = False
    """True if the function has a loop: it takes ``repeat`` too (`dynx.simd.repetition`)."""
    turns: int = 1
    """Number of steps that the kernel of a function with a loop takes in a call."""


_kernels: dict[Hashable, Kernel] = {}


class CompiledStep:
    """A step in several variants, each compiled when it is first needed."""

    def __init__(self, text: Callable[[Hashable], StepText]) -> None:
        """`text` returns the text of a variant."""
        self._text = text
        self._variants: dict[Hashable, Kernel] = {}

    def kernel(self, variant: Hashable = None) -> Kernel:
        """Return the kernel of a variant. Raises UnsupportedFeatureError for one that cannot be traced."""
        kernel = self._variants.get(variant)
        if kernel is None:
            kernel = self._variants[variant] = compiled(self._text(variant))
        return kernel


def compiled(text: StepText) -> Kernel:
    """Return the kernel of a text: of an earlier equal one of this process, from the cache on disk, or
    compiled.

    Raises UnsupportedFeatureError for a text that cannot be traced.
    """
    kernel = None if text.key is None else _kernels.get(text.key)
    if kernel is None:
        shapes = {name: (size,) for name, size in text.inputs.items()}
        try:
            if text.repeats:
                kernel = load_repetition(trace_repetition(text.function, shapes, turns=text.turns))
            else:
                program = trace(text.function, shapes)
                kernel = load_kernel(program_recipe(program), lambda: program)
        except TraceError as error:
            raise UnsupportedFeatureError(f"{text.failure}: {error}") from error
        if text.key is not None:
            _kernels[text.key] = kernel
            for old in list(_kernels)[:-MAX_CACHED_KERNELS]:
                _kernels.pop(old, None)
    return kernel


class BoundSteps:
    """Steps of lanes whose arrays are known, numbered from `first` on."""

    def __init__(
        self,
        kernels: Sequence[Kernel],
        chosen: Integers,
        rows: Mapping[str, tuple[Floats, Integers]],
        written: Mapping[str, tuple[Floats, Integers]],
        *,
        first: int,
        lanes: int = 1,
        status: str | None = STATUS,
        bound: Status = Status.DONE,
    ) -> None:
        """`chosen` (n,) is the number of the kernel of each step. `rows` has for each name an array, (height,
        size) for all lanes or (height, lanes, size), and the row (n,) of each step; `written` has those of
        outputs where they are others. Steps end at a `status`, if they have one, above `bound`."""
        inputs = {name: StridedRows(array, number) for name, (array, number) in rows.items()}
        outputs = {name: StridedRows(array, number) for name, (array, number) in written.items()}
        self.first = first
        self._status = None if status is None else rows[status][0]
        self._calls = CallSequence(
            kernels, chosen, inputs, lanes, outputs=outputs, status=status, bound=float(bound)
        )
        self.end = first + len(chosen)

    def run(self, begin: int, end: int) -> Stop | None:
        """Take the steps from `begin` to before `end`; return where they ended before that."""
        stopped = self._calls.run(begin - self.first, end - self.first)
        if stopped is None or self._status is None:
            return None
        call, lane = stopped
        found = self._status[0, lane, 0] if self._status.ndim == 3 else self._status[0, 0]
        return Stop(self.first + call, lane, Status(int(found)))

    def single(self, step: int) -> Callable[[], None]:
        """Return a function that takes one step, whatever its status."""
        return self._calls.single(step - self.first)

    def repeat_group(self, step: int, lane: int) -> None:
        """Repeat a step for one vector of lanes, from number `lane` on."""
        self._calls.repeat_group(step - self.first, lane)


def position_excess(model: Model, start: Array, q: Array, found: Any = 0.0) -> Any:
    """Return a number that is positive if a joint passed a position limit in a step from the configuration
    `start` (nq,) to q (nq,), or if `found` is, for symbols."""
    joints = slice(7 if model.floating else 0, None)
    limits = stop_positions(model)
    bounds = bounds_of_step(traced_array(start[joints]), *limits)
    for x, lower, upper, low, high in zip(q[joints], *limits, *bounds, strict=True):
        beyond = [low - x] if isfinite(lower) else []
        beyond += [x - high] if isfinite(upper) else []
        for each in beyond:
            found = as_symbol(each).maximum(found)
    for joint in model.ball_joints:
        if joint.limits.upper < pi:
            # Squared sines of half the angles, which grow with these up to pi.
            first = model.position_index(joint.name)
            before, now = (sum(x * x for x in each[first : first + 3]) for each in (start, q))
            bound = as_symbol(before).maximum(sin(0.5 * joint.limits.upper) ** 2)
            found = as_symbol(now - bound).maximum(found)
    return found
