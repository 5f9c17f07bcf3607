"""The doctor on files with ball joints: MuJoCo and Drake, which take them, are compared with dynx."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.doctor.examination import draw_states
from dynx.loaded import installed_engines
from dynx.model import JointDynamics, Limits, Model
from dynx.model.limited_positions import limited_positions
from tests.sim.test_ball_joints import arm, each_base

pytest.importorskip("mujoco")

TAKING = [name for name in ("mujoco", "drake") if name in installed_engines()]


def written(folder: Path, text: str) -> str:
    path = folder / "arm.xml"
    path.write_text(text)
    return str(path)


@each_base
def test_a_file_that_mujoco_loads_alike(base: Any, tmp_path: Path) -> None:
    path = written(tmp_path, arm(base).to_mjcf())
    for report in (dynx.diagnose(path), dynx.compare_as_loaded(path)):
        assert report.error is None
        assert report.alike
        assert [each.engine for each in report.engines] == TAKING


def test_the_axis_of_a_ball_joint_is_no_difference(tmp_path: Path) -> None:
    """MuJoCo calls it spherical, with an axis of its own and no lower limit, which mean nothing."""
    bent = replace(arm().joint("shoulder"), axis=(1.0, 0.0, 0.0), limits=Limits(upper=0.5))
    model = Model.build("arm", arm().links, [bent, *arm().joints[1:]])
    assert dynx.diagnose(written(tmp_path, model.to_mjcf())).model_difference == ()


def test_joint_dynamics_of_a_ball_joint_are_causes(tmp_path: Path) -> None:
    """MuJoCo's inverse dynamics has damping, friction and armature of the file about each axis."""
    path = written(tmp_path, arm("fixed", JointDynamics(0.1, 0.2, 0.3)).to_mjcf())
    report = dynx.diagnose(path)
    assert not report.alike
    assert report.explained
    causes = {finding.name for finding in report.findings if finding.kind == "difference"}
    assert causes == {
        "damping-in-inverse-dynamics",
        "friction-in-inverse-dynamics",
        "armature-in-mass-matrix",
    }


def test_states_turn_a_ball_joint_about_every_axis_within_its_limit() -> None:
    model = arm()
    states = draw_states(model, 50, 0)
    assert np.all(np.ptp(states.q[:, :4], axis=0) > 0.5)
    limited = draw_states(arm(limits=Limits(upper=0.5)), 50, 0)
    angle = limited_positions(model, limited.q)[:, 0]
    assert 0.3 < np.max(angle) <= 0.45


def test_an_engine_that_is_named_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path, arm().to_mjcf())
    report = dynx.diagnose(path, engines=["mujoco", "pinocchio"])
    assert report.error is not None
    assert "'shoulder'" in report.error.message
    assert "as 'pinocchio' loads them" in report.error.message


SDF = """<sdf version="1.9"><model name="crane">
  <link name="mast"><inertial><mass>20</mass>
    <inertia><ixx>1</ixx><iyy>2</iyy><izz>2.5</izz></inertia></inertial></link>
  <link name="boom"><pose>0.3 0.2 0.5 0.3 -0.4 0.8</pose>
    <inertial><pose>0.1 0.2 0.3 0 0 0</pose><mass>2</mass>
    <inertia><ixx>1</ixx><iyy>1.1</iyy><izz>1.2</izz></inertia></inertial></link>
  <joint name="foot" type="fixed"><parent>world</parent><child>mast</child></joint>
  <joint name="turn" type="ball"><pose>0.1 -0.2 0.1 0.5 0.6 -0.9</pose>
    <parent>mast</parent><child>boom</child>AXIS</joint>
</model></sdf>"""


def test_drake_loads_a_file_in_sdf_alike(tmp_path: Path) -> None:
    """The frame of the joint is turned in both links."""
    if "drake" not in installed_engines():
        pytest.skip("needs Drake")
    report = dynx.diagnose(SDF.replace("AXIS", ""))
    assert report.error is None
    assert report.alike
    assert [each.engine for each in report.engines] == ["drake"]
    damped = SDF.replace("AXIS", "<axis><dynamics><damping>0.5</damping></dynamics></axis>")
    report = dynx.diagnose(damped)
    assert report.explained
    assert {each.rule for each in report.differences} <= {"DX301"}


def test_pybullet_is_refused_for_sdf() -> None:
    if "pybullet" not in installed_engines():
        pytest.skip("needs PyBullet")
    report = dynx.diagnose(SDF.replace("AXIS", ""), engines=["pybullet"])
    assert report.error is not None
    assert "'turn'" in report.error.message
    assert "that as 'drake' loads them does" in report.error.message
