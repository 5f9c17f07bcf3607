"""Evaluation of compiled variants (`dynx.simd.variants`) for batches of samples, on several threads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from dynx.errors import ArgumentError
from dynx.simd.cache import load_code
from dynx.simd.emit import Settings
from dynx.simd.image import Code, Image, compile_text
from dynx.simd.kernel import part_count
from dynx.simd.program import collection_paused
from dynx.simd.target import Target, host
from dynx.simd.threads import run_parts
from dynx.simd.variants.emission import Variants, emit_variants
from dynx.spatial.scalar import Floats

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


def compile_variants(variants: Variants, target: Target, settings: Settings) -> Image:
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
