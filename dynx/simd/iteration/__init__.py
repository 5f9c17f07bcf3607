"""Iterations: a traced step that every lane repeats for its own task until the task is finished."""

from dynx.simd.iteration.emission import GIVEN_UP, NO_RESTART, REACHED, RUNNING, Iteration
from dynx.simd.iteration.kernel import IterationKernel, compile_iteration, load_iteration

__all__ = [
    "GIVEN_UP",
    "NO_RESTART",
    "REACHED",
    "RUNNING",
    "Iteration",
    "IterationKernel",
    "compile_iteration",
    "load_iteration",
]
