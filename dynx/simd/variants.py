"""Variants: a traced program that is evaluated for every row of a fixed table, with the rows in the lanes.

An equation with several solutions is an example: a sample is one equation, and the rows of the table hold the
signs that choose the solution. One sample alone fills the lanes, and no input is repeated in memory. There
are as many lanes as variants. Where the processor has fewer, it computes several vectors by turns, which
hides the time that each operation takes.

The last input of the program is a row of the table; the others belong to the sample and are broadcast to all
lanes. Outputs have a row for each variant of each sample, but those called *masks*, scalars that are 0 or
not, are packed: a byte for each sample, in which bit k belongs to variant k. A second program with the same
ports, which may take longer, is evaluated instead for the samples in which the mask *repeat* is set.

The entry function takes the address of 64-bit words: the number of samples; an address and a row stride in
bytes for each input of a sample and each output; then an address and a zero for each mask. Products and sums
are contracted as in routines, so results depend neither on other samples nor on the number of lanes.

`VariantKernel` evaluates compiled variants for batches of samples, on several threads.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from dynx.errors import ArgumentError, CompileError
from dynx.simd.cache import load_code
from dynx.simd.emit import ENTRY, Settings
from dynx.simd.image import Code, Image, compile_text
from dynx.simd.ir_writer import hex_double
from dynx.simd.kernel import part_count
from dynx.simd.program import Port, Program, collection_paused
from dynx.simd.routines import Place, Routine, RoutineBody, argument_word
from dynx.simd.target import Processor, host
from dynx.simd.threads import run_parts
from dynx.simd.trigonometry import declarations, replacements
from dynx.spatial.scalar import Floats

MAX_VARIANTS = 8
"""Most variants: the bits of a byte."""


@dataclass(frozen=True)
class Variants:
    """Two programs, the rows of the table, and the names of the outputs that are masks, which come last."""

    program: Program
    second: Program
    table: tuple[tuple[float, ...], ...]
    masks: tuple[str, ...]
    repeat: str
    """Name of the mask that selects samples for the second program."""

    def __post_init__(self) -> None:
        """Raises CompileError for a table, masks or a second program that do not fit the program."""
        count, (*_, last) = len(self.table), self.program.inputs
        if count > MAX_VARIANTS or count & (count - 1) or any(len(row) != last.size for row in self.table):
            raise CompileError(
                f"{count} variants of {last.size} numbers; wanted 1, 2, 4 or {MAX_VARIANTS} rows of them"
            )
        if (self.second.inputs, self.second.outputs) != (self.program.inputs, self.program.outputs):
            raise CompileError("the second program has other inputs or outputs than the first")
        masks = self.program.outputs[len(self.outputs) :]
        if [(port.name, port.size) for port in masks] != [(name, 1) for name in self.masks]:
            raise CompileError(f"the last outputs are {masks}; wanted the scalars {self.masks}")
        if self.repeat not in self.masks:
            raise CompileError(f"{self.repeat} is none of the masks {self.masks}")

    @property
    def samples(self) -> tuple[Port, ...]:
        """Inputs with a row for each sample."""
        return self.program.inputs[:-1]

    @property
    def outputs(self) -> tuple[Port, ...]:
        """Outputs with a row for each variant of each sample."""
        return self.program.outputs[: len(self.program.outputs) - len(self.masks)]


def emit_variants(variants: Variants, target: Processor, settings: Settings) -> str:
    """Return the text of the LLVM module; CompileError unless there are as many lanes as variants."""
    if len(variants.table) != settings.lanes:
        raise CompileError(f"{len(variants.table)} variants and {settings.lanes} lanes")
    programs = enumerate((variants.program, variants.second))
    bodies = [_VariantProgram(variants, program, number, target, settings) for number, program in programs]
    texts = [body.text() for body in bodies]
    places = bodies[0].operands
    operands = ", ".join(f"i32 {place}" for place in (0, *places))
    parts = [
        f'target triple = "{target.triple}"',
        f"@operands = internal constant [{1 + len(places)} x i32] [{operands}]",
        *texts,
        _loop(variants),
        *replacements(texts, settings.lanes),
        *declarations(settings.lanes),
    ]
    return "\n".join(parts) + "\n"


class _VariantProgram(RoutineBody):
    """A program as a function of the number of the first variant, counted over all samples.

    The vectors hold the rows of the table, then the masks.
    """

    def __init__(
        self, variants: Variants, program: Program, number: int, target: Processor, settings: Settings
    ) -> None:
        self._samples, width = len(variants.samples), variants.program.inputs[-1].size
        places: list[Place] = ["constants"] * self._samples
        places.append("vectors")
        places += [self._samples + k for k in range(len(variants.outputs))]
        places += ["vectors"] * len(variants.masks)
        super().__init__(Routine(program, tuple(places)), target, settings, number)
        self._count = len(variants.table)
        unused = [0] * (self._samples + 1 + len(variants.outputs))
        self.operands = [*unused, *(width + k for k in range(len(variants.masks)))]
        """First vector of each port that has one."""

    def _start(self, port: int) -> str:
        if port >= self._samples:
            return super()._start(port)
        if port not in self._operands:
            self._operands[port] = [
                *argument_word(f"base{port}", 1 + 2 * port, "ptr"),
                *argument_word(f"stride{port}", 2 + 2 * port),
                f"  %sample{port} = udiv i64 %first, {self._count}",
                f"  %offset{port} = mul i64 %sample{port}, %stride{port}",
                f"  %start{port} = getelementptr i8, ptr %base{port}, i64 %offset{port}",
            ]
        return f"%start{port}"


def _loop(variants: Variants) -> str:
    """Return the entry function."""
    count, width = len(variants.table), variants.program.inputs[-1].size
    vector, size = f"<{count} x double>", width + len(variants.masks)
    first_mask = 1 + 2 * (len(variants.samples) + len(variants.outputs))
    aligned = f"align {8 * count}"
    lines = [
        f"define void @{ENTRY}(ptr noalias nocapture readonly %arguments) {{",
        "entry:",
        f"  %vectors = alloca [{size} x {vector}], align 64",
        "  %n = load i64, ptr %arguments",
    ]
    for k in range(width):
        values = ", ".join(f"double {hex_double(row[k])}" for row in variants.table)
        lines += [
            f"  %column{k} = getelementptr {vector}, ptr %vectors, i64 {k}",
            f"  store {vector} <{values}>, ptr %column{k}, {aligned}",
        ]
    for m in range(len(variants.masks)):
        lines += argument_word(f"bytes{m}", first_mask + 2 * m, "ptr")
        lines.append(f"  %mask_at{m} = getelementptr {vector}, ptr %vectors, i64 {width + m}")
    passed = "ptr @operands, ptr %arguments, i64 %first, ptr %vectors, ptr null"
    lines += [
        "  br label %sample",
        "sample:",
        "  %i = phi i64 [0, %entry], [%next, %store]",
        f"  %first = mul i64 %i, {count}",
        f"  call void @routine0({passed})",
        *_bits("repeat", f"%mask_at{variants.masks.index(variants.repeat)}", count),
        f"  %clear = icmp eq i{count} %repeat, 0",
        "  br i1 %clear, label %store, label %again",
        "again:",
        f"  call void @routine1({passed})",
        "  br label %store",
        "store:",
    ]
    for m in range(len(variants.masks)):
        lines += _bits(f"bits{m}", f"%mask_at{m}", count)
        byte = f"%bits{m}"
        if count < MAX_VARIANTS:
            lines.append(f"  %byte{m} = zext i{count} %bits{m} to i8")
            byte = f"%byte{m}"
        lines += [
            f"  %byte_at{m} = getelementptr i8, ptr %bytes{m}, i64 %i",
            f"  store i8 {byte}, ptr %byte_at{m}",
        ]
    lines += [
        "  %next = add i64 %i, 1",
        "  %more = icmp slt i64 %next, %n",
        "  br i1 %more, label %sample, label %done",
        "done:",
        "  ret void",
        "}",
    ]
    return "\n".join(lines)


def _bits(name: str, address: str, count: int) -> list[str]:
    """Return the code that sets a bit for each lane that is not 0 of the vector at an address."""
    vector = f"<{count} x double>"
    return [
        f"  %{name}_mask = load {vector}, ptr {address}, align {8 * count}",
        f"  %{name}_set = fcmp une {vector} %{name}_mask, zeroinitializer",
        f"  %{name} = bitcast <{count} x i1> %{name}_set to i{count}",
    ]


Bytes = NDArray[np.uint8]


class BoundVariants:
    """Memory of one sample: `inputs` to write, a row (size,) each; `outputs` (variants, size) to read after
    ``run()``, and `masks`, of which byte k of its only number is mask k. Not safe for several threads."""

    __slots__ = ("_kept", "inputs", "masks", "outputs", "run")

    def __init__(self, kernel: VariantKernel, code: Code, outputs: Sequence[Floats]) -> None:
        image = kernel.image
        inputs = [np.zeros((1, port.size)) for port in image.inputs]
        number = np.zeros(1, dtype="<u8")
        masks = [number.view(np.uint8)[k : k + 1] for k in range(kernel.n_masks)]
        words = np.array(kernel.words(inputs, outputs, masks), dtype=np.int64)
        self._kept = (words, code, inputs)
        self.inputs = tuple(each[0] for each in inputs)
        self.outputs, self.masks = tuple(outputs), number.data
        self.run: Callable[[], None] = partial(code.locked_entry, words.ctypes.data)


class VariantKernel:
    """Compiled variants. Safe to use from several threads; the code is freed when nothing refers to it."""

    def __init__(self, image: Image, count: int, n_masks: int) -> None:
        """Link the image of `count` variants. Raises CompileError if that fails."""
        self.image, self.count, self.n_masks = image, count, n_masks
        self._code = Code(image)

    def __call__(
        self, inputs: Sequence[Floats], outputs: Sequence[Floats], masks: Sequence[Bytes], *, threads: int = 1
    ) -> None:
        """Fill `outputs` (n count, size) and `masks` (n,) from `inputs` (n, size) of n samples.

        Rows are contiguous; those of inputs may have a stride of 0. Results do not depend on the number of
        threads or on other samples. Raises ArgumentError for arrays that do not fit.
        """
        n = len(masks[0])
        words = self.words(inputs, outputs, masks)
        if not n:
            return
        lanes = self.image.lanes
        parts = min(part_count(n * self.count, lanes, self.image.size, threads), n)
        bounds = np.arange(parts + 1) * n // parts
        strides = [array.strides[0] for array in inputs]
        strides += [array.strides[0] * self.count for array in outputs]
        strides += [array.strides[0] for array in masks]
        arguments = np.tile(np.array(words, dtype=np.int64), (parts, 1))
        arguments[:, 0] = np.diff(bounds)
        arguments[:, 1::2] += bounds[:-1, None] * np.array(strides)
        start, step = arguments.ctypes.data, arguments.strides[0]

        def call(part: int, _alive: object = (inputs, outputs, masks, arguments)) -> None:
            self._code.entry(start + part * step)

        run_parts(call, parts, threads)

    def bind(self, outputs: Sequence[Floats]) -> BoundVariants:
        """Return memory for one sample, with these arrays (count, size) as outputs."""
        return BoundVariants(self, self._code, outputs)

    def words(self, inputs: Sequence[Floats], outputs: Sequence[Floats], masks: Sequence[Bytes]) -> list[int]:
        """Return the arguments of the code; ArgumentError for arrays that do not fit."""
        n = len(masks[0])
        ports, arrays = (*self.image.inputs, *self.image.outputs), (*inputs, *outputs)
        rows = [n] * len(inputs) + [n * self.count] * len(outputs)
        words = [n]
        for port, array, count in zip(ports, arrays, rows, strict=True):
            contiguous = not array.size or port.size == 1 or (array.ndim == 2 and array.strides[1] == 8)
            if array.shape != (count, port.size) or array.dtype != np.float64 or not contiguous:
                raise ArgumentError(
                    f"{port.name} is {array.dtype} {array.shape} with strides {array.strides}; "
                    f"wanted float64 ({count}, {port.size}) with contiguous rows"
                )
            words += [array.ctypes.data, array.strides[0]]
        for mask in masks:
            if mask.shape != (n,) or mask.dtype != np.uint8 or not mask.flags.c_contiguous:
                raise ArgumentError(f"a mask is {mask.dtype} {mask.shape}; wanted contiguous uint8 ({n},)")
            words += [mask.ctypes.data, 0]
        if len(masks) != self.n_masks:
            raise ArgumentError(f"{len(masks)} masks; wanted {self.n_masks}")
        return words


def compile_variants(variants: Variants, target: Processor, settings: Settings) -> Image:
    """Compile variants to an image, whose ports are the inputs of a sample and the outputs of a variant."""
    with collection_paused():
        code = compile_text(emit_variants(variants, target, settings), target)
    return Image(variants.samples, variants.outputs, settings.lanes, target, (code,))


def load_variants(recipe: bytes, count: int, masks: int, variants: Callable[[], Variants]) -> VariantKernel:
    """Load the kernel of `count` variants with `masks`, which `recipe` determines, from the cache, or compile
    and store it."""
    target = host()
    settings = Settings(count)
    return load_code(
        recipe,
        lambda: compile_variants(variants(), target, settings),
        target,
        settings,
        partial(VariantKernel, count=count, n_masks=masks),
    )
