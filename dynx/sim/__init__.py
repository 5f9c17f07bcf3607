"""Simulation: plants, integrators, the closed loop, and its record; many rollouts at once."""

from dynx.sim.batch.batch import BatchInterrupted, simulate_batch
from dynx.sim.batch.rollouts import BatchRollouts
from dynx.sim.loop.sensors import Noise
from dynx.sim.plants.disturbances import Push
from dynx.sim.plants.model_error import Payload, plant_model
from dynx.sim.plants.plant import Plant, StepResult
from dynx.sim.plants.registry import register as register_plant
from dynx.sim.record.rollout import Rollout, Summary
from dynx.sim.simulation import RolloutInterrupted, simulate

__all__ = [
    "BatchInterrupted",
    "BatchRollouts",
    "Noise",
    "Payload",
    "Plant",
    "Push",
    "Rollout",
    "RolloutInterrupted",
    "StepResult",
    "Summary",
    "plant_model",
    "register_plant",
    "simulate",
    "simulate_batch",
]
