"""Notes on degrees, millimetres and gravity that points up: at every door, and only there."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.cli.shell.main import cli
from dynx.model.unlikely_inputs import FAR, gravity_notes, position_notes
from dynx.testing.strategies import models
from dynx.world import Scene, SceneRobot, World

ARM = dynx.load("six_axis_arm")
DEGREES = (30.0, -60.0, 60.0, 0.0, 45.0, 0.0)


@given(models(), st.integers(0, 2**32 - 1))
def test_what_lies_within_the_limits_is_not_noted(model: dynx.Model, seed: int) -> None:
    assert list(position_notes(model, model.random(seed))) == []


@given(models(), st.integers(0, 2**32 - 1), st.data())
def test_a_number_in_other_units_is_noted_with_what_it_would_be(
    model: dynx.Model, seed: int, data: st.DataObject
) -> None:
    limited = [
        k
        for k, joint in enumerate(model.coordinate_joints)
        if joint.type in FAR and math.isfinite(joint.limits.upper - joint.limits.lower)
    ]
    if not limited:
        return
    k, q = data.draw(st.sampled_from(limited)), model.random(seed)
    joint, place = model.coordinate_joints[k], k + (7 if model.floating else 0)
    turning = joint.type == "revolute"
    factor, unit = (math.pi / 180.0, "degrees") if turning else (1e-3, "mm")
    meant = q[place]
    q[place] = meant / factor
    noted = list(position_notes(model, q, "start"))
    lower, upper = joint.limits.lower, joint.limits.upper
    if lower - FAR[joint.type] <= q[place] <= upper + FAR[joint.type]:
        assert noted == []
    else:
        assert len(noted) == 1
        assert noted[0].startswith(f"start: {joint.name!r} is at ")
        assert f"{q[place]:g} {unit} are {meant:.5g}" in noted[0]


def test_many_joints_are_counted() -> None:
    noted = list(position_notes(ARM, np.full(6, 100.0)))
    assert noted[3:] == ["q: 3 more are far beyond their limits"]


@given(st.tuples(*[st.floats(-100.0, 100.0)] * 3))
def test_gravity_is_noted_where_it_points_up(gravity: tuple[float, float, float]) -> None:
    assert bool(list(gravity_notes(gravity))) == (gravity[2] > 0.0)


QUERIES = ("fk", "jacobian", "id", "fd", "mass", "ik")


@pytest.mark.parametrize("command", QUERIES)
@pytest.mark.parametrize("quiet", [(), ("--quiet",), ("--json",)])
def test_every_query_notes_degrees_and_gravity(command: str, quiet: tuple[str, ...]) -> None:
    arguments = [command, "six_axis_arm", "--q", ",".join(map(str, DEGREES)), "--gravity", "0,0,9.81"]
    if command == "ik":
        arguments += ["--to-pose", "0.4,0.2,0.5"]
    result = CliRunner().invoke(cli, [*arguments, *quiet])
    assert result.exit_code == 0, result.output
    assert "note: --q: 'joint2' is at -60 rad" in result.stderr
    assert "-60 degrees are -1.0472 rad" in result.stderr
    assert "note: --gravity: gravity (0, 0, 9.81) points up" in result.stderr
    assert (result.stdout == "") == (quiet == ("--quiet",))
    plain = CliRunner().invoke(cli, [command, "six_axis_arm", *arguments[6:], *quiet])
    assert "note:" not in plain.stderr


@pytest.mark.parametrize("engine", ["pinocchio", "pybullet", "mujoco", "drake", "reference", "compiled"])
def test_gravity_of_a_query_is_that_of_the_model(engine: str) -> None:
    import json

    at = ["id", "six_axis_arm", "--engine", engine, "--q", "0.1,0.4,-0.3,0.2,0.5,0.6", "--json"]
    found = json.loads(CliRunner().invoke(cli, [*at, "--gravity", "1,-2,-3"]).stdout)["tau"]
    model = dynx.load("six_axis_arm", gravity=(1.0, -2.0, -3.0))
    with dynx.backend("reference", model) as backend:
        expected = backend.gravity_torque([0.1, 0.4, -0.3, 0.2, 0.5, 0.6])
    assert np.abs(np.array(found) - expected).max() < 1e-11 * np.abs(expected).max()


def test_worlds_and_rollouts_have_the_notes() -> None:
    robot = SceneRobot("arm", ARM)
    up = (0.0, 0.0, 9.81)
    with World(Scene("s", robots=(robot,), gravity=up)) as world:
        assert any("points up" in each for each in world.notes)
    with World(Scene("s", robots=(robot,))) as world:
        assert not any("points up" in each for each in world.notes)
    settings: dict[str, Any] = {"duration": 0.01, "plant": "reference", "joint_limits": False}
    rollout = dynx.simulate(ARM.with_gravity(up), None, q0=DEGREES, **settings)
    assert len(rollout.notes) == 5
    assert "5 notes" in repr(rollout)
    assert dynx.simulate(ARM, None, q0=np.deg2rad(DEGREES), **settings).notes == ()
