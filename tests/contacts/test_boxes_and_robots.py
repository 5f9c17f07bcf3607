"""Closed forms of boxes and robots, against equations of motion that are integrated; cases on engines."""

from __future__ import annotations

import math
import re
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import dynx
from dynx.contacts import case_names, conform, find_case
from dynx.contacts.cases import friction, resting
from dynx.contacts.motion import G
from dynx.contacts.run import CaseRun, Measured, carry_out
from dynx.errors import ArgumentError
from dynx.spatial.scalar import Floats
from dynx.steppers.registry import installed_worlds
from dynx.world import Material
from tests.cli.contacts.documents import Sliding
from tests.world.engines import WORLDS


def tip(b: float, h: float, force: Floats, push: Floats | None, angle: float) -> tuple[float, float]:
    """Return the angular velocity of a box of 1 kg that has turned by `angle` about its lower edge, and the
    largest ratio of friction and normal force on the way.

    `force` (2,) acts at the centre and `push` (2,) at the middle of the top; x points to the edge, z up.
    """
    inertia, phi, w, step = (b * b + h * h) * 4.0 / 3.0, 0.0, 0.0, 1e-5
    worst, before = 0.0, 0.0
    while phi < angle:
        c, s = math.cos(phi), math.sin(phi)
        turn = np.array([[c, s], [-s, c]])
        center, top = turn @ (-b, h), turn @ (-b, 2.0 * h)
        total = force if push is None else force + push
        moment = center[1] * force[0] - center[0] * force[1]
        if push is not None:
            moment += top[1] * push[0] - top[0] * push[1]
        alpha = moment / inertia
        # The centre moves on a circle: the force of the ground is what that takes beside the other forces.
        ground = alpha * np.array([center[1], -center[0]]) - w * w * center - total
        worst = max(worst, abs(ground[0]) / ground[1])
        before = w
        w += step * alpha
        phi += step * 0.5 * (w + before)
    return w, worst


@pytest.mark.parametrize("angle", friction.ANGLES)
def test_a_box_tips_on_a_slope_as_its_equation_of_motion_says(angle: float) -> None:
    slope = math.atan(friction.TippingBox.trials["tips"].tangent)
    force = G * np.array([math.sin(slope), -math.cos(slope)])
    w, ratio = tip(friction.HALF_WIDTH, friction.HALF_HEIGHT, force, None, angle)
    assert math.isclose(friction.tipping_speed_on_slope(slope, angle), w, rel_tol=1e-4)
    # The edge does not slip.
    assert ratio < friction.TippingBox.trials["tips"].friction


def test_a_box_does_not_tip_below_the_threshold() -> None:
    slope = math.atan(friction.HALF_WIDTH / friction.HALF_HEIGHT)
    assert friction.tipping_speed_on_slope(slope + 1e-9, 1e-6) > 0.0
    with pytest.raises(ValueError, match="math domain"):
        friction.tipping_speed_on_slope(slope - 1e-3, 1e-6)


def test_a_pushed_cube_tips_as_its_equation_of_motion_says() -> None:
    push = friction.PushedBox.trials["tips"]
    half = friction.HALF
    force, at_top = np.array([0.0, -G]), np.array([push.force, 0.0])
    w, ratio = tip(half, half, force, at_top, friction.TILT)
    assert math.isclose(friction.tipping_speed_under_push(push.force, friction.TILT), w, rel_tol=1e-4)
    assert ratio < push.friction


TRIALS = [(name, trial) for name in case_names() for trial in find_case(name).trials]


def test_cases_have_the_names_by_which_they_are_found() -> None:
    assert [find_case(name).name for name in case_names()] == [*case_names()]


@pytest.mark.parametrize(("name", "trial"), TRIALS)
def test_a_trial_that_names_a_number_has_it(name: str, trial: str) -> None:
    parameters = find_case(name).trials[trial]
    named = [float(number) for number in re.findall(r"\d+(?:\.\d+)?", trial)]
    assert set(named) <= set(parameters if isinstance(parameters, tuple) else (parameters,))
    # An elastic impact restores the whole speed of approach, and an inelastic one nothing.
    assert parameters == {"elastic": 1.0, "inelastic": 0.0}.get(trial, parameters)


def test_trials_are_on_the_sides_of_the_thresholds_that_their_names_say() -> None:
    ratio = friction.HALF_WIDTH / friction.HALF_HEIGHT
    trials = friction.TippingBox.trials
    assert trials["rests"].tangent < min(trials["rests"].friction, ratio)
    assert trials["slides"].friction < min(trials["slides"].tangent, ratio)
    assert ratio < trials["tips"].tangent < trials["tips"].friction
    pushes = friction.PushedBox.trials
    assert pushes["stays"].force < pushes["stays"].friction * G
    assert pushes["slides"].force > pushes["slides"].friction * G
    # Push and friction turn a cube that slides about its centre less than the normal force at its edge can.
    push = pushes["slides"]
    lever = push.height - friction.HALF
    assert push.force * lever + push.friction * G * friction.HALF < G * friction.HALF
    limit = resting.FRICTION * G * (resting.PLATFORM + resting.BLOCK)
    forces = resting.DrivenPlatform.trials
    assert forces["sticks"] < limit < forces["slides"]


@pytest.mark.parametrize("force", [0.0, 5.0, 11.0, 12.0, 30.0])
def test_platform_and_block_have_the_momentum_of_the_force(force: float) -> None:
    block, platform = resting.accelerations(force)
    total = resting.BLOCK * block + resting.PLATFORM * platform
    assert math.isclose(total, force, abs_tol=1e-12)
    assert block <= min(platform, resting.FRICTION * G) + 1e-12


