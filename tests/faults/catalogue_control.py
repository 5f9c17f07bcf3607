"""Faults in control laws and in simulation."""

from __future__ import annotations

from tests.faults.fault import Fault

LAWS = "tests/control/test_laws.py"
BEHAVIOUR = "tests/control/test_behaviour.py"
GLUED = "tests/sim/loop/test_staged.py"
AGREE = "tests/sim/plants/test_plants_agree.py"
OPTIONS = "tests/sim/loop/test_options.py"
PHYSICS = "tests/sim/plants/test_physics.py"
RESUME = "tests/sim/loop/test_resume.py"

CONTROL_FAULTS = (
    Fault(
        "control_discrete_law_without_the_velocity",
        "dynx.control.discrete_computed_torque",
        right="return ((q_next - q) / dt - v) / dt",
        wrong="return (q_next - q) / dt / dt",
        caught_by=f"{LAWS}::test_the_discrete_law_lands_on_its_setpoint",
    ),
    Fault(
        "control_integral_winds_up",
        "dynx.control.pid",
        right="self._dt * self.ki * error + self._share * (tau - wanted)",
        wrong="self._dt * self.ki * error",
        caught_by=f"{BEHAVIOUR}::test_an_integral_does_not_wind_up_while_the_motor_is_at_its_limit",
    ),
    Fault(
        "control_damping_ratio_without_its_two",
        "dynx.control.gains",
        right="return w * w, 2.0 * checked_gain",
        wrong="return w * w, checked_gain",
        caught_by="tests/control/test_gains.py::test_natural_frequency_and_damping_are_those_of_the_error",
    ),
    Fault(
        "sim_bullet_motors_are_not_released",
        "dynx.engines.pybullet.stepping",
        right="        if self._motors_hold:\n",
        wrong="        if False:\n",
        caught_by="tests/control/test_engine_motors.py::test_the_tutorial_s_trap",
    ),
    Fault(
        "sim_explicit_euler",
        "dynx.sim.plants.integrators",
        right="        v = v + h * a\n        return q + h * v, v, a",
        wrong="        return q + h * v, v + h * a, a",
        caught_by="tests/sim/test_tracking.py::test_the_discrete_law_leaves_no_error",
    ),
    Fault(
        "sim_floating_step_at_the_link_s_origin",
        "dynx.sim.plants.floating_step",
        right="cross(a[3:6], center) + cross(w, lever)",
        wrong="cross(a[3:6], center)",
        caught_by=f"{PHYSICS}::test_semi_implicit_euler_keeps_linear_momentum",
    ),
    Fault(
        "sim_bullet_base_torque_about_the_origin",
        "dynx.engines.pybullet.plant",
        right="R @ (tau[3:6] - cross(c, tau[:3]))",
        wrong="R @ tau[3:6]",
        caught_by=f"{AGREE}::test_a_quadruped_that_falls_and_turns_and_moves_its_legs",
    ),
    Fault(
        "sim_noise_is_that_of_the_first_step",
        "dynx.sim.loop.sensors",
        right="number = step // self._clock.steps_per_control",
        wrong="number = 0",
        caught_by=f"{OPTIONS}::test_noise_has_the_size_and_the_seed_that_were_asked",
    ),
    Fault(
        "sim_memory_is_forgotten_when_resumed",
        "dynx.sim.loop.plain",
        right="for number in range(-(-record.steps // self.clock.steps_per_control)):",
        wrong="for number in range(0):",
        caught_by=f"{RESUME}::test_on_a_plant_of_dynx",
    ),
    Fault(
        "sim_stop_strikes_one_joint_alone",
        "dynx.sim.loop.stops",
        right="                v = v + inverse[:, at] @ impulse\n",
        wrong="                v = v.copy()\n",
        caught_by=f"{OPTIONS}::test_a_stop_is_an_inelastic_impact",
    ),
    Fault(
        "glue_forgets_the_delay",
        "dynx.sim.loop.staged",
        right="return np.maximum(steps - clock.delay_steps, 0)",
        wrong="return steps",
        caught_by=f"{GLUED}::test_the_record_is_that_of_the_plain_loop",
    ),
    Fault(
        "glue_is_compiled_with_licence",
        "dynx.sim.loop.stages",
        right="fast=False",
        wrong="fast=True",
        caught_by=f"{GLUED}::test_the_record_is_that_of_the_plain_loop",
    ),
    Fault(
        "glue_traces_a_law_of_somebody_s_own",
        "dynx.sim.loop.stages",
        right='str(method.__module__).startswith("dynx.control.") for method in methods',
        wrong="True for method in methods",
        caught_by=f"{GLUED}::test_a_law_of_one_s_own_is_asked_in_every_step",
    ),
    Fault(
        "glue_goes_on_with_what_is_no_number",
        "dynx.sim.loop.staged",
        right="if defect[0] != 0.0:",
        wrong="if defect[0] > 0.0:",
        caught_by=f"{GLUED}::test_no_plant_is_given_what_is_no_number",
    ),
    Fault(
        "glue_cuts_a_torque_that_is_beyond_all_numbers",
        "dynx.sim.loop.staged",
        right="np.array([v @ v + unsound], dtype=object)",
        wrong="np.array([v @ v], dtype=object)",
        caught_by=f"{GLUED}::test_a_torque_beyond_all_numbers_is_not_cut_to_the_limits",
    ),
    Fault(
        "limits_make_a_number_of_what_is_none",
        "dynx.simd.expr",
        right='return self._from("max", -most)._from("min", most)',
        wrong='return self._with("max", -most)._with("min", most)',
        caught_by="tests/simd/test_trace.py::test_cutting_keeps_what_is_no_number",
    ),
    Fault(
        "glue_loses_steps_taken_before_ctrl_c",
        "dynx.sim.loop.staged",
        right="            record.steps = first + k\n",
        wrong="            record.steps = first + k // 32 * 32\n",
        caught_by=f"{GLUED}::test_ctrl_c_in_the_middle_of_a_stage",
    ),
)
