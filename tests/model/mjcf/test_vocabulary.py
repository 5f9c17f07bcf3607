"""Each attribute that MuJoCo's schema has is used, listed as not used, or of an element that is left out as a
whole: found by loading a nonsense value of it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import fields

import pytest

import dynx
from dynx.errors import DynxError
from dynx.model.mjcf.document import ATTRIBUTES
from dynx.model.mjcf.options import _MEDIUM, _SETTINGS
from dynx.model.mjcf.vocabulary import NOT_USED, OF_ACTUATORS, OF_SENSORS, SECTIONS_WITHOUT_ROBOT

mujoco = pytest.importorskip("mujoco")

BODIES = """<body name="a"><joint name="j" ref="0.4" stiffness="1"/><geom name="g" type="mesh" mesh="m"/>
      <site name="s" xyaxes="1 0 0 0 1 0"/><camera name="eye"/><light/>
      <body name="b"><inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/><joint name="k" type="slide"/>
        <geom name="g2" type="box" size="0.1 0.1 0.1"/><geom material="mat"/><geom material="plain"/>
        <geom type="mesh" mesh="n"/><body name="c"><joint name="ball" type="ball"/>
        <geom type="sphere" mesh="m"/></body></body>
    </body>"""
TEXT = f"""<mujoco>
  <compiler angle="radian"><lengthrange/></compiler>
  <option><flag/></option><size/><statistic/>
  <visual><global/><quality/><headlight/><map/><scale/><rgba/></visual>
  <default><mesh/><texture/><material><layer/></material><joint/><geom size="0.1" hfield="h"/><site/>
    <camera/><light/><pair/><equality/><tendon/><general/><default class="x"/></default>
  <asset>
    <mesh name="n" file="n.obj"/><mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/>
    <texture name="t" type="2d" file="t.png"/>
    <hfield name="h" nrow="2" ncol="2" size="1 1 1 1"/>
    <material name="mat" texture="t"><layer/></material><material name="plain"/>
  </asset>
  <worldbody><site name="wall"/><geom type="hfield"/>{BODIES}</worldbody>
  <contact><exclude body1="a" body2="b"/><pair geom1="g" geom2="g2"/></contact>
  <tendon><fixed name="t" stiffness="1"><joint joint="j" coef="1"/></fixed>
    <fixed><joint joint="j" coef="1"/></fixed></tendon>
  <equality><connect body1="a" anchor="0 0 0"/><weld body1="a"/><joint joint1="j"/><tendon tendon1="t"/>
  </equality>
  <actuator><motor name="m" joint="j"/><position joint="j"/><velocity joint="j"/><general joint="j"/>
  </actuator>
  <sensor>SENSORS</sensor>
  <custom><numeric name="n" data="1"/><text name="x" data="t"/><tuple name="y"><element/></tuple></custom>
  <keyframe><key name="home"/></keyframe>
