"""Refinement of targets that no start reached to a local minimum of the error: the iteration of its kernel.

Where the error stays large the full step overshoots, so a step that does not reduce the error is rejected and
the damping raised (Marquardt 1963), as in `dynx.ik.search`. A rejected step is followed by an evaluation of
the best configuration, from which the next step starts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.kernels.step import (
    HUGE_ERROR,
    SETTINGS,
    FramePath,
    TargetKind,
    bounded_step,
    shifted_to,
    traced_residual,
)
from dynx.ik.search import DAMPING, MIN_DAMPING, MIN_RELATIVE_GAIN
from dynx.model import Mechanism
from dynx.simd.inlining import less, less_equal, maximum, select
from dynx.simd.iteration import GIVEN_UP, NO_RESTART, REACHED, RUNNING, Iteration
from dynx.simd.trace import trace
from dynx.spatial.scalar import Array, Floats


@dataclass(frozen=True)
class RefinementMemory:
    """Layout of the variables of a task: result, then what the next steps need."""

    n: int
    """Number of coordinates."""

    @property
    def n_results(self) -> int:
        """Size of the result: coordinates, distance, angle, success, iterations."""
        return self.n + 4

    @property
    def initial(self) -> Floats:
        """Variables of a new task: result, squared error, damping factor, and whether x is the best one."""
        return np.array([0.0] * (self.n + 4) + [HUGE_ERROR, DAMPING, 1.0])


def refinement_iteration(
    mechanism: Mechanism, frame: int, coordinates: FrameCoordinates, kind: TargetKind
) -> Iteration:
    """Return the iteration that reduces the error of frame number `frame` from one configuration.

    Tasks have the arrays ``x``, where it begins (n,); ``memory`` (`RefinementMemory`); ``target``, ``near``,
    ``point`` and ``axes`` as in `dynx.ik.kernels.step.solver_iteration`. The constants are those of
    `SETTINGS`.
    """
    n = coordinates.count
    path = FramePath.of(mechanism, frame, coordinates)

    def step(
        x: Array,
        memory: Array,
        target: Array,
        near: Array,
        settings: Array,
        point: Array | None = None,
        axes: Array | None = None,
    ) -> dict[str, Any]:
        residual, J, squared = traced_residual(path, kind, x, target, point, axes)
        position_tolerance, rotation_tolerance, max_iterations, _ = settings
        iterations, least, factor, at_best = memory[n + 3 : n + 7]
        trial = 1.0 - at_best
        iterations = iterations + trial
        gain = least - squared
        accepted = maximum(at_best, less(0.0, gain))
        reached = residual.reached(position_tolerance, rotation_tolerance)
        found = [*x, residual.distance, residual.angle, reached]
        best = [select(accepted, a, b) for a, b in zip(found, memory[: n + 3], strict=True)]
        factor = select(at_best, factor, factor * select(accepted, 0.3, 4.0))
        converged = trial * less_equal(abs(gain), MIN_RELATIVE_GAIN * least)
        ends = maximum(converged, less_equal(max_iterations, iterations))
        stepped = bounded_step(J, residual.vector, x, coordinates, factor * squared + MIN_DAMPING)
        next_x = [
            select(accepted, a, b)
            for a, b in zip(shifted_to(stepped, near, coordinates), memory[:n], strict=True)
        ]
        after = [*best, iterations, select(accepted, squared, least), factor, 1.0 - accepted]
        status = select(reached * accepted, REACHED, select(ends, GIVEN_UP, RUNNING))
        return {
            "x": np.array(next_x, dtype=object),
            "memory": np.array(after, dtype=object),
            "status": status,
            "restart": NO_RESTART + 0.0 * squared,
        }

    memory = RefinementMemory(n)
    sizes = {"x": n, "memory": len(memory.initial), "target": kind.size, "near": n}
    sizes |= {"settings": len(SETTINGS)} | kind.optional_sizes
    shapes = {name: (size,) for name, size in sizes.items()}
    return Iteration(trace(step, shapes), ("settings",), memory.n_results)
