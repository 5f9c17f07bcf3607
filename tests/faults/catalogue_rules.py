"""Faults in the rules of the doctor, in what edits files for them, and in what compares descriptions."""

from __future__ import annotations

from tests.faults.fault import Fault

DX101 = "dynx.rules.catalogue.dx101_link_without_inertial"
DX105 = "dynx.rules.catalogue.dx105_inertia_not_diagonal"
DX106 = "dynx.rules.catalogue.dx106_root_inertial_rotated"
DX107 = "dynx.rules.catalogue.dx107_massless_root"
DX201 = "dynx.rules.catalogue.dx201_axis_not_unit"
DX216 = "dynx.rules.catalogue.dx216_upper_limit_missing"
DX217 = "dynx.rules.catalogue.dx217_joint_named_root_joint"
DX301 = "dynx.rules.catalogue.dx301_damping_in_inverse_dynamics"
DX401 = "dynx.rules.catalogue.dx401_decimal_comma"
IMPOSSIBLE = "dynx.rules.inertia.impossible"
PHYSICAL = "dynx.rules.inertia.physical"
LUMPING = "dynx.rules.inertia.merging"
EDITS = "dynx.rules.inertia.edits"
EDITING = "dynx.rules.text.editing"
NUMBERS = "dynx.rules.text.number_text"
DIFFERENCE = "dynx.loaded.difference"
SOURCE = "dynx.model.xml.source"
DETECTIONS = "tests/rules/test_dx1_detections.py"
REMEDIES = "tests/rules/test_dx1_remedies.py"
JOINTS = "tests/rules/test_dx2_joints.py"
DYNAMICS = "tests/rules/test_dx3_joint_dynamics.py"
MISSING_LIMITS = "tests/rules/test_missing_limits.py"
TEXT = "tests/rules/test_dx4_text.py"
NUMBER_TEXT = "tests/rules/text/test_number_text.py"
OPTIONAL = "tests/rules/test_dx51.py"
TEST_DIFFERENCE = "tests/loaded/test_difference.py"
TEST_SOURCE = "tests/model/xml/test_source.py"

