"""Kernels made of calls of routines: the table of calls of one robot, and its evaluation for batches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dynx.simd.cache import load_code
from dynx.simd.emit import Settings
from dynx.simd.image import Code, Image
from dynx.simd.kernel import Kernel, Workspace, arguments_of_parts, max_samples_of_one_part, part_count
from dynx.simd.program import Port
from dynx.simd.routines import RoutineSet, compile_routines
from dynx.simd.target import host
from dynx.simd.threads import run_parts
from dynx.spatial.scalar import Array, Floats

MAX_SINGLE_SHARE = 0.5
"""Largest number of samples, as a share of the lanes, that are evaluated one by one."""

ALIGNMENT = 64
"""Alignment of a workspace [bytes]."""

WORKSPACE_WORD = 4
"""Position of the address of the workspace among the arguments that follow those of the arrays."""

WORK_OF_CALL = 400
"""Average size of the code of a routine [bytes], which measures the work of a call."""


@dataclass
class CallTable:
    """Calls of routines in order, their constants, and the size of the workspace."""

    routines: RoutineSet
    _numbers: dict[str, int] = field(init=False)
    _calls: list[int] = field(default_factory=list)
    _constants: list[float] = field(default_factory=list)
    vectors: int = 0
    """Number of vectors of the workspace."""

    def __post_init__(self) -> None:
        self._numbers = {name: number for number, name in enumerate(self.routines.routines)}

    def reserve(self, size: int) -> int:
        """Return the place of `size` new vectors of the workspace."""
        first = self.vectors
        self.vectors += size
        return first

    def constants(self, *arrays: Array) -> int:
        """Return the place of the numbers of `arrays`, one after the other, among the constants."""
        first = len(self._constants)
        for array in arrays:
            self._constants += np.asarray(array, dtype=np.float64).ravel().tolist()
        return first

    def call(self, routine: str, *operands: int) -> None:
        """Append a call. Operands are places of vectors or constants, or columns, in the order of ports."""
        padding = self.routines.table_width - 1 - len(operands)
        self._calls += (self._numbers[routine], *operands, *[0] * padding)

    @property
    def calls(self) -> NDArray[np.int32]:
        """Rows of the table."""
        return np.array(self._calls, dtype=np.int32).reshape(-1, self.routines.table_width)

    @property
    def numbers(self) -> Floats:
        """Constants."""
        return np.array(self._constants)


@dataclass(frozen=True)
class RoutineCode:
    """Machine code of a set of routines: with one lane, and with all lanes of the processor's vectors."""

    single: Code
    several: Code
    image: Image
    """Image of the latter."""


def load_routines(recipe: bytes, routines: RoutineSet) -> RoutineCode:
    """Load a set of routines, which `recipe` determines, from the cache, or compile it and store it there."""
    target = host()

    def load(lanes: int) -> tuple[Image, Code]:
        settings = Settings(lanes)
        return load_code(
            recipe,
            lambda: compile_routines(routines, target, settings),
            target,
            settings,
            lambda image: (image, Code(image)),
        )

    (_, single), (image, several) = load(1), load(target.lanes)
    return RoutineCode(single, several, image)


class TableKernel(Kernel):
    """Evaluates the calls of a table for batches of samples, as `Kernel` does for a program.

    Few samples are evaluated one by one with one lane, instead of repeating them to fill the lanes.
    """

    def __init__(
        self, table: CallTable, inputs: Sequence[Port], outputs: Sequence[Port], code: RoutineCode
    ) -> None:
        several = code.image
        self.image = Image(tuple(inputs), tuple(outputs), several.lanes, several.target, several.objects)
        self._code, self._single = code.several, code.single
        self._max_single = max(1, int(MAX_SINGLE_SHARE * several.lanes))
        self._table = table
        self._calls, self._numbers = table.calls, table.numbers
        ports = (*inputs, *outputs)
        self._cleared = [8 * ports[array].size for array in table.routines.cleared]
        self._work = WORK_OF_CALL * len(self._calls) + 8 * sum(self._cleared)
        # Memory of the workspaces that no call uses at the moment.
        self._free: list[Floats] = []

    def _run(
        self, code: Code, inputs: Sequence[Floats], outputs: Sequence[Floats], n: int, threads: int
    ) -> None:
        lanes = self.image.lanes
        if n <= self._max_single:
            code, lanes = self._single, 1
        words = [n]
        for array in (*inputs, *outputs):
            words += [array.ctypes.data, array.strides[0]]
        workspace_word = len(words) + WORKSPACE_WORD
        words += self._more_words(0)
        arguments = arguments_of_parts(words, n, lanes, part_count(n, lanes, self._work, threads))
        start, step = arguments.ctypes.data, arguments.strides[0]

        def call(part: int, _alive: object = (inputs, outputs)) -> None:
            try:
                memory = self._free.pop()
            except IndexError:
                memory = self._workspace_memory()
            arguments[part, workspace_word] = _aligned_address(memory)
            code.entry(start + part * step)
            self._free.append(memory)

        run_parts(call, len(arguments), threads)

    def max_samples_of_one_part(self, threads: int) -> int:
        return max_samples_of_one_part(self.image.lanes, self._work, threads)

    def workspace(self, samples: int = 1) -> Workspace:
        memory = self._workspace_memory()
        return Workspace(
            self._open_code(),
            self.image,
            samples,
            single=self._single,
            more_words=self._more_words(_aligned_address(memory)),
            kept=(self, memory),
        )

    def _more_words(self, workspace: int) -> list[int]:
        """Return the arguments that follow those of the arrays (`dynx.simd.routines`)."""
        words = [self._calls.ctypes.data, 0, self._numbers.ctypes.data, 0, workspace, 0, len(self._calls), 0]
        for size in self._cleared:
            words += [size, 0]
        return words

    def _workspace_memory(self) -> Floats:
        return np.empty(self._table.vectors * self.image.lanes + ALIGNMENT // 8)

    def __reduce__(self) -> tuple[object, ...]:
        raise TypeError("a kernel of routines cannot be pickled; make it from its table again")


def _aligned_address(memory: Floats) -> int:
    return -(-memory.ctypes.data // ALIGNMENT) * ALIGNMENT