</mujoco>"""
SENSORS = {
    "site": (
        "touch",
        "accelerometer",
        "velocimeter",
        "gyro",
        "force",
        "torque",
        "magnetometer",
        "rangefinder",
    ),
    "joint": ("jointpos", "jointvel", "jointactuatorfrc"),
    "tendon": ("tendonpos", "tendonvel", "tendonactuatorfrc"),
    "actuator": ("actuatorpos", "actuatorvel", "actuatorfrc"),
    "body": ("subtreecom", "subtreelinvel", "subtreeangmom"),
}
OBJECTS = {"site": "s", "joint": "j", "tendon": "t", "actuator": "m", "body": "a"}
LEFT_OUT = re.compile(
    r"default/(general|motor|position|velocity|intvelocity|orientation|pid|damper|cylinder|muscle|adhesion"
    r"|dcmotor|plugin)|asset/(skin|model|mesh/plugin)|\(world\)body/(flexcomp|freejoint|attach|plugin|geom/plugin)|extension|deformable"
    r"|tendon/spatial|equality/flex|actuator/(intvelocity|orientation|pid|damper|cylinder|muscle|adhesion"
    r"|dcmotor|plugin)|sensor/(contact|tactile|user|plugin|insidesite|camprojection|ballquat|ballangvel|.*limit"
    r"|frame|distance|normal|fromto|rangefinder)"
)
"""Elements that a note names as a whole, that are refused, or that have the attributes of others here."""
NAMES = ("name", "class", "childclass")


def schema() -> Iterator[tuple[str, str]]:
    """Yield the path of each element of MuJoCo's schema, with each of its attributes."""
    path: list[str] = []
    for line in mujoco.mj_printSchema(False, False).splitlines():
        found = re.match(r"( *)([\w()]+) \([!?*R]\) *(.*)$", line)
        if found:
            path = [*path[: len(found[1]) // 3], found[2]]
        for name in (found[3] if found else line).split():
            yield "/".join(path[1:]), name


def document() -> str:
    sensors = [f'<{tag} {of}="{OBJECTS[of]}"/>' for of, tags in SENSORS.items() for tag in tags]
    return TEXT.replace("SENSORS", "".join(sensors) + "<clock/><e_potential/><e_kinetic/>")


def elements(path: str) -> Iterator[tuple[int, int]]:
    """Yield the places in the document of the elements of a path of the schema."""
    text, (section, *inner) = document(), path.replace("(world)body", "worldbody/body").split("/")
    start = text.index(f"<{section}")
    end = text.find(f"</{section}>", start)
    end = text.index("/>", start) + 2 if end < 0 else end
    tag = inner[-1] if inner else section
    first = start if tag == section and not inner else start + 1
    for each in re.finditer(rf"<{tag}(?=[\s/>])", text[first:end]):
        yield first + each.start(), text.index(">", first + each.start()) + 1
        if not inner:
            return


def is_read(path: str, attribute: str) -> bool:
    """Check whether a nonsense value of an attribute of some element of a path is an error, or changes the
    model or its notes."""
    text, base = document(), content(document())
    for start, end in elements(path):
        element = re.sub(rf' {attribute}="[^"]*"', "", text[start:end])
        for value in ("?", "t"):  # the name of a texture that the file has not is no error
            changed = re.sub(r"(/?>)$", rf' {attribute}="{value}"\1', element)
            try:
                found = content(text[:start] + changed + text[end:])
            except DynxError:
                return True
            if found != base:
                return True
    return False


def content(text: str) -> list[str]:
    """Return all that a model states, notes included."""
    model = dynx.load(text)
    shapes = repr(dict(model.geometry.links))
    return [shapes, *(repr(getattr(model, each.name)) for each in fields(model))]


def is_listed(path: str, attribute: str) -> bool:
    section, tag = path.split("/")[0], path.split("/")[-1].replace("(world)body", "body")
    if section in SECTIONS_WITHOUT_ROBOT or tag in ("tuple",):
        return True
    if section == "option":
        return attribute in _SETTINGS - set(_MEDIUM)
    if section == "actuator":
        return attribute in OF_ACTUATORS
    if section == "sensor":
        return attribute in OF_SENSORS
    return attribute in " ".join(NOT_USED.get(tag, {}).values()).split()


PATHS = sorted({path for path, _ in schema() if path and not LEFT_OUT.match(path)})


def test_the_sample_is_read() -> None:
    assert dynx.load(document()).nv == 5


@pytest.mark.parametrize("path", PATHS)
def test_each_attribute_of_the_schema_is_used_or_listed(path: str) -> None:
    assert [*elements(path)], "the sample has no such element"
    attributes = (name for of, name in schema() if of == path and name not in NAMES)
    assert [name for name in attributes if not is_listed(path, name) and not is_read(path, name)] == []


def test_no_attribute_of_the_schema_is_refused_as_unknown() -> None:
    unknown = set()
    for path, name in schema():
        section, tag = path.split("/")[0], path.split("/")[-1].replace("(world)body", "body")
        if section in ("compiler", "default", "(world)body", "keyframe") and tag in ATTRIBUTES:
            unknown |= {(tag, name)} - {(tag, known) for known in ATTRIBUTES[tag]}
    assert unknown == set()


LOOKS = ("size", "statistic", "global", "quality", "headlight", "map", "scale", "rgba", "worldbody")
"""Elements of which any attribute is accepted: those of drawing and memory."""


@pytest.mark.parametrize("what", ["element", "attribute"])
def test_each_unknown_element_and_attribute_is_an_error_or_named(what: str) -> None:
    text = document()
    base = set(dynx.load(text).notes)
    silent = set()
    for found in re.finditer(r"<([a-z_0-9]+)((?:\s[^<>]*?)?)(/?)>", text):
        tag, given, end = found.groups()
        if what == "attribute":
            changed = f'<{tag}{given} nonsense="1"{end}>'
        else:
            changed = f"<{tag}{given}><nonsense/>{f'</{tag}>' if end else ''}"
        try:
            model = dynx.load(text[: found.start()] + changed + text[found.end() :])
        except DynxError:
            continue
        named = any("nonsense" in each.message for each in set(model.notes) - base)
        left_out = what == "attribute" and tag == "general"  # a note says that the actuators are left out
        if not named and not left_out and not (what == "attribute" and tag in LOOKS):
            silent.add(tag)
    assert silent == set()


def test_an_unknown_section_has_one_note() -> None:
    notes = dynx.load(document().replace("<worldbody>", "<world/><world/><worldbody>", 1)).notes
    assert [each.message for each in notes if "unknown" in each.message] == [
        "unknown element <world> in <mujoco> was ignored (2 times)"
    ]


def test_what_has_an_effect_in_mujoco_is_named_with_its_line() -> None:
    text = document().replace('<geom name="g2"', '<geom name="g2" solref="0.1 1" margin="0.1"')
    text = text.replace('<joint name="k"', '<joint name="k" margin="0.1"')
    before, after = ({str(each) for each in dynx.load(one).notes} for one in (document(), text))
    line = text[: text.index('name="k"')].count("\n") + 1
    assert after - before == {
        f"line {line + 1}: not read of <geom>: margin, solref; contacts have the parameters of the World",
        f"line {line}: not read of <joint>: margin; they are parameters of MuJoCo's solver",
    }
    free = '<mujoco><worldbody><body><freejoint GIVEN/><geom size="1"/></body></worldbody></mujoco>'
    assert dynx.load(free.replace("GIVEN", 'group="2"')).notes == ()
    with pytest.raises(DynxError, match="align"):
        dynx.load(free.replace("GIVEN", 'align="?"'))
