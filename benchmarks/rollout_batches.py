"""Batches of rollouts of UR5, in steps of 1 ms: `dynx.simulate_batch`, MuJoCo's rollout, Pinocchio's batches.

With a controller all rollouts perform `Task`, so each must end where the loop written by hand does.
Without one they fall from random configurations, and MuJoCo must fall as dynx does. Slower libraries are
timed with fewer rollouts, which fit into the caches, to their advantage; times are compared by the step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from importlib import import_module
from typing import Any

import numpy as np

from benchmarks.bindings.urdf_text import spelled_out
from benchmarks.closed_loops import pinocchio_model, record_by_hand
from benchmarks.simulator import Check, Simulator
from benchmarks.tutorial_motion import AGREEMENT, DT, GRAVITY, KD, KP, STEPS, TRACKING, Task
from dynx.bench.timing import Call
from dynx.control import Controller, Measurement
from dynx.engines.pinocchio.library import pin
from dynx.model import Model
from dynx.sim import BatchRollouts, simulate_batch
from dynx.spatial.scalar import Floats
from dynx.trajectory import Setpoint

CLOSED = "dynx, closed loop"
FALLING = "dynx, no control"
PINOCCHIO = "pinocchio C++ batches, closed loop"
MUJOCO = "mujoco rollout, no control"
BATCHES = (CLOSED, FALLING, PINOCCHIO, MUJOCO)

MAX_FALL_DIFFERENCE = 1e-9
"""Bound on the difference of two engines at the end of a fall [rad]: rounding errors that grow for 2 s."""
COMPARED_FALLS = 8
"""Number of falls that are compared."""
MAX_PINOCCHIO_SIZE = (2048, 100)
"""Largest numbers of rollouts and steps for Pinocchio's batches: its threads synchronise twice a step, so
that they need many rollouts; fewer steps suffice."""


@dataclass(frozen=True)
class Size:
    """Numbers of rollouts and of steps."""

    task: Task
    rollouts: int
    mujoco: int
    """Rollouts that MuJoCo is timed with."""

    def start_of_fall(self, count: int) -> Floats:
        """Configurations (count, 6) from which the arm falls, at rest."""
        return self.task.model.random(np.random.default_rng(0), self.rollouts)[:count]


FULL = Size(Task(STEPS), rollouts=10_000, mujoco=128)
QUICK = Size(Task(100), rollouts=16, mujoco=8)


class NoTorque(Controller[None]):
    """Motors that give nothing."""

    needs_setpoint = False

    def __init__(self, model: Model) -> None:
        self.model = model

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        """Zero (nv,)."""
        return 0.0 * measurement.v, None


class Batch(Simulator):
    """Rollouts side by side."""

    def __init__(self, name: str, size: Size, rollouts: int, threads: int) -> None:
        self.name, self.threads, self.size = name, threads, size
        self.rollouts = rollouts
        self.steps = rollouts * size.task.n_steps


class DynxClosedLoops(Batch):
    """`dynx.simulate_batch` under computed torque."""

    def __init__(self, name: str, size: Size, threads: int) -> None:
        super().__init__(name, size, size.rollouts, threads)
        self._controller = size.task.law()

    def call(self) -> BatchRollouts:
        """The whole call."""
        return self._simulated(self.size.task.duration)

    def checks(self) -> Sequence[Check]:
        """Check the tracking error, and the distance of the last states from the hand-written loop."""
        done = self.call()
        apart = np.abs(done.q - record_by_hand(self.size.task)[-1])
        return [
            Check("tracking error [rad]", float(np.max(done.worst)), TRACKING),
            Check("distance from the loop by hand [rad]", float(np.max(apart)), AGREEMENT),
        ]

    def initial_state(self) -> Call:
        """A single step."""
        return partial(self._simulated, DT)

    def _simulated(self, duration: float) -> BatchRollouts:
        task = self.size.task
        return simulate_batch(
            task.model,
            self._controller,
            task.motion,
            rollouts=self.rollouts,
            dt=DT,
            duration=duration,
            threads=self.threads,
        )


class DynxFalls(Batch):
    """`dynx.simulate_batch` under a controller without torque, to compare with MuJoCo's rollout."""

    def __init__(self, name: str, size: Size, threads: int) -> None:
        super().__init__(name, size, size.rollouts, threads)
        self._controller = NoTorque(size.task.model)
        self._q0 = size.start_of_fall(self.rollouts)

    def call(self) -> BatchRollouts:
        """The whole call."""
        return self._simulated(self.size.task.duration)

    def checks(self) -> Sequence[Check]:
        """Check the distance from the hand-computed falls."""
        return [apart_from_falls_by_hand(self.size, self.call().q)]

    def initial_state(self) -> Call:
        """A single step."""
        return partial(self._simulated, DT)

    def _simulated(self, duration: float) -> BatchRollouts:
        model = self.size.task.model
        rest = model.neutral()
        return simulate_batch(
            model, self._controller, rest, q0=self._q0, dt=DT, duration=duration, threads=self.threads
        )


