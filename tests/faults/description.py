"""Faults in the model and in the reading and writing of descriptions."""

from __future__ import annotations

from tests.faults.fault import Fault

DESCRIPTION_FAULTS = (
    Fault(
        "joints_in_breadth_first_order",
        "dynx.model.topology",
        right="joint = stack.pop()",
        wrong="joint = stack.pop(0)",
        test_file="tests/contract/test_coordinates.py",
        test="test_order_is_depth_first_in_the_order_of_the_document",
    ),
    Fault(
        "mimic_chain_offset_not_scaled",
        "dynx.model.topology",
        right="offset += scale * driver.mimic.offset",
        wrong="offset += driver.mimic.offset",
        test_file="tests/model/test_topology.py",
        test="test_a_chain_of_mimics_becomes_one_step",
    ),
    Fault(
        "mimic_joint_of_a_locked_joint_left_at_zero",
        "dynx.model.topology",
        right="offset += scale * (driver.locked_at or 0.0)",
        wrong="offset += 0.0 * scale",
        test_file="tests/model/test_locking.py",
        test="test_followers_of_a_locked_joint_are_fixed",
    ),
    Fault(
        "locked_prismatic_joint_moved_in_parent_axes",
        "dynx.model.locking",
        right="T[:3, 3] + T[:3, :3] @ (axis * value)",
        wrong="T[:3, 3] + axis * value",
        test_file="tests/contract/test_coordinates.py",
        test="TestLockedJoints::test_all_else_is_as_it_was[reference]",
    ),
    Fault(
        "locked_revolute_joint_rotated_about_the_parent_axis",
        "dynx.model.locking",
        right="T[:3, :3] @ rotation_about(axis, np.array(value))",
        wrong="rotation_about(axis, np.array(value)) @ T[:3, :3]",
        test_file="tests/contract/test_coordinates.py",
        test="TestLockedJoints::test_a_locked_hinge_stays_where_its_angle_put_it[reference]",
    ),
    Fault(
        "products_of_inertia_swapped",
        "dynx.model.elements",
        right="[self.ixx, self.ixy, self.ixz],\n"
        "                [self.ixy, self.iyy, self.iyz],\n"
        "                [self.ixz, self.iyz, self.izz],",
        wrong="[self.ixx, self.ixz, self.ixy],\n"
        "                [self.ixz, self.iyy, self.iyz],\n"
        "                [self.ixy, self.iyz, self.izz],",
        test_file="tests/contract/test_masses.py",
        test="test_impossible_products_of_inertia[reference]",
    ),
    Fault(
        "inertial_attitude_ignored",
        "dynx.model.mechanism",
        right="p_inertial, R_inertial, convert(link.inertial.tensor)",
        wrong="p_inertial, 0 * R_inertial + numbers(np.eye(3)), numbers(link.inertial.tensor)",
        test_file="tests/contract/test_bodies.py",
        test="test_mass_matrix_is_the_sum_over_the_links[reference-fixed]",
    ),
    Fault(
        "merged_link_not_moved_to_its_place",
        "dynx.model.mechanism",
        right="merged[body] = merged[body] + own.transform(R, p)",
        wrong="merged[body] = merged[body] + own",
        test_file="tests/contract/test_bodies.py",
        test="test_centre_of_mass_and_gravity_are_those_of_the_links[reference-fixed]",
    ),
    Fault(
        "integration_moves_the_base_in_world_axes",
        "dynx.model.configuration",
        right="position = q[..., :3] + rotate(rotation_from_quat(q[..., 3:7]), position)",
        wrong="position = q[..., :3] + position",
        test_file="tests/contract/test_coordinates.py",
        test="test_velocity_is_the_rate_of_the_pose[reference-floating]",
    ),
    Fault(
        "decimal_comma_accepted",
        "dynx.model.urdf.values",
        right="word = word.strip()",
        wrong='word = word.strip().replace(",", ".")',
        test_file="tests/model/urdf/test_refusals.py",
        test="test_a_bad_description_is_refused_with_line_and_reason[decimal comma]",
    ),
    Fault(
        "nan_accepted_in_a_description",
        "dynx.model.urdf.values",
        right="        if _NUMBER.fullmatch(word):\n"
        "            value = float(word)\n"
        "            if math.isfinite(value):\n"
        "                return value\n",
        wrong="        try:\n            return float(word)\n        except ValueError:\n            pass\n",
        test_file="tests/model/urdf/test_refusals.py",
        test="test_a_bad_description_is_refused_with_line_and_reason[not a number]",
    ),
    Fault(
        "axis_not_normalised",
        "dynx.model.urdf.joints",
        right="return (x / norm, y / norm, z / norm)",
        wrong="return (x, y, z)",
        test_file="tests/model/urdf/test_reader.py",
        test="test_an_axis_of_any_length_becomes_a_unit_vector",
    ),
    Fault(
        "writer_rounds_to_15_digits",
        "dynx.model.urdf.writer",
        right="return repr(max(-sys.float_info.max, min(sys.float_info.max, float(value))))",
        wrong='return f"{max(-1e308, min(1e308, float(value))):.15g}"',
        test_file="tests/model/urdf/test_writer.py",
        test="test_a_random_model_is_read_back_equal",
    ),
    Fault(
        "package_path_may_leave_the_package",
        "dynx.model.package_paths",
        right="if not found.is_relative_to(package):",
        wrong="if not found.is_absolute():",
        test_file="tests/model/test_package_paths.py",
        test="test_paths_outside_or_missing_raise",
    ),
)
