"""Kernels of one robot that are not quantities of the interface: how they are found again and called."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from math import prod
from pathlib import Path

import numpy as np

import dynx.backends
import dynx.model
import dynx.rbd
import dynx.spatial
from dynx._version import __version__
from dynx.backends.evaluation import common_batch
from dynx.model import Mechanism, Model
from dynx.simd.cache import load_kernel, source_hash
from dynx.simd.emit import Settings
from dynx.simd.kernel import Kernel
from dynx.simd.program import Program
from dynx.simd.target import host
from dynx.spatial.scalar import Array, Floats

LARGE = 16
"""Degrees of freedom above which code is cut into shorter segments: it takes half the time to compile
and runs about a tenth slower."""


def robot_kernel(model: Model, question: object, program: Callable[[], Program]) -> Kernel:
    """The kernel of a program that `model` and `question` decide, from the cache if it is there."""
    content = (model.links, model.joints, model.base, model.gravity, model.extra_frames)
    recipe = repr((_algorithms(), content, question)).encode()
    lanes = host().lanes
    large = model.mechanism.nv > LARGE
    settings = Settings(lanes, segment=1200) if large else Settings(lanes)
    return load_kernel(recipe, program, settings=settings)


def evaluated(kernel: Kernel, arrays: Sequence[Floats], threads: int) -> list[Floats]:
    """The outputs (..., *shape) of a kernel for inputs (..., size) whose leading axes broadcast."""
    batch = common_batch(*arrays)
    n = prod(batch)
    rows = [_rows(array, batch, n) for array in arrays]
    found = [np.empty((*batch, *port.shape)) for port in kernel.outputs]
    kernel(
        rows,
        [out.reshape(n, port.size) for out, port in zip(found, kernel.outputs, strict=True)],
        threads=threads,
    )
    return found


def tree_coordinates(mechanism: Mechanism, q: Array, *rates: Array) -> tuple[Array, ...]:
    """q and velocities of the model in those of the tree: what mimic joints make of them."""
    coupling = mechanism.coupling
    if coupling is None:
        return (q, *rates)
    S = coupling.matrix()
    return (coupling.expand_q(q), *(rate @ S.T for rate in rates))


def model_torque(mechanism: Mechanism, tau: Array) -> Array:
    """A torque of the tree in the coordinates of the model, by virtual work."""
    coupling = mechanism.coupling
    return tau if coupling is None else np.asarray(tau @ coupling.matrix())


def argument_shapes(mechanism: Mechanism, third: str) -> dict[str, tuple[int, ...]]:
    """Of q, v and a third argument like v, in the coordinates of the model."""
    coupling = mechanism.coupling
    n = len(mechanism.bodies) if coupling is None else coupling.n_joints
    nq, nv = (n + 7, n + 6) if mechanism.floating else (n, n)
    return {"q": (nq,), "v": (nv,), third: (nv,)}


def _rows(array: Floats, batch: tuple[int, ...], n: int) -> Floats:
    if array.ndim == 1:
        return np.broadcast_to(array, (n, *array.shape))
    return np.broadcast_to(array, (*batch, array.shape[-1])).reshape(n, array.shape[-1])


@cache
def _algorithms() -> str:
    """Hash of the text of all that programs of robots are made by."""
    packages = (dynx.rbd, dynx.spatial, dynx.model, dynx.backends)
    folders = [Path(str(package.__file__)).parent for package in packages]
    return f"{__version__} {np.__version__} {source_hash(*folders)}"
