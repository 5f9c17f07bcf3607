"""Pinocchio itself for comparison: its C++ batches, its binding in a loop, and the C++ part of the binding.

The engine's model is the one of the backend `pinocchio` (the same links and joints, see
`dynx.engines.pinocchio.engine_model`). In the engine's model a mimic joint has a coordinate of its own, so
the engine gets a robot without mimic constraints, at the same states.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from dynx.bench.cases import BENCHMARK_QUANTITIES, Batch, BenchmarkCase
from dynx.bench.implementations import Implementation, PreparedCall, Role
from dynx.bench.timing import Call
from dynx.engines.pinocchio.engine_model import engine_model
from dynx.engines.pinocchio.library import pin
from dynx.model import Model
from dynx.spatial.scalar import Floats

BATCH, LOOP, INSIDE = "pinocchio C++ batch", "pinocchio binding", "pinocchio C++ call"
"""Names of the three implementations: `rneaInParallel` and `abaInParallel`, a Python loop over the
binding, and the same loop minus the overhead of a call."""


MIN_CALLS = 1024
"""Smallest batch at which the time in C++ can be separated from the overhead of a call."""

_ONE_JOINT_SHAPE = {"forward_kinematics": (4, 4), "jacobian": (6, 1), "mass_matrix": (1, 1)}
"""Shape of the results of a robot with one joint, where it is not (1,)."""


class PinocchioImplementation(Implementation):
    """Base of the three implementations: the engine's model, and the samples in its coordinates."""

    role: Role = "peer"
    version = f"pinocchio {pin.__version__}"
    threads = 1
    whole = False

    def __init__(self, model: Model) -> None:
        self.model = without_mimics(model)
        self._engine, self._frame_ids = engine_model(self.model)

    def samples(self, batch: Batch) -> Batch:
        """Return the same states with mimic joints as coordinates of their own.

        Each torque is distributed over the joints of one coordinate so that the virtual work is the same.
        """
        coupling = batch.model.mechanism.coupling
        if coupling is None:
            return batch
        S = coupling.matrix()
        tau = batch.tau / np.sum(S * S, axis=0)
        arrays = (coupling.expand_q(batch.q), *(each @ S.T for each in (batch.v, batch.a, tau)))
        return Batch(self.model, batch.frame, *map(np.ascontiguousarray, arrays))


class PinocchioBatch(PinocchioImplementation):
    """`rneaInParallel` and `abaInParallel`: OpenMP threads over the columns of column-major matrices.

    The transpose of a row-major array of samples is such a matrix, so nothing has to be rearranged.
    """

    name = BATCH
    whole = True
    _in_parallel: ClassVar[dict[str, str]] = {
        "inverse_dynamics": "rneaInParallel",
        "forward_dynamics": "abaInParallel",
    }

    def __init__(self, model: Model, threads: int) -> None:
        super().__init__(model)
        self.threads = threads
        self._pool = pin.ModelPool(self._engine, threads)

    def supports(self, case: BenchmarkCase) -> bool:
        """Check whether it is one of the two quantities of Pinocchio's batches, with more than one sample."""
        return case.batch > 1 and case.quantity in self._in_parallel

    def prepare(self, case: BenchmarkCase, batch: Batch, out: Floats) -> PreparedCall:
        function = getattr(pin, self._in_parallel[case.quantity])
        columns = [each.T for each in batch.arguments(case.quantity)]
        results, threads, pool = out.T, self.threads, self._pool

        def call() -> Floats:
            function(threads, pool, *columns, results)
            return out

        return PreparedCall(call)


class PinocchioLoop(PinocchioImplementation):
    """The binding called once for each sample, the results put into one array."""

    name = LOOP

    def supports(self, case: BenchmarkCase) -> bool:
        """Check whether the quantity is one that is timed by default."""
        return case.quantity in BENCHMARK_QUANTITIES

    def prepare(self, case: BenchmarkCase, batch: Batch, out: Floats) -> PreparedCall:
        frame = self._frame_ids[batch.model.frame_index(batch.frame)]
        function = _binding_call(self._engine, case.quantity, frame)
        return PreparedCall(_looped(function, case, batch, out))


class PinocchioInside(PinocchioLoop):
    """The C++ part of those calls: the time of the same loop minus that of a loop over a model of one joint.

    Both loops convert arguments and results, look up the overload, and write one row. The second also
    computes one joint, so this time is too short by that part.
    """

    name = INSIDE

    def supports(self, case: BenchmarkCase) -> bool:
        """True if the batch has enough calls for a difference above the noise."""
        return case.batch >= MIN_CALLS and super().supports(case)

    def prepare(self, case: BenchmarkCase, batch: Batch, out: Floats) -> PreparedCall:
        full = super().prepare(case, batch, out)
        engine, frame = _one_joint()
        n = len(batch)
        one = Batch(batch.model, batch.frame, *(np.zeros((n, 1)) for _ in range(4)))
        least = np.zeros((n, *_ONE_JOINT_SHAPE.get(case.quantity, (1,))))
        function = _binding_call(engine, case.quantity, frame)
        return PreparedCall(full.call, _looped(function, case, one, least))


def pinocchio_implementations(model: Model, threads: int) -> Iterator[PinocchioImplementation]:
    """Yield the three implementations; only the batches use threads."""
    yield PinocchioBatch(model, threads)
    yield PinocchioLoop(model)
    yield PinocchioInside(model)


def without_mimics(model: Model) -> Model:
    """Return the model without mimic constraints: each mimic joint becomes an independent joint."""
    if model.mechanism.coupling is None:
        return model
    return replace(model, joints=tuple(replace(joint, mimic=None) for joint in model.joints))


def _binding_call(engine: Any, quantity: str, frame: int) -> Callable[..., Floats]:
    """Return a function that evaluates one sample as users of the binding do."""
    data = engine.createData()
    rnea, aba, crba, jacobian = pin.rnea, pin.aba, pin.crba, pin.computeFrameJacobian
    forward, update, axes = pin.forwardKinematics, pin.updateFramePlacement, pin.LOCAL_WORLD_ALIGNED

    def placement(q: Floats) -> Floats:
        forward(engine, data, q)
        T: Floats = update(engine, data, frame).homogeneous
        return T

    calls: dict[str, Callable[..., Floats]] = {
        "forward_kinematics": placement,
        "jacobian": lambda q: jacobian(engine, data, q, frame, axes),
        "inverse_dynamics": lambda q, v, a: rnea(engine, data, q, v, a),
        "forward_dynamics": lambda q, v, tau: aba(engine, data, q, v, tau),
        "mass_matrix": lambda q: crba(engine, data, q),
    }
    return calls[quantity]


def _looped(function: Callable[..., Floats], case: BenchmarkCase, batch: Batch, out: Floats) -> Call:
    """Return a call of `function` for every sample; for a single sample without a loop."""
    rows = list(zip(*batch.arguments(case.quantity), strict=True))
    if case.batch == 1:
        sample = rows[0]
        return lambda: function(*sample)

    # For a robot with one joint the binding returns the Jacobian as a vector.
    results = out[..., 0] if out.shape[1:] == (6, 1) else out

    def call() -> Floats:
        for k, sample in enumerate(rows):
            results[k] = function(*sample)
        return out

    return call


def _one_joint() -> tuple[Any, int]:
    """Return a model of one revolute joint with a frame at its end."""
    engine = pin.Model()
    joint = engine.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "joint")
    engine.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
    frame = pin.Frame("end", joint, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME)
    return engine, int(engine.addFrame(frame, False))
