"""Kernels of one robot for programs other than quantities, such as derivatives, and their evaluation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from math import prod
from pathlib import Path

import numpy as np

import dynx.backends
import dynx.compiled
import dynx.model
import dynx.rbd
import dynx.spatial
from dynx._version import __version__
from dynx.backends.evaluation import batch_rows, common_batch
from dynx.model import Model
from dynx.simd.cache import load_kernel, source_hash
from dynx.simd.emit import Settings
from dynx.simd.kernel import Kernel
from dynx.simd.program import Program
from dynx.simd.target import host
from dynx.spatial.scalar import Floats

MAX_NV_OF_LONG_SEGMENTS = 16
"""Number of degrees of freedom above which code is divided into shorter segments, which take half the time
to compile and run about a tenth slower."""


def robot_kernel(model: Model, purpose: object, program: Callable[[], Program]) -> Kernel:
    """Return the kernel of `program`, which `model` and `purpose` determine; from the cache if it is
    there."""
    content = (model.links, model.joints, model.base, model.gravity, model.extra_frames)
    recipe = repr((_algorithms(), content, purpose)).encode()
    lanes = host().lanes
    large = model.mechanism.nv > MAX_NV_OF_LONG_SEGMENTS
    settings = Settings(lanes, segment=1200) if large else Settings(lanes)
    return load_kernel(recipe, program, settings=settings)


def evaluate_kernel(kernel: Kernel, arrays: Sequence[Floats], threads: int) -> list[Floats]:
    """Evaluate a kernel on inputs (..., size) whose leading axes broadcast; return its outputs (...,
    *shape)."""
    batch = common_batch(*arrays)
    n = prod(batch)
    rows = [batch_rows(array, batch) for array in arrays]
    found = [np.empty((*batch, *port.shape)) for port in kernel.outputs]
    kernel(
        rows,
        [out.reshape(n, port.size) for out, port in zip(found, kernel.outputs, strict=True)],
        threads=threads,
    )
    return found


@cache
def _algorithms() -> str:
    """Return the hash of the source of the packages that build such programs."""
    packages = (dynx.rbd, dynx.spatial, dynx.model, dynx.backends, dynx.compiled)
    folders = [Path(str(package.__file__)).parent for package in packages]
    return f"{__version__} {np.__version__} {source_hash(*folders)}"
