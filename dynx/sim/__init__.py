"""Simulation: plants, integrators, the closed loop, and its record; many rollouts at once.

Each name is imported when it is first used: the options of a simulation are read without NumPy.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from dynx.registry import moved_names

if TYPE_CHECKING:
    from dynx.sim.batch import BatchInterrupted, simulate_batch
    from dynx.sim.batch_rollouts import BatchRollouts
    from dynx.sim.comparison.comparison import RolloutComparison, compare
    from dynx.sim.loop.noise import Noise
    from dynx.sim.one_rollout import RolloutInterrupted, simulate
    from dynx.sim.plants.model_error import Payload, plant_model
    from dynx.sim.plants.plant import Plant, StepResult
    from dynx.sim.plants.registry import register as register_plant
    from dynx.sim.plants.scene_plant import ScenePlant
    from dynx.sim.record.rollout import Rollout
    from dynx.sim.record.rollout_data import Summary
    from dynx.sim.scenario.scenario import Scenario
    from dynx.sim.simulation import Simulation, SimulationState

_HOME = {
    "BatchInterrupted": "batch",
    "BatchRollouts": "batch_rollouts",
    "Noise": "loop.noise",
    "Payload": "plants.model_error",
    "Plant": "plants.plant",
    "Rollout": "record.rollout",
    "RolloutComparison": "comparison.comparison",
    "RolloutInterrupted": "one_rollout",
    "Scenario": "scenario.scenario",
    "ScenePlant": "plants.scene_plant",
    "Simulation": "simulation",
    "SimulationState": "simulation",
    "StepResult": "plants.plant",
    "Summary": "record.rollout_data",
    "compare": "comparison.comparison",
    "plant_model": "plants.model_error",
    "register_plant": "plants.registry",
    "simulate": "one_rollout",
    "simulate_batch": "batch",
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
    _moved = moved_names(
        __name__,
        {
            "compare_rollouts": "dynx.compare",
            "Push": "dynx.ExternalForce",
            "Snapshot": "dynx.world.Snapshot",
            "State": "dynx.sim.SimulationState",
        },
    )

    def __getattr__(name: str) -> Any:
        if name not in _HOME:
            return _moved(name)
        attribute = "register" if name == "register_plant" else name
        found = getattr(import_module(f"dynx.sim.{_HOME[name]}"), attribute)
        globals()[name] = found
        return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
