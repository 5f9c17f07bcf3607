"""Iterations: a traced step that each lane repeats for its own task until the step says it is finished.

Tasks differ in the number of steps that they take. A lane whose task is finished stores the result and takes
the next task, so that all lanes stay busy; between those events nothing but the step is computed. A step may
also restart its task: then the lane loads a row of a table of starts.

The step is a program with these ports. Inputs: ``x`` (m,), which a start overwrites; ``memory`` (s,), the
other variables; *task inputs*, with a row for each task, which stay in the lane while the task lasts; and
*constants*, the same for all tasks. Outputs: ``x`` and ``memory`` after the step, ``status`` (`RUNNING`,
`GIVEN_UP` or `REACHED`), and ``restart``, the number of a row of the table of starts, or a negative number.
The first `n_results` entries of the memory, after the step that ends the task, are its result. A task first
starts from its rows of x and memory; a row of the table of starts replaces x at a restart only. ``restart``
has no effect in a step that ends the task. A step that never ends a task never returns.

Lanes do not exchange values, and products and sums are contracted as in routines. So the result of a task
depends neither on the other tasks nor on the number of lanes.

The entry function takes the address of 64-bit words: the number of tasks; an address and a row stride in
bytes for each array, which are ``x``, ``memory``, the task inputs and the result; then the addresses of the
constants and of the table of starts, each followed by a zero; and 1 to stop at the first task that is
reached, otherwise 0. In that case all earlier tasks are completed, and the results of later ones are
undefined; the first word is then the number of completed tasks. A row stride of 0 repeats a row.

`IterationKernel` evaluates a compiled iteration on many tasks and several threads.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from dynx.errors import CompileError
from dynx.simd.arrays import check_arrays
from dynx.simd.cache import load_code
from dynx.simd.emit import ENTRY, Settings
from dynx.simd.image import Code, Image, compile_text
from dynx.simd.iteration_status import REACHED, RUNNING
from dynx.simd.kernel import arguments_of_parts
from dynx.simd.program import Port, Program, collection_paused
from dynx.simd.routines import Place, Routine, RoutineBody, argument_word
from dynx.simd.target import Processor, host
from dynx.simd.threads import run_parts
from dynx.simd.trigonometry import declarations, replacements
from dynx.spatial.scalar import Floats

_OUTPUTS = ("x", "memory", "status", "restart")


@dataclass(frozen=True)
class Iteration:
    """A step, the names of those inputs that are constants, and the size of the result."""

    step: Program
    constants: tuple[str, ...]
    n_results: int

    def __post_init__(self) -> None:
        """Raises CompileError unless the outputs are x, memory, status and restart, in this order, and x and
        memory have the shape of the inputs of that name.

        The names of the constants, `n_results` and the shapes of status and restart are not checked.
        """
        shapes = {port.name: port.shape for port in self.step.outputs}
        inputs = {port.name: port.shape for port in self.step.inputs}
        if tuple(shapes) != _OUTPUTS or any(inputs.get(name) != shapes[name] for name in _OUTPUTS[:2]):
            raise CompileError(f"a step has the inputs {inputs} and outputs {shapes}; wanted {_OUTPUTS}")

    @property
    def arrays(self) -> tuple[Port, ...]:
        """Inputs with a row for each task: x, memory and the task inputs."""
        by_name = {port.name: port for port in self.step.inputs if port.name not in self.constants}
        return (by_name.pop("x"), by_name.pop("memory"), *by_name.values())

    @property
    def result(self) -> Port:
        """Output with a row for each task."""
        return Port("result", (self.n_results,))


def emit_iteration(iteration: Iteration, target: Processor, settings: Settings) -> str:
    """Return the text of the LLVM module of an iteration."""
    layout = _PortLayout(iteration, settings.lanes)
    routine = Routine(iteration.step, layout.places)
    bodies = [RoutineBody(routine, target, settings, 0).text()]
    operands = ", ".join(f"i32 {place}" for place in (0, *layout.operands))
    parts = [
        f'target triple = "{target.triple}"',
        f"@operands = internal constant [{1 + len(layout.operands)} x i32] [{operands}]",
        *bodies,
        _take(iteration, layout),
        _store(iteration, layout),
        _start(layout),
        _loop(iteration, layout),
        *replacements(bodies, settings.lanes),
        *declarations(settings.lanes),
    ]
    return "\n".join(parts) + "\n"


class _PortLayout:
    """Places of the ports of a step among the vectors of the lanes and among the constants."""

    def __init__(self, iteration: Iteration, lanes: int) -> None:
        self.lanes = lanes
        self.places: tuple[Place, ...] = ()
        """Place of each port of the step."""
        self.operands: list[int] = []
        """First vector or constant of each port."""
        self.vector: dict[str, int] = {}
        """First vector of each port that is not constant, by name."""
        self.vectors = constants = 0
        for port in (*iteration.step.inputs, *iteration.step.outputs):
            if port.name in iteration.constants:
                self.places += ("constants",)
                self.operands.append(constants)
                constants += port.size
                continue
            self.places += ("vectors",)
            if port.name not in self.vector:
                self.vector[port.name] = self.vectors
                self.vectors += port.size
            self.operands.append(self.vector[port.name])
        sizes = {port.name: port.size for port in iteration.step.inputs}
        self.x_size = sizes["x"]
        self.n_arrays = len(iteration.arrays) + 1

    def cell(self, vector: int) -> Sequence[str]:
        """Return the code that sets %cell to the address of the lane %lane of a vector."""
        return [
            f"  %cell{vector}_ = getelementptr double, ptr %vectors, i64 {vector * self.lanes}",
            f"  %cell{vector} = getelementptr double, ptr %cell{vector}_, i64 %lane",
        ]


def _copied(layout: _PortLayout, vector: int, row: str, column: int) -> list[str]:
    """Return the code that copies an entry of a row to the lane %lane of a vector."""
    return [
        f"  %at{vector} = getelementptr double, ptr {row}, i64 {column}",
        f"  %value{vector} = load double, ptr %at{vector}",
        *layout.cell(vector),
        f"  store double %value{vector}, ptr %cell{vector}",
    ]


def _row(array: int) -> list[str]:
    """Return the code that sets %row to the address of the row %task of an array."""
    return [
        *argument_word(f"base{array}", 1 + 2 * array, "ptr"),
        *argument_word(f"stride{array}", 2 + 2 * array),
        f"  %offset{array} = mul i64 %task, %stride{array}",
        f"  %row{array} = getelementptr i8, ptr %base{array}, i64 %offset{array}",
    ]


def _take(iteration: Iteration, layout: _PortLayout) -> str:
    """Return the function that loads a task into a lane."""
    lines = [
        "define internal void @take(ptr %arguments, ptr %vectors, i64 %lane, i64 %task) noinline {",
        "entry:",
    ]
    for array, port in enumerate(iteration.arrays):
        lines += _row(array)
        for column in range(port.size):
            lines += _copied(layout, layout.vector[port.name] + column, f"%row{array}", column)
    return "\n".join([*lines, "  ret void", "}"])


def _store(iteration: Iteration, layout: _PortLayout) -> str:
    """Return the function that stores the result of the task in a lane."""
    lines = [
        "define internal void @store(ptr %arguments, ptr %vectors, i64 %lane, i64 %task) noinline {",
        "entry:",
    ]
    array = layout.n_arrays - 1
    lines += _row(array)
    for column in range(iteration.n_results):
        vector = layout.vector["memory"] + column
        lines += [
            *layout.cell(vector),
            f"  %value{vector} = load double, ptr %cell{vector}",
            f"  %at{vector} = getelementptr double, ptr %row{array}, i64 {column}",
            f"  store double %value{vector}, ptr %at{vector}",
        ]
    return "\n".join([*lines, "  ret void", "}"])


def _start(layout: _PortLayout) -> str:
    """Return the function that loads a row of the table of starts into a lane."""
    lines = [
        "define internal void @start(ptr %starts, ptr %vectors, i64 %lane, i64 %number) noinline {",
        "entry:",
        f"  %offset = mul i64 %number, {layout.x_size}",
        "  %row = getelementptr double, ptr %starts, i64 %offset",
    ]
    for column in range(layout.x_size):
        lines += _copied(layout, layout.vector["x"] + column, "%row", column)
    return "\n".join([*lines, "  ret void", "}"])


def _loop(iteration: Iteration, layout: _PortLayout) -> str:
    """Return the entry function.

    `task` holds the number of the task of each lane, at least `end` if it has none; `end` is the number of
    tasks, or that of the first one reached plus 1 if the kernel stops there.
    """
    lanes, more = layout.lanes, 1 + 2 * layout.n_arrays
    vector, integers = f"<{lanes} x double>", f"<{lanes} x i64>"
    status, restart = layout.vector["status"], layout.vector["restart"]
    lines = [
        f"define void @{ENTRY}(ptr noalias nocapture %arguments) {{",
        "entry:",
        f"  %vectors = alloca [{layout.vectors} x {vector}], align 64",
        f"  %tasks = alloca [{lanes} x i64], align 64",
        "  %end_at = alloca i64",
        "  %next_at = alloca i64",
        "  %n = load i64, ptr %arguments",
        *argument_word("constants", more, "ptr"),
        *argument_word("starts", more + 2, "ptr"),
        *argument_word("stops", more + 4),
        f"  %status_at = getelementptr {vector}, ptr %vectors, i64 {status}",
        f"  %restart_at = getelementptr {vector}, ptr %vectors, i64 {restart}",
        "  store i64 %n, ptr %end_at",
        f"  store i64 {lanes}, ptr %next_at",
        "  %last = sub i64 %n, 1",
        "  br label %fill",
        # A lane without a task repeats the last one, so that it computes with valid numbers.
        "fill:",
        "  %k = phi i64 [0, %entry], [%k_next, %fill]",
        "  %beyond = icmp sgt i64 %k, %last",
        "  %own = select i1 %beyond, i64 %last, i64 %k",
        "  call void @take(ptr %arguments, ptr %vectors, i64 %k, i64 %own)",
        "  %task_k = getelementptr i64, ptr %tasks, i64 %k",
        "  store i64 %k, ptr %task_k",
        "  %k_next = add i64 %k, 1",
        f"  %unfilled = icmp slt i64 %k_next, {lanes}",
        "  br i1 %unfilled, label %fill, label %iterate",
        "iterate:",
        "  call void @routine0(ptr @operands, ptr %arguments, i64 0, ptr %vectors, ptr %constants)",
        f"  %status = load {vector}, ptr %status_at, align 64",
        f"  %restart = load {vector}, ptr %restart_at, align 64",
        f"  %ended = fcmp une {vector} %status, zeroinitializer",
        f"  %restarts = fcmp oge {vector} %restart, zeroinitializer",
        f"  %eventful = or <{lanes} x i1> %ended, %restarts",
        f"  %bits = bitcast <{lanes} x i1> %eventful to i{lanes}",
        f"  %uneventful = icmp eq i{lanes} %bits, 0",
        "  br i1 %uneventful, label %iterate, label %serve",
        "serve:",
        "  %lane = phi i64 [0, %iterate], [%lane_next, %served]",
        "  %task_at = getelementptr i64, ptr %tasks, i64 %lane",
        "  %task = load i64, ptr %task_at",
        "  %end = load i64, ptr %end_at",
        "  %has_task = icmp slt i64 %task, %end",
        "  br i1 %has_task, label %examine, label %served",
        "examine:",
        "  %state_at = getelementptr double, ptr %status_at, i64 %lane",
        "  %state = load double, ptr %state_at",
        f"  %over = fcmp une double %state, {RUNNING}",
        "  br i1 %over, label %finish, label %go_on",
        "go_on:",
        "  %row_at = getelementptr double, ptr %restart_at, i64 %lane",
        "  %row = load double, ptr %row_at",
        "  %starts_again = fcmp oge double %row, 0.0",
        "  br i1 %starts_again, label %restart_lane, label %served",
        "restart_lane:",
        "  %number = fptosi double %row to i64",
        "  call void @start(ptr %starts, ptr %vectors, i64 %lane, i64 %number)",
        "  br label %served",
        "finish:",
        "  call void @store(ptr %arguments, ptr %vectors, i64 %lane, i64 %task)",
        f"  %reached = fcmp oeq double %state, {REACHED}",
        "  %stop = icmp ne i64 %stops, 0",
        "  %is_last = and i1 %reached, %stop",
        "  %task_end = add i64 %task, 1",
        "  %new_end = select i1 %is_last, i64 %task_end, i64 %end",
        "  store i64 %new_end, ptr %end_at",
        "  %new = load i64, ptr %next_at",
        "  %new_next = add i64 %new, 1",
        "  store i64 %new_next, ptr %next_at",
        "  store i64 %new, ptr %task_at",
        "  %remains = icmp slt i64 %new, %new_end",
        "  br i1 %remains, label %refill, label %served",
        "refill:",
        "  call void @take(ptr %arguments, ptr %vectors, i64 %lane, i64 %new)",
        "  br label %served",
        "served:",
        "  %lane_next = add i64 %lane, 1",
        f"  %more_lanes = icmp slt i64 %lane_next, {lanes}",
        "  br i1 %more_lanes, label %serve, label %decide",
        "decide:",
        f"  %all_tasks = load {integers}, ptr %tasks, align 64",
        "  %end_now = load i64, ptr %end_at",
        f"  %end_0 = insertelement {integers} poison, i64 %end_now, i32 0",
        f"  %ends = shufflevector {integers} %end_0, {integers} poison, <{lanes} x i32> zeroinitializer",
        f"  %has_tasks = icmp slt {integers} %all_tasks, %ends",
        f"  %busy = bitcast <{lanes} x i1> %has_tasks to i{lanes}",
        f"  %idle = icmp eq i{lanes} %busy, 0",
        "  br i1 %idle, label %return, label %iterate",
        "return:",
        "  store i64 %end_now, ptr %arguments",
        "  ret void",
        "}",
    ]
    return "\n".join(lines)


MIN_PART_TASKS = 128
"""Least number of tasks of a part, which another thread may take. At the end of a part lanes become idle."""

MAX_PART_TASKS = 2048
"""Most tasks of a part. Ctrl-C takes effect between two parts."""

PARTS_PER_THREAD = 4
"""Number of parts per thread; more than 1, because parts take different times."""


class IterationKernel:
    """A compiled iteration. Safe to use from several threads; the code is freed when nothing refers to it."""

    def __init__(self, image: Image) -> None:
        """Link the image of an iteration. Raises CompileError if that fails."""
        self.image = image
        self._code = Code(image)

    def __call__(
        self,
        tasks: Sequence[Floats],
        result: Floats,
        constants: Floats,
        starts: Floats,
        *,
        threads: int = 1,
    ) -> None:
        """Fill `result` (n, n_results), one row for each task, from `tasks`: arrays (n, size) of x, memory
        and the task inputs, in this order.

        All arrays are float64 with contiguous rows; rows of tasks may have a stride of 0. `constants` holds
        the constants in the order of their ports, `starts` (k, m) the rows at which tasks are restarted. The
        result of a task does not depend on the other tasks or on the number of threads. Raises ArgumentError
        for a wrong number of arrays or a read-only result, DTypeError for another dtype than float64 and
        ShapeError for a wrong shape, all before anything is written. Only `tasks` and `result` are checked:
        `constants` and `starts` must have the size and layout given here, or memory beyond them is read.
        """
        n = check_arrays(self.image.inputs, self.image.outputs, tasks, [result])
        if n == 0:
            return
        words = self._words(n, tasks, result, constants, starts, stop=False)
        parts = max(-(-n // MAX_PART_TASKS), 1)
        if threads > 1:
            parts = max(parts, min(n // MIN_PART_TASKS, threads * PARTS_PER_THREAD))
        arguments = arguments_of_parts(words, n, 1, parts)
        start, step = arguments.ctypes.data, arguments.strides[0]

        def call(part: int, _alive: object = (tasks, result, constants, starts)) -> None:
            self._code.entry(start + part * step)

        run_parts(call, parts, threads)

    def bind_race(
        self, tasks: Sequence[Floats], result: Floats, constants: Floats, starts: Floats
    ) -> Callable[[], int]:
        """Return a function that fills `result` for the tasks up to the first that is reached, in order.

        It returns the number of completed tasks, of which the last is reached unless all are completed;
        results of later tasks are undefined. As many tasks are computed at a time as there are lanes. The
        function reads the present contents of the arrays, which are those of a plain call and must stay
        alive; it holds Python's global lock, and is not safe to use from several threads at a time.
        """
        n = check_arrays(self.image.inputs, self.image.outputs, tasks, [result])
        if n == 0:
            return lambda: 0
        words = np.array(self._words(n, tasks, result, constants, starts, stop=True), dtype=np.int64)
        run, count, kept = self._code.locked_entry, words.data, (self._code, tasks, result, constants, starts)
        address = words.ctypes.data

        def race(_alive: object = kept) -> int:
            count[0] = n
            run(address)
            return int(count[0])

        return race

    def _words(
        self,
        n: int,
        tasks: Sequence[Floats],
        result: Floats,
        constants: Floats,
        starts: Floats,
        *,
        stop: bool,
    ) -> list[int]:
        words = [n]
        for array in (*tasks, result):
            words += [array.ctypes.data, array.strides[0]]
        return [*words, constants.ctypes.data, 0, starts.ctypes.data, 0, int(stop), 0]


def compile_iteration(iteration: Iteration, target: Processor, settings: Settings) -> Image:
    """Compile an iteration to an image, whose ports have a row for each task."""
    with collection_paused():
        code = compile_text(emit_iteration(iteration, target, settings), target)
    return Image(iteration.arrays, (iteration.result,), settings.lanes, target, (code,))


def load_iteration(
    recipe: bytes, iteration: Callable[[], Iteration], lanes: int | None = None
) -> IterationKernel:
    """Load the kernel of an iteration, which `recipe` determines, from the cache, or compile and store it.

    `lanes` tasks are computed at once, by default as many as the processor's vectors have lanes. With one
    lane the tasks are computed in order, so that the array of a task may be the result of the one before.
    """
    target = host()
    settings = Settings(target.lanes if lanes is None else lanes)

    def compiled() -> Image:
        return compile_iteration(iteration(), target, settings)

    return load_code(recipe, compiled, target, settings, IterationKernel)
