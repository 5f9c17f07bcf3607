"""Faults in batches of rollouts."""

from __future__ import annotations

from tests.faults.fault import Fault

BATCH = "tests/sim/batch/test_batch.py"
FLOATING = "tests/sim/batch/test_floating.py"
OPTIONS = "tests/sim/batch/test_options.py"
AN_OPTION = f"{OPTIONS}::test_an_option_means_what_it_means_to_one_rollout"
ALL_OPTIONS = f"{FLOATING}::test_all_options_together"
OWN_COEFFICIENTS = f"{OPTIONS}::test_each_rollout_has_coefficients_of_its_own"
TASK_SPACE = "tests/sim/batch/test_task_space.py::test_a_rollout_is_that_of_simulate"

BATCH_FAULTS = (
    Fault(
        "batch_steps_by_explicit_euler",
        "dynx.sim.batch.kernel",
        right="return q + self.dt * v, v",
        wrong='return q + self.dt * given["v"], v',
        caught_by=f"{BATCH}::test_a_rollout_is_that_of_simulate",
    ),
    Fault(
        "batch_repeats_the_noise_of_its_first_part",
        "dynx.sim.batch.batch",
        right="(noise.seed, first // PART)",
        wrong="(noise.seed, 0)",
        caught_by=f"{BATCH}::test_outcomes_do_not_depend_on_who_computes_them",
    ),
    Fault(
        "batch_takes_the_kept_part_of_other_arguments",
        "dynx.sim.batch.store",
        right="arrays = (part.start, part.fixed, tuple(part.setpoints),",
        wrong="arrays = (tuple(part.setpoints),",
        caught_by=f"{BATCH}::test_ctrl_c_keeps_what_is_done",
    ),
    Fault(
        "batch_takes_the_kept_part_of_another_push",
        "dynx.sim.batch.store",
        right="part.goals, part.wrenches, part.noise)",
        wrong="part.goals, part.noise)",
        caught_by=f"{FLOATING}::test_who_computes_it_and_a_stop_on_the_way_change_nothing",
    ),
    Fault(
        "batch_takes_the_kept_part_of_another_delay",
        "dynx.sim.batch.store",
        right="part.steps_per_control, part.delay_steps, part.record_every)",
        wrong="part.steps_per_control, part.record_every)",
        caught_by=f"{FLOATING}::test_who_computes_it_and_a_stop_on_the_way_change_nothing",
    ),
    Fault(
        "batch_forgets_what_the_law_remembers_between_controls",
        "dynx.sim.batch.kernel",
        right='outcome = {name: given[name] for name in ("memory", "cut") if name in given}',
        wrong='outcome = {name: 0 * given[name] for name in ("memory", "cut") if name in given}',
        caught_by=f"{BATCH}::test_a_law_asked_at_some_steps_only",
    ),
    Fault(
        "batch_measures_a_step_too_late",
        "dynx.sim.batch.part",
        right="self._sets[(turn - self._part.delay_steps) % sets]",
        wrong="self._sets[(turn - max(self._part.delay_steps - 1, 0)) % sets]",
        caught_by=AN_OPTION,
    ),
    Fault(
        "batch_pushes_begin_a_step_late",
        "dynx.sim.batch.loads",
        right="since = since + WHOLE * clock.dt",
        wrong="since = since - WHOLE * clock.dt",
        caught_by=AN_OPTION,
    ),
    Fault(
        "batch_coefficients_of_the_joints_in_the_wrong_order",
        "dynx.sim.batch.loads",
        right="found[np.flatnonzero(constant)] = given[name]",
        wrong="found[np.flatnonzero(constant)] = given[name][::-1]",
        caught_by=OWN_COEFFICIENTS,
    ),
    Fault(
        "batch_numbers_for_joints_taken_for_rollouts",
        "dynx.sim.batch.loads",
        right="len(shape) > 1 or (len(shape) == 1 and shape != (joints,))",
        wrong="len(shape) >= 1",
        caught_by=AN_OPTION,
    ),
    Fault(
        "batch_rotors_forgotten",
        "dynx.sim.batch.kernel",
        right='M = evaluated(mechanism, "mass_matrix", (), q) + np.diag(rotors)',
        wrong='M = evaluated(mechanism, "mass_matrix", (), q) + 0 * np.diag(rotors)',
        caught_by=AN_OPTION,
    ),
    Fault(
        "batch_counts_a_cut_torque_once_however_long_it_is_held",
        "dynx.sim.batch.kernel",
        right='given["held_for"] * (1.0 - sign(left))',
        wrong="(1.0 - sign(left))",
        caught_by=AN_OPTION,
    ),
    Fault(
        "batch_base_steps_by_its_origin",
        "dynx.sim.batch.kernel",
        right="return np.asarray(root.first_moment / mass)",
        wrong="return np.asarray(0 * root.first_moment / mass)",
        caught_by=ALL_OPTIONS,
    ),
    Fault(
        "batch_base_forgets_that_its_centre_of_mass_turned",
        "dynx.sim.plants.floating_step",
        right="at - R_next @ center",
        wrong="at - R @ center",
        caught_by=f"{FLOATING}::test_the_centre_of_mass_and_the_spin_take_the_step_along_the_axes_of_the_world",
    ),
    Fault(
        "batch_noise_displaces_the_base_along_the_world",
        "dynx.sim.batch.kernel",
        right="integrate(q, off) if self.model.floating",
        wrong="np.concatenate([q[:3] + off[:3], integrate(q, off)[3:]]) if self.model.floating",
        caught_by=f"{FLOATING}::test_noise_displaces_the_base_along_its_own_axes",
    ),
    Fault(
        "batch_frame_without_its_centripetal_acceleration",
        "dynx.sim.batch.traced_controller",
        right='return self._of_frame("jacobian_derivative", frame, reference, q, v)',
        wrong='return 0 * self._of_frame("jacobian_derivative", frame, reference, q, v)',
        caught_by=TASK_SPACE,
    ),
)
