"""Sensors of MJCF as data: what MuJoCo compiles of a file, the model states, and the writer writes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.errors import DescriptionError
from dynx.model import StatedSensor
from dynx.model.conversion import convert, robot_differences
from dynx.model.mjcf.reader import read_trees
from tests.model.mjcf.models import models
from tests.model.random_numbers import Draw

mujoco = pytest.importorskip("mujoco")

OF_SITES = ["touch", "accelerometer", "velocimeter", "gyro", "force", "torque", "magnetometer", "rangefinder"]
OF_JOINTS = ["jointpos", "jointvel", "jointactuatorfrc"]
OF_LIMITS = ["jointlimitpos", "jointlimitvel", "jointlimitfrc"]
OF_BALLS = ["ballquat", "ballangvel"]
OF_FRAMES = ["framepos", "framequat", "framexaxis", "frameyaxis", "framezaxis", "framelinvel", "frameangvel"]
OF_SUBTREES = ["subtreecom", "subtreelinvel", "subtreeangmom"]
OF_ACTUATORS = ["actuatorpos", "actuatorvel", "actuatorfrc"]
OF_PAIRS = ["distance", "normal", "fromto"]
WITHOUT_CUTOFF = {"framequat", "framexaxis", "frameyaxis", "framezaxis", "ballquat", "normal"}

amounts = st.floats(0.001, 50.0).map(lambda x: round(x, 3))

ARM = """<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 1"/><site name="post"/>
    <body name="a">BASE<geom name="ga" size="0.1"/><site name="s"/><camera name="eye"/>
      <body name="b" pos="0 0 1"><joint name="k" range="-50 60"/><geom name="gb" size="0.1"/>
        <body name="c"><joint name="ball" type="ball"/><geom name="gc" size="0.1"/><site name="t"/></body>
        <body name="d"><joint name="l"/><geom name="gd" size="0.1"/></body>
      </body>
    </body>
  </worldbody>
  <tendon><fixed name="cable" range="0 1"><joint joint="k" coef="1"/></fixed></tendon>
  <actuator><motor name="m" joint="k"/><muscle name="pull" joint="k"/></actuator>
  <sensor>SENSORS</sensor>
