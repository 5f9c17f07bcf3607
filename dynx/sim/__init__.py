"""Simulation: plants, integrators, the closed loop, and its record; many rollouts at once."""

from typing import TYPE_CHECKING

from dynx.registry import moved_names
from dynx.sim.batch.batch import BatchInterrupted, simulate_batch
from dynx.sim.batch.rollouts import BatchRollouts
from dynx.sim.comparison.comparison import RolloutComparison, compare
from dynx.sim.loop.noise import Noise
from dynx.sim.one_rollout import RolloutInterrupted, simulate
from dynx.sim.plants.disturbances import Push
from dynx.sim.plants.model_error import Payload, plant_model
from dynx.sim.plants.plant import Plant, StepResult
from dynx.sim.plants.registry import register as register_plant
from dynx.sim.plants.scene_plant import ScenePlant
from dynx.sim.record.rollout import Rollout
from dynx.sim.record.rollout_data import Summary
from dynx.sim.scenario.scenario import Scenario
from dynx.sim.simulation import Simulation
from dynx.sim.snapshot import Snapshot, State

__all__ = [
    "BatchInterrupted",
    "BatchRollouts",
    "Noise",
    "Payload",
    "Plant",
    "Push",
    "Rollout",
    "RolloutComparison",
    "RolloutInterrupted",
    "Scenario",
    "ScenePlant",
    "Simulation",
    "Snapshot",
    "State",
    "StepResult",
    "Summary",
    "compare",
    "plant_model",
    "register_plant",
    "simulate",
    "simulate_batch",
]

# Hidden from type checkers, which would take any name for an attribute.
if not TYPE_CHECKING:
    __getattr__ = moved_names(__name__, {"compare_rollouts": "dynx.compare"})
