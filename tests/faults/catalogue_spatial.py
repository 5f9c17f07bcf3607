"""Faults in spatial algebra."""

from __future__ import annotations

from tests.faults.fault import Fault

SO3 = "dynx.spatial.so3"
SE3 = "dynx.spatial.se3"
INERTIA = "dynx.spatial.inertia"
COORDINATES = "tests/contract/test_coordinates.py"
CLOSED_FORMS = "tests/oracles/test_closed_forms.py"
FREE_BODY = f"{CLOSED_FORMS}::test_backend_matches_closed_form[free_body-reference]"
PENDULUM = f"{CLOSED_FORMS}::test_backend_matches_closed_form[pendulum-reference]"
DOUBLE_PENDULUM = f"{CLOSED_FORMS}::test_backend_matches_closed_form[double_pendulum-reference]"

SPATIAL_FAULTS = (
    Fault(
        "cross_product_sign",
        SO3,
        right="a1 * b2 - a2 * b1",
        wrong="a2 * b1 - a1 * b2",
        caught_by="tests/spatial/test_so3.py::test_cross_skew_and_numpy_agree",
    ),
    Fault(
        "rpy_order",
        SO3,
        right="cr, cp, cy = c[..., 0:1], c[..., 1:2], c[..., 2:3]\n"
        "    sr, sp, sy = s[..., 0:1], s[..., 1:2], s[..., 2:3]",
        wrong="cr, cp, cy = c[..., 2:3], c[..., 1:2], c[..., 0:1]\n"
        "    sr, sp, sy = s[..., 2:3], s[..., 1:2], s[..., 0:1]",
        caught_by=f"{COORDINATES}::test_at_zero_frames_are_where_the_description_puts_them[reference-fixed]",
    ),
    Fault(
        "rpy_read_as_degrees",
        SO3,
        right="c, s = cos(rpy), sin(rpy)",
        wrong="c, s = cos(np.radians(rpy)), sin(np.radians(rpy))",
        caught_by=f"{COORDINATES}::test_at_zero_frames_are_where_the_description_puts_them[reference-fixed]",
    ),
    Fault(
        "rotation_about_axis_backwards",
        SO3,
        right="(eye - along) * c + skew(axis) * s",
        wrong="(eye - along) * c - skew(axis) * s",
        caught_by=(
            f"{COORDINATES}::test_a_coordinate_moves_what_is_below_its_joint_along_its_axis[reference-fixed]"
        ),
    ),
    Fault(
        "quaternion_order_wxyz",
        SO3,
        right="x, y, z, w = (quat_xyzw[..., i : i + 1] for i in range(4))",
        wrong="w, x, y, z = (quat_xyzw[..., i : i + 1] for i in range(4))",
        caught_by=f"{COORDINATES}::TestFloatingBase::test_pose_of_the_base[reference]",
    ),
    Fault(
        "quaternion_conjugated",
        SO3,
        right="2 * (x * y - z * w), 2 * (x * z + y * w)],\n"
        "        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],\n"
        "        [2 * (x * z - y * w), 2 * (y * z + x * w)",
        wrong="2 * (x * y + z * w), 2 * (x * z - y * w)],\n"
        "        [2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)],\n"
        "        [2 * (x * z + y * w), 2 * (y * z - x * w)",
        caught_by=f"{COORDINATES}::TestFloatingBase::test_pose_of_the_base[reference]",
    ),
    Fault(
        "quaternion_product_order",
        SO3,
        right="aw * bv + bw * av + cross(av, bv)",
        wrong="aw * bv + bw * av + cross(bv, av)",
        caught_by="tests/spatial/test_so3.py::test_product_of_quaternions_is_that_of_rotations",
    ),
    Fault(
        "rotation_the_long_way_round",
        SO3,
        right="sign = np.where(w < 0, -1.0, 1.0)",
        wrong="sign = np.ones_like(w)",
        caught_by="tests/spatial/test_so3.py::test_exp_undoes_log_and_takes_the_shorter_way",
    ),
    Fault(
        "exponential_without_V",
        SE3,
        right="return rotate(V, linear), quat_exp(angular)",
        wrong="return rotate(np.eye(3) + 0 * V, linear), quat_exp(angular)",
        caught_by="tests/spatial/test_se3.py::test_exp_is_the_exponential_of_the_twist",
    ),
    Fault(
        "logarithm_series_sign",
        SE3,
        right="np.eye(3) - 0.5 * W + d * (W @ W)",
        wrong="np.eye(3) + 0.5 * W + d * (W @ W)",
        caught_by="tests/spatial/test_se3.py::test_log_undoes_exp",
    ),
    Fault(
        "inverse_pose_without_turning_the_position",
        SE3,
        right="-rotate(R_T, T[..., :3, 3])",
        wrong="-T[..., :3, 3]",
        caught_by="tests/spatial/test_se3.py::test_inverse_is_the_matrix_inverse",
    ),
    Fault(
        "pose_error_in_the_axes_of_the_frame",
        SE3,
        right="R = T_world_target[..., :3, :3] @ np.swapaxes(T_world_frame[..., :3, :3], -1, -2)",
        wrong="R = np.swapaxes(T_world_frame[..., :3, :3], -1, -2) @ T_world_target[..., :3, :3]",
        caught_by="tests/spatial/test_se3.py::test_pose_error_leads_to_the_target",
    ),
    Fault(
        "no_parallel_axis_term",
        INERTIA,
        right="central - (C @ C) * mass",
        wrong="central + 0 * C",
        caught_by=PENDULUM,
    ),
    Fault(
        "parallel_axis_term_lost_in_a_change_of_frame",
        INERTIA,
        right="rotated - shift @ H - H @ shift - self.mass * (shift @ shift)",
        wrong="rotated - shift @ H - H @ shift",
        caught_by=DOUBLE_PENDULUM,
    ),
    Fault(
        "inertia_turned_the_wrong_way",
        INERTIA,
        right="rotation @ tensor @ np.swapaxes(rotation, -1, -2)",
        wrong="np.swapaxes(rotation, -1, -2) @ tensor @ rotation",
        caught_by="tests/spatial/test_inertia.py::test_what_a_urdf_says_is_steiners_theorem",
    ),
    Fault(
        "angular_momentum_about_the_wrong_point",
        INERTIA,
        right="rotate(self.second_moment, angular) + cross(self.first_moment, linear)",
        wrong="rotate(self.second_moment, angular)",
        caught_by=FREE_BODY,
    ),
    Fault(
        "branchless_logarithm_of_half_a_turn_is_none",
        "dynx.spatial.branchless",
        right="same_way = sign(sign(w) + 0.5)",
        wrong="same_way = sign(w)",
        caught_by="tests/spatial/test_branchless.py::test_every_largest_component_and_ties_between_them",
    ),
    Fault(
        "branchless_path_of_a_twist_too_straight",
        "dynx.spatial.branchless",
        right="((1.0 - sin(angle) / angle) / (angle * angle)) * (W @ W)",
        wrong="(1.0 - sin(angle) / angle) * (W @ W)",
        caught_by="tests/spatial/test_branchless.py::test_of_rotations_and_poses",
    ),
    Fault(
        "branchless_quaternion_of_its_first_component",
        "dynx.spatial.branchless",
        right="larger = 0.5 * (larger + abs(larger))",
        wrong="larger = 0.0 * larger",
        caught_by="tests/spatial/test_branchless.py::test_every_largest_component_and_ties_between_them",
    ),
)