</mujoco>"""


def document(sensors: str, base: str = '<joint name="j"/>') -> str:
    return ARM.replace("SENSORS", sensors).replace("BASE", base)


def compiled(text: str) -> Any:
    return mujoco.MjModel.from_xml_string(text)


def rows(engine: Any) -> list[tuple[object, ...]]:
    """Return name, type, objects by their kinds and names, cutoff and noise of each compiled sensor."""

    def named(kind: int, number: int) -> tuple[int, str | None]:
        kind_of_name = mujoco.mjtObj.mjOBJ_BODY if kind == mujoco.mjtObj.mjOBJ_XBODY else kind
        return int(kind), mujoco.mj_id2name(engine, kind_of_name, number) if number >= 0 else None

    return [
        (
            engine.sensor(k).name,
            int(engine.sensor_type[k]),
            named(engine.sensor_objtype[k], engine.sensor_objid[k]),
            named(engine.sensor_reftype[k], engine.sensor_refid[k]),
            float(engine.sensor_cutoff[k]),
            float(engine.sensor_noise[k]),
        )
        for k in range(engine.nsensor)
    ]


def stated_rows(sensors: Sequence[StatedSensor]) -> list[tuple[object, ...]]:
    """Return what `rows` returns, of the sensors of a model."""

    def named(kind: str, name: str) -> tuple[int, str | None]:
        return (mujoco.mju_str2Type(kind), name) if kind else (0, None)

    types = {"jointactuatorfrc": "JOINTACTFRC", "tendonactuatorfrc": "TENDONACTFRC"} | {
        "distance": "GEOMDIST",
        "normal": "GEOMNORMAL",
        "fromto": "GEOMFROMTO",
    }
    return [
        (
            each.name,
            int(getattr(mujoco.mjtSensor, f"mjSENS_{types.get(each.type, each.type.upper())}")),
            named(each.object_type, each.object),
            named(each.reference_type, each.reference),
            each.cutoff,
            each.noise,
        )
        for each in sensors
    ]


@st.composite
def sensor_elements(draw: Draw, parts: dict[str, list[str]], name: str) -> str:
    """Draw a sensor of one of the parts."""

    def framed(kind: str) -> str:
        of = draw(st.sampled_from([each for each in ("body", "xbody", "site", "geom") if parts.get(each)]))
        return f' {kind}type="{of}" {kind}name="{draw(st.sampled_from(parts[of]))}"'

    kinds = {
        "site": OF_SITES,
        "joint": OF_JOINTS,
        "limited": OF_LIMITS,
        "ball": OF_BALLS,
        "actuator": OF_ACTUATORS,
        "body": OF_SUBTREES,
        "tendon": ["tendonpos", "tendonvel", "tendonactuatorfrc", "tendonlimitpos"],
        "camera": ["camprojection", "rangefinder"],
        "geom": OF_PAIRS,
    }
    of = draw(st.sampled_from([each for each in kinds if parts.get(each)] + ["frame", *parts["none"]]))
    if of == "frame":
        tag = draw(st.sampled_from([*OF_FRAMES, "framelinacc", "frameangacc", "insidesite"]))
        text = framed("obj")
        if tag in OF_FRAMES and draw(st.booleans()):
            text += framed("ref")
        if tag == "insidesite":
            text += f' site="{draw(st.sampled_from(parts["site"]))}"'
    elif of == "none":
        tag, text = draw(st.sampled_from(["e_potential", "e_kinetic", "clock"])), ""
    else:
        tag = draw(st.sampled_from(kinds[of]))
        attribute = {"limited": "joint", "ball": "joint", "geom": "geom1"}.get(of, of)
        chosen = draw(st.sampled_from(parts[of]))
        text = f' {attribute}="{chosen}"'
        if of == "geom":
            other = draw(st.sampled_from(["geom", "body"]))
            # MuJoCo refuses a body or geom and itself.
            others = [each for each in parts[other] if each[-1] != chosen[-1]]
            text += f' {other}2="{draw(st.sampled_from(others))}"'
        if tag == "camprojection":
            text += f' site="{draw(st.sampled_from(parts["site"]))}"'
    if draw(st.booleans()):
        text += f' name="{name}"'
    if tag not in WITHOUT_CUTOFF and draw(st.booleans()):
        text += f' cutoff="{draw(amounts)}"'
    if draw(st.booleans()):
        text += f' noise="{draw(amounts)}"'
    return f"<{tag}{text}/>"


def parts_of(engine: Any) -> dict[str, list[str]]:
    ball, free = int(mujoco.mjtJoint.mjJNT_BALL), int(mujoco.mjtJoint.mjJNT_FREE)
    joints = [
        (engine.joint(k).name, int(engine.jnt_type[k]), bool(engine.jnt_limited[k]))
        for k in range(engine.njnt)
    ]
    bodies = [engine.body(k).name for k in range(engine.nbody)]
    return {
        "site": [engine.site(k).name for k in range(engine.nsite)],
        "joint": [name for name, kind, _ in joints if kind not in (ball, free)],
        "ball": [name for name, kind, _ in joints if kind == ball],
        "limited": [name for name, _, limited in joints if limited],
        "body": bodies,
        "xbody": bodies,
    }


@st.composite
def texts(draw: Draw) -> str:
    """Draw a random model with sensors."""
    # A separator keeps the names of copies apart from those of other parts.
    text: str = draw(models()).replace("<replicate ", '<replicate sep="_" ')
    parts = parts_of(compiled(text))
    # MuJoCo makes two of each sensor without an object at each copy, dynx one in all.
    parts["none"] = [] if "<replicate" in text else ["none"]
    elements = [draw(sensor_elements(parts, f"n{k}")) for k in range(draw(st.integers(1, 5)))]
    return text.replace("</mujoco>", f"<sensor>{''.join(elements)}</sensor></mujoco>")


@given(texts())
def test_a_sensor_is_what_mujoco_compiles_and_is_written_back(text: str) -> None:
    model = dynx.load(text)
    wanted = rows(compiled(text))
    assert model.sensors is not None
    assert stated_rows(model.sensors) == wanted
    conversion = convert(model, "mjcf")
    assert conversion.differences == ()
    again = dynx.load(conversion.text)
    assert again.sensors == model.sensors
    if not any("does not compile" in each for each in conversion.notes):
        assert rows(compiled(conversion.text)) == wanted


PARTS = {
    "site": ["s", "t"],
    "joint": ["j", "k", "l"],
    "limited": ["k"],
    "ball": ["ball"],
    "body": ["world", *"abcd"],
    "xbody": ["world", *"abcd"],
    "geom": ["ga", "gb", "gc", "gd"],
    "actuator": ["m", "pull"],
    "tendon": ["cable"],
    "camera": ["eye"],
    "none": ["none"],
}
NOT_WRITTEN = {"eye", "pull"}


@given(st.tuples(*(sensor_elements(PARTS, f"n{k}") for k in range(4))))
def test_sensors_of_parts_that_are_not_written_are_left_out_by_name(elements: tuple[str, ...]) -> None:
    text = document("".join(elements))
    model = dynx.load(text)
    assert model.sensors is not None
    assert stated_rows(model.sensors) == rows(compiled(text))
    conversion = convert(model, "mjcf")
    assert conversion.differences == ()
    left = [each for each in model.sensors if {each.object, each.reference} & NOT_WRITTEN]
    assert stated_rows([each for each in model.sensors if each not in left]) == rows(
        compiled(conversion.text)
    )
    notes = " ".join(each for each in conversion.notes if each.startswith("Sensors"))
    assert bool(left) == bool(notes)
    assert all((each.name or each.type) in notes for each in left[:1])
    assert [*robot_differences(model, replace(model, sensors=()))] == ["the sensors differ"]


def test_sensors_stay_with_the_robot_and_are_named_by_formats_without_them() -> None:
    text = document('<gyro name="imu" site="s"/><jointpos joint="k"/>', "<freejoint/>")
    model = dynx.load(text.replace(' type="ball"', ""))
    assert model.notes == tuple(each for each in model.notes if "sensor" not in str(each))
    assert model.with_base("fixed").sensors == model.with_gravity((0.0, 0.0, 0.0)).sensors == model.sensors
    assert replace(model, sensors=None) == model
    for to in ("urdf", "sdf"):
        assert any("sensors" in each and "'imu'" in each for each in convert(model, to).notes)
    assert dynx.load("planar_2r").sensors is None
    (note,) = [
        each
        for each in convert(dynx.load(model.to_mjcf(), lock={"k": 0.1}), "mjcf").notes
        if each.startswith("Sensors")
    ]
    assert "Sensors of a joint that the document lacks are left out ('jointpos')" in note


@pytest.mark.parametrize(
    ("element", "message"),
    [
        ('<gyro site="x"/>', "senses the site 'x'"),
        ('<framepos objtype="xbody" objname="x"/>', "senses the xbody 'x'"),
        ('<framepos objtype="site" objname="s" reftype="geom" refname="x"/>', "senses the geom 'x'"),
        ('<tendonpos tendon="x"/>', "senses the tendon 'x'"),
        ('<actuatorfrc actuator="x"/>', "senses the actuator 'x'"),
        ('<camprojection site="s" camera="x"/>', "senses the camera 'x'"),
        ("<gyro/>", "wants one of site"),
        ('<distance geom1="ga" body1="a" geom2="gb"/>', "wants one of geom1 and body1"),
        ('<framepos objname="s"/>', "objtype of sensor"),
        ('<framepos objtype="joint" objname="k"/>', "wanted one of body"),
        ('<framepos objtype="site" objname="s" reftype="site"/>', "has reftype and no refname"),
        (
            '<framelinacc objtype="site" objname="s" reftype="site" refname="t"/>',
            "unknown attribute 'reftype'",
        ),
        ('<gyro site="s" nois="1"/>', "unknown attribute 'nois'"),
        ('<gyros site="s"/>', "unknown element <gyros>"),
        ('<gyro site="s" noise="-1"/>', "noise of sensor '' is -1"),
        ('<gyro site="s" cutoff="-1"/>', "cutoff of sensor '' is -1"),
        ('<clock name="x"/><clock name="x"/>', "two sensors have the name 'x'"),
    ],
)
def test_what_mujoco_refuses_of_a_sensor_is_refused_with_its_line(element: str, message: str) -> None:
    text = document(element)
    with pytest.raises(ValueError, match=r".+"):
        compiled(text)
    for read in (dynx.load, lambda text: read_trees(text, "<string>")):
        with pytest.raises(DescriptionError, match=message) as caught:
            read(text)
        assert caught.value.line == 13


@pytest.mark.parametrize(
    ("element", "base", "reason"),
    [
        ('<user dim="1"/>', "", "is of a type that is not read"),
        ('<contact geom1="ga"/>', "", "is of a type that is not read"),
        ('<gyro site="s" delay="0.01" nsample="2"/>', "", "has delay"),
        ('<rangefinder site="s" data="dist dir"/>', "", "has data"),
        ('<gyro site="post"/>', "<freejoint/>", "senses no site of the robot"),
        ('<framepos objtype="geom" objname="floor"/>', "<freejoint/>", "senses no geom of the robot"),
    ],
)
def test_a_sensor_that_is_not_taken_is_named_with_the_reason(element: str, base: str, reason: str) -> None:
    text = document(f'<clock name="c"/>{element}', base)
    compiled(text)
    model = dynx.load(text)
    assert model.sensors == (StatedSensor("c", "clock"),)
    (note,) = [each for each in model.notes if "<sensor>" in each.message]
    assert note.message.startswith("not read: 1 element of <sensor>")
    assert reason in note.message
    assert note.line == 13


def test_a_sensor_of_a_joint_without_what_it_senses_is_left_out() -> None:
    """MuJoCo refuses these files."""
    for element, kind in (
        ('<jointlimitpos joint="l"/>', "joint with a range"),
        ('<ballquat joint="k"/>', "ball joint"),
        ('<jointpos joint="ball"/>', "joint"),
    ):
        model = dynx.load(document(element))
        assert model.sensors == ()
        assert any(f"senses no {kind} of the robot" in each.message for each in model.notes)


def test_the_frame_of_a_site_and_the_link_of_a_body_are_those_of_the_model() -> None:
    text = document('<gyro site="s"/><framepos objtype="body" objname="a"/>').replace('name="s"', 'name="b"')
    model = dynx.load(text.replace('site="s"', 'site="b"'))
    assert model.sensors is not None
    assert [each.object for each in model.sensors] == ["b_site", "a"]
    assert dynx.load(model.to_mjcf()).sensors == model.sensors


def test_sensors_of_copies_and_of_attached_models_are_those_of_mujoco(tmp_path: Path) -> None:
    sensors = (
        '<gyro name="g" site="s"/><framepos name="f" objtype="xbody" objname="b" reftype="body" '
        'refname="world"/><clock name="c"/><actuatorfrc name="p" actuator="m"/>'
        '<camprojection name="q" site="s" camera="eye"/>'
    )
    (tmp_path / "arm.xml").write_text(document(sensors).replace("<mujoco>", '<mujoco model="arm">'))
    path = tmp_path / "pair.xml"
    path.write_text(
        '<mujoco><asset><model name="arm" file="arm.xml"/></asset><worldbody>'
        '<attach model="arm" body="a" prefix="x_"/></worldbody><sensor><touch site="x_t"/></sensor></mujoco>'
    )
    engine = mujoco.MjModel.from_xml_path(str(path))
    found = dynx.load(path).sensors
    assert found is not None
    assert sorted(stated_rows(found)) == sorted(rows(engine))
    copies = (
        '<mujoco><worldbody><site name="o"/><replicate count="2" offset="0 0 1"><body name="b">'
        '<joint name="j"/><geom size="0.1"/><site name="s"/></body></replicate></worldbody>'
        '<actuator><motor name="m" joint="j"/></actuator><sensor><touch name="e" site="o"/>'
        '<actuatorfrc name="p" actuator="m"/><framepos name="f" objtype="site" objname="s" reftype="site" '
        'refname="o"/><gyro name="one" site="s1"/></sensor></mujoco>'
    )
    model = dynx.load(copies)
    assert model.sensors is not None
    assert stated_rows(model.sensors) == rows(compiled(copies))
    assert [each.name for each in model.actuators or ()] == ["m0", "m1"]


def test_included_sensors_have_the_line_of_their_file(tmp_path: Path) -> None:
    (tmp_path / "sensors.xml").write_text(
        '<mujocoinclude>\n<sensor>\n<gyro site="s"/></sensor></mujocoinclude>'
    )
    path = tmp_path / "arm.xml"
    path.write_text(document("<clock/>").replace("</mujoco>", '<include file="sensors.xml"/></mujoco>'))
    sensors = dynx.load(path).sensors
    assert sensors is not None
    assert [(each.type, each.line) for each in sensors] == [("clock", 13), ("gyro", 3)]
