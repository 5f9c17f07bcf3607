"""Planted defects: `diagnose` finds each at its place, alone and in pairs, and nothing in clean robots.

Each is planted in one of the fastest robots alone, and in a pair with another; ``python -m
tests.doctor.planting`` plants it in ten robots of all, and in ten pairs.
"""

from __future__ import annotations

import pytest

from dynx.loaded import ENGINES, installed_engines, loader_class
from dynx.model.tree import Base
from dynx.rules import all_rules
from tests.doctor.planting.catalogue import EXEMPT, PLANTERS
from tests.doctor.planting.judging import complaint_about_clean, judge
from tests.doctor.planting.plan import Trial, pair_trials, plant_defects, single_trials
from tests.doctor.planting.robots import OWN, QUICK, REAL, ROBOTS, bases, clean_skeleton, clean_text
from tests.doctor.planting.site import CannotPlant

needs_all_engines = pytest.mark.skipif(
    set(installed_engines()) != set(ENGINES), reason="a cause shows in the engines that it concerns"
)

RULES = tuple(PLANTERS)


@needs_all_engines
def test_every_rule_that_holds_is_planted_and_no_other_is_exempt() -> None:
    versions = {engine: loader_class(engine).engine_version() for engine in installed_engines()}
    differences = [rule for rule in all_rules() if rule.kind == "difference" and "urdf" in rule.formats]
    holding = {rule.id for rule in differences if rule.holds_for(versions)}
    assert PLANTERS.keys() == holding
    assert EXEMPT.keys() == {rule.id for rule in differences} - holding


def test_there_are_robots_enough_and_real_ones_among_them() -> None:
    assert len(REAL) >= 10
    assert len({clean_skeleton(robot, "fixed").model.name for robot in ROBOTS}) >= 20
    assert set(OWN) < set(QUICK) < set(ROBOTS)


@needs_all_engines
@pytest.mark.parametrize(
    ("robot", "base"), [(robot, base) for robot in QUICK for base in bases(robot)], ids=str
)
def test_a_clean_robot_is_not_blamed(robot: str, base: Base) -> None:
    assert complaint_about_clean(robot, base) is None


@pytest.mark.long_cases
@needs_all_engines
@pytest.mark.parametrize("rule", RULES)
def test_a_defect_alone_is_named_at_its_place(rule: str) -> None:
    assert judge(next(single_trials([rule], 1, among=QUICK))).complaints == ()


@pytest.mark.long_cases
@needs_all_engines
@pytest.mark.parametrize("trial", list(pair_trials(RULES, 1, among=QUICK)), ids=str)
def test_two_defects_are_named_at_their_places(trial: Trial) -> None:
    assert judge(trial).complaints == ()


@pytest.mark.parametrize("rule", RULES)
def test_a_planter_repeats_itself_and_changes_little(rule: str) -> None:
    trial = next(single_trials([rule], 1, among=QUICK))
    once, again = plant_defects(trial)[-1], plant_defects(trial)[-1]
    assert once.source.text == again.source.text
    assert once.place == again.place
    assert once.place[0] == rule
    before = clean_text(trial.robot, trial.base).split("\n")
    kept = set(once.source.text.split("\n"))
    # A new name is written wherever the old one was mentioned.
    assert len({*before} ^ kept) > 0
    # Only a robot without inertial data is changed in every link.
    assert sum(line not in kept for line in before) <= (12 if rule != "DX118" else len(before))


def test_two_defects_are_never_planted_at_one_place() -> None:
    for trial in pair_trials(RULES, 1, seed=1, among=QUICK):
        one, other = plant_defects(trial)
        assert one.place[1:] != other.place[1:] or one.place[1:] == (None, None)


def test_a_planter_says_where_it_cannot_plant() -> None:
    with pytest.raises(CannotPlant, match="DX106 is no defect on the floating base"):
        plant_defects(Trial(("DX106",), "ur5", "floating", 0))
    with pytest.raises(CannotPlant, match="no second joint that moves"):
        plant_defects(Trial(("DX215",), "pendulum", "fixed", 0))
