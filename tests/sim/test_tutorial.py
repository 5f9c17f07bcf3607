"""The tutorial's experiments: every mode on both plants, as closely as it is said to follow."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dynx.backends import installed_backends
from dynx.engines.pybullet.backend import PyBulletBackend
from dynx.errors import (
    ArgumentError,
    LimitError,
    NotInstalledError,
    ShapeError,
    UnknownBackendError,
    UnsupportedFeatureError,
)
from dynx.model.loading import load
from dynx.sim.tutorial import BULLET, LEAST, MODES, PINOCCHIO, PLANTS, Row, plot_rows, tutorial
from tests.oracles.closed_form import MODELS
from tests.sim.bars import EXACT_ON_BULLET, EXACT_ON_DYNX, PLANTS_AGREE, TRACKING

needs_bullet = pytest.mark.skipif("pybullet" not in installed_backends(), reason="PyBullet is not installed")
MOTORS = ("position-motor", "velocity-motor", "pd-motor")


@pytest.fixture(scope="module")
def rows() -> dict[str, Row]:
    """Return the rows of all modes on all plants, simulated once."""
    return {row.mode: row for row in tutorial().rows()}


def error(row: Row, plant: str = PINOCCHIO) -> float:
    """Return the largest error of a mode, which must have one."""
    largest = row.outcomes[plant].max_error
    assert largest is not None
    return largest


def test_every_mode_is_there_with_what_it_is(rows: dict[str, Row]) -> None:
    assert tuple(rows) == MODES
    assert all(tuple(row.outcomes) == PLANTS for row in rows.values())
    assert len({row.what for row in rows.values()}) == len(MODES)


@needs_bullet
def test_motors_are_pybullet_s(rows: dict[str, Row]) -> None:
    for mode in MOTORS:
        outcomes = rows[mode].outcomes
        assert outcomes[PINOCCHIO].problem == "a motor inside PyBullet"
        assert (outcomes[PINOCCHIO].max_error, outcomes[PINOCCHIO].failed) == (None, False)
        assert outcomes[BULLET].problem is None
    # What the engine does inside its step is what the law outside does.
    assert error(rows["pd-motor"], BULLET) == pytest.approx(error(rows["pd"], BULLET), rel=1e-6)
    # Each step ends nearly where it should: the tutorial's first two experiments.
    assert error(rows["position-motor"], BULLET) < error(rows["velocity-motor"], BULLET) < 2e-3


@needs_bullet
def test_plants_agree_on_every_law(rows: dict[str, Row]) -> None:
    for mode in set(MODES) - set(MOTORS):
        ours, bullet = (rows[mode].outcomes[plant].rollout for plant in (PINOCCHIO, BULLET))
        assert ours is not None
        assert bullet is not None
        assert np.abs(ours.q - bullet.q).max() <= PLANTS_AGREE, mode


def test_laws_that_know_more_follow_more_closely(rows: dict[str, Row]) -> None:
    order = ("velocity", "pd", "pid", "gravity-pd", "feed-forward-pd", "discrete-computed-torque")
    errors = [error(rows[mode]) for mode in order]
    assert errors == sorted(errors, reverse=True)
    assert error(rows["computed-torque"]) <= TRACKING
    assert error(rows["discrete-computed-torque"]) <= EXACT_ON_DYNX


@needs_bullet
def test_the_bars_hold_on_pybullet(rows: dict[str, Row]) -> None:
    assert error(rows["computed-torque"], BULLET) <= TRACKING
    assert error(rows["discrete-computed-torque"], BULLET) <= EXACT_ON_BULLET


def test_errors_are_those_of_the_record(rows: dict[str, Row]) -> None:
    outcome = rows["pd"].outcomes[PINOCCHIO]
    assert outcome.rollout is not None
    assert outcome.max_error == np.abs(outcome.rollout.error).max()
    assert outcome.rms_error == pytest.approx(np.sqrt(np.mean(outcome.rollout.error**2)))
    assert outcome.rollout.t[-1] == pytest.approx(2.0)
    assert outcome.rollout.model.gravity == (0.0, 0.0, -9.8)


def test_without_pybullet_the_other_plant_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing() -> None:
        raise NotInstalledError("no PyBullet here")

    monkeypatch.setattr(PyBulletBackend, "require_engine", missing)
    for row in tutorial(duration=2.0, dt=0.02).rows():
        assert row.outcomes[BULLET].problem == "no PyBullet here"
        assert row.outcomes[BULLET].rollout is None
        assert row.mode in MOTORS or row.outcomes[PINOCCHIO].rollout is not None


def test_a_mode_that_cannot_be_simulated_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    def refusing(*arguments: object, **options: object) -> None:
        raise ArgumentError("no such motion")

    monkeypatch.setattr("dynx.sim.tutorial.simulate", refusing)
    for row in tutorial(duration=2.0, dt=0.02, plants=(PINOCCHIO,)).rows():
        outcome = row.outcomes[PINOCCHIO]
        assert row.mode in MOTORS or (outcome.problem, outcome.rollout) == ("no such motion", None)


def test_a_mode_that_diverges_keeps_its_record() -> None:
    # In steps of 0.2 s a critically damped error of 20 rad/s is beyond what a step can hold.
    # Stops would bound the motion; this robot has none.
    free = load(MODELS / "double_pendulum.urdf")
    assert not np.isfinite([free.lower, free.upper]).any()
    made = tutorial(free, to=[0.5, -0.3], dt=0.2, duration=20.0, plants=(PINOCCHIO,))
    rows = {row.mode: row for row in made.rows()}
    outcome = rows["computed-torque"].outcomes[PINOCCHIO]
    assert outcome.failed
    assert outcome.problem is not None
    assert "diverged in step" in outcome.problem
    assert outcome.rollout is not None
    assert outcome.max_error is None
    assert not rows["discrete-computed-torque"].outcomes[PINOCCHIO].failed


def test_another_robot_goes_where_it_is_told() -> None:
    model = load(MODELS / "double_pendulum.urdf")
    rows = {row.mode: row for row in tutorial(model, to=[0.5, -0.3], dt=2e-3).rows()}
    assert error(rows["computed-torque"]) <= TRACKING
    assert all(row.outcomes[PINOCCHIO].problem is None for row in rows.values() if row.mode not in MOTORS)


def test_motions_that_cannot_be_had() -> None:
    with pytest.raises(ArgumentError, match="6 coordinates and panda has"):
        tutorial(load("panda"))
    with pytest.raises(UnsupportedFeatureError, match="solo has a floating one"):
        tutorial(load("solo12", base="floating"))
    with pytest.raises(ShapeError):
        tutorial(to=[1.0, 2.0])
    with pytest.raises(LimitError, match="velocity of"):
        tutorial(duration=0.2)
    with pytest.raises(UnknownBackendError, match="pinocchio"):
        tutorial(backend="pinochio")


def test_the_plot_has_every_mode_on_a_logarithmic_axis(rows: dict[str, Row], tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    target = tmp_path / "errors.png"
    figure = plot_rows([*rows.values()], tutorial(), target)
    assert target.stat().st_size > 10_000
    assert len(figure.axes) == len(PLANTS)
    for axis in figure.axes:
        assert axis.get_yscale() == "log"
        assert [line.get_label() for line in axis.get_lines()] == list(MODES)
        assert all(np.min(line.get_ydata(), initial=1.0) >= LEAST for line in axis.get_lines())
