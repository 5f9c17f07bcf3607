"""Verdicts of `conform` on an engine of exact mechanics with planted faults."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping, Sequence
from importlib.util import find_spec
from typing import Any, ClassVar

import pytest

from dynx.contacts import Conformance, ContactCase, Figure, FigureResult, SettingsChange, conform
from dynx.contacts.cases.friction import Slope
from dynx.contacts.run import Measured
from dynx.contacts.verdict import TrialOfEngine, collect
from dynx.errors import ArgumentError, UnknownBackendError, UnknownNameError
from dynx.model import Pose
from dynx.world import Scene, World, box, ground

STEPS = (8e-3, 4e-3, 2e-3)
REASON = "A factor that this engine has for the tests."


pytestmark = pytest.mark.usefixtures("exact")


def conformance(
    cases: Sequence[str | ContactCase],
    settings: Mapping[str, Any] | None = None,
    candidates: Sequence[SettingsChange] = (),
    jobs: int = 0,
    **options: Any,
) -> Conformance:
    """Return the results of cases in the exact world, falsified by settings."""
    given, tried = {"exact": settings or {}}, {"exact": candidates}
    return conform(["exact"], STEPS, cases, settings=given, candidates=tried, jobs=jobs, **options)


def figure(found: Conformance, name: str) -> FigureResult:
    """Return the only result of a figure."""
    (result,) = (result for result in found.results if result.figure == name)
    return result


def test_exact_mechanics_is_exact() -> None:
    found = conformance(["slope"])
    assert found.engines == ("exact",)
    assert found.steps == STEPS
    assert {result.verdict.kind for result in found.results} == {"within"}
    assert found.runs == 6
    assert found.unexplained == ()


def test_an_error_is_attributed_to_the_setting_that_removes_it() -> None:
    candidates = [
        SettingsChange({"restitution_factor": (0.5, 0.0)}, "It plays no part."),
        SettingsChange({"friction_factor": (1.4, 1.0)}, REASON),
    ]
    found = conformance(["sliding_to_rolling"], {"friction_factor": 2.0}, candidates)
    result = figure(found, "distance")
    attribution = result.verdict.attribution
    assert result.verdict.kind == "setting"
    assert attribution is not None
    assert attribution.reason == REASON
    assert attribution.values == {"friction_factor": (2.0, 1.0)}
    assert attribution.before == result.errors[-1] > result.tolerance > attribution.after


def test_an_error_without_a_cause_is_unexplained() -> None:
    candidates = [SettingsChange({"restitution_factor": (0.5, 0.0)}, "It plays no part.")]
    found = conformance(["sliding_to_rolling"], {"friction_factor": 2.0}, candidates)
    assert figure(found, "distance").verdict.kind == "unexplained"
    assert found.unexplained == (figure(found, "distance"),)
    # The speed at the end does not depend on friction.
    assert figure(found, "speed").verdict.kind == "within"


def test_an_error_that_a_change_reduces_and_does_not_remove_is_unexplained() -> None:
    candidates = [SettingsChange({"friction_factor": (1.2,)}, REASON)]
    found = conformance(["sliding_to_rolling"], {"friction_factor": 2.0}, candidates)
    assert figure(found, "distance").verdict.kind == "unexplained"


def test_an_error_in_proportion_to_a_setting_is_attributed_to_it() -> None:
    candidates = [SettingsChange({"depth": (5e-3, 2.5e-3)}, REASON)]
    found = conformance(["resting_depth"], {"depth": 1e-2}, candidates)
    attribution = figure(found, "depth of the ball").verdict.attribution
    assert attribution is not None
    assert attribution.order == pytest.approx(1.0, abs=0.05)
    assert attribution.values == {"depth": (1e-2, 5e-3, 2.5e-3)}
    assert attribution.after < 0.3 * attribution.before


def test_a_setting_that_is_beyond_the_values_tried_is_no_cause_in_proportion() -> None:
    candidates = [SettingsChange({"depth": (1e-2, 2e-2)}, REASON)]
    found = conformance(["resting_depth"], {"depth": 1e-2}, candidates)
    assert figure(found, "depth of the ball").verdict.kind == "unexplained"


def test_two_settings_are_a_cause_together_where_neither_is_alone() -> None:
    candidates = [
        SettingsChange({"friction_factor": (1.0,)}, "Friction."),
        SettingsChange({"inertia_factor": (1.0,)}, "Inertia."),
        SettingsChange({"friction_factor": (1.0,), "inertia_factor": (1.0,)}, REASON),
    ]
    given = {"friction_factor": 1.5, "inertia_factor": 0.2}
    found = conformance(["sliding_to_rolling"], given, candidates)
    attribution = figure(found, "distance").verdict.attribution
    assert attribution is not None
    assert attribution.reason == REASON
    assert attribution.values == {"friction_factor": (1.5, 1.0), "inertia_factor": (0.2, 1.0)}


class Euler(ContactCase):
    """A ball in free fall, whose figures have known errors."""

    name: ClassVar[str] = "euler"
    title: ClassVar[str] = "Figures with known errors"
    law: ClassVar[str] = "0"
    source: ClassVar[str] = "none"

    def scene(self, parameters: None) -> Scene:
        return Scene("nothing")

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        error = world.dt / STEPS[0]
        return [
            Figure("first", error, 0.0, "", 1.0),
            Figure("second", error**2, 0.0, "", 1.0),
            Figure("constant", 0.1, 0.0, "", 1.0),
        ]


def test_errors_that_fall_have_their_order() -> None:
    found = conformance([Euler()])
    for name, order in (("first", 1.0), ("second", 2.0)):
        verdict = figure(found, name).verdict
        assert verdict.kind == "falls"
        assert verdict.order == pytest.approx(order)
    assert figure(found, "constant").verdict.kind == "unexplained"
    assert found.counts() == {"within": 0, "falls": 2, "setting": 0, "cannot": 0, "unexplained": 1}


class Fatal(Euler):
    """A case that ends its process at the smallest step."""

    name: ClassVar[str] = "fatal"

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        if world.dt == STEPS[-1]:
            os._exit(3)
        return super().measure(world, parameters)


def test_a_crash_is_recorded_and_ends_nothing_else() -> None:
    found = conformance([Fatal(), "sliding_to_rolling"], jobs=1)
    assert [(each.kind, each.dt) for each in found.failures] == [("crash", STEPS[-1])]
    assert {result.case for result in found.results} == {"sliding_to_rolling"}


def test_results_do_not_depend_on_the_number_of_processes() -> None:
    cases = ["slope", "sliding_to_rolling"]
    one, two = (
        conform(["exact"], STEPS, cases, settings={"exact": {"creep": 1e-3}}, candidates={}, jobs=jobs)
        for jobs in (0, 1)
    )
    assert one.results == two.results


def test_progress_counts_every_run() -> None:
    calls: list[tuple[int, int]] = []
    found = conformance([Euler()], progress=lambda done, total: calls.append((done, total)))
    assert calls == [(1, 3), (2, 3), (3, 3)]
    assert found.runs == 3


def test_bad_arguments_are_refused_before_any_run() -> None:
    with pytest.raises(UnknownBackendError, match="exact"):
        conform(["exakt"])
    with pytest.raises(UnknownNameError, match="slope"):
        conform(["exact"], cases=["slop"])
    with pytest.raises(UnknownNameError, match="friction_factor"):
        conformance(["slope"], {"friction_faktor": 1.0})
    with pytest.raises(UnknownNameError, match="which does not run"):
        conform(["exact"], settings={"mujoco": {}})
    with pytest.raises(ArgumentError, match="at least one step"):
        conform(["exact"], steps=[])
    with pytest.raises(ArgumentError, match="a step"):
        conform(["exact"], steps=[-1e-3])


def test_a_lacking_coefficient_excuses_only_figures_that_rest_on_it() -> None:
    figures = (
        Figure("height", 0.0, 0.25, "m", 1.0, rests_on=("restitution",)),
        Figure("weight", 0.0, 9.81, "N", 9.81),
    )
    trial = TrialOfEngine("exact", Euler(), "")
    outcomes = [Measured(figures, lacking={"restitution": "it has none"})] * 3
    height, weight = collect(trial, outcomes)
    assert height.reason == "it has none"
    assert weight.reason is None


@pytest.mark.parametrize("scale", [0.0, -1.0, float("nan")])
def test_errors_are_relative_to_a_positive_scale(scale: float) -> None:
    with pytest.raises(ArgumentError, match="scale of the figure 'height'"):
        Figure("height", 1.0, 2.0, "m", scale)


class Resting(ContactCase):
    """A box at rest, of which a function gives the figures."""

    name = "resting"
    title = "A box at rest"
    law = "v = 0"
    source = "balance of forces"

    def __init__(self, figures: Callable[[World], Any]) -> None:
        self._figures = figures

    def scene(self, parameters: Any) -> Scene:
        cube = box("cube", (0.1, 0.1, 0.1), mass=1.0, pose=Pose((0.0, 0.0, 0.05)))
        return Scene("box", bodies=(ground(), cube))

    def measure(self, world: World, parameters: Any) -> Any:
        return self._figures(world)


def still(world: World) -> list[Figure]:
    return [Figure("speed", 0.0, 0.0, "m/s", 1.0)]


class Taken(Resting):
    name = "slope"


class Untitled(Resting):
    title = ""


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"engines": "exact"}, "engines is 'exact'; wanted a list of names"),
        ({"cases": "slope"}, "cases is 'slope'; wanted a list of names and cases"),
        ({"cases": [Slope]}, r"is the class Slope; wanted an instance, Slope\(\)"),
        ({"cases": [3]}, "a case is of type int"),
        ({"cases": [Taken(still)]}, "has the name 'slope', which is one of dynx's own"),
        ({"cases": [Resting(still), Resting(still)]}, "two cases have the name 'resting'"),
        ({"cases": ["slope", Slope()]}, "two cases have the name 'slope'"),
        ({"cases": [Untitled(still)]}, "Untitled has no title"),
        ({"steps": 1e-3}, "steps is '0.001'; wanted a list of steps"),
        ({"steps": [1e-9]}, "a step is 1e-09 s; wanted 1e-06 to 0.1 s"),
        ({"steps": [100.0, 1e-3]}, "a step is 100 s; wanted"),
        ({"settings": {"exact": {"substeps": 0}}}, "substeps is '0'; wanted a whole number"),
        ({"settings": {"exact": 3}}, "settings of exact is of type int"),
        ({"settings": 3}, "settings is of type int"),
    ],
)
def test_arguments_that_cannot_be_used_are_named(arguments: dict[str, Any], message: str) -> None:
    given: dict[str, Any] = {"engines": ["exact"], "steps": [4e-3], "cases": ["slope"], "jobs": 0}
    with pytest.raises(ArgumentError, match=message):
        conform(**given | arguments)


def test_substeps_are_taken_in_every_step() -> None:
    taken = []

    def count(world: World) -> list[Figure]:
        taken.append(world.substeps)
        return still(world)

    conform(["exact"], [4e-3], [Resting(count)], settings={"exact": {"substeps": 8}}, jobs=0)
    assert taken == [8]


def oops(world: World) -> list[Figure]:
    raise ValueError("oops")


def late(world: World) -> list[Figure]:
    return [*still(world), Figure("late", 0.0, 0.0, "", 1.0)] if world.dt < 3e-3 else still(world)


@pytest.mark.parametrize(
    ("figures", "message"),
    [
        (lambda world: [], "measure returned no figures"),
        (lambda world: None, "measure returned no figures"),
        (lambda world: [*still(world), *still(world)], "two figures of the name 'speed'"),
        (lambda world: [Figure("speed", float("nan"), 0.0, "m/s", 1.0)], "the figure 'speed' is nan"),
        (lambda world: [Figure("speed", 0.0, float("nan"), "m/s", 1.0)], "exact value of the figure 'speed'"),
        (oops, r"test_conform\.py:\d+: ValueError: oops"),
    ],
)
def test_what_a_case_measures_is_checked(figures: Callable[[World], Any], message: str) -> None:
    found = conform(["exact"], [4e-3], [Resting(figures)], jobs=0)
    assert not found.results
    (lost,) = found.failures
    assert lost.kind == "error"
    assert re.search(message, lost.message)


def test_figures_are_the_same_at_every_step() -> None:
    with pytest.raises(ArgumentError, match="'resting' has the figures speed at one step and speed, late"):
        conform(["exact"], [4e-3, 2e-3], [Resting(late)], jobs=0)


@pytest.mark.skipif(find_spec("mujoco") is None, reason="needs MuJoCo")
def test_settings_that_an_engine_raises_are_returned_with_those_in_effect() -> None:
    given = {"mujoco": {"time_constant": 0.003, "impratio": 10.0, "slip_time_constant": 0.01}}
    found = conform(["mujoco"], [4e-3, 1e-3], [Resting(still)], settings=given, jobs=0)
    assert found.in_effect == {"mujoco": {"time_constant": (0.008, 0.003)}}
    given["mujoco"]["substeps"] = 4
    assert conform(["mujoco"], [4e-3], [Resting(still)], settings=given, jobs=0).in_effect["mujoco"] == {}
