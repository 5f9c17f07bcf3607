"""Links without collision shapes are kept from nothing: they are named, or the avoidance is refused."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import dynx
from dynx.cli.shell.main import cli
from dynx.errors import ArgumentError, UnknownNameError
from dynx.ik.velocity import VelocityTask
from dynx.model import Model, Pose
from dynx.world import Scene, SceneRobot, Weld, box

CRATE = box("crate", (0.2, 0.2, 0.2), pose=Pose((5.0, 0.0, 0.0)))


def chain(shaped: tuple[int, ...], count: int = 5) -> str:
    """Return the description of a chain of links with a mass, some with a box, and of a tool frame."""
    box_shape = '<collision><geometry><box size="0.1 0.05 0.05"/></geometry></collision>'
    mass = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    links = [f'<link name="l{k}">{mass}{box_shape if k in shaped else ""}</link>' for k in range(count)]
    joints = [
        f'<joint name="j{k}" type="revolute"><parent link="l{k - 1}"/><child link="l{k}"/><axis xyz="0 0 1"/>'
        '<origin xyz="0.4 0 0"/><limit lower="-2" upper="2" effort="9" velocity="9"/></joint>'
        for k in range(1, count)
    ]
    tool = (
        f'<link name="tool"/><joint name="t" type="fixed"><parent link="l{count - 1}"/><child link="tool"/>'
        "</joint>"
    )
    return f'<robot name="chain">{"".join(links)}{"".join(joints)}{tool}</robot>'


def arm(*shaped: int) -> Model:
    return dynx.load(chain(shaped))


def test_a_robot_that_nothing_could_be_kept_from_is_refused(tmp_path: Path) -> None:
    scene = Scene(bodies=[CRATE])
    for model in (arm(), arm(0)):
        with pytest.raises(
            ArgumentError, match="no link of robot 'chain' that can move has a collision shape"
        ):
            scene.avoidance_for(model)
        with pytest.raises(ArgumentError, match="has a collision shape"):
            dynx.backend("reference", model).inverse_kinematics(np.eye(4), "tool", avoid=scene)
    robot, file = tmp_path / "arm.urdf", tmp_path / "cell.toml"
    robot.write_text(chain(()), encoding="utf-8")
    file.write_text(
        'schema = "dynx.scene/1"\nname = "cell"\n[[bodies]]\nname = "crate"\n'
        "shape = { box = [0.2, 0.2, 0.2] }\n",
        encoding="utf-8",
    )
    refused = CliRunner().invoke(cli, ["ik", str(robot), "--to-pose", "1.2,0,0", "--avoid", str(file)])
    assert refused.exit_code == 2
    assert "has a collision shape" in refused.stderr


def test_a_body_that_the_robot_carries_is_enough() -> None:
    carried = box("tool", (0.1, 0.1, 0.1), mass=1.0)
    welded = Weld("arm/l4", "tool", Pose((0.2, 0.0, 0.0)))
    scene = Scene(robots=[SceneRobot("arm", arm())], bodies=[CRATE, carried], constraints=[welded])
    avoidance = scene.avoidance()
    assert [avoidance.names(pair) for pair in avoidance.pairs] == [("tool", "crate")]
    assert "'l1', 'l2', 'l3' and 1 more have no collision shape" in avoidance.note


def test_moving_links_without_shapes_are_named_in_results() -> None:
    """A frame without mass and visual shapes is not, nor is the base, which does not move."""
    model = arm(1, 2, 4)
    engine, scene = dynx.backend("reference", model), Scene(bodies=[CRATE])
    q = np.full(4, 0.3)
    target = engine.forward_kinematics(q, "tool")
    found = engine.inverse_kinematics(target, "tool", q, avoid=scene)
    assert found.success
    assert found.note == "'l3' has no collision shape, so that avoid keeps nothing from it"
    assert found.note in found.message
    if importlib.util.find_spec("daqp") is not None:
        task = VelocityTask("tool")
        assert engine.velocity_ik(q, task, dt=0.01, avoid=scene).note == found.note
        outside = np.array([-7.0, 0.3, 0.3, 0.3])
        both = engine.velocity_ik(outside, task, dt=0.01, avoid=scene).note
        assert both.endswith(f"; {found.note}")
    two = Scene(bodies=[CRATE]).avoidance_for(arm(1, 2))
    assert two.note == "'l3' and 'l4' have no collision shape, so that avoid keeps nothing from them"
    whole = engine.inverse_kinematics(
        target, "tool", q, avoid=Scene(bodies=[CRATE]).avoidance_for(arm(1, 2, 3, 4))
    )
    assert whole.note == ""


def test_an_avoidance_without_pairs_says_so() -> None:
    robot = SceneRobot("arm", arm(1))
    assert "keeps no bodies apart" in Scene(robots=[robot]).avoidance().note
    assert "keeps no bodies apart" not in Scene(robots=[robot], bodies=[CRATE]).avoidance().note


def test_a_misspelt_option_has_the_nearest_name() -> None:
    scene = Scene(robots=[SceneRobot("arm", arm(1))])
    with pytest.raises(UnknownNameError, match="no option 'margn'; did you mean 'margin'"):
        scene.avoidance(margn=0.02)  # type: ignore[call-arg]  # the misspelt name is what is tested
