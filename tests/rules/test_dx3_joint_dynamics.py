"""Rules about what engines add to the rigid bodies: they name calls, and leave the file as it is."""

from __future__ import annotations

from pathlib import Path

import pytest

import dynx
from dynx.loaded import ENGINES, load_as, loader_class
from dynx.loaded.robot import call_on_joint
from dynx.model.xml.source import XmlSource
from dynx.rules import Case, find_rule
from dynx.rules.rule import CallingRule
from tests.rules.trap_cases import assert_same_robot, changed_lines, mended, only, trap

CALLING = ("DX301", "DX302", "DX304", "DX306", "DX307", "DX308")


@pytest.mark.parametrize("rule_id", CALLING)
def test_the_remedy_is_a_call_that_the_engines_know(rule_id: str) -> None:
    case = trap(rule_id)
    found, remedy = mended(rule_id, case)
    only(found)
    assert remedy.case.source is case.source
    rule = find_rule(rule_id)
    assert isinstance(rule, CallingRule)
    for call in rule.calls:
        engine = call.partition(".")[0]
        assert engine in ENGINES
        assert call in loader_class(engine).CALLS


@pytest.mark.parametrize("rule_id", ["DX301", "DX302", "DX304", "DX306", "DX307"])
def test_the_joint_is_named(rule_id: str) -> None:
    assert only(mended(rule_id, trap(rule_id))[0]).joint == "elbow"


@pytest.mark.parametrize(("rule_id", "attribute"), [("DX301", 'damping="0.5"'), ("DX302", 'friction="0.2"')])
def test_zero_is_no_matter_and_neither_is_a_fixed_joint(rule_id: str, attribute: str) -> None:
    text = trap(rule_id).source.text
    name = attribute.partition("=")[0]
    assert not find_rule(rule_id).detect(Case(XmlSource(text.replace(attribute, f'{name}="0"'))))
    fixed = text.replace('name="elbow" type="revolute"', 'name="elbow" type="fixed"')
    assert not find_rule(rule_id).detect(Case(XmlSource(fixed)))


def test_a_call_for_one_engine_is_not_enough() -> None:
    case, rule = trap("DX301"), find_rule("DX301")
    assert isinstance(rule, CallingRule)
    for call in rule.calls:
        assert len(rule.detect(case.with_calls(call))) == 1
    assert not rule.detect(case.with_calls(*rule.calls))


def test_limits_with_room_between_them_are_no_matter() -> None:
    text = trap("DX306").source.text.replace('upper="0.3"', 'upper="0.4"')
    assert not find_rule("DX306").detect(Case(XmlSource(text)))


def test_shapes_of_one_link_alone_and_meshes_are_no_matter() -> None:
    text = trap("DX308").source.text
    one = text.replace('<box size="0.8 0.8 0.8"/>', '<mesh filename="slider.stl"/>')
    assert not find_rule("DX308").detect(Case(XmlSource(one)))


@pytest.mark.parametrize("rule_id", ["DX303", "DX305"])
def test_what_engines_refuse_is_edited(rule_id: str) -> None:
    case = trap(rule_id)
    found, remedy = mended(rule_id, case)
    assert only(found).joint == "elbow"
    assert_same_robot(case.model, remedy.case.model)
    assert len(changed_lines(case, remedy.case)) == 1


def test_negative_damping_can_be_made_positive_or_zero() -> None:
    assert mended("DX303", trap("DX303"))[1].case.model.joint("elbow").dynamics.damping == 1e-300
    zero = mended("DX303", trap("DX303", DX303="zero"))[1].case.model
    assert zero.joint("elbow").dynamics.damping == 0.0


def test_an_armature_alone_is_kept_beside_the_damping_that_is_added() -> None:
    text = trap("DX305").source.text.replace("<dynamics/>", '<dynamics armature="0.01"/>')
    model = mended("DX305", Case(XmlSource(text)))[1].case.model
    assert model.joint("elbow").dynamics.armature == 0.01


FREE = """<mujoco model="ball"><option OPTION/><worldbody><body name="ball">
  <joint name="root" type="free" COEFFICIENT/>
  <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
  <body name="arm"><joint name="elbow" type="hinge" axis="0 1 0" COEFFICIENT/>
  <inertial pos="0.1 0 0" mass="1" diaginertia="1 1 1"/></body>
</body></worldbody></mujoco>"""

OF_FREE_JOINTS = [
    ("DX301", "damping", "the free joint has damping 2"),
    ("DX302", "frictionloss", "the free joint has dry friction 2"),
    ("DX309", "armature", "the free joint has an armature of 2"),
]


@pytest.mark.parametrize(("rule_id", "attribute", "message"), OF_FREE_JOINTS)
def test_what_acts_on_a_free_joint_is_named(rule_id: str, attribute: str, message: str) -> None:
    """MuJoCo applies it to the floating base, which has no joint in dynx."""
    text = FREE.replace("OPTION", "").replace("COEFFICIENT", f'{attribute}="2"')
    case = Case(XmlSource(text), "floating")
    found, remedy = mended(rule_id, case)
    assert [(each.link, each.joint) for each in found] == [("ball", "root"), (None, "elbow")]
    assert found[0].message == message
    assert remedy.case.source is case.source
    plain = text.replace(f'type="free" {attribute}="2"', f'type="free" {attribute}="0"')
    (other,) = find_rule(rule_id).detect(Case(XmlSource(plain), "floating"))
    assert other.joint == "elbow"


def test_an_option_that_switches_dampers_off_leaves_no_cause() -> None:
    text = FREE.replace("<option OPTION/>", '<option><flag damper="disable"/></option>')
    case = Case(XmlSource(text.replace("COEFFICIENT", 'damping="2"')), "floating")
    assert not find_rule("DX301").detect(case)


@pytest.mark.parametrize(("rule_id", "attribute", "message"), OF_FREE_JOINTS)
def test_a_coefficient_of_a_free_joint_is_proved(rule_id: str, attribute: str, message: str) -> None:
    pytest.importorskip("mujoco")
    text = FREE.replace("OPTION", "").replace("COEFFICIENT", f'{attribute}="2"')
    text = text.replace(f'axis="0 1 0" {attribute}="2"', 'axis="0 1 0"')
    report = dynx.diagnose(text, engines=["mujoco"], samples=1)
    assert report.explained, report.unexplained
    (cause,) = (each for each in report.differences if each.effect is not None)
    assert (cause.rule, cause.link, cause.proved) == (rule_id, "ball", True)


@pytest.mark.parametrize("call", ["mujoco.no_damping", "mujoco.no_friction", "mujoco.no_armature"])
def test_the_call_on_a_free_joint_acts_on_its_six_velocities(call: str, tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    coefficients = 'damping="2" frictionloss="3" armature="4"'
    path = tmp_path / "ball.xml"
    path.write_text(FREE.replace("OPTION", "").replace("COEFFICIENT", coefficients))
    kind = {"damping": "damping", "friction": "frictionloss", "armature": "armature"}[call.partition("_")[2]]
    with load_as("mujoco", path, dynx.load(path), [call_on_joint(call, "root")]) as robot:
        loaded = vars(robot)["_loaded"]
        assert not getattr(loaded, f"dof_{kind}")[:6].any()
        assert getattr(loaded, f"dof_{kind}")[6]
