"""MuJoCo as a peer: `mj_inverse` in a loop, and `mujoco.rollout` over the batch."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from dynx.bench.cases import Batch, BenchmarkCase
from dynx.bench.implementations import Implementation, PreparedCall, Role
from dynx.errors import EngineLimitError
from dynx.model import Model
from dynx.spatial.scalar import Floats


class MujocoPeer(Implementation):
    """The engine's model is that of the backend `mujoco`, without contacts, limits and damping."""

    role: Role = "peer"
    threads = 1
    whole = False
    quantity: str

    def __init__(self, model: Model) -> None:
        # Imported here, for MuJoCo is an extra.
        from dynx.engines.mujoco.build import build_tree
        from dynx.engines.mujoco.library import mujoco

        self.version = f"mujoco {mujoco.__version__}"
        if model.mechanism.coupling is not None:
            raise EngineLimitError("MuJoCo has mimic joints as constraints: a different problem")
        if model.floating:
            raise EngineLimitError("MuJoCo has other coordinates of a floating base: a fixed one is timed")
        self._mujoco: Any = mujoco
        self._engine: Any = build_tree(model).model

    def supports(self, case: BenchmarkCase) -> bool:
        """One quantity."""
        return case.quantity == self.quantity


class MujocoInverse(MujocoPeer):
    """`mj_inverse` called once for each sample, as MuJoCo's users do; results go to one array."""

    name = "mujoco mj_inverse"
    quantity = "inverse_dynamics"

    def prepare(self, case: BenchmarkCase, batch: Batch, out: Floats) -> PreparedCall:
        """Ready."""
        rows = list(zip(batch.q, batch.v, batch.a, strict=True))
        engine, inverse = self._engine, self._mujoco.mj_inverse
        data = self._mujoco.MjData(engine)

        def call() -> Floats:
            for k, (q, v, a) in enumerate(rows):
                data.qpos[:], data.qvel[:], data.qacc[:] = q, v, a
                inverse(engine, data)
                out[k] = data.qfrc_inverse
            return out

        return PreparedCall(call)


class MujocoRollout(MujocoPeer):
    """One step of `mujoco.rollout` for each sample, from its state under its torques.

    It does more than forward dynamics: it integrates, and what it gives back is the next state. The
    acceleration is how much the velocity grew, over the step (semi-implicit Euler).
    """

    name = "mujoco rollout"
    quantity = "forward_dynamics"
    whole = True

    def __init__(self, model: Model, threads: int) -> None:
        super().__init__(model)
        self.threads = threads
        rollout = import_module("mujoco.rollout")
        # A pool of no threads works on the calling thread.
        self._rollout = rollout.Rollout(nthread=0 if threads == 1 else threads)

    def prepare(self, case: BenchmarkCase, batch: Batch, out: Floats) -> PreparedCall:
        """Ready."""
        engine, step, nq, nv = self._engine, self._engine.opt.timestep, batch.model.nq, batch.model.nv
        state, kind = self._mujoco.mjtState, self._mujoco.mjtState.mjSTATE_FULLPHYSICS.value
        width = self._mujoco.mj_stateSize(engine, kind)
        before, after = np.zeros((len(batch), width)), np.zeros((len(batch), 1, width))
        data = [self._mujoco.MjData(engine) for _ in range(self.threads)]
        # A state is the time, then q, then v.
        velocity = slice(1 + nq, 1 + nq + nv)

        def call() -> Floats:
            before[:, 1 : 1 + nq], before[:, velocity] = batch.q, batch.v
            self._rollout.rollout(
                engine,
                data,
                before,
                batch.tau[:, None, :],
                control_spec=state.mjSTATE_QFRC_APPLIED.value,
                nstep=1,
                state=after,
            )
            np.subtract(after[:, 0, velocity], batch.v, out=out)
            out[:] /= step
            return out

        return PreparedCall(call)

    def close(self) -> None:
        """End the threads."""
        self._rollout.close()
