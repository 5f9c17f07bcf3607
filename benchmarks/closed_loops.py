"""One closed loop in several implementations: `dynx.simulate`, the tutorial's loop, NumPy with Pinocchio.

All compute the same: computed torque, semi-implicit Euler, and recorded positions, velocities and torques. Of
dynx the whole call is timed, with its checks and with opening and closing the engine. Of the others only the
loop is timed; the robot is loaded and the reference trajectory computed before.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import Any

import numpy as np

from benchmarks.bullet_loop import BulletStepper, Rows
from benchmarks.simulator import Check, Simulator
from benchmarks.tutorial_motion import AGREEMENT, DT, GRAVITY, KD, KP, TRACKING, Task
from dynx.backends.registry import backend_class
from dynx.bench.timing import Call
from dynx.engines.pinocchio.library import pin
from dynx.model import Model
from dynx.sim import simulate
from dynx.spatial.scalar import Floats

TUTORIAL = "tutorial's loop, PyBullet alone"
TUTORIAL_SUBSTEPS = "tutorial's loop, 10 sub-steps"
TUTORIAL_NUMPY = "tutorial's loop, with NumPy"
BARE = "NumPy and pin, by hand"
DYNX = "dynx, controller and plant pinocchio"
LOOPS = (
    DYNX,
    "dynx, controller and plant compiled",
    "dynx, controller pinocchio, plant pybullet",
    TUTORIAL,
    TUTORIAL_SUBSTEPS,
    TUTORIAL_NUMPY,
    BARE,
)


class ClosedLoop(Simulator):
    """One rollout of the task."""

    same_scheme = True
    """Whether it takes the very steps of semi-implicit Euler at 1 ms."""

    def __init__(self, name: str, task: Task) -> None:
        self.name = name
        self.task = task
        self.steps = task.n_steps

    @abstractmethod
    def call(self) -> Floats | Rows:
        """Positions (n_steps + 1, 6)."""

    def checks(self) -> Sequence[Check]:
        """Check the tracking error, and the distance from the hand-written loop."""
        q = np.array(self.call())
        tracking = Check("tracking error [rad]", self.task.tracking_error(q), TRACKING)
        if not self.same_scheme:
            return [tracking]
        apart = float(np.max(np.abs(q - record_by_hand(self.task))))
        return [tracking, Check("distance from the loop by hand [rad]", apart, AGREEMENT)]


class DynxLoop(ClosedLoop):
    """`dynx.simulate` with the controller on one backend and a plant."""

    def __init__(self, name: str, task: Task, *, law: str, plant: str) -> None:
        super().__init__(name, task)
        backend_class(plant)
        self._law = task.law(law)
        self._plant = plant

    def call(self) -> Floats:
        """The whole call; its record has more than the positions."""
        return self._simulated(self.task.duration)

    def start(self) -> Call:
        """A single step."""
        return partial(self._simulated, DT)

    def _simulated(self, duration: float) -> Floats:
        task = self.task
        return simulate(task.model, self._law, task.motion, plant=self._plant, dt=DT, duration=duration).q


class TutorialLoop(ClosedLoop):
    """The tutorial's loop in PyBullet; it knows of sub-steps only as a setting of the engine."""

    def __init__(self, name: str, task: Task, *, substeps: int = 1, numpy: bool = False) -> None:
        super().__init__(name, task)
        # With 1 there is one step of 1 ms as well as with 0, and it was never slower.
        self.same_scheme = substeps == 1
        self._world = BulletStepper(task, substeps)
        self._run: Callable[[], Floats | Rows] = self._world.run_with_numpy if numpy else self._world.run

    def call(self) -> Floats | Rows:
        """The loop."""
        return self._run()

    def close(self) -> None:
        """End the world."""
        self._world.close()


class LoopByHand(ClosedLoop):
    """The least that a user of Pinocchio writes: `rnea`, `aba`, two sums, arrays for the record."""

    def __init__(self, task: Task) -> None:
        super().__init__(BARE, task)
        self._engine = pinocchio_model(task.model)

    def call(self) -> Floats:
        """The loop; velocities and torques are kept as well."""
        model, n = self._engine, self.steps
        data = model.createData()
        wanted_q, wanted_v, wanted_a = self.task.wanted
        Q, V, Tau = np.empty((n + 1, model.nq)), np.empty((n + 1, model.nv)), np.empty((n, model.nv))
        q, v = np.zeros(model.nq), np.zeros(model.nv)
        rnea, aba = pin.rnea, pin.aba
        for k in range(n):
            a = wanted_a[k] + KD * (wanted_v[k] - v) + KP * (wanted_q[k] - q)
            tau = rnea(model, data, q, v, a)
            Q[k], V[k], Tau[k] = q, v, tau
            v = v + DT * aba(model, data, q, v, tau)
            q = q + DT * v
        Q[n], V[n] = q, v
        return Q

    def checks(self) -> Sequence[Check]:
        """Check the tracking error only: the others are compared with this loop."""
        return super().checks()[:1]


def pinocchio_model(model: Model) -> Any:
    """Pinocchio's own reading of the file."""
    engine = pin.buildModelFromUrdf(model.source)
    engine.gravity.linear = np.array(GRAVITY)
    return engine


@cache
def record_by_hand(task: Task) -> Floats:
    """Positions (n_steps + 1, 6) of the hand-written loop."""
    return LoopByHand(task).call()


def closed_loop(name: str, task: Task) -> ClosedLoop:
    """The loop of that name (`LOOPS`); NotInstalledError where its engine is not there."""
    makers: dict[str, Callable[[], ClosedLoop]] = {
        DYNX: partial(DynxLoop, name, task, law="pinocchio", plant="pinocchio"),
        LOOPS[1]: partial(DynxLoop, name, task, law="compiled", plant="compiled"),
        LOOPS[2]: partial(DynxLoop, name, task, law="pinocchio", plant="pybullet"),
        TUTORIAL: partial(TutorialLoop, name, task),
        TUTORIAL_SUBSTEPS: partial(TutorialLoop, name, task, substeps=10),
        TUTORIAL_NUMPY: partial(TutorialLoop, name, task, numpy=True),
        BARE: partial(LoopByHand, task),
    }
    return makers[name]()
