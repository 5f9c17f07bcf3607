"""Kernels of one robot for programs other than quantities, such as derivatives, and their evaluation."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from functools import cache
from math import prod

import numpy as np

import dynx.backends
import dynx.compiled
import dynx.model
import dynx.rbd
import dynx.spatial
from dynx.backends.evaluation import batch_rows, common_batch
from dynx.compiled.simplification import simplify_mechanism
from dynx.model import Mechanism, Model
from dynx.simd.cache import load_kernel, source_version
from dynx.simd.emit import Settings
from dynx.simd.kernel import Kernel
from dynx.simd.program import Program
from dynx.simd.target import host
from dynx.simd.threads import checked_threads
from dynx.spatial.scalar import Floats

MAX_NV_OF_LONG_SEGMENTS = 16
"""Number of degrees of freedom above which code is divided into shorter segments, which take half the time
to compile and run about a tenth slower."""


Making = Callable[[Mechanism], Program]
"""Function that makes a program from the simplified mechanism of a robot."""


class RobotKernels:
    """Kernels of one robot, compiled when they are first needed; several threads may share them."""

    def __init__(self, model: Model, threads: int | None) -> None:
        """A batch is split over at most `threads` threads. Raises ArgumentError for an invalid number."""
        self._model = model
        self.threads = checked_threads(threads)
        self._kernels: dict[object, Kernel] = {}
        self._making = threading.Lock()

    def evaluate(self, purpose: object, program: Making, arrays: Sequence[Floats]) -> list[Floats]:
        """Evaluate `program` on inputs (..., size) that broadcast; return its outputs (..., *shape)."""
        return self.run(self.kernel(purpose, program), arrays)

    def run(self, kernel: Kernel, arrays: Sequence[Floats]) -> list[Floats]:
        """Evaluate a kernel on inputs (..., size) that broadcast; return its outputs (..., *shape)."""
        batch = common_batch(*arrays)
        n = prod(batch)
        rows = [batch_rows(array, batch) for array in arrays]
        found = [np.empty((*batch, *port.shape)) for port in kernel.outputs]
        columns = [out.reshape(n, port.size) for out, port in zip(found, kernel.outputs, strict=True)]
        kernel(rows, columns, threads=self.threads)
        return found

    def kernel(self, purpose: object, program: Making) -> Kernel:
        """Return the kernel of `program`, which `purpose` determines; from the cache if it is there."""
        kernel = self._kernels.get(purpose)
        if kernel is None:
            with self._making:
                kernel = self._kernels.get(purpose)
                if kernel is None:
                    kernel = self._kernels[purpose] = self._load(purpose, program)
        return kernel

    def _load(self, purpose: object, program: Making) -> Kernel:
        model, lanes = self._model, host().lanes
        content = (model.links, model.joints, model.base, model.gravity, model.extra_frames, model.base_pose)
        recipe = repr((_algorithms(), content, purpose)).encode()
        large = model.mechanism.nv > MAX_NV_OF_LONG_SEGMENTS
        settings = Settings(lanes, segment=1200) if large else Settings(lanes)
        mechanism = model.mechanism
        return load_kernel(recipe, lambda: program(simplify_mechanism(mechanism)), settings=settings)


@cache
def _algorithms() -> str:
    """Return the hash of the source of the packages that build such programs."""
    return source_version(dynx.rbd, dynx.spatial, dynx.model, dynx.backends, dynx.compiled)
