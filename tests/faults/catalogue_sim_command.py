"""Faults in `dynx sim`, in the laws that it has by name, and in the tutorial."""

from __future__ import annotations

from tests.faults.fault import Fault

COMMAND = "tests/cli/sim/test_command.py"
ENDS = "tests/cli/sim/test_ends.py"
ALL_MODES = "tests/cli/sim/test_tutorial.py"
LAWS = "tests/sim/test_named_controllers.py"
TUTORIAL = "tests/sim/test_tutorial.py"

SIM_COMMAND_FAULTS = (
    Fault(
        "sim_gains_of_torque_without_the_inertia",
        "dynx.sim.named_controllers",
        right='return {"kp": p * inertia, "kd": d * inertia}',
        wrong='return {"kp": p, "kd": d}',
        caught_by=f"{LAWS}::test_gains_are_those_of_one_error_whatever_the_law",
    ),
    Fault(
        "sim_damping_of_kp_alone_without_the_inertia",
        "dynx.sim.named_controllers",
        right="2.0 * z * np.sqrt(p * inertia)",
        wrong="2.0 * z * np.sqrt(p)",
        caught_by=f"{LAWS}::test_kp_alone_is_damped",
    ),
    Fault(
        "sim_gains_that_no_law_takes_are_dropped",
        "dynx.sim.named_controllers",
        right="        if gain not in law.takes:",
        wrong="        if False:",
        caught_by=f"{LAWS}::test_gains_that_a_law_does_not_take",
    ),
    Fault(
        "tutorial_in_another_gravity",
        "dynx.sim.tutorial",
        right="(0.0, 0.0, -9.8)",
        wrong="(0.0, 0.0, -9.81)",
        caught_by=f"{TUTORIAL}::test_errors_are_those_of_the_record",
    ),
    Fault(
        "tutorial_mode_that_diverged_has_an_error",
        "dynx.sim.tutorial",
        right="return self.rollout is not None and self.problem is not None",
        wrong="return False",
        caught_by=f"{TUTORIAL}::test_a_mode_that_diverges_keeps_its_record",
    ),
    Fault(
        "sim_command_ends_well_whatever_happened",
        "dynx.cli.sim.run",
        right="return DONE if ended is None else ANSWER_IS_NO",
        wrong="return DONE",
        caught_by=f"{ENDS}::test_a_simulation_that_diverges_keeps_its_record",
    ),
    Fault(
        "sim_command_named_joints_from_neutral",
        "dynx.cli.sim.motion",
        right='goal = configuration(model, asked.to, "--to", start)',
        wrong='goal = configuration(model, asked.to, "--to")',
        caught_by=f"{COMMAND}::test_joints_that_are_not_named_stay",
    ),
    Fault(
        "sim_command_ends_before_the_fastest_motion",
        "dynx.cli.sim.motion",
        right="span = dt * math.ceil(motion.duration / dt - 1e-9)",
        wrong="span = dt * math.floor(motion.duration / dt)",
        caught_by=f"{COMMAND}::test_profiles_lead_there",
    ),
    Fault(
        "sim_command_one_factor_outdoes_that_of_a_link",
        "dynx.cli.sim.request",
        right="factors = dict.fromkeys((link.name for link in model.links), of_all)",
        wrong="factors = dict.fromkeys((link.name for link in model.links), 1.0)",
        caught_by=f"{COMMAND}::test_one_factor_for_all_links_and_another_for_one",
    ),
    Fault(
        "sim_command_passes_over_options_of_one_simulation",
        "dynx.cli.sim.command",
        right="if given and param.name not in sim_options.OF_TUTORIAL:",
        wrong="if False:",
        caught_by=f"{ALL_MODES}::test_arguments_that_cannot_be_used",
    ),
)
