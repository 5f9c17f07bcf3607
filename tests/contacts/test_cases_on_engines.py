"""Cases of dynx on engines: every one runs, and Bullet's impacts are exact without its corrections."""

from __future__ import annotations

import math
from importlib import import_module

import pytest

from dynx.contacts import case_names, find_case
from dynx.contacts.run import CaseRun, Measured, carry_out
from dynx.steppers.registry import installed_worlds
from dynx.world import Material

RIGID = {"contact_erp": 0.0, "contact_slop": 0.0, "rebound_time_constant": 1e6}
"""Settings with which Bullet does not push apart what penetrates."""

TRIALS = [(name, trial) for name in case_names() for trial in find_case(name).trials]

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
def test_every_case_has_finite_figures_of_different_names(name: str, trial: str) -> None:
    figures = measured("mujoco", name, trial, 4e-3).figures
    assert figures
    assert all(math.isfinite(figure.error) and figure.tolerance > 0.0 for figure in figures)
    assert len({figure.name for figure in figures}) == len(figures)


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
