"""Faults in the doctor: the right answers, the comparison, the proof, the mending and the report."""

from __future__ import annotations

from tests.faults.fault import Fault

TRUTH = "dynx.doctor.examine.right_answers"
EXAMINATION = "dynx.doctor.examine.examination"
ATTRIBUTION = "dynx.doctor.prove.attribution"
MENDING = "dynx.doctor.prove.mending"
DIAGNOSIS = "dynx.doctor.diagnosis"
REPORT = "dynx.doctor.report"
GIVEN_FILE = "dynx.doctor.examine.engine_input"
TEST_TRUTH = "tests/doctor/examine/test_right_answers.py"
TEST_EXAMINATION = "tests/doctor/examine/test_examination.py"
TEST_ATTRIBUTION = "tests/doctor/prove/test_attribution.py"
TEST_MENDING = "tests/doctor/prove/test_mending.py"
TEST_DIAGNOSIS = "tests/doctor/test_diagnosis_of_one_engine.py"
TEST_REPORT = "tests/doctor/test_report.py"
TEST_GIVEN_FILE = "tests/doctor/examine/test_engine_input.py"
FORMATS = "tests/doctor/formats"

DOCTOR_FAULTS = (
    # -- the right answers ---------------------------------------------------------------------
    Fault(
        "truth_in_upright_gravity",
        TRUTH,
        right="base=base, gravity=TILTED)",
        wrong="base=base)",
        caught_by=f"{TEST_TRUTH}::test_followers_move_by_themselves_and_gravity_is_tilted",
    ),
    Fault(
        "truth_asks_forward_dynamics_for_what_it_knows",
        TRUTH,
        right="np.roll(torque, 1, axis=0)",
        wrong="np.roll(torque, len(torque), axis=0)",
        caught_by=f"{TEST_TRUTH}::test_torques_and_accelerations_fit_and_no_state_is_balanced[fixed]",
    ),
    Fault(
        "truth_torque_taken_without_velocities",
        TRUTH,
        right='np.einsum("nij,nj->ni", self.mass_matrix, a) + self.bias)',
        wrong='np.einsum("nij,nj->ni", self.mass_matrix, a) - self.bias)',
        caught_by=f"{TEST_TRUTH}::test_torques_and_accelerations_fit_and_no_state_is_balanced[floating]",
    ),
    Fault(
        "truth_referee_sees_the_better_half",
        TRUTH,
        right="return max(_ratio(gap.astype(np.float64), right) for gap, right in gaps)",
        wrong="return min(_ratio(gap.astype(np.float64), right) for gap, right in gaps)",
        caught_by=f"{TEST_TRUTH}::test_the_referee_finds_a_wrong_answer_of_either_kind",
    ),
    Fault(
        "truth_states_beyond_the_limits",
        TRUTH,
        right="rng.uniform(0.1, 0.9, (count",
        wrong="rng.uniform(-0.1, 1.1, (count",
        caught_by=f"{TEST_TRUTH}::test_states_keep_away_from_limits",
    ),
    # -- the comparison ------------------------------------------------------------------------
    Fault(
        "doctor_nan_counts_as_zero",
        EXAMINATION,
        right="np.where(np.isnan(size), np.inf, size)",
        wrong="np.where(np.isnan(size), 0.0, size)",
        caught_by=f"{TEST_EXAMINATION}::test_what_is_no_number_is_no_agreement",
    ),
    Fault(
        "doctor_error_is_absolute",
        EXAMINATION,
        right="_number(_largest(answers.deviation.get(quantity, {})) / self.scale(quantity, engine))",
        wrong="_number(_largest(answers.deviation.get(quantity, {})))",
        caught_by=f"{TEST_EXAMINATION}::test_an_error_is_relative_whatever_the_robot_weighs",
    ),
    Fault(
        "doctor_right_answer_of_zero_is_no_scale",
        EXAMINATION,
        right="return _largest(own) or 1.0",
        wrong="return max(_largest(own), 1e3)",
        caught_by=f"{TEST_EXAMINATION}::test_where_the_right_answer_is_zero_an_error_is_all_of_the_answer",
    ),
    Fault(
        "doctor_failed_question_left_out",
        EXAMINATION,
        right="if answers.refused is not None or quantity in answers.failed:",
        wrong="if answers.refused is not None:",
        caught_by=f"{TEST_EXAMINATION}::test_what_is_no_number_is_no_agreement",
    ),
    Fault(
        "doctor_acceleration_the_same_way_twice",
        EXAMINATION,
        right="back = 2.0 * truth.bias - there",
        wrong="back = 1.0 * there",
        caught_by=f"{TEST_EXAMINATION}::test_a_force_that_acts_on_one_side_alone_shows",
    ),
    Fault(
        "doctor_backward_error_terms_cancel",
        EXAMINATION,
        right="terms + np.abs(truth.bias) + np.abs(tau)",
        wrong="np.abs(terms + truth.bias - tau)",
        caught_by=f"{TEST_EXAMINATION}::test_an_acceleration_is_judged_by_the_torque_that_it_takes",
    ),
    Fault(
        "doctor_link_without_place_is_not_compared",
        EXAMINATION,
        right="if not np.isnan(gap[:, k]).all()}",
        wrong="if not np.isnan(gap[:, k]).any()}",
        caught_by=f"{TEST_EXAMINATION}::test_a_link_that_is_fused_away_is_not_compared_and_one_without_place_is",
    ),
    Fault(
        "doctor_fewer_states_are_the_last",
        EXAMINATION,
        right="part: gap[:count] for part, gap",
        wrong="part: gap[-count:] for part, gap",
        caught_by=f"{TEST_EXAMINATION}::test_fewer_states_are_the_first_of_them",
    ),
    # -- the proof -----------------------------------------------------------------------------
    Fault(
        "effect_not_compared_with_the_tolerance",
        ATTRIBUTION,
        right="size > max(worst.relative_error, self._tolerance)",
        wrong="size > worst.relative_error",
        caught_by=f"{TEST_ATTRIBUTION}::test_an_effect_below_the_tolerance_is_none",
    ),
    Fault(
        "proof_that_never_fails",
        ATTRIBUTION,
        right="dict(effects), bool(effects) and right)",
        wrong="dict(effects), bool(effects) or right)",
        caught_by=f"{TEST_ATTRIBUTION}::test_a_cause_is_not_proved_where_the_engine_stays_wrong",
    ),
    Fault(
        "every_place_has_the_effect_of_all",
        ATTRIBUTION,
        right="proofs.append(self._attribution(rule, each, effects))",
        wrong="proofs.append(self._attribution(rule, each, touched))",
        caught_by=(
            f"{TEST_ATTRIBUTION}::test_a_cause_that_explains_all_is_proved_at_each_place_with_its_own_effect"
        ),
    ),
    Fault(
        "effect_of_another_robot",
        ATTRIBUTION,
        right="if not remedy.changes_physics and _coordinates",
        wrong="if _coordinates",
        caught_by=(
            f"{TEST_ATTRIBUTION}::"
            "test_a_remedy_that_changes_the_robot_has_no_effect_on_an_engine_that_is_right"
        ),
    ),
    Fault(
        "causes_that_hide_each_other_are_not_found",
        ATTRIBUTION,
        right="        if untouched:",
        wrong="        if not touched and not untouched:",
        caught_by=f"{TEST_ATTRIBUTION}::test_of_two_refusals_each_is_proved_among_the_mended",
    ),
    Fault(
        "engines_that_a_rule_does_not_name_are_blamed",
        ATTRIBUTION,
        right="if engine in rule.engines]",
        wrong="if engine]",
        caught_by=f"{TEST_ATTRIBUTION}::test_a_rule_has_no_effect_on_an_engine_that_it_does_not_name",
    ),
    # -- the mending ---------------------------------------------------------------------------
    Fault(
        "mending_what_was_to_be_left_out",
        MENDING,
        right="place(rule, detection) not in places",
        wrong="place(rule, detection) in places",
        caught_by=f"{TEST_MENDING}::test_a_place_that_is_left_out_stays_as_it_is",
    ),
    Fault(
        "mending_practice_unasked",
        MENDING,
        right='return rule.kind == "difference" or rule.id in (case.choices or {})',
        wrong="return True",
        caught_by=f"{TEST_MENDING}::test_practice_is_left_alone_whatever_its_rule_could_do",
    ),
    Fault(
        "mending_more_than_is_needed",
        DIAGNOSIS,
        right="            return least, result",
        wrong="            return full, result",
        caught_by=f"{TEST_DIAGNOSIS}::test_only_the_place_that_matters_is_mended",
    ),
    Fault(
        "diagnosis_small_differences_forgotten",
        DIAGNOSIS,
        right="errors[quantity] > tolerance:",
        wrong="errors[quantity] > 1e-6:",
        caught_by=f"{TEST_DIAGNOSIS}::test_a_small_difference_that_no_rule_explains_is_said_with_its_joint",
    ),
    Fault(
        "diagnosis_refusal_to_the_end_forgotten",
        DIAGNOSIS,
        right="if answers.refused is not None and engine not in known:",
        wrong="if answers.refused is not None and engine in known:",
        caught_by=f"{TEST_DIAGNOSIS}::test_a_file_that_is_refused_to_the_end_is_not_explained",
    ),
    Fault(
        "diagnosis_without_what_the_mended_file_gives",
        "dynx.doctor.reporting",
        right="after=after.errors(each.engine))",
        wrong="after=each.before)",
        caught_by=f"{TEST_DIAGNOSIS}::test_every_place_that_matters_is_mended_and_the_file_is_then_alike",
    ),
    # -- the report ----------------------------------------------------------------------------
    Fault(
        "report_explained_whatever_is_left",
        REPORT,
        right="not self.unexplained and self.residual <= self.tolerance",
        wrong="not self.unexplained",
        caught_by=f"{TEST_REPORT}::test_alike_and_explained",
    ),
    Fault(
        "report_alike_though_refused",
        REPORT,
        right="self.error is None and not refused and largest <= self.tolerance",
        wrong="self.error is None and largest <= self.tolerance",
        caught_by=f"{TEST_REPORT}::test_one_engine_that_differs_is_enough",
    ),
    Fault(
        "report_proved_where_one_place_is",
        REPORT,
        right="{finding.rule for finding in self.differences if not finding.proved}",
        wrong="set()",
        caught_by=f"{TEST_REPORT}::test_the_verdict_counts_what_is_proved",
    ),
    Fault(
        "report_infinity_in_json",
        REPORT,
        right="return value if math.isfinite(value) else None",
        wrong="return value if not math.isnan(value) else None",
        caught_by=f"{TEST_REPORT}::test_the_summary_counts_each_robot_once",
    ),
    Fault(
        "given_file_without_the_shapes_that_weigh",
        GIVEN_FILE,
        right='("mesh", "sdf_mesh", "convex")',
        wrong='("geometry",)',
        caught_by=f"{TEST_GIVEN_FILE}::test_shapes_that_weigh_stay_and_files_that_may_be_missing_go",
    ),
    Fault(
        "given_file_in_another_encoding",
        GIVEN_FILE,
        right="path.write_bytes(source.to_bytes())",
        wrong="path.write_bytes(source.data)",
        caught_by=f"{TEST_GIVEN_FILE}::test_a_file_is_written_as_it_was_read_and_is_gone_afterwards",
    ),
    # -- the formats ---------------------------------------------------------------------------
    Fault(
        "junit_passes_what_is_infinite",
        "dynx.doctor.formats.junit",
        right="if not error <= report.tolerance\n        ]\n        case",
        wrong="if error > 1.0\n        ]\n        case",
        caught_by=f"{FORMATS}/test_junit.py::test_what_is_known_is_skipped_and_what_is_new_fails",
    ),
    Fault(
        "sarif_of_both_bases_keeps_the_milder",
        "dynx.doctor.formats.sarif",
        right='_LEVELS.index(result["level"]) > _LEVELS.index(old["level"])',
        wrong='_LEVELS.index(result["level"]) < _LEVELS.index(old["level"])',
        caught_by=f"{FORMATS}/test_sarif.py::test_of_two_bases_the_more_alarming_is_told",
    ),
    Fault(
        "baseline_knows_every_engine_at_a_known_place",
        "dynx.doctor.formats.baseline",
        right="if not each.engines <= allowed.get(each.place, frozenset()))",
        wrong="if not each.engines & allowed.get(each.place, frozenset()))",
        caught_by=f"{FORMATS}/test_baseline.py::test_one_more_engine_is_new_and_one_less_is_not",
    ),
    Fault(
        "vote_of_engines_that_were_never_compared",
        "dynx.doctor.formats.vote",
        right="in compared - differing for other in group)",
        wrong="not in differing for other in group)",
        caught_by=f"{FORMATS}/test_vote.py::test_engines_that_were_not_compared_are_not_of_one_mind",
    ),
)
