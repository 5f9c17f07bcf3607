"""Faults in the textbook algorithms."""

from __future__ import annotations

from tests.faults.fault import Fault

ABA = "dynx.rbd.aba"
CRBA = "dynx.rbd.crba"
RNEA = "dynx.rbd.rnea"
PLACEMENT = "dynx.rbd.placement"
BASE_PARAMETERS = "dynx.rbd.base_parameters"
LINEAR = "dynx.rbd.linear"
KINEMATICS = "dynx.rbd.kinematics"
JACOBIANS = "dynx.rbd.jacobians"
CENTROIDAL = "dynx.rbd.centroidal"
CORIOLIS = "dynx.rbd.coriolis"
COORDINATES = "tests/contract/test_coordinates.py"
REFERENCES = "tests/contract/test_references.py"
FORCES = "tests/contract/test_forces.py"
CLOSED_FORMS = "tests/oracles/test_closed_forms.py"
FREE_BODY = f"{CLOSED_FORMS}::test_backend_matches_closed_form[free_body-reference]"
PENDULUM = f"{CLOSED_FORMS}::test_backend_matches_closed_form[pendulum-reference]"
DOUBLE_PENDULUM = f"{CLOSED_FORMS}::test_backend_matches_closed_form[double_pendulum-reference]"
PLANAR_3R = f"{CLOSED_FORMS}::test_backend_matches_closed_form[planar_3r-reference]"
CART_POLE = f"{CLOSED_FORMS}::test_backend_matches_closed_form[cart_pole-reference]"
EXACT = "tests/rbd/test_identities.py"
FEWER = "tests/rbd/test_base_parameters.py"
NATIVE = (
    "tests/engines/pinocchio/test_backend.py"
    "::test_native_answers_are_those_derived_and_those_of_the_reference"
)

