"""Evaluation of a compiled iteration (`dynx.simd.iteration`) on many tasks and several threads."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from dynx.simd.arrays import check_arrays
from dynx.simd.cache import load_code
from dynx.simd.emit import Settings
from dynx.simd.image import Code, Image, compile_text
from dynx.simd.iteration.emission import Iteration, emit_iteration
from dynx.simd.kernel import arguments_of_parts
from dynx.simd.program import collection_paused
from dynx.simd.target import Target, host
from dynx.simd.threads import run_parts
from dynx.spatial.scalar import Floats

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
        """Fill `result` (n, n_results) for `tasks`, arrays (n, size) of the ports x, memory and the tasks.

        All arrays are float64 with contiguous rows; rows of tasks may have a stride of 0. `constants` holds
        the constants in the order of their ports, `starts` (k, m) the rows at which tasks are restarted. The
        result of a task does not depend on the other tasks or on the number of threads. Raises ArgumentError,
        DTypeError or ShapeError for arrays that do not fit, and writes nothing then.
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


def compile_iteration(iteration: Iteration, target: Target, settings: Settings) -> Image:
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
