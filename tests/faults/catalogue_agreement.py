"""Faults in the agreement that is to find all others."""

from __future__ import annotations

from tests.faults.fault import Fault

COMPARISON = "dynx.agreement.comparison"
SUSPECTS = "dynx.agreement.suspects"
IDENTITIES = "dynx.agreement.identities"
SAMPLING = "dynx.agreement.sampling"
TEST_COMPARISON = "tests/agreement/test_comparison.py"
TEST_SUSPECTS = "tests/agreement/test_suspects.py"
TEST_IDENTITIES = "tests/agreement/test_identities.py"

AGREEMENT_FAULTS = (
    Fault(
        "agreement_whatever_the_error",
        COMPARISON,
        right="        verdict.relative <= tolerance,\n        locate(",
        wrong="        True,\n        locate(",
        caught_by="tests/agreement/test_agreement.py::test_a_defect_is_seen_with_nothing_to_compare_it_with",
    ),
    Fault(
        "not_a_number_counts_as_right",
        COMPARISON,
        right="np.where(np.isfinite(size), size, np.inf)",
        wrong="np.where(np.isfinite(size), size, 0.0)",
        caught_by=f"{TEST_COMPARISON}::test_what_is_no_number_is_infinitely_wrong",
    ),
    Fault(
        "worst_error_is_the_mean",
        COMPARISON,
        right="worst = np.unravel_index(int(np.argmax(relative)), relative.shape)",
        wrong="worst = np.unravel_index(int(np.argmin(relative)), relative.shape)",
        caught_by=f"{TEST_COMPARISON}::test_the_largest_relative_error_and_its_place",
    ),
    Fault(
        "refusal_by_one_counts_as_agreement",
        COMPARISON,
        right="alike = len(refused) == len(answers) and all(answer.singular for answer in refused)",
        wrong="alike = bool(refused)",
        caught_by=f"{TEST_COMPARISON}::test_a_refusal_by_one_is_a_difference_that_names_it",
    ),
    Fault(
        "answer_compared_with_itself",
        COMPARISON,
        right="answers = [each.of(quantity.name, quantity.evaluate) for each in (first, second)]",
        wrong="answers = [each.of(quantity.name, quantity.evaluate) for each in (first, first)]",
        caught_by="tests/agreement/test_agreement.py::test_a_defect_is_seen_and_its_backend_is_named",
    ),
    Fault(
        "referee_not_heard",
        SUSPECTS,
        right="if other == EXACT:",
        wrong='if other == "nobody":',
        caught_by=f"{TEST_SUSPECTS}::test_the_referee_convicts_even_against_a_majority",
    ),
    Fault(
        "no_suspect_is_named",
        SUSPECTS,
        right="if weight == strength:",
        wrong="if weight > strength:",
        caught_by=f"{TEST_SUSPECTS}::test_without_evidence_both_parties_are_named",
    ),
    Fault(
        "broken_identity_left_out",
        SUSPECTS,
        right="if not check.agree and check.backend not in named:",
        wrong="if not check.agree and check.backend in named:",
        caught_by=f"{TEST_SUSPECTS}::test_an_identity_broken_where_nothing_differs_names_its_backend",
    ),
    Fault(
        "identity_of_passivity_wrong",
        IDENTITIES,
        right="return rate - C - np.swapaxes(C, -1, -2),",
        wrong="return rate - 2.0 * C,",
        caught_by=f"{TEST_IDENTITIES}::test_the_reference_keeps_every_identity",
    ),
    Fault(
        "identity_of_symmetry_always_kept",
        IDENTITIES,
        right="return M - np.swapaxes(M, -1, -2), mass_scale(sizes)",
        wrong="return M - M, mass_scale(sizes)",
        caught_by=f"{TEST_IDENTITIES}::test_a_defect_breaks_its_identity",
    ),
    Fault(
        "samples_do_not_follow_the_seed",
        SAMPLING,
        right="rng = np.random.default_rng(seed)",
        wrong="rng = np.random.default_rng()",
        caught_by="tests/agreement/test_sampling.py::test_samples_follow_from_the_seed",
    ),
    Fault(
        "solution_judged_by_the_engine_that_found_it",
        "dynx.agreement.solutions",
        right="for answer, verifier in zip(solutions, (second, first), strict=True):",
        wrong="for answer, verifier in zip(solutions, (first, second), strict=True):",
        caught_by=(
            "tests/agreement/test_solutions.py::"
            "test_a_configuration_that_reaches_the_target_by_its_own_poses_only_is_no_solution"
        ),
    ),
)