class PinocchioLoops(Batch):
    """`rneaInParallel` and `abaInParallel` in each step, NumPy's arrays over all rollouts between them."""

    def __init__(self, name: str, size: Size, threads: int) -> None:
        super().__init__(name, size, min(size.rollouts, MAX_PINOCCHIO_SIZE[0]), threads)
        self._n_steps = min(size.task.n_steps, MAX_PINOCCHIO_SIZE[1])
        self.steps = self.rollouts * self._n_steps
        self._pool = pin.ModelPool(pinocchio_model(size.task.model), threads)

    def call(self) -> Floats:
        """Return the last configurations (rollouts, 6)."""
        task, threads, pool = self.size.task, self.threads, self._pool
        shape = (self.rollouts, task.model.nv)
        q, v, a, tau = (np.zeros(shape) for _ in range(4))
        inverse, forward = pin.rneaInParallel, pin.abaInParallel
        # A row-major array of samples is, transposed, the column-major matrix that Pinocchio takes.
        columns = [q.T, v.T, a.T, tau.T]
        first = (rows[: self._n_steps] for rows in task.wanted)
        for q_wanted, v_wanted, a_wanted in zip(*first, strict=True):
            np.subtract(q_wanted, q, out=a)
            a *= KP
            a += KD * (v_wanted - v)
            a += a_wanted
            inverse(threads, pool, *columns)
            forward(threads, pool, columns[0], columns[1], columns[3], columns[2])
            v += DT * a
            q += DT * v
        return q

    def checks(self) -> Sequence[Check]:
        """Check the distance from the hand-written loop."""
        apart = np.abs(self.call() - record_by_hand(self.size.task)[self._n_steps])
        return [Check("distance from the loop by hand [rad]", float(np.max(apart)), AGREEMENT)]


class MujocoRollouts(Batch):
    """`mujoco.rollout`, all steps of all rollouts in one call; the states are kept.

    MuJoCo reads the URDF itself, which joins the frames without mass to the links that carry them; there
    is no geometry, and all that is not needed of its step is switched off.
    """

    def __init__(self, name: str, size: Size, threads: int) -> None:
        super().__init__(name, size, size.mujoco, threads)
        mujoco, rollout = _modules()
        flag, kind = mujoco.mjtDisableBit, mujoco.mjtState.mjSTATE_FULLPHYSICS.value
        engine = self._engine = mujoco.MjModel.from_xml_string(spelled_out(size.task.model))
        engine.opt.timestep = DT
        engine.opt.gravity[:] = GRAVITY
        engine.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
        engine.opt.disableflags = sum(
            getattr(flag, f"mjDSBL_{name}").value
            for name in ("CONSTRAINT", "EQUALITY", "FRICTIONLOSS", "LIMIT", "CONTACT", "SENSOR", "WARMSTART")
        )
        self._data = [mujoco.MjData(engine) for _ in range(threads)]
        # A pool of no threads works on the thread that calls.
        self._rollout = rollout.Rollout(nthread=0 if threads == 1 else threads)
        width, self._nq = mujoco.mj_stateSize(engine, kind), engine.nq
        # A state is the time, then q, then v.
        self._before = np.zeros((self.rollouts, width))
        self._before[:, 1 : 1 + self._nq] = size.start_of_fall(self.rollouts)
        self._states = np.zeros((self.rollouts, size.task.n_steps, width))

    def call(self) -> Floats:
        """States (rollouts, steps, 1 + nq + nv)."""
        steps = self.size.task.n_steps
        self._rollout.rollout(self._engine, self._data, self._before, nstep=steps, state=self._states)
        return self._states

    def checks(self) -> Sequence[Check]:
        """Check the distance from the hand-computed falls."""
        self._states.fill(np.nan)
        return [apart_from_falls_by_hand(self.size, self.call()[:, -1, 1 : 1 + self._nq])]

    def close(self) -> None:
        """End the threads."""
        self._rollout.close()


def apart_from_falls_by_hand(size: Size, fallen: Floats) -> Check:
    """Compare the first of the last configurations (rollouts, 6) with those computed by hand."""
    apart = float(np.max(np.abs(fallen[:COMPARED_FALLS] - falls_by_hand(size))))
    return Check("distance from the falls by hand [rad]", apart, MAX_FALL_DIFFERENCE)


@cache
def falls_by_hand(size: Size) -> Floats:
    """Last configurations (COMPARED_FALLS, 6) of the first falls, by `pin.aba` and two sums in each step."""
    engine = pinocchio_model(size.task.model)
    data = engine.createData()
    fallen = size.start_of_fall(COMPARED_FALLS)
    for row in range(len(fallen)):
        q, v, none = fallen[row], np.zeros(engine.nv), np.zeros(engine.nv)
        for _ in range(size.task.n_steps):
            v = v + DT * pin.aba(engine, data, q, v, none)
            q = q + DT * v
        fallen[row] = q
    return fallen


def rollout_batch(name: str, size: Size, threads: int) -> Batch:
    """The batch of that name (`BATCHES`); NotInstalledError where its engine is not there."""
    makers: dict[str, Callable[[str, Size, int], Batch]] = {
        CLOSED: DynxClosedLoops,
        FALLING: DynxFalls,
        PINOCCHIO: PinocchioLoops,
        MUJOCO: MujocoRollouts,
    }
    return makers[name](name, size, threads)


def _modules() -> tuple[Any, Any]:
    """`mujoco` and `mujoco.rollout`, imported here, for MuJoCo is an extra."""
    from dynx.engines.mujoco.library import mujoco

    return mujoco, import_module("mujoco.rollout")
