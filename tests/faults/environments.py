"""Faults in tasks of reinforcement learning."""

from __future__ import annotations

from tests.faults.fault import Fault

ENVIRONMENTS_FAULTS = (
    Fault(
        "lander_velocity_of_its_origin",
        "dynx.envs.tasks.lunar_lander.task",
        right="return v[0] - CENTER * v[2] * math.cos(q[2])",
        wrong="return v[0] + CENTER * v[2] * math.cos(q[2])",
        test_file="tests/envs/test_lunar_lander.py",
        test="test_flights_are_those_of_gymnasium[pybullet-seed 0]",
    ),
    Fault(
        "lander_pushed_at_its_origin",
        "dynx.envs.tasks.lunar_lander.craft",
        right="force = np.array([fx, fz, -CENTER * fx])",
        wrong="force = np.array([fx, fz, 0.0])",
        test_file="tests/envs/test_lunar_lander.py",
        test="test_flights_are_those_of_gymnasium[pybullet-seed 0]",
    ),
    Fault(
        "lander_ground_above_its_highest_end",
        "dynx.envs.tasks.lunar_lander.craft",
        right="lowest = min(lowest, side * LEG_AWAY",
        wrong="lowest = max(lowest, side * LEG_AWAY",
        test_file="tests/envs/test_lunar_lander.py",
        test="test_clearance_is_a_lower_bound",
    ),
    Fault(
        "world_task_that_does_not_return_to_the_start",
        "dynx.envs.world.episodes",
        right="            self._world.restore(self._start)",
        wrong="            pass",
        test_file="tests/envs/test_world_tasks.py",
        test="test_episodes_after_a_seed_are_the_same_bits[Push-pybullet]",
    ),
    Fault(
        "walk_rewarded_for_standing",
        "dynx.envs.tasks.walk",
        right="error, turning = v[:2] - episode.memory.velocity[:2]",
        wrong="error, turning = v[:2]",
        test_file="tests/envs/test_world_tasks.py",
        test="test_walking_is_rewarded_by_the_velocity",
    ),
)