RBD_FAULTS = (
    Fault(
        "no_gyroscopic_term",
        RNEA,
        right="xy, xz, yz = x * y, x * z, y * z",
        wrong="xy, xz, yz = 0 * x, 0 * y, 0 * z",
        caught_by=FREE_BODY,
    ),
    Fault(
        "no_coriolis_term_of_a_slide",
        RNEA,
        right="proper + second + 2 * cross(turning, rate)",
        wrong="proper + second + cross(turning, rate)",
        caught_by=f"{NATIVE}[floating-False]",
    ),
    Fault(
        "no_coriolis_term_of_a_hinge",
        RNEA,
        right="turned + second + cross(turning, rate)",
        wrong="turned + second + 0 * rate",
        caught_by=f"{NATIVE}[floating-False]",
    ),
    Fault(
        "gravity_sign",
        RNEA,
        right="return Motion(still, still, -mechanism.gravity)",
        wrong="return Motion(still, still, mechanism.gravity)",
        caught_by=f"{FORCES}::TestGravity::test_default[reference]",
    ),
    Fault(
        "gravity_not_turned_with_a_floating_base",
        RNEA,
        right="up = rotate_back(rotation_from_quat(q[..., 3:7]), -mechanism.gravity)",
        wrong="up = 0 * q[..., :3] - mechanism.gravity",
        caught_by=FREE_BODY,
    ),
    Fault(
        "lever_arm_of_the_child_forgotten",
        PLACEMENT,
        right="rotate(self.R, moment) + cross(self.p, below)",
        wrong="rotate(self.R, moment)",
        caught_by=DOUBLE_PENDULUM,
    ),
    Fault(
        "velocity_carried_outward_backwards",
        PLACEMENT,
        right="linear + cross(angular, self.p)",
        wrong="linear - cross(angular, self.p)",
        caught_by=DOUBLE_PENDULUM,
    ),
    Fault(
        "force_taken_for_moment_at_a_slide",
        RNEA,
        right="np.sum(body.axis * (moment if body.revolute else force), axis=-1)",
        wrong="np.sum(body.axis * moment, axis=-1)",
        caught_by=CART_POLE,
    ),
    Fault(
        "composite_of_the_children_only",
        CRBA,
        right="placements[index].inertia_of_parent(composite[index])",
        wrong="placements[index].inertia_of_parent(bodies[index].inertia)",
        caught_by=PLANAR_3R,
    ),
    Fault(
        "moment_of_the_child_sign",
        PLACEMENT,
        right="rotate(self.R, moment) + cross(self.p, below)",
        wrong="rotate(self.R, moment) - cross(self.p, below)",
        caught_by=DOUBLE_PENDULUM,
    ),
    Fault(
        "base_coupling_transposed",
        CRBA,
        right="M[3 + i][j] = M[j][3 + i] = coupling[..., i, j] + zero",
        wrong="M[3 + i][j] = M[j][3 + i] = coupling[..., j, i] + zero",
        caught_by=FREE_BODY,
    ),
    Fault(
        "velocity_product_missing_in_forward_dynamics",
        ABA,
        right="summed((force, moment), handed.times(*products[index]))",
        wrong="(force, moment)",
        caught_by=DOUBLE_PENDULUM,
    ),
    Fault(
        "free_fall_left_in_the_acceleration",
        ABA,
        right="np.concatenate([linear - root.proper, angular,",
        wrong="np.concatenate([linear, angular,",
        caught_by=FREE_BODY,
    ),
    Fault(
        "articulated_inertia_not_handed_on",
        ABA,
        right="handed = A.yielding(U, K, kept)",
        wrong="handed = A",
        caught_by=DOUBLE_PENDULUM,
    ),
    Fault(
        "no_centripetal_term_of_a_hinge",
        RNEA,
        right="[xz - Y, yz + X, -(xx + yy)],",
        wrong="[xz - Y, yz + X, 0 * xx],",
        caught_by=DOUBLE_PENDULUM,
    ),
    Fault(
        "matrix_turned_about_z_with_its_transpose",
        PLACEMENT,
        right="apart + cc * xy - ss * yx,",
        wrong="apart + cc * yx - ss * xy,",
        caught_by=f"{FEWER}::test_a_turn_about_z_is_the_product_of_matrices",
    ),
    Fault(
        "mass_along_the_axis_lost_on_the_way_to_the_parent",
        BASE_PARAMETERS,
        right="RigidInertia(mass, h * along, np.diag(across) * line),",
        wrong="RigidInertia(mass, h * along, 0 * np.diag(across) * line),",
        caught_by=f"{FEWER}::test_torque_and_mass_matrix_are_the_same",
    ),
    Fault(
        "joint_of_a_child_left_where_the_old_frame_was",
        BASE_PARAMETERS,
        right="Q_parent.T @ (body.p - o_parent)",
        wrong="Q_parent.T @ body.p",
        caught_by=f"{FEWER}::test_real_robots_take_fewer_numbers",
    ),
    Fault(
        "back_substitution_skips_a_row",
        LINEAR,
        right="for k in range(i + 1, n):",
        wrong="for k in range(i + 2, n):",
        caught_by=FREE_BODY,
    ),
    Fault(
        "child_placed_in_world_axes",
        KINEMATICS,
        right="p.append(p_parent + rotate(R_parent, p_joint))",
        wrong="p.append(p_parent + p_joint + 0 * R_parent[..., 0])",
        caught_by=f"{COORDINATES}::test_at_zero_frames_are_where_the_description_puts_them[reference-fixed]",
    ),
    Fault(
        "base_velocity_taken_in_world_axes",
        KINEMATICS,
        right="[rotate(R_root, v[..., :3])], [rotate(R_root, v[..., 3:6])]",
        wrong="[v[..., :3]], [v[..., 3:6]]",
        caught_by=f"{CLOSED_FORMS}::test_momentum_of_a_free_body[reference]",
    ),
    Fault(
        "lever_arm_backwards",
        JACOBIANS,
        right="linear[column], angular[column] = cross(z, p - o), z + zero",
        wrong="linear[column], angular[column] = cross(z, o - p), z + zero",
        caught_by=f"{REFERENCES}::test_default_is_the_geometric_jacobian[reference-fixed]",
    ),
    Fault(
        "rows_angular_first",
        JACOBIANS,
        right="for pair in zip(linear, angular, strict=True)]",
        wrong="for pair in zip(angular, linear, strict=True)]",
        caught_by=f"{REFERENCES}::test_default_is_the_geometric_jacobian[reference-fixed]",
    ),
    Fault(
        "base_columns_in_world_axes",
        JACOBIANS,
        right="columns += [(k, R[..., :, k % 3], o, ROOT) for k in range(6)]",
        wrong="columns += [(k, np.eye(3)[k % 3] + 0 * o, o, ROOT) for k in range(6)]",
        caught_by=(
            f"{COORDINATES}::TestFloatingBase::test_velocity_of_the_base_is_in_the_base_frame[reference]"
        ),
    ),
    Fault(
        "jacobian_derivative_without_the_moving_lever",
        JACOBIANS,
        right="d_linear[column] = cross(dz, p - o) + cross(z, velocity - o_velocity)",
        wrong="d_linear[column] = cross(dz, p - o)",
        caught_by=DOUBLE_PENDULUM,
    ),
    Fault(
        "jacobian_derivative_without_the_turning_axes",
        JACOBIANS,
        right="d_linear = [d - cross(turning, x) for d, x in zip(d_linear, linear, strict=True)]",
        wrong="d_linear = [d + 0 * turning for d in d_linear]",
        caught_by=f"{REFERENCES}::test_derivative_of_the_jacobian[reference-local-fixed]",
    ),
    Fault(
        "world_reference_shifted_backwards",
        JACOBIANS,
        right="[J[..., :3, :] + skew(p) @ J[..., 3:, :], J[..., 3:, :]]",
        wrong="[J[..., :3, :] - skew(p) @ J[..., 3:, :], J[..., 3:, :]]",
        caught_by=f"{REFERENCES}::test_local_and_world_follow_from_the_default[reference-fixed]",
    ),
    Fault(
        "point_offset_sign",
        JACOBIANS,
        right="[J[..., :3, :] - arm @ J[..., 3:, :], J[..., 3:, :]]",
        wrong="[J[..., :3, :] + arm @ J[..., 3:, :], J[..., 3:, :]]",
        caught_by=f"{REFERENCES}::test_a_point_is_a_frame_at_that_point[reference-local-fixed]",
    ),
    Fault(
        "point_taken_in_world_axes",
        JACOBIANS,
        right='lever = point if reference == "local" else rotate(R, point)',
        wrong="lever = point + 0 * R[..., 0]",
        caught_by=f"{REFERENCES}::test_a_point_is_a_frame_at_that_point[reference-local_world_aligned-fixed]",
    ),
    Fault(
        "point_without_centripetal_term",
        JACOBIANS,
        right="moved = moved - skew(cross(turning, lever)) @ J[..., 3:, :]",
        wrong="moved = moved + 0 * turning.sum()",
        caught_by=f"{REFERENCES}::test_a_point_is_a_frame_at_that_point[reference-local_world_aligned-fixed]",
    ),
    Fault(
        "coriolis_matrix_not_that_of_christoffel",
        CORIOLIS,
        right="return _Composite(inertia, cross(w, inertia.first_moment), -skew(w) @ inertia.spread)",
        wrong="W, I = skew(w), inertia.second_moment\n"
        "    return _Composite(inertia, cross(w, inertia.first_moment), (W @ I - I @ W) / 2)",
        caught_by=FREE_BODY,
    ),
    Fault(
        "coriolis_matrix_of_bodies_that_stand_still_in_their_parent",
        CORIOLIS,
        right="E = E - skew(inertia.first_moment) @ step.lever_rate",
        wrong="E = E + 0",
        caught_by=DOUBLE_PENDULUM,
    ),
    Fault(
        "coriolis_matrix_of_slides_that_stand_still",
        CORIOLIS,
        right="dp = dp + rotate(R, speed)",
        wrong="dp = dp + 0 * rotate(R, speed)",
        caught_by=f"{NATIVE}[floating-False]",
    ),
    Fault(
        "coriolis_matrix_with_a_couple_the_wrong_way_round",
        CORIOLIS,
        right="couple=F @ u + _transposed(self.E) @ e,",
        wrong="couple=F @ u + self.E @ e,",
        caught_by="tests/rbd/test_coriolis.py::test_it_is_the_sum_over_bodies_of_its_definition_in_50_digits",
    ),
    Fault(
        "centre_divided_by_the_mass_of_one_body",
        CENTROIDAL,
        right="return np.asarray(moment[0] / mass[0])",
        wrong="return np.asarray(moment[0] / mass[-1])",
        caught_by=f"{EXACT}::test_center_of_mass_jacobian_and_momentum_are_its_rate",
    ),
    Fault(
        "momentum_about_the_worlds_origin",
        CENTROIDAL,
        right="spin = spin + about_origin + cross(p - center, momentum)",
        wrong="spin = spin + about_origin + cross(p, momentum)",
        caught_by=f"{CLOSED_FORMS}::test_momentum_of_a_free_body[reference]",
    ),
    Fault(
        "energy_without_one_half",
        CENTROIDAL,
        right="return np.asarray(energy / 2)",
        wrong="return np.asarray(energy)",
        caught_by=PENDULUM,
    ),
    Fault(
        "potential_energy_sign",
        CENTROIDAL,
        right="np.asarray(-np.sum(mechanism.gravity * moment[0], axis=-1))",
        wrong="np.asarray(np.sum(mechanism.gravity * moment[0], axis=-1))",
        caught_by=PENDULUM,
    ),
)
