"""Faults in the SIMD compiler, the backend `compiled`, derivatives, parameters and the regressor.

None that would write outside of arrays or run altered code: what such a process does is not defined.
"""

from __future__ import annotations

from tests.faults.fault import Fault

SIMD = "dynx.simd"
TESTS = "tests/simd"
STRICT = f"{TESTS}/test_emit.py::test_strict_code_is_the_interpreter_bit_for_bit"
ANY_NUMBER = f"{TESTS}/test_kernel.py::test_any_number_of_samples"
ELEMENTARY = f"{TESTS}/test_elementary.py::test_within_two_units_everywhere"
TEST_PARAMETRIC = "tests/compiled/test_parametric.py"
TEST_FRAMES = "tests/compiled/test_frames.py"

SIMD_FAULTS = (
    Fault(
        "simd_sum_of_constants_for_their_difference",
        f"{SIMD}.simplify",
        right='"sub": lambda a, b: a - b,',
        wrong='"sub": lambda a, b: a + b,',
        caught_by=f"{TESTS}/test_simplify.py::test_exact_rules_keep_every_bit",
    ),
    Fault(
        "simd_difference_turned_round",
        f"{SIMD}.simplify",
        right='graph.apply("sub", *node.args[::-1])',
        wrong='graph.apply("sub", *node.args)',
        caught_by=f"{TESTS}/test_simplify.py::test_finite_rules_hold_for_finite_values_up_to_the_sign_of_zero",
    ),
    Fault(
        "simd_subtraction_commutes",
        f"{SIMD}.expr",
        right='frozenset({"add", "mul"})',
        wrong='frozenset({"add", "mul", "sub"})',
        caught_by=f"{TESTS}/test_verify.py::test_operations_that_do_not_commute_are_two",
    ),
    Fault(
        "simd_kept_value_overwritten_by_the_last_that_reads_it",
        f"{SIMD}.schedule",
        right="for value in held if last[value] < number]",
        wrong="for value in held if last[value] <= number]",
        caught_by=f"{TESTS}/test_schedule.py::test_what_is_still_wanted_is_not_overwritten",
    ),
    Fault(
        "simd_cosine_in_the_quadrant_of_the_sine",
        f"{SIMD}.trigonometry",
        right="{write.integer_splat(1)}",
        wrong="{write.integer_splat(3)}",
        caught_by=f"{TESTS}/test_trigonometry.py::test_within_two_units_up_to_the_limit",
    ),
    Fault(
        "simd_third_part_of_half_pi_left_out",
        f"{SIMD}.trigonometry",
        right="for part in HALF_PI:",
        wrong="for part in HALF_PI[:1]:",
        caught_by=f"{TESTS}/test_trigonometry.py::test_within_two_units_up_to_the_limit",
    ),
    Fault(
        "simd_polynomials_for_every_angle",
        f"{SIMD}.trigonometry",
        right="LIMIT = 1e5",
        wrong="LIMIT = 1e300",
        caught_by=f"{TESTS}/test_trigonometry.py::test_within_one_unit_beyond_it",
    ),
    Fault(
        "simd_second_part_of_ln_2_left_out",
        f"{SIMD}.elementary",
        right="r = of.multiply_add(k, splat(-low), r)",
        wrong="r = of.multiply_add(k, splat(-0.0 * low), r)",
        caught_by=ELEMENTARY,
    ),
    Fault(
        "simd_tanh_of_1_too_early",
        f"{SIMD}.elementary",
        right="FLAT = 20.0",
        wrong="FLAT = 18.0",
        caught_by=ELEMENTARY,
    ),
    Fault(
        "simd_small_tanh_by_the_formula_of_large_ones",
        f"{SIMD}.elementary",
        right="SMALL = 0.55",
        wrong="SMALL = 0.05",
        caught_by=ELEMENTARY,
    ),
    Fault(
        "simd_arctangent_of_a_polynomial_beyond_its_range",
        f"{SIMD}.elementary",
        right="MIDDLE, STEEP = 0.6,",
        wrong="MIDDLE, STEEP = 0.8,",
        caught_by=ELEMENTARY,
    ),
    Fault(
        "simd_sign_lost_from_tanh",
        f"{SIMD}.simplify",
        right='op in ("sin", "tanh", "arctan") else',
        wrong='op in ("sin", "arctan") else',
        caught_by=f"{TESTS}/test_simplify.py::test_exact_rules_keep_every_bit",
    ),
    Fault(
        "simd_derivative_of_tanh_of_the_wrong_argument",
        f"{SIMD}.differentiate",
        right='graph.apply("sub", one, index), graph.apply("add", one, index)',
        wrong='graph.apply("sub", one, a), graph.apply("add", one, a)',
        caught_by=f"{TESTS}/test_differentiate.py::test_each_operation_s_derivatives_are_limits_of_difference_quotients",
    ),
    Fault(
        "simd_every_group_the_last",
        f"{SIMD}.emit",
        right="%first = select i1 %late, i64 %last, i64 %i",
        wrong="%first = select i1 %late, i64 %last, i64 %last",
        caught_by=STRICT,
    ),
    Fault(
        "simd_smaller_for_larger",
        f"{SIMD}.emit",
        right='"max": "ogt"',
        wrong='"max": "olt"',
        caught_by=STRICT,
    ),
    Fault(
        "simd_tile_transposed_the_wrong_way",
        f"{SIMD}.rows",
        right="even, odd = (0, 4, 2, 6), (1, 5, 3, 7)",
        wrong="even, odd = (0, 4, 2, 6), (1, 3, 5, 7)",
        caught_by=f"{TESTS}/test_emit.py::test_inputs_go_through_to_outputs_of_every_width",
    ),
    Fault(
        "simd_value_of_an_earlier_segment_not_kept",
        f"{SIMD}.schedule",
        right="if home.get(node, number) < number:",
        wrong="if home.get(node, number) < number - 1:",
        caught_by=STRICT,
    ),
    Fault(
        "simd_samples_between_parts_left_out",
        f"{SIMD}.kernel",
        right="first[-1] = n",
        wrong="first[-1] = n // lanes * lanes",
        caught_by=f"{TESTS}/test_kernel.py::test_threads_change_nothing",
    ),
    Fault(
        "simd_derivative_of_a_quotient_with_the_wrong_sign",
        f"{SIMD}.differentiate",
        right='return inverse, graph.apply("neg", graph.apply("mul", index, inverse))',
        wrong='return inverse, graph.apply("mul", index, inverse)',
        caught_by=f"{TESTS}/test_differentiate.py::test_each_operation_s_derivatives_are_limits_of_difference_quotients",
    ),
    Fault(
        "regressor_products_of_inertia_mixed_up",
        "dynx.rbd.regressor",
        right="[o, x, o, y, z, o]",
        wrong="[o, x, o, y, o, z]",
        caught_by="tests/rbd/test_regressor.py::test_torque_is_regressor_times_parameters_in_50_digits",
    ),
    Fault(
        "regressor_without_the_turning_of_a_floating_base",
        "dynx.rbd.regressor",
        right="+ cross(twists.angular[0], twists.linear[0])]",
        wrong="]",
        caught_by="tests/rbd/test_regressor.py::test_torque_is_regressor_times_parameters_in_50_digits",
    ),
    Fault(
        "parametric_armature_forgotten_in_the_mass_matrix",
        "dynx.compiled.parametric",
        right="M[base + k, base + k] + joints[k, 2]",
        wrong="M[base + k, base + k] + 0 * joints[k, 2]",
        caught_by=f"{TEST_PARAMETRIC}::test_the_models_own_parameters_give_its_own_answers",
    ),
    Fault(
        "compiled_factor_without_fill_in",
        "dynx.compiled.mass_factors",
        right="A[i, j] = A[i, j] or np.any(A[i, :j] & A[j, :j])",
        wrong="A[i, j] = A[i, j]",
        caught_by="tests/compiled/test_mass_factors.py::test_zeros_between_branches_stay_unless_a_mimic_joint_fills_them",
    ),
    Fault(
        "compiled_batch_believed_without_its_check",
        "dynx.compiled.call",
        right="if not self._trusting and not defect.max(initial=0.0) < SOUND:",
        wrong="if not self._trusting and defect.max(initial=0.0) > SOUND:",
        caught_by="tests/compiled/test_arguments.py::test_a_bad_number_anywhere",
    ),
    Fault(
        "compiled_singular_mass_matrix_not_noticed",
        "dynx.compiled.kernels",
        right="defect = defect + np.sum(abs(found)) * (SOUND / LARGEST)",
        wrong="defect = defect + 0 * np.sum(abs(found)) * (SOUND / LARGEST)",
        caught_by="tests/compiled/test_arguments.py::test_a_configuration_without_an_acceleration",
    ),
    Fault(
        "compiled_frame_moved_by_joints_beyond_it",
        "dynx.compiled.frames",
        right="np.sum(shares[k:]) for k in range(1, len(shares))",
        wrong="np.sum(shares[k:]) for k in range(len(shares) - 1)",
        caught_by=f"{TEST_FRAMES}::test_any_frame_of_any_robot",
    ),
    Fault(
        "compiled_references_of_a_frame_exchanged",
        "dynx.compiled.frames",
        right='place[_LOCAL], place[_WORLD] = reference == "local", reference == "world"',
        wrong='place[_WORLD], place[_LOCAL] = reference == "local", reference == "world"',
        caught_by=f"{TEST_FRAMES}::test_any_frame_of_any_robot",
    ),
    Fault(
        "compiled_acceleration_at_a_world_origin_that_moves_along",
        "dynx.compiled.frames",
        right=" + skew(self.stays * twist[:3]) @ x[3:]",
        wrong="",
        caught_by=f"{TEST_FRAMES}::test_any_frame_of_any_robot",
    ),
    Fault(
        "compiled_place_known_to_the_first_sample_only",
        "dynx.compiled.call",
        right="room.input_rows[-1][...] = self._place",
        wrong="room.input_rows[-1][:1] = self._place",
        caught_by=f"{TEST_FRAMES}::test_every_way_gives_the_same_bits",
    ),
)
