"""Contact conformance: errors of each engine where bodies touch, against closed forms of mechanics.

A `ContactCase` is a scene with a closed form. `conform` runs every case in every engine at several steps and
gives each measured `Figure` a verdict: it is within the tolerance, its error falls with the step, the error
is attributed to a setting of the engine (proved by running again with the setting changed), the engine lacks
the coefficient, or the error is unexplained::

    from dynx.contacts import conform

    found = conform(["mujoco"], steps=(4e-3, 2e-3, 1e-3), cases=["slope", "rebound"])
    for result in found.results:
        print(result.case, result.trial, result.figure, result.errors, result.verdict.kind)

A case is a subclass of `ContactCase` in a module of `dynx.contacts.cases`, and a line in
`dynx.contacts.case.BUILT_IN`; `conform` takes those of a program as objects, or by the names that
`dynx.contacts.case.register` gives them. Its `trials` are independent scenes, which `measure` steps in a
world of any engine, with the help of `dynx.contacts.motion`. A case names no engine and contains no verdict.
It states for each figure the tolerance below which an error counts as none, and in `Figure.rests_on` the
coefficients without which no engine can give the exact value. `dynx.contacts.candidates` lists the settings
to which errors may be attributed, each with a reason.

The result of an impact depends on the moment within a step at which the bodies touch. A case with an impact
therefore has several bodies, which touch at different moments, and its figure is the one with the largest
error, which then falls with the step.
"""

from typing import TYPE_CHECKING

from dynx.contacts.candidates import CANDIDATES, SettingsChange
from dynx.contacts.case import ContactCase, Figure, case_names, find_case, find_cases
from dynx.contacts.case import register as register_case
from dynx.contacts.case import unregister as unregister_case
from dynx.contacts.conformance import STEPS, Conformance, FigureResult, NoResult, conform
from dynx.contacts.verdict import VERDICTS, Attribution, AttributionOutcome, Price, Verdict, VerdictKind
from dynx.registry import moved_names

__all__ = [
    "CANDIDATES",
    "STEPS",
    "VERDICTS",
    "Attribution",
    "AttributionOutcome",
    "Conformance",
    "ContactCase",
    "Figure",
    "FigureResult",
    "NoResult",
    "Price",
    "SettingsChange",
    "Verdict",
    "VerdictKind",
    "case_names",
    "conform",
    "find_case",
    "find_cases",
    "register_case",
    "unregister_case",
]

if not TYPE_CHECKING:
    __getattr__ = moved_names(
        __name__,
        {
            "Candidate": "dynx.contacts.SettingsChange",
            "Case": "dynx.contacts.ContactCase",
            "Outcome": "dynx.contacts.AttributionOutcome",
        },
    )