RULES_FAULTS = (
    # -- DX101 to DX107 ------------------------------------------------------------------------
    Fault(
        "dx101_finds_links_that_cannot_move",
        DX101,
        right="and name not in static and name",
        wrong="and name",
        caught_by=f"{DETECTIONS}::test_a_link_without_inertial_is_found_where_it_can_move[six_axis_arm]",
    ),
    Fault(
        "dx101_zero_for_the_root_that_floats",
        DX101,
        right="            names.remove(root)\n",
        wrong="",
        caught_by=f"{REMEDIES}::test_a_root_without_inertial_gets_that_of_the_body_welded_to_it",
    ),
    Fault(
        "dx101_frame_of_one_kilogram",
        EDITS,
        right='<inertial>\\n  <mass value="0"/>',
        wrong='<inertial>\\n  <mass value="1"/>',
        caught_by=f"{REMEDIES}::test_a_root_without_inertial_gets_that_of_the_body_welded_to_it",
    ),
    Fault(
        "dx102_two_moments_raised_of_three",
        PHYSICAL,
        right="iyy=inertial.iyy + added, izz=inertial.izz + added)",
        wrong="iyy=inertial.iyy + added)",
        caught_by=f"{REMEDIES}::test_a_body_on_the_edge_is_put_inside_by_what_nobody_can_measure",
    ),
    Fault(
        "dx102_raised_by_a_thousandth",
        PHYSICAL,
        right="_MARGIN = 16.0 * FLOAT64_EPS",
        wrong="_MARGIN = 1e-3",
        caught_by=f"{REMEDIES}::test_a_body_on_the_edge_is_put_inside_by_what_nobody_can_measure",
    ),
    Fault(
        "dx103_negative_moment_is_no_fault",
        PHYSICAL,
        right="    if small < -rounding:",
        wrong="    if small < -large:",
        caught_by=f"{DETECTIONS}::test_a_planted_tensor_is_found_alone_on_its_link_and_line[six_axis_arm-DX104]",
    ),
    Fault(
        "dx103_change_of_the_physics_not_said",
        IMPOSSIBLE,
        right="changes_physics=bool(replaced))",
        wrong="changes_physics=bool(fused))",
        caught_by=f"{REMEDIES}::test_a_tensor_of_no_body_without_neighbours_becomes_the_nearest_one",
    ),
    Fault(
        "dx103_mass_counted_in_both_links",
        LUMPING,
        right="return Inertial(0.0, inertial.origin)",
        wrong="return Inertial(inertial.mass, inertial.origin)",
        caught_by=f"{REMEDIES}::test_a_tensor_that_is_a_body_with_its_neighbour_is_lumped_at_equal_dynamics",
    ),
    Fault(
        "dx107_lumped_in_the_wrong_frame",
        LUMPING,
        right="seen_from(*group.pose(name, into))",
        wrong="seen_from(*group.pose(into, name))",
        caught_by=f"{REMEDIES}::test_a_root_without_inertial_gets_that_of_the_body_welded_to_it",
    ),
    Fault(
        "dx105_only_what_is_off_by_a_millionth",
        DX105,
        right="_NOTICEABLE = 1e-14",
        wrong="_NOTICEABLE = 1e-6",
        caught_by=f"{DETECTIONS}::test_a_tensor_is_found_where_what_bullet_makes_of_it_could_show",
    ),
    Fault(
        "dx105_products_stay",
        DX105,
        right="turned = CentralInertia.of(inertial).inertial(inertial.origin.rpy)",
        wrong="turned = CentralInertia.of(inertial).aligned()",
        caught_by=f"{REMEDIES}::test_only_the_tensor_changes_in_the_text",
    ),
    Fault(
        "dx106_on_the_floating_base",
        DX106,
        right='case.base != "fixed" or',
        wrong='case.base == "fixed" or',
        caught_by=f"{DETECTIONS}::test_the_rotation_of_the_root_counts_on_the_fixed_base_alone",
    ),
    Fault(
        "dx107_root_lumped_into_the_body",
        DX107,
        right="(root, body), root)",
        wrong="(root, body), body)",
        caught_by=f"{REMEDIES}::test_the_root_becomes_the_body_it_carries_through_a_chain_of_fixed_joints",
    ),
    # -- DX2 to DX4 ----------------------------------------------------------------------------
    Fault(
        "dx201_axes_that_are_too_short_pass",
        DX201,
        right="if abs(length - 1.0) > _ROUNDING:",
        wrong="if length - 1.0 > _ROUNDING:",
        caught_by=f"{JOINTS}::test_an_axis_is_scaled_as_dynx_scales_it",
    ),
    Fault(
        "dx201_axis_of_the_first_joint",
        DX201,
        right='case.model.joint(joint.attributes["name"]).axis',
        wrong="case.model.joint(case.model.joint_names[0]).axis",
        caught_by=f"{JOINTS}::test_an_axis_is_scaled_as_dynx_scales_it",
    ),
    Fault(
        "numbers_of_fifteen_digits",
        NUMBERS,
        right="return repr(float(value) + 0.0)",
        wrong='return f"{value:.15g}"',
        caught_by="tests/rules/text/test_number_text.py::test_a_number_is_written_as_it_was",
    ),
    Fault(
        "dx301_damping_of_zero_is_damping",
        DX301,
        right='if damping := number_or_none(dynamics, "damping"):',
        wrong='if (damping := number_or_none(dynamics, "damping")) is not None:',
        caught_by=f"{DYNAMICS}::test_zero_is_no_matter_and_neither_is_a_fixed_joint",
    ),
    Fault(
        "dx301_one_call_is_enough",
        EDITING,
        right="case.calls.issuperset(self.calls)",
        wrong="case.calls.intersection(self.calls)",
        caught_by=f"{DYNAMICS}::test_a_call_for_one_engine_is_not_enough",
    ),
    Fault(
        "dx401_thousands_whatever_was_chosen",
        DX401,
        right='if self.chosen(case) == "thousands" and',
        wrong="if",
        caught_by=f"{TEXT}::test_a_comma_is_read_by_choice",
    ),
    Fault(
        "remedy_at_every_place",
        EDITING,
        right="if each.detection in wanted for edit",
        wrong="if wanted for edit",
        caught_by=f"{JOINTS}::test_one_axis_of_two_is_scaled_where_that_is_asked",
    ),
    Fault(
        "dx216_every_limit_without_upper",
        DX216,
        right="lower is None or lower > _UPPER_OF_PYBULLET",
        wrong="lower is None",
        caught_by=f"{MISSING_LIMITS}::test_a_range_that_no_motion_shows_is_no_matter",
    ),
    Fault(
        "dx216_writes_what_pybullet_has",
        DX216,
        right='"upper", "0"',
        wrong='"upper", "-1"',
        caught_by=f"{MISSING_LIMITS}::test_the_end_that_urdf_has_is_written_and_the_robot_stays",
    ),
    Fault(
        "dx217_on_the_fixed_base",
        DX217,
        right='case.base != "floating" or joint is None',
        wrong="joint is None",
        caught_by=f"{JOINTS}::test_the_joint_named_root_joint_is_renamed_where_the_base_floats",
    ),
    Fault(
        "dx405_blank_in_front",
        NUMBERS,
        right="text.lstrip(_BLANKS) == word",
        wrong="text == word",
        caught_by=f"{NUMBER_TEXT}::test_a_plain_number_has_no_fault",
    ),
    Fault(
        "practice_mended_unasked",
        EDITING,
        right="return None if self.chosen(case) == self.KEEP else super().remedy(case, detections)",
        wrong="return super().remedy(case, detections)",
        caught_by=f"{OPTIONAL}::test_multiples_of_a_quarter_turn_cut_short",
    ),
    # -- descriptions --------------------------------------------------------------------------
    Fault(
        "difference_nan_is_alike",
        DIFFERENCE,
        right="    if not (np.isfinite(wanted).all() and np.isfinite(held).all()):\n        return True",
        wrong="    if not (np.isfinite(wanted).all() and np.isfinite(held).all()):\n        return False",
        caught_by=f"{TEST_DIFFERENCE}::test_what_is_no_number_deviates",
    ),
    Fault(
        "difference_size_of_the_last_value",
        DIFFERENCE,
        right="largest = max(size, float(np.max(np.abs(wanted)))",
        wrong="largest = max(1.0, size, float(np.max(np.abs(wanted)))",
        caught_by=f"{TEST_DIFFERENCE}::test_a_deviation_of_a_light_link_is_listed",
    ),
    Fault(
        "difference_link_that_is_not_there_passes",
        DIFFERENCE,
        right="if not still and link.name not in fused:",
        wrong="if not still and link.name in fused:",
        caught_by=f"{TEST_DIFFERENCE}::test_each_deviation_is_listed_and_no_other[arm-existence]",
    ),
    # -- editing of text -----------------------------------------------------------------------
    Fault(
        "source_lines_counted_from_the_first_element",
        SOURCE,
        right="line = self._lines_before + self._parser.CurrentLineNumber",
        wrong="line = self._parser.CurrentLineNumber",
        caught_by=f"{TEST_SOURCE}::test_lines_count_what_stands_before_the_first_element",
    ),
    Fault(
        "source_value_not_escaped",
        SOURCE,
        right='written = f" {name}={quoteattr(value)}"',
        wrong="written = f' {name}=\"{value}\"'",
        caught_by=f"{TEST_SOURCE}::test_edits_keep_comments_quotes_and_indentation",
    ),
    Fault(
        "source_attribute_set_twice",
        SOURCE,
        right="place = element.places.get(name)",
        wrong="place = element.places.get(value)",
        caught_by=f"{TEST_SOURCE}::test_an_attribute_is_set_and_all_else_stays",
    ),
    Fault(
        "source_line_of_a_neighbour_goes_too",
        SOURCE,
        right="if not self.data[before:start].strip() and not self.data[end:after].strip():",
        wrong="if not self.data[before:start].strip():",
        caught_by=f"{TEST_SOURCE}::test_what_stands_behind_an_element_stays",
    ),
    Fault(
        "source_line_ends_of_another_system",
        SOURCE,
        right='text = _BARE_FEED.sub(self._line_end, edit.text.encode("utf-8"))',
        wrong='text = edit.text.encode("utf-8")',
        caught_by=f"{TEST_SOURCE}::test_line_ends_are_kept",
    ),
)
