"""Results as a person sees them: summaries, representations, plots."""

from __future__ import annotations

import inspect
from typing import Any

import numpy as np
import pytest

import dynx
from dynx import control, ik
from dynx.sim import Rollout, Scenario, simulate, simulate_batch
from dynx.sim.batch_rollouts import BatchRollouts
from tests.sim.bars import tutorial_robot

ARM = tutorial_robot()
REST = np.array([0.2, -1.0, 0.8, 0.3, -0.4, 0.5])


@pytest.fixture(scope="module")
def driven() -> Rollout:
    """An arm under a controller of joints."""
    law = control.PD(ARM, kp=100.0, kd=10.0)
    return simulate(ARM, law, REST, plant="compiled", duration=0.02)


def test_a_summary_names_joints_and_units(driven: Rollout) -> None:
    text = str(driven.summary())
    joint = ARM.joint_names[int(np.argmax(driven.summary().max_torque))]
    assert f"N m of {joint}" in text
    assert "rad of" in text
    assert "drift" not in text  # the motors did work
    fallen = simulate(ARM, None, plant="compiled", duration=0.02, q0=REST)
    assert "energy drift" in str(fallen.summary())


def test_a_rollout_without_a_reference_shows_no_errors(driven: Rollout) -> None:
    fallen = simulate(ARM, None, plant="compiled", duration=0.02, q0=REST)
    for shown in (fallen._repr_html_(), fallen.summary()._repr_html_(), repr(fallen.summary())):
        assert "no reference" in shown
        assert "nan" not in shown
    assert "max error" not in fallen._repr_html_()
    assert "max error" in driven._repr_html_()
    assert repr(driven.summary()).startswith("<Summary: largest error ")


def test_notebooks_show_tables(driven: Rollout) -> None:
    solved = dynx.backend("reference", ARM).inverse_kinematics([0.3, 0.2, 0.4], "tool0")
    many = simulate_batch(ARM, control.PD(ARM, kp=100.0, kd=10.0), REST, rollouts=2, duration=0.01)
    report = dynx.agree(ARM, ["reference"], samples=1, referee_samples=0)
    shown: tuple[tuple[Any, str], ...] = (
        (driven, ARM.joint_names[0]),
        (control.PD(ARM, kp=100.0, kd=10.0), "kp 100"),
        (solved, "q[0]"),
        (many, "2 of 2"),
        (report, "reference agree"),
        (dynx.diagnose("nosuch"), "not examined"),
    )
    for each, words in shown:
        html = each._repr_html_()
        assert html.startswith("<table>"), each
        assert words in html
        assert len(repr(each)) < 400
    assert repr(solved).startswith("<IKResult reached, at most")
    assert repr(many) == f"<BatchRollouts of {ARM.name}: 2 of 2 done>"


def test_inverse_kinematics_shows_its_options() -> None:
    shown = list(inspect.signature(dynx.Backend.inverse_kinematics).parameters.values())[1:]
    assert shown == list(inspect.signature(ik.inverse_kinematics).parameters.values())[1:]


def test_a_frame_controller_plots_the_error_of_its_frame(driven: Rollout) -> None:
    pytest.importorskip("matplotlib")
    law = control.Impedance(ARM, "tool0", stiffness=500.0, damping=50.0)
    rollout = simulate(ARM, law, REST, plant="compiled", duration=0.02)
    middle = rollout.plot().axes[1]
    assert middle.get_ylabel() == "error of tool0 [m; rad]"
    assert [line.get_label() for line in middle.lines] == ["x", "y", "z", "rx", "ry", "rz"]
    assert driven.plot().axes[1].get_ylabel() == "error q* - q [rad]"


@pytest.mark.parametrize(("spread", "scale"), [(1e-4, "log"), (0.5, "linear")])
def test_errors_that_span_decades_are_on_a_log_axis(spread: float, scale: str) -> None:
    pytest.importorskip("matplotlib")
    n = 101
    errors = np.linspace(spread, 1.0, n)[:, None] * np.ones(6)
    one, no_record = np.zeros((n, 6)), np.zeros((n, 0, 6))
    arrays: dict[str, Any] = dict.fromkeys(("q", "v", "saturated"), one)
    arrays |= dict.fromkeys(("max_error", "rms_error"), errors)
    arrays |= dict.fromkeys(("q_record", "v_record", "tau_record"), no_record)
    arrays |= {"diverged": np.full(n, np.nan), "done": np.ones(n, dtype=bool), "t": np.zeros(0)}
    many = BatchRollouts(Scenario(ARM), **arrays)
    upper, lower = many.plot().axes
    # Of each joint the whiskers are the 5th and the 95th percentile.
    ends = np.percentile(errors[:, 0], (5.0, 95.0))
    lines = [np.asarray(line.get_ydata(), dtype=float) for line in lower.lines]
    for end in ends:
        assert sum(bool(np.isclose(y, end, rtol=1e-9).any()) for y in lines) >= ARM.nv
    assert upper.get_xscale() == lower.get_yscale() == scale