def test_platform_and_block_change_continuously_at_the_threshold() -> None:
    limit = resting.FRICTION * G * (resting.PLATFORM + resting.BLOCK)
    assert np.allclose(resting.accelerations(limit), resting.accelerations(limit * (1 + 1e-12)))


def test_forces_on_feet_balance_the_weight_of_the_robot_that_is_simulated() -> None:
    weight, front = resting.foot_forces()
    robot = dynx.load(resting.quadruped(), base="floating")
    assert math.isclose(weight, robot.total_mass * G)
    q = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, *[resting.LEG] * 4])
    # The moment of gravity about the y axis through the rear feet, from the dynamics of the robot.
    gravity = dynx.backend("reference", robot).gravity_torque(q)
    moment = gravity[4] - resting.REACH * gravity[2]
    assert math.isclose(-moment, front * 2.0 * resting.REACH, rel_tol=1e-12)


RIGID = {"contact_erp": 0.0, "contact_slop": 0.0, "rebound_time_constant": 1e6}
"""Settings with which Bullet does not push apart what penetrates."""

LOOSE = ("spinning_ball", "bouncing_ball", "oblique_impact", "fast_slide")
"""Cases in which contacts of MuJoCo that give way have large errors at 1 ms."""

UNITS = {"", "m", "rad", "m/s", "rad/s", "m/s^2", "rad/s^2", "N", "J", "kg m/s", "kg m^2/s"}

IMPACTS = [
    each
    for each in TRIALS
    if each[0] in ("collision", "newtons_cradle", "restitution_pairs", "spinning_ball")
]


def measured(engine: str, name: str, trial: str, dt: float, **settings: float) -> Measured:
    outcome = carry_out(CaseRun(engine, find_case(name), trial, dt, settings))
    assert isinstance(outcome, Measured), outcome
    return outcome


@pytest.mark.skipif("mujoco" not in installed_worlds(), reason="needs the engine mujoco")
@pytest.mark.parametrize(("name", "trial"), TRIALS)
def test_every_case_has_figures_of_different_names_that_are_near_their_closed_forms(
    name: str, trial: str
) -> None:
    figures = measured("mujoco", name, trial, 1e-3).figures
    assert figures
    # The contacts of MuJoCo give way, most in impacts. A wrong axis, sign or factor is an error of order 1.
    bound = 0.5 if name in LOOSE else 0.05
    assert all(figure.error <= bound and figure.tolerance > 0.0 for figure in figures)
    assert len({figure.name for figure in figures}) == len(figures)
    assert {figure.unit for figure in figures} <= UNITS


@pytest.mark.skipif("pybullet" not in installed_worlds(), reason="needs the engine pybullet")
@pytest.mark.parametrize(("name", "trial"), IMPACTS)
def test_impacts_of_bullet_are_exact_without_its_corrections(name: str, trial: str) -> None:
    for figure in measured("pybullet", name, trial, 4e-3, **RIGID).figures:
        assert figure.error <= 1e-7, figure


@pytest.mark.skipif("pybullet" not in installed_worlds(), reason="needs the engine pybullet")
@pytest.mark.parametrize(("name", "trial"), IMPACTS)
def test_impacts_tell_another_restitution_from_the_right_one(
    name: str, trial: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Elastic(Material):
        """A material whose restitution is another one than the scene asks for."""

        def __post_init__(self) -> None:
            super().__post_init__()
            object.__setattr__(self, "restitution", 0.3)

    case = find_case(name)
    monkeypatch.setattr(import_module(type(case).__module__), "Material", Elastic)
    assert any(figure.error > 0.01 for figure in measured("pybullet", name, trial, 4e-3, **RIGID).figures)


ENGINES = [name for name in WORLDS if find_spec(name) is not None]

needs_engine = pytest.mark.skipif(not ENGINES, reason="needs an engine for worlds")

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "write-a-contact-case.md"


@needs_engine
def test_a_case_of_the_program_that_runs_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Sliding, "__module__", "__main__")
    with pytest.raises(ArgumentError, match="a module of its own"):
        conform(ENGINES[:1], cases=[Sliding()])


@needs_engine
def test_the_case_of_the_documentation_falls_with_the_step(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = PAGE.read_text(encoding="utf-8")
    (tmp_path / "falling_ball.py").write_text(code.split("```python\n")[1].split("```")[0])
    monkeypatch.syspath_prepend(tmp_path)
    import falling_ball  # type: ignore[import-not-found]

    found = conform(ENGINES[:1], (4e-3, 2e-3), [falling_ball.FreeFall()], jobs=1)
    assert [result.verdict.kind for result in found.results] == ["falls", "falls"]
    assert found.results[0].verdict.order == pytest.approx(1.0, abs=1e-6)


def interrupt(done: int, total: int) -> None:
    """Interrupt after two runs."""
    if done == 2:
        raise KeyboardInterrupt


@needs_engine
def test_an_interruption_keeps_the_trials_that_are_done() -> None:
    found = conform(
        ENGINES[:1],
        (4e-3,),
        ["resting_force", "slope"],
        jobs=0,
        progress=interrupt,
        interruptible=True,
    )
    # Of one trial of the first case and two of the second, the last is left out. What stays is not judged,
    # because no setting could be tried.
    assert {each.case for each in found.results} == {"resting_force"}
    assert found.not_done >= 1
    assert not found.failures
    assert not found.unexplained
    assert found.versions[ENGINES[0]]


def test_an_interruption_is_raised_where_nobody_asks_for_the_results() -> None:
    with pytest.raises(KeyboardInterrupt):
        conform(ENGINES[:1], (4e-3,), ["resting_force", "slope"], jobs=0, progress=interrupt)
