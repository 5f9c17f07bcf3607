"""Causes of errors: what acts in a change, what it leaves of the error, and what it costs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import pytest

from dynx.contacts import Attribution, ContactCase, Figure, FigureResult, SettingsChange, conform
from dynx.world import Scene, World

STEPS = (4e-3, 2e-3, 1e-3)
REASON = "A factor that this engine has for the tests."
FRICTION, INERTIA = "friction_factor", "inertia_factor"


pytestmark = pytest.mark.usefixtures("exact")


class Planned(ContactCase):
    """Two trials, whose figures have errors that follow from the settings alone."""

    name: ClassVar[str] = "planned"
    title: ClassVar[str] = "Figures with planned errors"
    law: ClassVar[str] = "0"
    source: ClassVar[str] = "none"
    trials: ClassVar[dict[str, Any]] = {"one": 1, "other": 2}

    def scene(self, parameters: int) -> Scene:
        return Scene("nothing")

    def measure(self, world: World, parameters: int) -> Sequence[Figure]:
        friction, inertia = (world.settings[name] for name in (FRICTION, INERTIA))
        step = world.dt / STEPS[0]
        if parameters == 2:
            return [Figure("victim", 0.01 if friction == 2.0 else 0.5, 0.0, "", 1.0)]
        return [
            Figure("removed", 0.1 if friction == 2.0 else 1e-5, 0.0, "", 1.0),
            Figure("falls", 0.1 if friction == 2.0 else 0.1 * step, 0.0, "", 1.0),
            Figure("trades", 0.1 if friction == 2.0 else 0.4 * step**2, 0.0, "", 1.0),
            Figure("hardly", 0.1 if friction == 2.0 else 0.1005 * step, 0.0, "", 1.0),
            Figure("both", 0.1 if friction == 2.0 or inertia == 1.0 else 1e-5, 0.0, "", 1.0),
        ]


class OneFigure(Planned):
    """A trial with one figure, whose error a change removes."""

    name: ClassVar[str] = "one_figure"
    trials: ClassVar[dict[str, Any]] = {"": 1}

    def measure(self, world: World, parameters: int) -> Sequence[Figure]:
        return [Figure("removed", 0.1 if world.settings[FRICTION] == 2.0 else 1e-5, 0.0, "", 1.0)]


def results(*candidates: SettingsChange) -> dict[str, FigureResult]:
    """Return the results by figure, of a world with the friction doubled."""
    given, tried = {"exact": {FRICTION: 2.0}}, {"exact": candidates}
    found = conform(["exact"], STEPS, [Planned()], settings=given, candidates=tried, jobs=0)
    return {each.figure: each for each in found.results}


def cause(result: FigureResult) -> Attribution:
    """Return the cause of an error, which has to have one."""
    assert result.verdict.attribution is not None
    return result.verdict.attribution


def test_only_the_settings_that_act_are_the_cause() -> None:
    for change in ({FRICTION: (1.0,), INERTIA: (0.5,)}, {INERTIA: (0.5,), FRICTION: (1.0,)}):
        found = results(SettingsChange(change, REASON))
        assert cause(found["removed"]).values == {FRICTION: (2.0, 1.0)}
        assert cause(found["both"]).values == {FRICTION: (2.0, 1.0), INERTIA: (1.0, 0.5)}


def test_a_change_that_is_worse_at_some_step_is_no_cause() -> None:
    trades = results(SettingsChange({FRICTION: (1.0,)}, REASON))["trades"]
    assert trades.errors[0] < 0.4
    assert trades.verdict.kind == "unexplained"


def test_a_difference_within_the_tolerance_is_not_worse() -> None:
    hardly = results(SettingsChange({FRICTION: (1.0,)}, REASON))["hardly"]
    assert 0.0 < cause(hardly).errors[-1][0] - hardly.errors[0] < hardly.tolerance
    assert cause(hardly).outcome == "falls"


def test_an_error_that_then_falls_is_told_from_one_that_is_removed() -> None:
    found = results(SettingsChange({FRICTION: (1.0,)}, REASON))
    assert (cause(found["removed"]).outcome, cause(found["removed"]).order) == ("removed", None)
    falls = cause(found["falls"])
    assert falls.outcome == "falls"
    assert falls.order == pytest.approx(1.0)
    assert falls.errors[-1] == pytest.approx((0.1, 0.05, 0.025))


def test_other_errors_that_a_change_makes_worse_are_its_price() -> None:
    found = results(SettingsChange({FRICTION: (1.0,)}, REASON))
    (price,) = cause(found["removed"]).price
    assert (price.trial, price.figure, price.before, price.after) == ("other", "victim", 0.01, 0.5)


def runs_and_cause(*candidates: SettingsChange) -> tuple[int, Attribution | None]:
    """Return the number of runs that find the cause of one error, and the cause."""
    given, tried = {"exact": {FRICTION: 2.0}}, {"exact": candidates}
    found = conform(["exact"], STEPS, [OneFigure()], settings=given, candidates=tried, jobs=0)
    return found.runs, found.results[0].verdict.attribution


def test_values_beyond_the_first_that_is_a_cause_are_not_run() -> None:
    for values in ((1.0,), (1.0, 0.5)):
        runs, found = runs_and_cause(SettingsChange({FRICTION: values}, REASON))
        assert runs == 2 * len(STEPS)
        assert found is not None
        assert found.values == {FRICTION: (2.0, 1.0)}


def test_values_beyond_one_without_effect_are_not_run() -> None:
    runs, found = runs_and_cause(SettingsChange({INERTIA: (0.5, 0.25)}, REASON))
    assert (runs, found) == (len(STEPS) + 1, None)


def test_values_beyond_the_one_in_use_are_run() -> None:
    runs, found = runs_and_cause(SettingsChange({FRICTION: (2.0, 1.0)}, REASON))
    assert runs == 2 * len(STEPS)
    assert found is not None
    assert found.values == {FRICTION: (2.0, 1.0)}
