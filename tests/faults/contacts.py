"""Faults in the cases of contact, and in the verdicts on them."""

from __future__ import annotations

from tests.faults.fault import Fault

CONTACTS_FAULTS = (
    Fault(
        "contacts_twice_the_friction",
        "dynx.contacts.cases.slope",
        right="exact = G * (math.sin(angle) - FRICTION * math.cos(angle))",
        wrong="exact = G * (math.sin(angle) - 2.0 * FRICTION * math.cos(angle))",
        test_file="tests/contacts/test_closed_forms.py",
        test="test_exact_mechanics_has_no_error[slope]",
    ),
    Fault(
        "contacts_sliding_without_its_distance",
        "dynx.contacts.cases.sliding_to_rolling",
        right=" - 0.5 * FRICTION * G * rolls**2",
        wrong="",
        test_file="tests/contacts/test_closed_forms.py",
        test="test_exact_mechanics_has_no_error[sliding_to_rolling]",
    ),
    Fault(
        "contacts_best_interval_of_a_series",
        "dynx.contacts.trend",
        right="        to_tolerance = b == math.log(tolerance)",
        wrong="        to_tolerance = b < logs[0]",
        test_file="tests/contacts/test_trend.py",
        test="test_an_error_that_stops_falling_stays",
    ),
    Fault(
        "contacts_any_reduction_is_a_cause",
        "dynx.contacts.attribution",
        right='        if trend.kind == "stays":',
        wrong="        if trend is None:",
        test_file="tests/contacts/test_conform.py",
        test="test_an_error_that_a_change_reduces_and_does_not_remove_is_unexplained",
    ),
    Fault(
        "contacts_causes_that_are_worse_at_some_step",
        "dynx.contacts.attribution",
        right="not after <= before + series.tolerance for",
        wrong="after == before == -series.tolerance for",
        test_file="tests/contacts/test_causes.py",
        test="test_a_change_that_is_worse_at_some_step_is_no_cause",
    ),
    Fault(
        "contacts_any_lacking_coefficient_excuses",
        "dynx.contacts.series",
        right="[lacking[name] for name in first.rests_on if name in lacking]",
        wrong="[*lacking.values()]",
        test_file="tests/contacts/test_conform.py",
        test="test_a_lacking_coefficient_excuses_only_figures_that_rest_on_it",
    ),
)
