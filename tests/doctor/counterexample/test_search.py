"""Differences are reduced to the smallest robot and the simplest state that show them."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dynx import load
from dynx.agreement.tolerances import BAR
from dynx.doctor import counterexample
from dynx.doctor.counterexample import INITIAL_STATES, complexity, smallest_counterexample
from dynx.doctor.examination import model_without_mimics
from dynx.doctor.report import Counterexample
from dynx.errors import DynxError
from dynx.model import Model
from dynx.model.documents import bare_urdf
from dynx.model.library import find
from dynx.model.tree import Base
from dynx.model.xml.source import XmlSource
from dynx.reference.backend import ReferenceBackend
from dynx.rules import Case
from dynx.spatial.scalar import Floats
from dynx.testing.strategies import models
from tests.examples import PROFILE

Difference = Callable[[Case, Model, Floats, Floats, Floats], float]


def case_of(robot: str, base: Base = "fixed") -> Case:
    return Case(XmlSource(find(robot).read_bytes(), robot), base)


def find_counterexample(
    case: Case, difference: Difference, budget: float | None = None, seed: int = 0
) -> Counterexample:
    result = smallest_counterexample(case, difference, tolerance=BAR, seed=seed, budget=budget)
    assert result is not None
    return result


def assert_shows(result: Counterexample, difference: Difference, base: Base) -> Model:
    """Check that the text loads, the state fits the robot, and the error is the reported one."""
    case = Case(XmlSource(result.urdf), base)
    model = model_without_mimics(case.source, base)
    q, v, a = (np.array(row) for row in (result.q, result.v, result.a))
    assert (len(q), len(v), len(a)) == (model.nq, model.nv, model.nv)
    assert result.relative_error > BAR
    assert difference(case, model, q, v, a) == result.relative_error
    assert result.moving_joints == len(model.joint_names)
    return model


def error_at_angle(link: str, joint: str) -> Difference:
    """Simulate an engine with an error if the link exists and the joint is not at zero."""

    def difference(case: Case, model: Model, q: Floats, v: Floats, a: Floats) -> float:
        if link not in {each.name for each in model.links} or joint not in model.joint_names:
            return 0.0
        turned = q[model.joint_names.index(joint) + model.nq - len(model.joint_names)]
        return 0.25 if abs(turned) > 0.01 else 0.0

    return difference


def error_of_unit_mass(link: str) -> Difference:
    """Simulate an engine that reads the mass of a link as 1 kg, in inverse dynamics."""

    def difference(case: Case, model: Model, q: Floats, v: Floats, a: Floats) -> float:
        links = tuple(
            replace(each, inertial=replace(each.inertial, mass=1.0))
            if each.name == link and each.inertial is not None
            else each
            for each in model.links
        )
        torques = []
        for robot in (model, replace(model, links=links)):
            with ReferenceBackend(robot) as engine:
                torques.append(engine.inverse_dynamics(q, v, a))
        size = max(float(np.max(np.abs(torque), initial=0.0)) for torque in torques)
        gap = float(np.max(np.abs(torques[0] - torques[1]), initial=0.0))
        return gap / size if size else 0.0

    return difference


@pytest.mark.long_cases
@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize(
    ("robot", "link", "joint"),
    [
        ("talos", "gripper_right_inner_double_link", "arm_left_2_joint"),
        ("talos", "base_link", "leg_right_6_joint"),
        ("tiago", "xtion_optical_frame", "arm_1_joint"),
    ],
)
def test_a_link_and_a_joint_are_all_that_stays(robot: str, link: str, joint: str, base: Base) -> None:
    difference = error_at_angle(link, joint)
    result = find_counterexample(case_of(robot, base), difference)
    model = assert_shows(result, difference, base)
    assert len(model.links) == 2
    assert model.joint_names == (joint,)
    assert list(result.q[:-1]) == model.neutral()[:-1].tolist()
    assert complexity(repr(result.q[-1])) <= complexity("0.5")
    assert model.lower[-1] <= result.q[-1] <= model.upper[-1]
    assert not any(result.v)
    assert not any(result.a)


@pytest.mark.parametrize(
    ("base", "links", "moving"), [("fixed", 2, 1), ("floating", 1, 0)], ids=["fixed", "floating"]
)
@pytest.mark.parametrize(
    ("robot", "link"), [("talos", "arm_left_5_link"), ("tiago", "arm_4_link")], ids=["talos", "tiago"]
)
def test_a_mass_that_is_read_wrong(robot: str, link: str, base: Base, links: int, moving: int) -> None:
    difference = error_of_unit_mass(link)
    result = find_counterexample(case_of(robot, base), difference)
    model = assert_shows(result, difference, base)
    assert link in {each.name for each in model.links}
    assert (len(model.links), result.moving_joints) == (links, moving)
    # Gravity alone shows it, so nothing has to move but, with the base fixed, a joint's own angle.
    assert sum(x != 0.0 for x in (*result.v, *result.a)) <= 1


def test_a_difference_in_the_text_is_kept() -> None:
    def difference(case: Case, model: Model, q: Floats, v: Floats, a: Floats) -> float:
        axes = [axis for joint in case.joints.values() for axis in joint.all("axis")]
        return 1.0 if any("  " in axis.attributes.get("xyz", "") for axis in axes) else 0.0

    text = find("ur5").read_text(encoding="utf-8").replace('<axis xyz="0 1 0"', '<axis xyz="0  1 0"')
    case = Case(XmlSource(text))
    result = find_counterexample(case, difference)
    model = assert_shows(result, difference, "fixed")
    assert len(model.links) == 2
    assert 'xyz="0  1 0"' in result.urdf


def test_two_parts_of_the_state_that_must_change_at_once() -> None:
    """Only Hypothesis changes both signs at once; the greedy reduction cannot change one alone."""

    def difference(case: Case, model: Model, q: Floats, v: Floats, a: Floats) -> float:
        return 1.0 if model.nv >= 2 and v[0] * v[1] > 0.0 else 0.0

    for seed in range(1, 5):
        result = find_counterexample(case_of("double_pendulum"), difference, seed=seed)
        assert result.v == (1.0, 1.0)


def test_without_hypothesis(monkeypatch: pytest.MonkeyPatch) -> None:
    difference = error_at_angle("base_link", "leg_right_6_joint")
    with_it = find_counterexample(case_of("talos"), difference)
    monkeypatch.setitem(sys.modules, "hypothesis", None)
    assert find_counterexample(case_of("talos"), difference) == with_it


def test_nothing_is_left_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    find_counterexample(
        case_of("double_pendulum"), lambda case, model, q, v, a: float(np.max(np.abs(v), initial=0.0))
    )
    assert list(tmp_path.iterdir()) == []


def test_no_counterexample() -> None:
    never = smallest_counterexample(case_of("ur5"), lambda *_: BAR, tolerance=BAR, seed=0, budget=None)
    assert never is None
    no_robot = Case(XmlSource("<robot name='r'><link name='a'/><link name='b'/></robot>"))
    assert smallest_counterexample(no_robot, lambda *_: 1.0, tolerance=BAR, seed=0, budget=None) is None


def test_a_nan_is_an_infinite_error() -> None:
    result = find_counterexample(case_of("ur5"), lambda *_: float("nan"))
    assert result.relative_error == float("inf")
    assert result.moving_joints == 0


def test_a_real_difference_does_not_end_as_noise() -> None:
    """Rounding noise of the smallest robots is above the tolerance here, and is no counterexample."""

    def difference(case: Case, model: Model, q: Floats, v: Floats, a: Floats) -> float:
        return 0.5 if "wrist_3_joint" in model.joint_names else 10 * BAR

    assert find_counterexample(case_of("ur5"), difference).relative_error == 0.5


class Clock:
    """Clock that advances by one second with each evaluation of the difference."""

    def __init__(self, difference: Difference) -> None:
        self.now = 0.0
        self._difference = difference

    def __call__(self) -> float:
        return self.now

    def difference(self, case: Case, model: Model, q: Floats, v: Floats, a: Floats) -> float:
        self.now += 1.0
        return self._difference(case, model, q, v, a)


@pytest.mark.parametrize("budget", [1, INITIAL_STATES + 1, 30])
def test_the_budget_is_respected(budget: int, monkeypatch: pytest.MonkeyPatch) -> None:
    difference = error_at_angle("arm_4_link", "arm_3_joint")
    clock = Clock(difference)
    monkeypatch.setattr(counterexample, "perf_counter", clock)
    result = smallest_counterexample(
        case_of("tiago"), clock.difference, tolerance=BAR, seed=0, budget=float(budget)
    )
    assert clock.now <= budget
    if result is not None:
        assert_shows(result, difference, "fixed")


def test_the_number_of_trials_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    difference = error_at_angle("arm_4_link", "arm_3_joint")
    clock = Clock(difference)
    monkeypatch.setattr(counterexample, "MAX_TRIALS", 40)
    assert_shows(find_counterexample(case_of("tiago"), clock.difference), difference, "fixed")
    assert clock.now <= 40


@st.composite
def robots_with_a_difference(draw: st.DrawFn) -> tuple[Case, Difference]:
    """Draw a robot, and an engine with an error that depends on a joint angle or on the mass of a link."""
    model = draw(models(from_urdf=True, locks=False, min_links=2))
    case = Case(XmlSource(bare_urdf(model), "<random>"), model.base)
    names = [link.name for link in model.links]
    moving = [joint.name for joint in model.joints if joint.moves]
    link = draw(st.sampled_from(names))
    about_a_mass = draw(st.booleans())
    if moving and not about_a_mass:
        return case, error_at_angle(link, draw(st.sampled_from(moving)))
    return case, error_of_unit_mass(link)


@settings(max_examples=min(PROFILE, max(20, PROFILE // 4)))  # each example examines a hundred robots
@given(robots_with_a_difference(), st.integers(0, 3))
def test_on_random_robots(robot: tuple[Case, Difference], seed: int) -> None:
    case, difference = robot
    try:
        result = smallest_counterexample(case, difference, tolerance=BAR, seed=seed, budget=None)
    except DynxError as error:
        raise AssertionError(f"{error}\n{case.source.text}") from error
    if result is None:
        return
    model = assert_shows(result, difference, case.base)
    original = model_without_mimics(case.source, case.base)
    assert len(model.links) <= len(original.links)
    assert result.moving_joints <= len(original.joint_names)
    assert load(result.urdf, base=case.base).nv <= original.nv
    again = smallest_counterexample(case, difference, tolerance=BAR, seed=seed, budget=None)
    assert again == result
