"""A cause is proved by removing it alone, and by an engine that is right once all are removed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import pytest

from dynx.doctor.attribution import AttributedCause, CauseAttributor
from dynx.doctor.examination import LOADING, TORQUE
from dynx.doctor.mending import mend
from dynx.loaded import LoadedRobot
from dynx.rules import Case, Detection, Remedy, Rule, find_rule
from dynx.spatial.scalar import Floats
from tests.doctor.faulty_engine import NAME, SECRET, FaultyEngine, examiner
from tests.rules.documents import case_of, joint, link

BAR = 1e-12
FRAME = '<link name="{}"/>'
TWO = case_of(
    *(link("base"), FRAME.format("near"), FRAME.format("far")),
    joint("j", "base", "near"),
    joint("k", "near", "far", '<origin xyz="2 0 0.1" rpy="0.5 0 0"/>', type="prismatic"),
    *(link("hand", center=(0.1, 0.2, 0.3)), joint("w", "far", "hand", type="fixed")),
)


class Replacement(Rule):
    """Rule that replaces a text by another."""

    id = "DX998"
    name = "text-replaced"
    engines: ClassVar[Mapping[str, str]] = {NAME: ">=3.2.7"}

    def __init__(self, old: str, new: str, *, changes_physics: bool = False) -> None:
        self._old, self._new, self._changes = old, new, changes_physics

    def occurrences(self, case: Case) -> Sequence[Detection]:
        return [Detection(None, None, None, "found")] if self._old in case.source.text else []

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy:
        text = case.source.text.replace(self._old, self._new)
        new = type(case.source)(text, case.source.source)
        return Remedy(case.with_source(new), "replaced it", changes_physics=self._changes)


class Heavy(FaultyEngine):
    """Torques are 1 % too large, for which there is no rule."""

    def inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        return 1.01 * super().inverse_dynamics(q, v, a)


def attribute(
    case: Case,
    *rules: Rule,
    engine: type[LoadedRobot] = FaultyEngine,
    tolerance: float = BAR,
) -> list[AttributedCause]:
    """Attribute the differences in a case to rules."""
    made = examiner(engine)
    before, after = made.examine(case), made.examine(mend(case, rules).case)
    attributor = CauseAttributor(made, case, rules, before, after, tolerance, lambda step: None)
    return [each for rule in rules for each in attributor.attribute(rule, rule.detect(case))]


def test_a_cause_that_explains_all_is_proved_at_each_place_with_its_own_effect() -> None:
    near, far = attribute(TWO, find_rule("DX101"))
    assert near.proved
    assert far.proved
    assert near.largest_effect is not None
    assert far.largest_effect is not None
    # The far link slides along z and contributes to fewer torques.
    assert near.largest_effect.relative_error != far.largest_effect.relative_error
    assert {*near.effects, *far.effects} == {NAME}


@pytest.mark.parametrize("tolerance", [BAR, 1e-3])
def test_an_effect_below_the_tolerance_is_none(tolerance: float) -> None:
    case = case_of(
        *(link("base"), link("arm", mass=1e4, moments=(2e4, 2e4, 2e4)), FRAME.format("tool")),
        joint("j", "base", "arm"),
        joint("k", "arm", "tool", type="fixed"),
    )
    (found,) = attribute(case, find_rule("DX101"), tolerance=tolerance)
    # 1 kg m^2 more than the arm's 2e4.
    assert bool(found.effects) == (tolerance == BAR)
    assert found.proved == (tolerance == BAR)
    assert (found.largest_effect is None) == (tolerance > BAR)


def test_a_cause_is_not_proved_where_the_engine_stays_wrong() -> None:
    arm = link("arm", center=(0.1, 0.2, 0.3))
    case = case_of(
        link("base"), arm, FRAME.format("tool"), joint("j", "base", "arm"), joint("k", "arm", "tool")
    )
    (found,) = attribute(case, find_rule("DX101"), engine=Heavy)
    assert found.effects
    assert not found.proved


def test_a_remedy_that_changes_the_robot_has_no_effect_on_an_engine_that_is_right() -> None:
    case = case_of(*(link("base"), link("arm", center=(0.1, 0.2, 0.3))), joint("j", "base", "arm"))
    rule = Replacement('<mass value="1.0"/>', '<mass value="2.0"/>', changes_physics=True)
    (found,) = attribute(case, rule)
    assert not found.effects
    assert not found.proved


def test_of_two_refusals_each_is_proved_among_the_mended() -> None:
    case = case_of(link("base"), f"<!-- {SECRET} one -->", f"<!-- {SECRET} two -->")
    rules = [Replacement(f"{SECRET} {number}", "") for number in ("one", "two")]
    for found in attribute(case, *rules):
        assert found.proved
        assert found.effects[NAME].quantity == LOADING
        assert found.effects[NAME].relative_error == float("inf")


def test_a_rule_has_no_effect_on_an_engine_that_it_does_not_name() -> None:
    class Silent(Replacement):
        engines: ClassVar[Mapping[str, str]] = {"drake": ">=1.51.1"}

    (found,) = attribute(case_of(link("base"), f"<!-- {SECRET} -->"), Silent(SECRET, ""))
    assert not found.effects
    assert not found.proved


def test_the_quantity_is_the_one_that_moves_most() -> None:
    class Wrong(FaultyEngine):
        def inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
            links = self.right.model.links
            right = super().inverse_dynamics(q, v, a)
            return right if all(each.name != "odd" for each in links) else 3.0 * right

    case = case_of(*(link("base"), link("odd", center=(0.1, 0.2, 0.3))), joint("j", "base", "odd"))
    (found,) = attribute(case, Replacement('"odd"', '"even"', changes_physics=True), engine=Wrong)
    assert found.largest_effect is not None
    assert found.largest_effect.quantity == TORQUE
    assert found.largest_effect.relative_error == pytest.approx(2.0)
