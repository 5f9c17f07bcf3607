"""The JSON document of ``dynx contacts``: errors are relative, lists run over `steps`, the largest first."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, TypedDict

from dynx.contacts import (
    Attribution,
    AttributionOutcome,
    Conformance,
    ContactCase,
    FigureResult,
    NoResult,
    VerdictKind,
)

SCHEMA: Literal["dynx.contacts/1"] = "dynx.contacts/1"


class EngineEntry(TypedDict):
    """An engine, the settings given to it, and its number of figures with each verdict.

    `in_effect` has the values in effect at each step of settings given that the engine changes.
    """

    engine: str
    version: str
    settings: dict[str, Any]
    in_effect: dict[str, list[float]]
    verdicts: dict[VerdictKind, int]


class PriceEntry(TypedDict):
    """Another figure of the case, whose error at the smallest step a change at least doubles."""

    trial: str
    figure: str
    before: float
    after: float


class AttributionEntry(TypedDict):
    """Settings whose change removes an error or makes it fall, proved by running again.

    `settings` has the values of each setting: the one in use, then those that were tried. `errors` has the
    errors at every step for each of the values in turn. `outcome` is removed where the last of them are
    within the tolerance at every step, falls where they fall with the step, and proportion where the error
    at the smallest step falls with the setting; `order` is the order at which they fall, null under removed.
    """

    settings: dict[str, list[Any]]
    reason: str
    errors: list[list[float]]
    outcome: AttributionOutcome
    order: float | None
    price: list[PriceEntry]


class FigureEntry(TypedDict):
    """A figure of one engine at every step, with the verdict on its error.

    An error is abs(measured - exact) / scale. `order` is that of the error in the step, under ``falls``;
    `reason` states why the engine cannot give the exact value, under ``cannot``.
    """

    engine: str
    trial: str
    figure: str
    unit: str
    exact: float
    scale: float
    tolerance: float
    measured: list[float]
    errors: list[float]
    verdict: VerdictKind
    order: float | None
    reason: str | None
    attribution: AttributionEntry | None


class NoResultEntry(TypedDict):
    """A trial that one engine refused, or in which it failed, at the step `dt`."""

    engine: str
    trial: str
    dt: float
    kind: str
    message: str


class CaseEntry(TypedDict):
    """A case with a closed form, and what was measured in it."""

    name: str
    title: str
    law: str
    source: str
    figures: list[FigureEntry]
    no_results: list[NoResultEntry]


class ContactsDocument(TypedDict):
    """Errors of engines against mechanics, by case.

    `not_done` is the number of trials of an engine that Ctrl-C left without a verdict.
    """

    schema: Literal["dynx.contacts/1"]
    steps: list[float]
    engines: list[EngineEntry]
    cases: list[CaseEntry]
    runs: int
    seconds: float
    not_done: int


def document(found: Conformance, seconds: float) -> ContactsDocument:
    """Return the document of a conformance."""
    return {
        "schema": SCHEMA,
        "steps": list(found.steps),
        "engines": [
            {
                "engine": name,
                "version": found.versions[name],
                "settings": dict(found.settings[name]),
                "in_effect": {key: list(values) for key, values in found.in_effect.get(name, {}).items()},
                "verdicts": found.counts(name),
            }
            for name in found.engines
        ],
        "cases": [_case(found, each) for each in found.cases],
        "runs": found.runs,
        "seconds": seconds,
        "not_done": found.not_done,
    }


def _case(found: Conformance, case: ContactCase) -> CaseEntry:
    return {
        "name": case.name,
        "title": case.title,
        "law": case.law,
        "source": case.source,
        "figures": [_figure(each) for each in found.results if each.case == case.name],
        "no_results": [
            _no_result(each) for each in (*found.refusals, *found.failures) if each.case == case.name
        ],
    }


def _figure(result: FigureResult) -> FigureEntry:
    verdict = result.verdict
    return {
        "engine": result.engine,
        "trial": result.trial,
        "figure": result.figure,
        "unit": result.unit,
        "exact": result.exact,
        "scale": result.scale,
        "tolerance": result.tolerance,
        "measured": list(result.measured),
        "errors": list(result.errors),
        "verdict": verdict.kind,
        "order": verdict.order,
        "reason": verdict.reason,
        "attribution": None if verdict.attribution is None else _attribution(verdict.attribution),
    }


def _attribution(attribution: Attribution) -> AttributionEntry:
    values: Mapping[str, tuple[Any, ...]] = attribution.values
    return {
        "settings": {name: [_plain(each) for each in tried] for name, tried in values.items()},
        "reason": attribution.reason,
        "errors": [list(each) for each in attribution.errors],
        "outcome": attribution.outcome,
        "order": attribution.order,
        "price": [
            {"trial": each.trial, "figure": each.figure, "before": each.before, "after": each.after}
            for each in attribution.price
        ],
    }


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def _no_result(lost: NoResult) -> NoResultEntry:
    return {
        "engine": lost.engine,
        "trial": lost.trial,
        "dt": lost.dt,
        "kind": lost.kind,
        "message": lost.message,
    }
