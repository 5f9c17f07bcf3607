"""Faults in inverse kinematics."""

from __future__ import annotations

from tests.faults.fault import Fault

COORDINATES = "dynx.ik.coordinates"
RESIDUAL = "dynx.ik.residual"
SEARCH = "dynx.ik.search"
SOLUTIONS = "tests/ik/test_solutions.py"
PLANAR = "tests/ik/test_planar_arm.py"

IK_FAULTS = (
    Fault(
        "ik_claims_success_unchecked",
        SEARCH,
        right="return Found(q, position_error, rotation_error, _half_square(way), success)",
        wrong="return Found(q, position_error, rotation_error, _half_square(way), True)",
        caught_by=f"{PLANAR}::test_limits_that_exclude_every_solution",
    ),
    Fault(
        "ik_success_by_position_alone",
        SEARCH,
        right="            position_error <= self._effort.position_tolerance\n"
        "            and rotation_error <= self._effort.rotation_tolerance\n",
        wrong="            position_error <= self._effort.position_tolerance\n",
        caught_by=f"{SOLUTIONS}::test_a_result_is_what_forward_kinematics_says_of_it",
    ),
    Fault(
        "ik_ignores_limits",
        "dynx.ik.levenberg_marquardt",
        right="if not over:",
        wrong="if over is not None:",
        caught_by=f"{PLANAR}::test_limits_that_exclude_one_solution_leave_the_other",
    ),
    Fault(
        "ik_rotation_error_in_the_axes_of_the_frame",
        RESIDUAL,
        right="rotation_vector(self._rotation.dot(T_world_frame[:3, :3].T))",
        wrong="rotation_vector(T_world_frame[:3, :3].T.dot(self._rotation))",
        caught_by=f"{SOLUTIONS}::test_what_is_reachable_within_limits_is_reached",
    ),
    Fault(
        "ik_point_left_in_the_axes_of_the_frame",
        RESIDUAL,
        right="(T_world_frame[:3, :3].dot(self._point) + T_world_frame[:3, 3]).tolist()",
        wrong="(self._point + T_world_frame[:3, 3]).tolist()",
        caught_by=f"{SOLUTIONS}::test_a_position_alone_and_a_point_of_the_frame",
    ),
    Fault(
        "ik_turns_beyond_the_limits",
        COORDINATES,
        right="value += TURN if value < low else -TURN if value > high else 0.0",
        wrong="value += TURN if value > high else 0.0",
        caught_by=(
            "tests/ik/test_coordinates.py::test_an_angle_that_would_pass_its_limit_comes_from_the_other_side"
        ),
    ),
    Fault(
        "ik_restarts_without_the_seed",
        SEARCH,
        right="rng = np.random.default_rng(rng)",
        wrong="rng = np.random.default_rng()",
        caught_by=f"{SOLUTIONS}::test_equal_seeds_give_equal_answers",
    ),
    Fault(
        "ik_never_restarts",
        SEARCH,
        right="for restarts in range(self._effort.max_restarts + 1):",
        wrong="for restarts in range(1):",
        caught_by=f"{SOLUTIONS}::test_what_is_reachable_within_limits_is_reached",
    ),
    Fault(
        "ik_batch_begins_where_the_first_sample_does",
        "dynx.ik.solver",
        right="starts = np.broadcast_to(start, (*batch, model.nq)).reshape(len(positions), model.nq)",
        wrong="starts = np.resize(np.ravel(start)[: model.nq], (len(positions), model.nq))",
        caught_by=f"{SOLUTIONS}::test_a_batch_gives_what_its_samples_give_alone",
    ),
)
