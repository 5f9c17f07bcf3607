"""Compiled `floating_displacement` of a base, because NumPy would take twenty times as long."""

from __future__ import annotations

from functools import cache

from dynx.rbd.displacement import floating_displacement
from dynx.simd.cache import load_kernel, program_recipe
from dynx.simd.emit import Settings
from dynx.simd.kernel import Kernel
from dynx.simd.simplify import STRICT
from dynx.simd.target import host
from dynx.simd.trace import trace
from dynx.spatial.scalar import Array


@cache
def displacement_kernel() -> Kernel:
    """Compile `floating_displacement` of a base alone."""

    def step(q: Array, u: Array, w: Array, h: Array, center: Array) -> dict[str, Array]:
        return dict(zip(("q", "v"), floating_displacement(q, u, w, h[0], center), strict=True))

    sizes = {"q": (7,), "u": (6,), "w": (6,), "h": (1,), "center": (3,)}
    program = trace(step, sizes, simplify=STRICT)
    return load_kernel(program_recipe(program), lambda: program, settings=Settings(host().lanes, fast=False))
