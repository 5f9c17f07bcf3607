"""The state of a simulation, and a snapshot of everything that determines how it continues."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from dynx.sim.loop.plain import LoopState
from dynx.sim.loop.record import Record
from dynx.sim.scenario.scenario import Scenario
from dynx.spatial.scalar import Floats


class State(NamedTuple):
    """The state of a robot at time `t` [s]: configuration `q` (nq,) and velocity `v` (nv,)."""

    t: float
    q: Floats
    v: Floats


@dataclass(frozen=True, eq=False)
class Snapshot:
    """State and record of a simulation at one moment, to which `Simulation.restore` returns."""

    scenario: Scenario
    record: Record
    loop_state: LoopState
    executor: tuple[str, ...]
    departures: tuple[str, ...]
    plant_memory: Any = None
    """All that the plant needs besides the state, such as the world around the robot."""

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.record.steps * self.scenario.dt
