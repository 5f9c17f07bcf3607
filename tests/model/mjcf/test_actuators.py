"""Actuators and contacts of MJCF as data: what MuJoCo compiles of a file, the model states."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.model import Actuator, Model
from dynx.model.conversion import convert

ARM = """<mujoco>
  <compiler angle="radian"/>
  DEFAULTS
  <worldbody>
    <geom name="floor" type="plane" size="1 1 1"/>
    <body name="a">BASE<geom name="ga" size="0.1"/>
      <body name="b" pos="0 0 1"><joint name="k" range="-0.5 1"/><geom name="gb" size="0.1"/>
        <body name="c" pos="0 0 1"><joint name="l" type="slide"/><geom name="gc" size="0.1"/></body>
        <body name="d" pos="0 1 0"><geom name="gd" size="0.1"/></body>
      </body>
    </body>
  </worldbody>
  SECTIONS
</mujoco>"""


def document(sections: str, defaults: str = "", base: str = '<joint name="j"/>') -> str:
    return ARM.replace("DEFAULTS", defaults).replace("SECTIONS", sections).replace("BASE", base)


numbers = st.floats(-50.0, 50.0).map(lambda x: round(x, 3))
positive = st.floats(0.01, 50.0).map(lambda x: round(x, 3))


@st.composite
def actuator_elements(draw: st.DrawFn, name: str) -> str:
    """Draw an actuator of a kind that is read, with some of its attributes."""
    joint = draw(st.sampled_from("jkl"))
    given = {"name": name, "joint": joint}
    if draw(st.booleans()):
        given["gear"] = " ".join(map(str, draw(st.lists(numbers, min_size=1, max_size=6))))
    inherits = joint == "k" and draw(st.booleans())
    for what in ("ctrl", "force"):
        if draw(st.booleans()) and not (inherits and what == "ctrl"):
            low, width = draw(numbers), draw(positive)
            given[f"{what}range"] = f"{low} {low + width}"
            if draw(st.booleans()):
                given[f"{what}limited"] = draw(st.sampled_from(["auto", "true", "false"]))
    tag = draw(st.sampled_from(["motor", "position", "velocity", "general"]))
    if tag == "position":
        given |= {each: str(draw(positive)) for each in ("kp", "kv") if draw(st.booleans())}
        if inherits:
            given["inheritrange"] = str(draw(positive))
    if tag == "velocity" and draw(st.booleans()):
        given["kv"] = str(draw(positive))
    if tag == "general":
        if draw(st.booleans()):
            given["gainprm"] = str(draw(numbers))
        if draw(st.booleans()):
            given["biasprm"] = " ".join(map(str, draw(st.lists(numbers, min_size=1, max_size=3))))
            given["biastype"] = draw(st.sampled_from(["none", "affine"]))
    return f"<{tag} " + " ".join(f'{key}="{value}"' for key, value in given.items()) + "/>"


def texts() -> st.SearchStrategy[str]:
    return st.tuples(*(actuator_elements(name) for name in ("p", "q"))).map(
        lambda each: document(f"<actuator>{''.join(each)}</actuator>")
    )


def compiled(text: str) -> Any:
    return pytest.importorskip("mujoco").MjModel.from_xml_string(text)


@given(texts())
def test_an_actuator_is_what_mujoco_compiles(text: str) -> None:
    model, engine = dynx.load(text), compiled(text)
    assert model.actuators is not None
    assert len(model.actuators) == 2
    for number, each in enumerate(model.actuators):
        assert engine.actuator(number).name == each.name
        assert engine.joint(engine.actuator_trnid[number, 0]).name == each.joint
        assert engine.actuator_gear[number, 0] == each.gear
        assert engine.actuator_gainprm[number, 0] == each.gain
        affine = engine.actuator_biastype[number] == 1
        assert tuple(engine.actuator_biasprm[number, :3] * affine) == each.bias
        for what, ends in (("ctrl", each.control_range), ("force", each.force_range)):
            limited = getattr(engine, f"actuator_{what}limited")[number]
            stated = getattr(engine, f"actuator_{what}range")[number]
            assert ends == pytest.approx(stated if limited else (-np.inf, np.inf), rel=1e-15)


@given(texts())
def test_actuators_are_written_back(text: str) -> None:
    model = dynx.load(text)
    again = dynx.load(model.to_mjcf())
    assert again.actuators == model.actuators
    assert convert(model, "mjcf").differences == ()


@pytest.mark.parametrize(
    ("defaults", "element", "wanted"),
    [
        (
            '<position kp="20" ctrlrange="-1 1"/>',
            '<position joint="k"/>',
            Actuator("", "k", 1, 20, (0, -20, 0)),
        ),
        ('<general ctrlrange="-1 1"/><motor gear="3"/>', '<motor joint="k"/>', Actuator("", "k", 3)),
        ('<position kp="20"/><motor ctrlrange="-1 1"/>', '<motor joint="k"/>', Actuator("", "k")),
        (
            '<motor ctrllimited="true" ctrlrange="-180 180" gear="3"/>',
            '<position joint="k" kp="20" gear="2" ctrlrange="-1 1"/>',
            Actuator("", "k", 2, 20, (0, -20, 0)),
        ),
    ],
)
def test_a_class_of_defaults_is_that_of_all_actuators(defaults: str, element: str, wanted: Actuator) -> None:
    text = document(f"<actuator>{element}</actuator>", f"<default>{defaults}</default>")
    assert dynx.load(text).actuators == (replace(wanted, control_range=(-1.0, 1.0)),)
    engine = compiled(text)
    assert (engine.actuator_gear[0, 0], engine.actuator_gainprm[0, 0]) == (wanted.gear, wanted.gain)
    assert tuple(engine.actuator_ctrlrange[0]) == (-1.0, 1.0)


@pytest.mark.parametrize(
    ("element", "reason"),
    [
        ('<muscle joint="k"/>', "is no motor"),
        ('<position joint="k" timeconst="0.1"/>', "has timeconst"),
        ('<general joint="k" dyntype="integrator"/>', "dyntype 'integrator'"),
        ('<general joint="k" biastype="muscle"/>', "biastype 'muscle'"),
        ('<general joint="k" gaintype="affine" gainprm="1 2 0"/>', "gaintype 'affine'"),
        ('<motor body="b"/>', "has body"),
    ],
)
def test_an_actuator_that_is_not_taken_is_named_with_the_reason(element: str, reason: str) -> None:
    model = dynx.load(document(f'<actuator><motor joint="j"/>{element}</actuator>'))
    assert model.actuators == (Actuator("", "j"),)
    (note,) = [each for each in model.notes if each.message.startswith("not read")]
    assert reason in note.message
    assert note.line == 13


def test_what_a_format_leaves_open_is_none_and_named_by_its_writer() -> None:
    model = dynx.load("planar_2r")
    assert model.actuators is None
    assert model.contact_filter is None
    assert [each.joint for each in dynx.load(model.to_mjcf()).actuators or ()] == [*model.joint_names]
    arm = dynx.load(
        document('<actuator><motor joint="j"/></actuator><contact><exclude body1="a" body2="c"/></contact>')
    )
    for to in ("urdf", "sdf"):
        notes = " ".join(convert(arm, to).notes)
        assert "actuators" in notes
        assert "may touch" in notes
    assert dynx.load(replace(arm, actuators=()).to_mjcf()).actuators == ()


# -- contacts -------------------------------------------------------------------------------------


@st.composite
def contact_texts(draw: st.DrawFn) -> str:
    """Draw a file whose geoms have other bits, with exclusions, pairs of geoms and flags."""
    pairs = st.sampled_from([*combinations("abcd", 2)])
    excluded = draw(st.lists(pairs, max_size=2, unique=True))
    paired = draw(st.lists(pairs, max_size=2, unique=True))
    base = draw(st.sampled_from(["", "<freejoint/>", '<joint name="j"/>']))
    section = "".join(f'<exclude body1="{a}" body2="{b}"/>' for a, b in excluded)
    section += "".join(f'<pair geom1="g{a}" geom2="g{b}"/>' for a, b in paired)
    text = document(f"<contact>{section}</contact>", base=base)
    if draw(st.booleans()):
        flag = draw(st.sampled_from(["contact", "filterparent"]))
        text = text.replace("<worldbody>", f'<option><flag {flag}="disable"/></option><worldbody>')
    for name in "abcd":
        bits = draw(st.integers(0, 3)), draw(st.integers(0, 3))
        text = text.replace(f'name="g{name}"', f'name="g{name}" contype="{bits[0]}" conaffinity="{bits[1]}"')
    # The geom of the body that is fixed in the world is a shape of the robot only on a fixed base.
    return text.replace('<geom name="floor" type="plane" size="1 1 1"/>', "")


@given(contact_texts())
def test_a_contact_filter_is_written_back(text: str) -> None:
    model = dynx.load(text)
    assert model.contact_filter is not None
    again = dynx.load(model.to_mjcf())
    assert again.contact_filter == model.contact_filter


@given(contact_texts())
def test_mujoco_compiles_the_same_contacts_of_what_is_written(text: str) -> None:
    engine = compiled(text)
    again = compiled(dynx.load(text).to_mjcf())
    for name in ("nexclude", "npair"):
        assert getattr(again, name) == getattr(engine, name)
    for flag in ("opt.disableflags",):
        assert again.opt.disableflags == engine.opt.disableflags, flag
    colliding = [
        sorted(
            (
                model.body(model.geom_bodyid[k]).name,
                int(model.geom_contype[k]),
                int(model.geom_conaffinity[k]),
            )
            for k in range(model.ngeom)
            if model.geom_contype[k] or model.geom_conaffinity[k]
        )
        for model in (engine, again)
    ]
    assert colliding[0] == colliding[1]


def test_elements_of_contact_that_name_nothing_of_the_robot_are_named() -> None:
    text = document(
        '<contact><exclude body1="a" body2="x"/><pair geom1="ga" geom2="gd" margin="0.1"/></contact>'
    )
    model = dynx.load(text)
    assert model.contact_filter is not None
    assert model.contact_filter.paired == ((("a", 0), ("d", 0)),)
    notes = [str(each) for each in model.notes]
    assert any("not read: 1 element of <contact>" in each for each in notes)
    assert any("parameters of <pair> are not read" in each for each in notes)


def test_models_that_differ_in_actuators_alone_are_equal() -> None:
    model = dynx.load(document('<actuator><motor joint="j"/></actuator>'))
    assert isinstance(model, Model)
    assert replace(model, actuators=(), contact_filter=None) == model
