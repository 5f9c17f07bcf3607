"""Springs of MJCF, SDF and URDF: MuJoCo as the oracle of what a file states, and round trips."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.model import JointDynamics, Model
from dynx.model.conversion import convert
from dynx.model.document_format import Format
from dynx.same import same_robot
from dynx.testing.strategies import models

LEG = """<mujoco model="leg">{}<worldbody><body name="thigh" pos="0 0 1">
  <joint name="hip" axis="0 1 0" stiffness="12" springref="20" damping="0.3"/>
  <geom type="capsule" fromto="0 0 0 0.1 0 -0.4" size="0.03"/>
  <body name="foot" pos="0.1 0 -0.4">
    <joint name="ankle" type="slide" axis="0 0 1" stiffness="900" springref="-0.02" ref="0.05"/>
    <joint name="toe" axis="0 1 0" stiffness="3" ref="15" springref="10"/>
    <geom type="sphere" size="0.05"/></body></body></worldbody></mujoco>"""

COMPILERS = ["", '<compiler angle="radian"/>', '<compiler angle="degree"/>']


@pytest.mark.parametrize("compiler", COMPILERS)
def test_springs_pull_as_mujoco_has_them(compiler: str) -> None:
    mujoco = pytest.importorskip("mujoco")
    text = LEG.format(compiler)
    model, compiled = dynx.load(text), mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(compiled)
    assert not any("spring" in note.message for note in model.notes)
    rng = np.random.default_rng(0)
    with dynx.backend("reference", model) as engine:
        for _ in range(5):
            data.qpos[:], data.qvel[:] = rng.standard_normal((2, 3))
            mujoco.mj_forward(compiled, data)
            q, v = data.qpos.copy(), data.qvel.copy()
            passive = engine.bias_torque(q, v) - engine.bias_torque(q, v, joint_dynamics=True)
            np.testing.assert_allclose(passive, data.qfrc_passive, rtol=1e-12, atol=1e-12)


def test_a_file_moves_as_in_mujoco() -> None:
    mujoco = pytest.importorskip("mujoco")
    text = LEG.format('<option timestep="0.001"/>')
    model, compiled = dynx.load(text), mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(compiled)
    mujoco.mj_step(compiled, data, 200)
    found = dynx.simulate(
        model, q0=compiled.qpos0, duration=0.2, dt=1e-3, plant="pinocchio", joint_limits=False
    )
    np.testing.assert_allclose(found.q[-1], data.qpos, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("coefficient", ["damping", "frictionloss", "stiffness"])
def test_a_negative_coefficient_is_read_and_named(coefficient: str) -> None:
    """MuJoCo takes it, and the joint gains energy there as well."""
    text = LEG.format("").replace('stiffness="12" springref="20" damping="0.3"', f'{coefficient}="-0.5"')
    (note,) = dynx.load(text).notes
    assert str(note).startswith(f"line 2: the {coefficient} of joint 'hip' is negative, so the ")


def test_what_is_not_read_of_springs_is_named() -> None:
    def notes(attributes: str) -> str:
        return "\n".join(map(str, dynx.load(LEG.format("").replace('stiffness="12"', attributes)).notes))

    assert "stiffness of joint 'hip' is a polynomial" in notes('stiffness="12 1"')
    assert "springyield of joint 'hip' is not read: its spring is elastic" in notes(
        'stiffness="12" springyield="0.1"'
    )
    assert "springdamper of joint 'hip' is not read: it has no spring and no damping" in notes(
        'stiffness="12" springdamper="0.1 1"'
    )
    off = dynx.load(LEG.format('<option><flag spring="disable"/></option>'))
    assert any("springs are disabled: no joint has a spring" in note.message for note in off.notes)
    assert not any(joint.dynamics.stiffness for joint in off.joints)
    assert off.joint("hip").dynamics.damping == 0.3


def springs_of(model: Model) -> dict[str, JointDynamics]:
    return {joint.name: joint.dynamics for joint in model.joints if joint.moves}


@pytest.mark.parametrize("to", ["mjcf", "sdf", "urdf"])
@given(drawn=models(min_links=2, max_links=4), seed=st.integers(0, 2**31))
def test_a_robot_keeps_its_springs_in_every_format(to: Format, drawn: Model, seed: int) -> None:
    rng = np.random.default_rng(seed)
    joints = []
    for each in drawn.joints:
        stiffness, reference = rng.standard_normal(2).tolist()
        spring = replace(each.dynamics, stiffness=abs(stiffness), spring_reference=reference)
        joints.append(replace(each, dynamics=spring) if each.moves else each)
    model = replace(drawn, joints=tuple(joints))
    written = convert(model, to)
    assert not [each for each in written.differences if "spring" in each]
    if not written.differences:
        assert written.robot is not None
        assert springs_of(written.robot) == springs_of(model)
    noted = any("URDF states no springs of joints" in note for note in written.notes)
    assert noted == (to == "urdf" and bool(springs_of(model)))


def test_the_text_of_urdf_states_a_spring_in_an_extension() -> None:
    model = dynx.load(LEG.format(""))
    text = model.to_urdf()
    assert '<dynx_spring stiffness="900.0" reference="-0.02"/>' in text
    assert dynx.load(text).joints == model.joints


def test_same_tells_springs_apart() -> None:
    one = dynx.load(LEG.format(""))
    for changes, kinds in (
        ({"stiffness": 13.0}, {"stiffness"}),
        ({"spring_reference": 1.0}, {"spring reference"}),
        ({"stiffness": 0.0}, {"stiffness"}),
    ):
        joints = tuple(
            replace(each, dynamics=replace(each.dynamics, **changes)) if each.name == "hip" else each
            for each in one.joints
        )
        report = same_robot(one, replace(one, joints=joints))
        assert {each.kind for each in report.attributes} == kinds
        assert report.same


def test_damping_and_armature_of_a_free_joint_are_named() -> None:
    """A joint of the type free takes the defaults of joints, and <freejoint> does not."""
    text = """<mujoco><default><joint damping="5" armature="0.0"/></default><worldbody>
    <body name="a">JOINT<geom size="0.1"/></body></worldbody></mujoco>"""
    found = [
        any("damping of the free joint do not act" in each.message for each in dynx.load(text).notes)
        for text in (text.replace("JOINT", each) for each in ('<joint type="free"/>', "<freejoint/>"))
    ]
    assert found == [True, False]
