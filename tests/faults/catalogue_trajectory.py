"""Faults in trajectories."""

from __future__ import annotations

from tests.faults.fault import Fault

EVERY = "tests/trajectory/test_every_trajectory.py"
CLOSED = "tests/trajectory/test_closed_forms.py"
KEPT = "tests/trajectory/test_limits_kept.py"
CHECK = "tests/trajectory/test_check.py"

TRAJECTORY_FAULTS = (
    Fault(
        "trajectory_goes_on_moving_after_its_end",
        "dynx.trajectory.base",
        right="            v[outside] = 0.0\n",
        wrong="",
        caught_by=f"{EVERY}::test_outside_it_stands_still_at_its_ends",
    ),
    Fault(
        "trajectory_ends_as_rounding_has_it",
        "dynx.trajectory.base",
        right="early, late = flat <= 0.0, flat >= self.duration",
        wrong="early, late = flat < 0.0, flat > self.duration",
        caught_by=f"{EVERY}::test_it_begins_and_ends_exactly_where_it_was_told_to",
    ),
    Fault(
        "trajectory_cycloid_accelerates_by_a_cosine",
        "dynx.trajectory.cycloidal",
        right="change = 2.0 * np.pi * sine / (T * T)",
        wrong="change = 2.0 * np.pi * np.cos(2.0 * np.pi * part) / (T * T)",
        caught_by=f"{CLOSED}::test_the_cycloidal_law",
    ),
    Fault(
        "trajectory_base_moves_without_its_screw",
        "dynx.trajectory.displacement",
        right="self.floating.integrate(self.start.q, x)",
        wrong="self.floating.integrate(self.floating.integrate(self.start.q, 0.5 * x[:, ::-1]), 0.5 * x)",
        caught_by=f"{EVERY}::test_so_they_are_on_a_floating_base",
    ),
    Fault(
        "trajectory_limit_of_the_first_joint_alone",
        "dynx.trajectory.bounds",
        right="least = float(np.min(bound[moving] / distance[moving], initial=np.inf))",
        wrong="least = float(np.min((bound[moving] / distance[moving])[:1], initial=np.inf))",
        caught_by=f"{KEPT}::test_a_trapezoid_keeps_its_limits_and_touches_one_at_any_time",
    ),
    Fault(
        "trajectory_planned_up_to_the_limit_with_no_room_for_rounding",
        "dynx.trajectory.bounds",
        right="return least * (1.0 - ROUNDING)",
        wrong="return least * (1.0 + ROUNDING)",
        caught_by=f"{KEPT}::test_a_double_s_keeps_its_limits_and_touches_one_at_any_time",
    ),
    Fault(
        "trajectory_double_s_forgets_the_velocity",
        "dynx.trajectory.rest_to_rest",
        right="steady = max(0.0, min(reached, halfway))",
        wrong="steady = max(0.0, halfway)",
        caught_by=f"{CLOSED}::test_the_durations_of_a_double_s",
    ),
    Fault(
        "trajectory_slowed_down_with_the_old_jerk",
        "dynx.trajectory.rest_to_rest",
        right="rates = tuple(rate / factor**order for rate in rates)",
        wrong="rates = tuple(rate / factor**2 for rate in rates)",
        caught_by=f"{KEPT}::test_a_longer_duration_slows_all_down_evenly",
    ),
    Fault(
        "trajectory_path_without_its_centripetal_part",
        "dynx.trajectory.paced",
        right="return Setpoint(q, slope * rate, bend * rate * rate + slope * change)",
        wrong="return Setpoint(q, slope * rate, slope * change)",
        caught_by=f"{EVERY}::test_so_they_are_of_those_that_take_longer_to_make",
    ),
    Fault(
        "trajectory_path_limits_unseen_between_places",
        "dynx.trajectory.time_optimal_path",
        right="return max(1.0, too_fast, too_sudden) * (1.0 + SPARE)",
        wrong="return 1.0",
        caught_by=f"{KEPT}::test_along_a_path_limits_are_kept_and_the_waypoints_passed",
    ),
    Fault(
        "trajectory_line_unmeasured_between_solutions",
        "dynx.trajectory.line",
        right="        s = np.linspace(0.0, 1.0, BETWEEN * n + 1)\n",
        wrong="        s = np.linspace(0.0, 1.0, n + 1)\n",
        caught_by="tests/trajectory/test_line.py::test_the_frame_is_on_the_line",
    ),
    Fault(
        "trajectory_spline_with_no_velocity_at_its_end",
        "dynx.trajectory.waypoints",
        right="clamped: Any = ((1, v0), (1, v1))",
        wrong="clamped: Any = ((1, v0), (1, v0))",
        caught_by="tests/trajectory/test_waypoints.py::test_what_holds_at_the_ends",
    ),
    Fault(
        "trajectory_excitation_beyond_the_limit_of_velocity",
        "dynx.trajectory.excitation",
        right="                self.velocity / (growth * np.abs(v).max(axis=0)),\n",
        wrong="                self.velocity / (0.9 * growth * np.abs(v).max(axis=0)),\n",
        caught_by="tests/trajectory/test_excitation.py::test_limits_are_kept_and_each_joint_touches_one",
    ),
    Fault(
        "trajectory_check_looks_at_upper_limits_only",
        "dynx.trajectory.limits",
        right="return np.where(over >= under, upper, lower), np.maximum(over, under)",
        wrong="return np.where(over >= under, upper, lower), over",
        caught_by=f"{CHECK}::test_limits_below_are_signed",
    ),
    Fault(
        "trajectory_check_skips_knots",
        "dynx.trajectory.limits",
        right="knots = trajectory.knots\n",
        wrong="knots = trajectory.knots[:1]\n",
        caught_by=f"{CHECK}::test_a_brief_excess_at_a_knot_is_found",
    ),
    Fault(
        "trajectory_joined_with_a_jump_of_velocity",
        "dynx.trajectory.joined",
        right='(("q", one.end.q, following.start.q), ("v", one.end.v, following.start.v))',
        wrong='(("q", one.end.q, following.start.q), ("v", one.end.v, one.end.v))',
        caught_by="tests/trajectory/test_joined.py::test_a_gap_is_refused",
    ),
)
