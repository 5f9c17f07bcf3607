"""Completion of a step that did not settle which joints stick, or in which joints passed their limits.

A kernel corrects the modes of the law of friction (`dynx.rbd.joint_friction`) once, which mostly
suffices. For the other lanes it is called again with the corrected modes, until they are right. A lane whose
modes are right gives the same bits again, so no result depends on its neighbours.

Joints that passed their limits stop by the law of `dynx.steppers.joint_stops`. A kernel computes the
velocities after the impact for the lanes in which such a joint moves outwards, and for no other.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.compiled.kernels import evaluate_quantity
from dynx.compiled.simplification import simplify_mechanism
from dynx.compiled.status import Status
from dynx.compiled.step import BoundSteps, StepText, compiled
from dynx.model import Model
from dynx.model.limited_positions import joint_ranges
from dynx.rbd.joint_friction import FrictionLaw
from dynx.sim.loop_step import LoopStep
from dynx.simd.kernel import Kernel
from dynx.spatial.scalar import Array, Floats
from dynx.steppers.implicit_joints import BLOCK_CORRECTIONS, MAX_SOLUTIONS
from dynx.steppers.joint_stops import JointStops, held_at_limits, velocity_after_impact
from dynx.steppers.layout import stop_positions

Rows = NDArray[np.signedinteger[Any]]
"""Numbers of rollouts."""


class Settling:
    """Arrays of a kernel that concern the modes of dry friction, and the status of each rollout."""

    def __init__(self, rows: int, joints: int) -> None:
        self.arrays: dict[str, Floats] = {
            "modes": np.zeros((1, rows, joints)),
            "one_by_one": np.zeros((1, rows, 1)),
            "next_modes": np.zeros((1, rows, joints)),
            "status": np.zeros((1, rows, 1)),
        }
        """Change of the modes from the signs of the velocities, whether they are corrected one at a time, the
        next change, and the status."""

    def __call__(self, bound: BoundSteps, step: int, lanes: int) -> None:
        """Repeat a step where necessary, for a vector of `lanes` rollouts at a time."""
        modes, one_by_one, following, status = (array[0] for array in self.arrays.values())
        status = status[:, 0]
        wrong = np.flatnonzero(status >= Status.UNSETTLED)
        for first in np.unique(np.minimum(wrong // lanes * lanes, len(status) - lanes)).tolist():
            group = slice(first, first + lanes)
            for count in range(MAX_SOLUTIONS):
                modes[group] = following[group]
                one_by_one[group] = count >= BLOCK_CORRECTIONS
                bound.repeat_group(step, first)
                if not (status[group] >= Status.UNSETTLED).any():
                    break
            modes[group] = one_by_one[group] = 0.0


class LaneStops:
    """Stops of the joints, which are the last n coordinates, in lanes of a batch.

    The kernel of an impact is compiled when a lane first needs it, or where the stops are pickled.
    """

    def __init__(self, lower: Floats, upper: Floats, impacts: LoopStep | Kernel) -> None:
        """`lower` and `upper` are position limits (n,); `impacts` is the kernel, or the step it is of."""
        self._lower, self._upper, self._impacts = lower, upper, impacts

    @classmethod
    def of(cls, step: LoopStep) -> LaneStops | BallLaneStops | None:
        """Make the stops of a batch; None for a robot without limits."""
        if step.model.ball_joints:
            return BallLaneStops(step.model, step) if np.isfinite(joint_ranges(step.model)).any() else None
        lower, upper = stop_positions(step.model)
        return cls(lower, upper, step) if np.isfinite([lower, upper]).any() else None

    @cached_property
    def _kernel(self) -> Kernel:
        return self._impacts if isinstance(self._impacts, Kernel) else _impact_kernel(self._impacts)

    def __reduce__(self) -> tuple[Any, ...]:
        return LaneStops, (self._lower, self._upper, self._kernel)

    def __call__(
        self,
        rows: Rows,
        before: Mapping[str, Floats],
        now: Mapping[str, Floats],
        fixed: Mapping[str, Floats],
        reference: Floats,
    ) -> None:
        """Stop joints of the state `now` after a step from `before`; all arrays have a row for each rollout.

        `rows` are those in which a joint passed a limit, `reference` (nq,) is the reference configuration, to
        which the tracking errors are corrected.
        """
        n = len(self._lower)
        joints, speeds = now["q"][rows, -n:], now["v"]
        struck = np.zeros((len(rows), speeds.shape[1]))
        held, struck[:, -n:] = held_at_limits(
            before["q"][rows, -n:], joints, speeds[rows, -n:], self._lower, self._upper
        )
        now["q"][rows, -n:] = held
        hit = struck.any(axis=1)
        if hit.any():
            self._strike(now, fixed, rows[hit], struck[hit])
        error = np.abs(reference[-n:] - held)
        now["max_error"][rows, -n:] = np.maximum(before["max_error"][rows, -n:], error)
        now["squared_errors"][rows, -n:] = before["squared_errors"][rows, -n:] + error * error

    def _strike(
        self, now: Mapping[str, Floats], fixed: Mapping[str, Floats], rows: Rows, struck: Floats
    ) -> None:
        """Change the velocities of some rows by impacts; `struck` (rows, nv) has the outward sign of each
        coordinate that is struck, and zeros."""
        known = {"q": now["q"], "v": now["v"].copy(), **fixed}
        while len(rows):
            names = (port.name for port in self._kernel.inputs)
            inputs = [struck if name == "struck" else known[name][rows] for name in names]
            after, pull = np.empty(struck.shape), np.empty(struck.shape)
            self._kernel(inputs, [after, pull])
            now["v"][rows] = np.where(struck != 0.0, 0.0, after)
            # Stops push and do not pull: these joints get no impulse, and the others another one.
            pulled = pull > 0.0
            wrong = pulled.any(axis=1)
            rows, struck = rows[wrong], np.where(pulled, 0.0, struck)[wrong]


class BallLaneStops:
    """Stops of a robot with ball joints in lanes of a batch, one lane after the other (`JointStops`).

    The kernel of the mass matrix is compiled when a lane first needs it, or where the stops are pickled.
    """

    def __init__(self, model: Model, inertia: LoopStep | Kernel) -> None:
        """`inertia` is the kernel of the mass matrix with armature, or the step it is of."""
        self._model, self._inertia = model, inertia
        self._stops = JointStops(model, partial(self._mass_matrix, {}))

    @cached_property
    def _kernel(self) -> Kernel:
        return self._inertia if isinstance(self._inertia, Kernel) else _inertia_kernel(self._inertia)

    def __reduce__(self) -> tuple[Any, ...]:
        return BallLaneStops, (self._model, self._kernel)

    def __call__(
        self,
        rows: Rows,
        before: Mapping[str, Floats],
        now: Mapping[str, Floats],
        fixed: Mapping[str, Floats],
        reference: Floats,
    ) -> None:
        """Do as `LaneStops.__call__`."""
        for row in rows.tolist():
            # Parts of a batch share these stops, and run in several threads.
            known = {name: array[row] for name, array in fixed.items()}
            stops = self._stops.with_mass_matrix(partial(self._mass_matrix, known))
            stopped = stops(before["q"][row], now["q"][row].copy(), now["v"][row].copy())
            if stopped is None:
                continue
            now["q"][row], now["v"][row] = stopped
            error = np.abs(self._model.difference(now["q"][row], reference))
            now["max_error"][row] = np.maximum(before["max_error"][row], error)
            now["squared_errors"][row] = before["squared_errors"][row] + error * error

    def _mass_matrix(self, known: Mapping[str, Floats], q: Floats) -> Floats:
        kernel, nv, lanes = self._kernel, self._model.nv, self._kernel.image.lanes
        numbers = {**known, "q": q}
        inputs = [np.tile(numbers[port.name], (lanes, 1)) for port in kernel.inputs]
        M = np.empty((lanes, nv * nv))
        kernel(inputs, [M])
        return np.asarray(M[0].reshape(nv, nv))


def _inertia_kernel(step: LoopStep) -> Kernel:
    """Compile the mass matrix with armature."""
    inertia, sizes = _inertia(step)
    return compiled(
        StepText(
            lambda **given: {"M": inertia(given)},
            {"q": step.model.nq, **sizes},
            "impacts cannot be compiled",
            step.key("inertia"),
        )
    )


def _inertia(step: LoopStep) -> tuple[Callable[[Mapping[str, Array]], Array], dict[str, int]]:
    """Return the mass matrix with armature as a function of the inputs of a kernel, and the sizes of those
    besides q."""
    mechanism, disturbances = simplify_mechanism(step.model.mechanism), step.disturbances
    sizes = {} if step.plant is None else {"parameters": len(step.plant.parameters.names)}
    if "joint_armature" in disturbances.varied:
        sizes["joint_armature"] = disturbances.varied["joint_armature"]

    def inertia(given: Mapping[str, Array]) -> Array:
        if step.plant is None:
            M = evaluate_quantity(mechanism, "mass_matrix", (), given["q"])
        else:
            M = step.plant.inertia(given["parameters"], given["q"])
        return np.asarray(M + np.diag(disturbances.armature_of(given)))

    return inertia, sizes


def _impact_kernel(step: LoopStep) -> Kernel:
    """Compile the velocities after impacts, and the impulses along the outward signs."""
    law = FrictionLaw.of(step.model, np.zeros(step.model.nv))
    inertia, of_inertia = _inertia(step)
    sizes = {"q": step.model.nq, "v": step.model.nv, "struck": step.model.nv, **of_inertia}

    def impact(**given: Array) -> dict[str, Array]:
        v, pull = velocity_after_impact(law, inertia(given), given["v"], given["struck"])
        return {"v": v, "pull": pull}

    return compiled(StepText(impact, sizes, "impacts cannot be compiled", step.key("impact")))
