"""Simulation: plants, integrators, the closed loop, and its record; many rollouts at once."""

from dynx.sim.batch import BatchInterrupted, simulate_batch
from dynx.sim.batch_rollouts import BatchRollouts
from dynx.sim.loads import Push
from dynx.sim.rollout import Rollout, Summary
from dynx.sim.sensors import Noise
from dynx.sim.simulation import RolloutInterrupted, simulate
from dynx.sim.variations import Payload, plant_model

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
