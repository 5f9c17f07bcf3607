"""Faults in certified distances."""

from __future__ import annotations

from tests.faults.fault import Fault

DISTANCE_FAULTS = (
    Fault(
        "distance_lower_bound_without_radii",
        "dynx.distance.distance",
        right="lower=lower - radii,",
        wrong="lower=lower,",
        test_file="tests/distance/test_certificate.py",
        test="test_bounds_are_attained",
    ),
    Fault(
        "distance_depth_of_the_first_polytope",
        "dynx.distance.penetration",
        right="self._offsets < self._upper - margin",
        wrong="self._offsets < -self._upper - margin",
        test_file="tests/distance/test_closed_forms.py",
        test="test_boxes_that_overlap",
    ),
    Fault(
        "distance_deeper_way_out_of_a_cylinder",
        "dynx.distance.parallel_axes",
        right="if to_side <= to_end:",
        wrong="if to_side > to_end:",
        test_file="tests/distance/test_certificate.py",
        test="test_equal_shapes_at_equal_poses[Cylinder]",
    ),
    Fault(
        "distance_broad_phase_without_radii",
        "dynx.distance.solids",
        right="self._reach = self.core.extent + self.core.radius",
        wrong="self._reach = self.core.extent",
        test_file="tests/world/test_distances.py",
        test="test_broad_phase_loses_no_pair",
    ),
    Fault(
        "avoidance_overlap_instead_of_the_margin",
        "dynx.ik.avoidance.avoidance",
        right="return self.separation.lower >= self.pair.margin",
        wrong="return self.separation.lower >= 0.0",
        test_file="tests/ik/avoidance/test_clear_solutions.py",
        test="test_solutions_keep_their_margins_by_another_engine[ur5]",
    ),
    Fault(
        "avoidance_of_the_first_body_only",
        "dynx.ik.avoidance.avoidance",
        right="((pair.a, found.point_a, 1.0), (pair.b, found.point_b, -1.0))",
        wrong="((pair.a, found.point_a, 1.0),)",
        test_file="tests/ik/avoidance/test_clear_solutions.py",
        test="test_derivatives_of_distances",
    ),
    Fault(
        "dampers_without_the_margin",
        "dynx.ik.velocity.dampers",
        right="each.separation.lower - each.pair.margin for each in near",
        wrong="each.separation.lower for each in near",
        test_file="tests/ik/velocity/test_dampers.py",
        test="test_the_margin_is_kept_on_the_way_into_an_obstacle[ur5]",
    ),
    Fault(
        "tracking_into_obstacles",
        "dynx.ik.tracking.avoiding",
        right="found.reached[clear] and self._is_clear(found.q[clear])",
        wrong="found.reached[clear]",
        test_file="tests/ik/tracking/test_avoiding.py",
        test="test_redundant_joints_move_around_a_post",
    ),
    Fault(
        "avoidance_proof_from_one_solution",
        "dynx.ik.clear_solutions",
        right="return near.pair in self._of_target and near",
        wrong="return near",
        test_file="tests/ik/avoidance/test_clear_solutions.py",
        test="test_what_the_target_decides_holds_for_every_solution",
    ),
)
