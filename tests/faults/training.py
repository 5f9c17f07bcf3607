"""Faults in vector environments, in parameters that episodes draw, and in training."""

from __future__ import annotations

from tests.faults.fault import Fault

VECTOR = "tests/envs/test_vector.py"
DRAWN = "tests/envs/test_randomization.py"
CART_POLE = "CartPole(sutton_barto_reward=True, cart_mass=1.0, pole_mass=0.1, half_length=0.5)"
STEPS = f"test_steps_are_those_of_single_environments[AutoresetMode.{{}}-{CART_POLE}]"

TRAINING_FAULTS = (
    Fault(
        "vector_limit_one_step_late",
        "dynx.envs.vector.kernels",
        right="_mask(taken >= self._limit)",
        wrong="_mask(taken > self._limit)",
        test_file=VECTOR,
        test=STEPS.format("DISABLED"),
    ),
    Fault(
        "vector_final_observation_is_the_next_first",
        "dynx.envs.vector.environment",
        right='final = self._arrays["final"][rows]',
        wrong='final = self._arrays["observation"][rows]',
        test_file=VECTOR,
        test=STEPS.format("SAME_STEP"),
    ),
    Fault(
        "vector_reward_in_the_step_of_the_reset",
        "dynx.envs.vector.kernels",
        right="reward, flags = select(ended, 0.0, reward), select(ended, 0.0, flags)",
        wrong="flags = select(ended, 0.0, flags)",
        test_file=VECTOR,
        test=STEPS.format("NEXT_STEP"),
    ),
    Fault(
        "vector_masked_reset_keeps_the_count_of_steps",
        "dynx.envs.vector.environment",
        right='        now["steps"][rows] = 0.0\n',
        wrong="",
        test_file=VECTOR,
        test=STEPS.format("DISABLED"),
    ),
    Fault(
        "vector_episodes_start_with_used_random_numbers",
        "dynx.envs.vector.environment",
        right="            self._random[rows] = self.np_random.random((len(rows), self.task.random_size))\n",
        wrong="",
        test_file=VECTOR,
        test="test_new_episodes_start_within_the_bounds_and_differ[AutoresetMode.SAME_STEP]",
    ),
    Fault(
        "vector_results_are_not_copies",
        "dynx.envs.vector.environment",
        right="rewards.copy(), terminated.copy(), truncated.copy()",
        wrong="rewards, terminated, truncated",
        test_file=VECTOR,
        test="test_results_of_a_step_are_copies",
    ),
    Fault(
        "vector_steps_after_an_invalid_action",
        "dynx.envs.vector.kernels",
        right="        flags = select(_is_valid(space, action), flags, _bits(INVALID))\n",
        wrong="",
        test_file=VECTOR,
        test="test_wrong_actions_leave_every_environment[task1-actions1-ArgumentError-"
        "environment 2: action is 2; wanted]",
    ),
    Fault(
        "drawn_alike_for_all_environments",
        "dynx.envs.randomization.counter_random",
        right="np.uint64(seed_word(seed)) + np.arange(count, dtype=np.uint64)",
        wrong="np.uint64(seed_word(seed)) + np.zeros(count, dtype=np.uint64)",
        test_file=DRAWN,
        test="test_vectors_of_any_size_and_single_environments_draw_the_same",
    ),
    Fault(
        "drawn_by_the_place_in_the_list",
        "dynx.envs.randomization.draws",
        right="[crc32(name.encode()) for name in self.names]",
        wrong="range(len(self.names))",
        test_file="tests/envs/test_draws.py",
        test="test_a_draw_depends_on_its_environment_alone",
    ),
    Fault(
        "noise_repeated_in_each_step",
        "dynx.envs.randomization.variation",
        right="        self._steps += np.uint64(1)\n",
        wrong="        self._steps += np.uint64(0)\n",
        test_file=DRAWN,
        test="test_noise_differs_from_step_to_step",
    ),
    Fault(
        "drawn_mass_without_its_inertia",
        "dynx.compiled.scaled_links",
        right="own.rotational_inertia * factor",
        wrong="own.rotational_inertia",
        test_file=DRAWN,
        test="test_scaled_masses_are_those_of_a_task_with_these_masses",
    ),
    Fault(
        "payload_moves_no_center_of_mass",
        "dynx.envs.randomization.point_mass",
        right="own.mass * _steiner(own_center - common)",
        wrong="own.mass * _steiner(own_center - own_center)",
        test_file=DRAWN,
        test="test_a_payload_of_a_world_is_a_body_on_the_link[forearm_link]",
    ),
    Fault(
        "delay_one_step_of_the_integrator_too_long",
        "dynx.envs.robot.varied_robot",
        right="(step + age * task.substeps + 0.5)",
        wrong="(step + age * task.substeps - 0.5)",
        test_file=DRAWN,
        test="test_a_delay_shifts_actions",
    ),
    Fault(
        "joint_friction_along_the_motion",
        "dynx.envs.robot.varied_robot",
        right="torque = -friction * np.clip",
        wrong="torque = friction * np.clip",
        test_file=DRAWN,
        test="test_joint_friction_opposes_the_motion[reference]",
    ),
    Fault(
        "world_with_the_masses_of_the_task",
        "dynx.envs.randomization.scenes",
        right="mass=factor * body.mass",
        wrong="mass=body.mass",
        test_file=DRAWN,
        test="test_worlds_have_the_drawn_parameters",
    ),
    Fault(
        "truncation_learned_as_an_end",
        "dynx.training.vectors",
        right="bool(truncated[k] and not terminated[k])",
        wrong="False",
        test_file="tests/training/test_vectors.py",
        test="test_an_end_by_the_time_limit_is_told_apart",
    ),
    Fault(
        "resumed_without_its_scaling",
        "dynx.training.checkpoints",
        right="            scaling.give(vector)\n",
        wrong="            pass\n",
        test_file="tests/training/test_run.py",
        test="test_a_resumed_run_starts_from_the_weights_and_schedules_of_its_checkpoint",
    ),
)
