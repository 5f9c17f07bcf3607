"""Simulation: plants, integrators, the closed loop, and its record; many rollouts at once."""

from dynx.sim.batch.batch import BatchInterrupted, simulate_batch
from dynx.sim.batch.rollouts import BatchRollouts
from dynx.sim.loop.sensors import Noise
from dynx.sim.plants.loads import Push
from dynx.sim.plants.model_error import Payload, plant_model
from dynx.sim.record.rollout import Rollout, Summary
from dynx.sim.simulation import RolloutInterrupted, simulate

__all__ = [
    "BatchInterrupted",
    "BatchRollouts",
    "Noise",
    "Payload",
    "Push",
    "Rollout",
    "RolloutInterrupted",
    "Summary",
    "plant_model",
    "simulate",
    "simulate_batch",
]
