"""What the page on troubles says is seen, is seen, and what it advises exists."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
import pytest

import dynx
from dynx import control, trajectory
from dynx.errors import DynxError, importing
from dynx.world import Scene, SceneRobot, World

PAGE = (Path(__file__).parents[1] / "docs" / "how-to" / "troubleshooting.md").read_text(encoding="utf-8")
ROWS = dict(re.findall(r"^\| (.*?) \| .*? \| (.*?) \|$", PAGE, re.MULTILINE))
"""What is seen -> what to do."""


def _not_installed() -> object:
    with importing("the viewer needs viser: pip install '.[viewer]' ({error})"):
        raise ImportError("no such thing")


def _unknown_frame() -> object:
    return dynx.backend("reference", dynx.load("ur5")).forward_kinematics(np.zeros(6), "tol0")


def _mesh(folder: Path) -> object:
    mesh = '<geometry><mesh filename="package://nowhere/a.stl"/></geometry>'
    file = folder / "robot.urdf"
    file.write_text(f'<robot name="r"><link name="a"><collision>{mesh}</collision></link></robot>')
    with World(Scene("scene", robots=(SceneRobot("r", dynx.load(file)),)), "mujoco"):
        return None


def _out_of_reach() -> object:
    target = np.eye(4)
    target[0, 3] = 5.0
    return dynx.backend("reference", dynx.load("ur5")).inverse_kinematics(target, "tool0", max_restarts=1)


def _not_found() -> object:
    target = np.eye(4)
    target[:3, 3] = 0.3, 0.2, 0.3
    engine = dynx.backend("reference", dynx.load("ur5"))
    return engine.inverse_kinematics(target, "tool0", max_restarts=0, max_iterations=1)


def _diverged() -> object:
    arm = dynx.load("ur5")
    law = control.PD(arm, kp=1e6, kd=1e5)
    return dynx.simulate(arm, law, arm.neutral() + 0.1, duration=1.0, dt=0.01)


def _limits() -> object:
    arm = dynx.load("ur5")
    fast = trajectory.cycloidal(np.zeros(6), np.full(6, 2.0), duration=0.1)
    return dynx.simulate(arm, control.ComputedTorque(arm, natural_frequency=20.0), fast)


SEEN: dict[str, Callable[[], object]] = {
    "`NotInstalledError: ... needs ...`": _not_installed,
    "`UnknownNameError: no frame 'tol0' in ur5; did you mean 'tool0'?`": _unknown_frame,
    "`IKResult out of reach`": _out_of_reach,
    "`IKResult not found`": _not_found,
    "`DivergedError: the simulation diverged`": _diverged,
    "`LimitError: the motion breaks 6 limits of ur5`": _limits,
}


def text_of(action: Callable[[], object]) -> str:
    """What a user sees: the result as it is printed, or the last line of the traceback."""
    try:
        return repr(action())
    except DynxError as error:
        return f"{type(error).__name__}: {error}"


@pytest.mark.parametrize("row", SEEN)
def test_what_the_page_says_is_seen(row: str) -> None:
    pieces = row.strip("`").split("...")
    text = text_of(SEEN[row])
    assert re.search(".*".join(map(re.escape, pieces)), text), text


def test_a_mesh_whose_package_is_unknown(tmp_path: Path) -> None:
    row = "`DescriptionError: ... package 'nowhere' was not found`"
    text = text_of(lambda: _mesh(tmp_path))
    assert row in ROWS
    assert re.search(".*".join(map(re.escape, row.strip("`").split("..."))), text), text


def test_every_message_of_the_page_is_tried() -> None:
    quoted = {row for row in ROWS if re.match(r"`\w+(Error|Result)\b", row)}
    assert quoted == {*SEEN, "`DescriptionError: ... package 'nowhere' was not found`"}


def test_the_options_of_the_advice_exist() -> None:
    engine = dynx.backend("reference", dynx.load("pendulum"))
    takers: dict[str, Callable[..., object]] = {
        "package_dirs": dynx.load,
        "free": engine.inverse_kinematics,
        "joint_dynamics": engine.inverse_dynamics,
        "integrator": dynx.simulate,
        "substeps": dynx.simulate,
    }
    assert set(re.findall(r"\b(\w+)=", " ".join(ROWS.values()))) == set(takers)
    for option, taker in takers.items():
        assert option in inspect.signature(taker).parameters


def test_the_error_of_the_step_is_that_of_all_engines_and_falls_with_another_integrator() -> None:
    arm, start = dynx.load("dynx_double_pendulum"), np.array([2.0, 0.5])
    end = {
        (plant, integrator): dynx.simulate(arm, q0=start, duration=1.0, plant=plant, integrator=integrator).q[
            -1
        ]
        for plant, integrator in product(("reference", "compiled", "pinocchio"), ("semi_implicit", "rk4"))
    }
    exact = dynx.simulate(arm, q0=start, duration=1.0, dt=2e-4, integrator="rk4").q[-1]
    first, *others = (
        np.abs(end[plant, "semi_implicit"] - exact).max() for plant in ("reference", "compiled", "pinocchio")
    )
    assert first > 1e-4
    assert others == pytest.approx([first, first], rel=1e-6)
    assert max(np.abs(q - exact).max() for (_, integrator), q in end.items() if integrator == "rk4") < 1e-8
