"""Closed forms of the cases, against exact mechanics that knows no case, right and falsified."""

from __future__ import annotations

from typing import Any

import pytest

from dynx.contacts import ContactCase, Figure, find_case
from dynx.contacts.cases import collisions, friction
from dynx.contacts.motion import G
from dynx.world import World

CASES = (
    "resting_force",
    "resting_depth",
    "slope",
    "friction_isotropy",
    "fast_slide",
    "rolling",
    "sliding_to_rolling",
    "rebound",
)
"""Cases whose bodies `ExactWorld` can move."""

FAULTS = (
    ("resting_force", {"weight_factor": 1.01}),
    ("resting_depth", {"depth": 1e-4}),
    ("slope", {"friction_factor": 2.0}),
    ("slope", {"friction_factor": 0.5}),
    ("slope", {"creep": 1e-3}),
    ("friction_isotropy", {"friction_factor": 2.0}),
    ("friction_isotropy", {"friction_factor": 1.01}),
    ("friction_isotropy", {"pyramid": True}),
    ("fast_slide", {"friction_factor": 1.01}),
    ("rolling", {"inertia_factor": 1.1}),
    ("rolling", {"friction_factor": 0.05}),
    ("sliding_to_rolling", {"friction_factor": 2.0}),
    ("sliding_to_rolling", {"friction_factor": 0.5}),
    ("sliding_to_rolling", {"inertia_factor": 1.1}),
    ("rebound", {"restitution_factor": 0.95}),
    ("rebound", {"restitution_factor": 0.0}),
)
"""Cases, and settings of `ExactWorld` that they have to notice."""


pytestmark = pytest.mark.usefixtures("exact")


def figures(case: ContactCase, trial: str, dt: float, **settings: Any) -> list[Figure]:
    """Return the figures of a trial in the exact world."""
    parameters = case.trials[trial]
    interval = case.contact_interval
    with World(case.scene(parameters), "exact", dt, contact_interval=interval, **settings) as world:
        return list(case.measure(world, parameters))


@pytest.mark.parametrize("name", CASES)
def test_exact_mechanics_has_no_error(name: str) -> None:
    case = find_case(name)
    for trial in case.trials:
        for figure in figures(case, trial, 2e-3):
            assert figure.error <= figure.tolerance, figure


def test_creep_on_a_slope_is_relative_to_the_speed_of_a_fall_by_the_height_of_the_box() -> None:
    (creep,) = figures(find_case("slope"), "tangent 0.4", 4e-3)
    assert creep.scale**2 / 2.0 == pytest.approx(G * friction.SLOPE_SIZE[2])


def test_each_rebound_is_lower_by_the_square_of_the_restitution(monkeypatch: pytest.MonkeyPatch) -> None:
    heights, dt = collisions.BOUNCING_BALL_HEIGHTS[::5], 2e-3
    monkeypatch.setattr(collisions, "BOUNCING_BALL_HEIGHTS", heights)
    case = find_case("bouncing_ball")
    (trial,) = case.trials
    # A ball turns at most half a step away from the highest state of its flight.
    sampling = 0.5 * G * (0.5 * dt) ** 2 / min(heights)
    for factor in (1.0, 0.95):
        found = figures(case, trial, dt, restitution_factor=factor)
        exact = [collisions.RESTITUTION ** (2 * n) for n in range(1, len(found) + 1)]
        assert [figure.exact for figure in found] == exact
        for n, figure in enumerate(found, 1):
            # The figure is above the exact value by the deviation, whichever its sign.
            lower = 1.0 - factor ** (2 * n)
            assert figure.measured / figure.exact - 1.0 == pytest.approx(
                lower, abs=sampling / figure.exact + 1e-9
            )


@pytest.mark.parametrize(
    ("name", "settings"),
    FAULTS,
    ids=lambda part: "-".join(part) if isinstance(part, dict) else part,
)
def test_false_mechanics_has_errors(name: str, settings: dict[str, Any]) -> None:
    case = find_case(name)
    found = [figure for trial in case.trials for figure in figures(case, trial, 4e-3, **settings)]
    assert any(figure.error > figure.tolerance for figure in found)
