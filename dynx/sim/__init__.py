"""Simulation: plants, integrators, the closed loop, and its record; many rollouts at once.

Each name is imported when it is first used: the options of a simulation are read without NumPy.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dynx.registry import moved_names

if TYPE_CHECKING:
    from dynx.rbd.parameters import Payload, plant_model
    from dynx.sim.batch import BatchInterrupted, simulate_batch
    from dynx.sim.batch_rollouts import BatchRollouts
    from dynx.sim.comparison import RolloutComparison, compare
    from dynx.sim.noise import Noise
    from dynx.sim.plants.plant import Plant, StepResult
    from dynx.sim.plants.registry import register as register_plant
    from dynx.sim.plants.scene_plant import ScenePlant
    from dynx.sim.record.rollout import Rollout, Summary
    from dynx.sim.scenario.scenario import Scenario
    from dynx.sim.simulation import RolloutInterrupted, Simulation, SimulationState, simulate

_HOME = {
    "BatchInterrupted": "dynx.sim.batch",
    "BatchRollouts": "dynx.sim.batch_rollouts",
    "Noise": "dynx.sim.noise",
    "Payload": "dynx.rbd.parameters",
    "Plant": "dynx.sim.plants.plant",
    "Rollout": "dynx.sim.record.rollout",
    "RolloutComparison": "dynx.sim.comparison",
    "RolloutInterrupted": "dynx.sim.simulation",
    "Scenario": "dynx.sim.scenario.scenario",
    "ScenePlant": "dynx.sim.plants.scene_plant",
    "Simulation": "dynx.sim.simulation",
    "SimulationState": "dynx.sim.simulation",
    "StepResult": "dynx.sim.plants.plant",
    "Summary": "dynx.sim.record.rollout",
    "compare": "dynx.sim.comparison",
    "plant_model": "dynx.rbd.parameters",
    "register_plant": "dynx.sim.plants.registry:register",
    "simulate": "dynx.sim.simulation",
    "simulate_batch": "dynx.sim.batch",
}

__all__ = [
    "BatchInterrupted",
    "BatchRollouts",
    "Noise",
    "Payload",
    "Plant",
    "Rollout",
    "RolloutComparison",
    "RolloutInterrupted",
    "Scenario",
    "ScenePlant",
    "Simulation",
    "SimulationState",
    "StepResult",
    "Summary",
    "compare",
    "plant_model",
    "register_plant",
    "simulate",
    "simulate_batch",
]


# Hidden from type checkers, which would take any name for an attribute: they know the imports above.
if not TYPE_CHECKING:
    _MOVED = {
        "compare_rollouts": "dynx.compare",
        "Push": "dynx.ExternalForce",
        "Snapshot": "dynx.world.Snapshot",
        "State": "dynx.sim.SimulationState",
    }
    __getattr__ = moved_names(__name__, _MOVED, _HOME)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
