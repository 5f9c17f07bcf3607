"""Documents of ``dynx contacts`` for tests, without a run: one figure with each verdict."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from dynx.cli.contacts.run import ContactsDocument, document
from dynx.contacts import (
    Attribution,
    Conformance,
    ContactCase,
    Figure,
    FigureResult,
    NoResult,
    Price,
    Verdict,
)
from dynx.world import Scene, World

STEPS = (4e-3, 2e-3, 1e-3)
ENGINES = ("one", "two", "three")


class Sliding(ContactCase):
    """A case that is never run."""

    name = "sliding"
    title = "A brick that slides"
    law = "dv/dt = -mu g"
    source = "Coulomb's law of friction"

    def scene(self, parameters: Any) -> Scene:
        raise NotImplementedError

    def measure(self, world: World, parameters: Any) -> list[Figure]:
        raise NotImplementedError


def result(
    engine: str = "one", trial: str = "fast", errors: tuple[float, ...] = (4e-2, 2e-2, 1e-2), **given: Any
) -> FigureResult:
    """Return a result that falls at order 1 unless a verdict is given."""
    verdict = given.pop("verdict", Verdict("falls", order=1.0))
    measured = tuple(-2.0 * (1.0 + error) for error in errors)
    return FigureResult(
        *(engine, "sliding", trial, given.pop("figure", "acceleration"), "m/s^2", -2.0, 2.0, 1e-3),
        measured=measured,
        errors=errors,
        verdict=verdict,
    )


def softened() -> Verdict:
    """Return a verdict with a setting that is a list, of which one number changes."""
    values = {"impedance": ((0.9, 0.95), (0.99, 0.95)), "impratio": (1.0, 100.0), "substeps": (1, 1)}
    errors = ((3e-2,) * 3, (2e-3, 1e-3, 1e-4))
    return Verdict("setting", attribution=Attribution(values, "Contacts are soft.", errors, "falls", 3.0))


def stiffened() -> Verdict:
    """Return a verdict with a setting with which the error falls."""
    errors = ((1e-1,) * 3, (1e-2,) * 3, (1e-3,) * 3)
    values = {"stiffness": (1e6, 1e7, 1e8)}
    price = (Price("fast", "acceleration", 1e-3, 2e-1), Price("fast", "speed", 1e-3, math.inf))
    return Verdict(
        "setting", attribution=Attribution(values, "Contacts are springs.", errors, "proportion", 1.0, price)
    )


def conformance(text: str = "word", *, not_done: int = 0) -> Conformance:
    """Return results with every verdict, a refusal and a failure; `text` stands wherever a text may."""
    case = Sliding()
    case.title, case.law = text, text  # type: ignore[misc]
    results = (
        result("one", "fast", (1e-5, 1e-5, 0.0), verdict=Verdict("within")),
        result("two", "fast"),
        result("three", "fast", (3e-2,) * 3, verdict=softened()),
        result("one", "slow", (1e-1,) * 3, verdict=stiffened()),
        result("two", "slow", (1.0, math.inf, math.nan), verdict=Verdict("unexplained")),
        result("three", "slow", (1.0,) * 3, verdict=Verdict("cannot", reason=text)),
        *(result(engine, figure=text, errors=(0.0,) * 3, verdict=Verdict("within")) for engine in ENGINES),
    )
    return Conformance(
        STEPS,
        ENGINES,
        (case,),
        {"one": {"impratio": 10.0}, "two": {}, "three": {}},
        results,
        (NoResult("three", "sliding", "upward", 4e-3, "refused", text),),
        (NoResult("two", "sliding", "upward", 4e-3, "crash", text),),
        99,
        dict.fromkeys(ENGINES, "1.0"),
        not_done,
        {"one": {"impratio": (20.0, 15.0, 10.0)}},
    )


def example(text: str = "word", *, not_done: int = 0) -> ContactsDocument:
    """Return the document of `conformance`."""
    return document(conformance(text, not_done=not_done), 12.5)


def at_one_step(found: Conformance) -> Conformance:
    """Return what is left of results where only the largest step is run."""
    results = tuple(
        replace(each, measured=each.measured[:1], errors=each.errors[:1], verdict=Verdict("unexplained"))
        for each in found.results
    )
    return replace(found, steps=found.steps[:1], results=results)
