"""Faults in the model: its tree, coordinates, limits and lumped bodies."""

from __future__ import annotations

from tests.faults.fault import Fault

TOPOLOGY = "dynx.model.topology"
LOCKING = "dynx.model.locking"
ELEMENTS = "dynx.model.elements"
MECHANISM = "dynx.model.mechanism"
CONFIGURATION = "dynx.model.configuration"
COORDINATES = "tests/contract/test_coordinates.py"
BODIES = "tests/contract/test_bodies.py"
REFUSALS = "tests/model/urdf/test_refusals.py"
REFUSED = f"{REFUSALS}::test_a_bad_description_is_refused_with_line_and_reason"

MODEL_FAULTS = (
    Fault(
        "joints_in_breadth_first_order",
        TOPOLOGY,
        right="joint = waiting.pop()",
        wrong="joint = waiting.pop(0)",
        caught_by=f"{COORDINATES}::test_order_is_depth_first_in_the_order_of_the_document",
    ),
    Fault(
        "children_sorted_by_name",
        TOPOLOGY,
        right="waiting = children[roots[0].name][::-1]",
        wrong="waiting = sorted(children[roots[0].name], key=lambda joint: joint.name, reverse=True)",
        caught_by=f"{COORDINATES}::test_order_is_depth_first_in_the_order_of_the_document",
    ),
    Fault(
        "children_in_reverse_order",
        TOPOLOGY,
        right="waiting.extend(reversed(children[joint.child]))",
        wrong="waiting.extend(children[joint.child])",
        caught_by=(
            "tests/model/test_topology.py::"
            "test_children_follow_their_parent_at_once_in_the_order_of_the_document"
        ),
    ),
    Fault(
        "two_roots_accepted",
        TOPOLOGY,
        right="if len(roots) > 1:",
        wrong="if len(roots) > 2:",
        caught_by=f"{REFUSED}[two root links]",
    ),
    Fault(
        "cycle_not_noticed",
        TOPOLOGY,
        right="if len(ordered_links) < len(links):",
        wrong="if not ordered_links:",
        caught_by=f"{REFUSED}[a cycle beside a root]",
    ),
    Fault(
        "duplicate_joint_names_accepted",
        TOPOLOGY,
        right='_refuse_duplicates("joint", joints, source)',
        wrong='_refuse_duplicates("joint", [], source)',
        caught_by=f"{REFUSED}[two joints of one name]",
    ),
    Fault(
        "second_parent_accepted",
        TOPOLOGY,
        right="if joint.child in parent_joint:",
        wrong="if joint is parent_joint.get(joint.child):",
        caught_by=f"{REFUSED}[two parents]",
    ),
    Fault(
        "offset_of_a_chain_of_mimics_not_scaled",
        TOPOLOGY,
        right="offset += scale * driver.mimic.offset",
        wrong="offset += driver.mimic.offset",
        caught_by="tests/model/test_topology.py::test_a_chain_of_mimics_becomes_one_step",
    ),
    Fault(
        "follower_of_a_locked_joint_left_at_zero",
        TOPOLOGY,
        right="offset += scale * (driver.locked_at or 0.0)",
        wrong="offset += 0.0 * scale",
        caught_by=(
            "tests/model/test_locking.py::test_followers_of_a_locked_joint_are_fixed_where_they_follow_to"
        ),
    ),
    Fault(
        "joint_locked_at_zero",
        LOCKING,
        right="fixed_at(joint, float(lock[joint.name]))",
        wrong="fixed_at(joint, 0.0 * float(lock[joint.name]))",
        caught_by=f"{COORDINATES}::TestLockedJoints::test_all_else_is_as_it_was[reference]",
    ),
    Fault(
        "locked_slide_moved_in_the_parents_axes",
        LOCKING,
        right="T[:3, 3] + T[:3, :3] @ (axis * value)",
        wrong="T[:3, 3] + axis * value",
        caught_by=f"{COORDINATES}::TestLockedJoints::test_all_else_is_as_it_was[reference]",
    ),
    Fault(
        "locked_hinge_turned_about_the_parents_axis",
        LOCKING,
        right="T[:3, :3] @ rotation_about(axis, np.array(value))",
        wrong="rotation_about(axis, np.array(value)) @ T[:3, :3]",
        caught_by=(
            f"{COORDINATES}::TestLockedJoints::test_a_locked_hinge_stays_where_its_angle_put_it[reference]"
        ),
    ),
    Fault(
        "products_of_inertia_swapped",
        ELEMENTS,
        right="[self.ixx, self.ixy, self.ixz],\n"
        "                [self.ixy, self.iyy, self.iyz],\n"
        "                [self.ixz, self.iyz, self.izz],",
        wrong="[self.ixx, self.ixz, self.ixy],\n"
        "                [self.ixz, self.iyy, self.iyz],\n"
        "                [self.ixy, self.iyz, self.izz],",
        caught_by="tests/contract/test_masses.py::test_impossible_products_of_inertia[reference]",
    ),
    Fault(
        "inertial_axes_ignored",
        MECHANISM,
        right="p_inertial, R_inertial, numbers(link.inertial.tensor)",
        wrong="p_inertial, 0 * R_inertial + numbers(np.eye(3)), numbers(link.inertial.tensor)",
        caught_by=f"{BODIES}::test_mass_matrix_is_the_sum_over_the_links[reference-fixed]",
    ),
    Fault(
        "welded_link_lumped_where_its_body_is",
        MECHANISM,
        right="lumped[body] = lumped[body] + own.seen_from(R, p)",
        wrong="lumped[body] = lumped[body] + own",
        caught_by=f"{BODIES}::test_centre_of_mass_and_gravity_are_those_of_the_links[reference-fixed]",
    ),
    Fault(
        "missing_inertial_given_a_kilogram",
        MECHANISM,
        right="if link.inertial is None:\n            continue\n",
        wrong="if link.inertial is None:\n"
        "            unit = RigidInertia(numbers(1.0), numbers(np.zeros(3)), numbers(np.eye(3)))\n"
        "            lumped[here[link.name][0]] = lumped[here[link.name][0]] + unit\n"
        "            continue\n",
        caught_by="tests/contract/test_masses.py::test_a_massless_link_on_a_joint[reference-no inertial]",
    ),
    Fault(
        "slide_taken_for_a_hinge",
        MECHANISM,
        right='revolute = joint.type != "prismatic"',
        wrong='revolute = joint.type != "fixed"',
        caught_by=(
            f"{COORDINATES}::test_a_coordinate_moves_what_is_below_its_joint_along_its_axis[reference-fixed]"
        ),
    ),
    Fault(
        "frame_offset_in_the_axes_of_the_body",
        MECHANISM,
        right="frames.append(BodyFrame(frame.name, body, R @ R_frame, p + rotate(R, p_frame)))",
        wrong="frames.append(BodyFrame(frame.name, body, R @ R_frame, p + p_frame))",
        caught_by=f"{COORDINATES}::test_frames_can_be_added[reference]",
    ),
    Fault(
        "mimic_multiplier_dropped",
        MECHANISM,
        right="S[base + row, base + column] = scale",
        wrong="S[base + row, base + column] = 1.0 if scale else 0.0",
        caught_by=f"{COORDINATES}::TestMimicJoints::test_reduced_answers[reference-mass_matrix]",
    ),
    Fault(
        "mimic_offset_dropped",
        MECHANISM,
        right="q.take(index, axis=-1) * scale + offset)",
        wrong="q.take(index, axis=-1) * scale)",
        caught_by=f"{COORDINATES}::TestMimicJoints::test_reduced_answers[reference-forward_kinematics]",
    ),
    Fault(
        "integrates_the_base_in_world_axes",
        CONFIGURATION,
        right="moved = q[..., :3] + rotate(rotation_from_quat(q[..., 3:7]), position)",
        wrong="moved = q[..., :3] + position",
        caught_by=f"{COORDINATES}::test_velocity_is_the_rate_of_the_pose[reference-floating]",
    ),
    Fault(
        "integrates_the_attitude_in_world_axes",
        CONFIGURATION,
        right="turned = quat_product(q[..., 3:7], quat)",
        wrong="turned = quat_product(quat, q[..., 3:7])",
        caught_by=f"{COORDINATES}::test_velocity_is_the_rate_of_the_pose[reference-floating]",
    ),
    Fault(
        "difference_without_the_conjugate",
        CONFIGURATION,
        right="conjugate = q0[..., 3:7] * np.array([-1.0, -1.0, -1.0, 1.0])",
        wrong="conjugate = q0[..., 3:7] * np.array([1.0, 1.0, 1.0, 1.0])",
        caught_by="tests/model/test_configuration.py::test_integrating_the_difference_arrives",
    ),
    Fault(
        "random_beyond_the_limits",
        CONFIGURATION,
        right="if bounded_below and bounded_above:\n        return low, high",
        wrong="if bounded_below and bounded_above:\n        return min(low, -reach), max(high, reach)",
        caught_by=(
            "tests/model/test_configuration.py::test_random_configurations_are_valid_and_within_the_limits"
        ),
    ),
    Fault(
        "limits_of_followers_ignored",
        CONFIGURATION,
        right="if joint.mimic is None or joint.mimic.multiplier == 0.0:",
        wrong="if joint.mimic is None or joint.mimic.multiplier != 0.0:",
        caught_by="tests/model/test_configuration.py::test_limits_of_a_driver_are_narrowed_by_its_followers",
    ),
    Fault(
        "clips_to_the_lower_limit_only",
        CONFIGURATION,
        right='np.clip(checked_array("q", q, model.nq), model.lower, model.upper)',
        wrong='np.clip(checked_array("q", q, model.nq), model.lower, np.inf)',
        caught_by=(
            "tests/model/test_configuration.py::test_clipping_is_idempotent_and_moves_only_what_is_outside"
        ),
    ),
    Fault(
        "nan_accepted",
        CONFIGURATION,
        right="if not np.isfinite(array).all():",
        wrong="if np.isinf(array).any():",
        caught_by=(
            "tests/contract/test_bad_input.py::test_an_array_that_cannot_be_used"
            "[reference-forward_kinematics-NaN]"
        ),
    ),
    Fault(
        "too_many_numbers_accepted",
        CONFIGURATION,
        right="array.shape[-1] != length",
        wrong="array.shape[-1] < length",
        caught_by=(
            "tests/contract/test_bad_input.py::test_an_array_that_cannot_be_used"
            "[reference-mass_matrix-too long]"
        ),
    ),
    Fault(
        "quaternion_of_any_length_accepted",
        CONFIGURATION,
        right="np.any(off > 1e-6)",
        wrong="np.any(norm < 1e-6)",
        caught_by=(
            "tests/contract/test_bad_input.py::test_a_quaternion_that_is_no_attitude"
            "[reference-forward_kinematics]"
        ),
    ),
)
