"""Sensors of two descriptions: what `dynx.same` lists apart from the verdict."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.model import Model, StatedSensor
from dynx.same import same_robot
from dynx.same.attributes import Attribute

TREE = """<mujoco>
  <worldbody><body name="a" pos="0 0 1"><geom name="ga" size="0.1"/><site name="s" SITE/>
    <site name="t" pos="0 0.5 0"/><body name="b"><joint name="j" axis="0 0 AXIS" range="-50 50"/>
      <geom name="gb" size="0.11" pos="0.1 0 0"/>
      <body name="c" pos="0 1 0"><joint name="k" axis="1 0 0" range="-50 50"/><geom name="gc" size="0.12"/>
      </body></body></body></worldbody>
  <actuator><motor name="m" joint="j"/><motor name="n" joint="k"/></actuator>
  <sensor>SENSORS</sensor>
</mujoco>"""


def document(sensors: str, site: str = "", axis: str = "1") -> str:
    return TREE.replace("SENSORS", sensors).replace("SITE", site).replace("AXIS", axis)


def listed(first: str | Model, second: str | Model) -> list[Attribute]:
    report = same_robot(first, second)
    assert report.same
    return [each for each in report.attributes if "sensor" in (each.kind, each.tag)]


amounts = st.sampled_from([0.0, 0.5, 3.0])
OBJECTS = {
    "joint": (["jointpos", "jointvel", "jointlimitpos", "jointactuatorfrc"], "jk"),
    "site": (["gyro", "accelerometer", "touch"], "st"),
    "body": (["subtreecom", "subtreeangmom"], "abc"),
    "xbody": (["framepos", "framequat"], "abc"),
    "actuator": (["actuatorfrc", "actuatorpos"], "mn"),
}


@st.composite
def sensors(draw: st.DrawFn) -> tuple[StatedSensor, ...]:
    found = []
    for number in range(draw(st.integers(1, 5))):
        kind = draw(st.sampled_from(sorted(OBJECTS)))
        types, names = OBJECTS[kind]
        of, name = draw(st.sampled_from(types)), draw(st.sampled_from([f"n{number}", f"n{number}", ""]))
        found.append(
            StatedSensor(
                name, of, kind, draw(st.sampled_from(names)), cutoff=draw(amounts), noise=draw(amounts)
            )
        )
    return tuple(found)


def with_sensors(stated: tuple[StatedSensor, ...], axis: str = "1") -> Model:
    return replace(dynx.load(document("", axis=axis)), sensors=stated)


@given(sensors(), st.randoms(use_true_random=False), st.sampled_from(["1", "-1"]))
def test_the_same_sensors_in_another_order_or_about_a_reversed_axis_are_equal(
    stated: tuple[StatedSensor, ...], random: object, axis: str
) -> None:
    others = list(stated)
    random.shuffle(others)  # type: ignore[attr-defined]
    assert listed(with_sensors(stated).to_mjcf(), with_sensors(tuple(others), axis).to_mjcf()) == []


@given(sensors(), st.data())
def test_a_planted_difference_is_listed_alone(stated: tuple[StatedSensor, ...], data: st.DataObject) -> None:
    stated = tuple(replace(each, name=f"n{k}") for k, each in enumerate(stated))
    number = data.draw(st.integers(0, len(stated) - 1))
    sensor = stated[number]
    types, names = OBJECTS[sensor.object_type]
    change = data.draw(st.sampled_from(["type", "object", "cutoff", "noise", "missing", "name"]))
    if change == "missing":
        changed = (*stated[:number], *stated[number + 1 :])
    else:
        other = {
            "type": next(each for each in types if each != sensor.type),
            "object": next(each for each in names if each != sensor.object),
            "cutoff": sensor.cutoff * (1.0 + 1e-6) + 1e-6,
            "noise": sensor.noise * (1.0 + 1e-6) + 1e-6,
            "name": "other",
        }[change]
        changed = (*stated[:number], replace(sensor, **{change: other}), *stated[number + 1 :])  # type: ignore[arg-type]
    for first, second in ((stated, changed), (changed, stated)):
        (found,) = listed(with_sensors(first).to_mjcf(), with_sensors(second).to_mjcf())
        assert (found.kind, found.tag) == ("name" if change == "name" else "sensor", "sensor")
        assert {sensor.name, other if change == "name" else sensor.name} >= {found.ours, found.theirs} - {
            None
        }
        assert found.first != found.second
        if change == "missing":
            assert "none" in (found.first, found.second)
        else:
            assert None not in (found.first_line, found.second_line)


def test_a_site_elsewhere_is_another_sensor_and_its_name_is_none() -> None:
    gyro = '<gyro name="g" site="s" noise="0.1"/>'
    (found,) = listed(document(gyro), document(gyro, 'pos="0 0 0.25"'))
    assert (found.first, found.second) == (
        "gyro site s, noise 0.1",
        "placed otherwise: gyro site s, noise 0.1",
    )
    renamed = document(gyro).replace('"s"', '"imu"')
    assert listed(document(gyro), renamed) == []
    body = '<subtreecom name="g" body="b"/>'
    (found,) = listed(document(body), document(body.replace('"b"', '"c"')))
    assert (found.first, found.second) == ("subtreecom body b", "subtreecom body c")


def test_a_renamed_actuator_is_the_same_object() -> None:
    text = document('<actuatorfrc name="g" actuator="m"/>')
    assert listed(text, text.replace('"m"', '"motor"')) == []


def test_what_only_one_description_can_state_is_a_note() -> None:
    text = document('<clock name="g"/>')
    urdf = dynx.load(text).to_urdf(geometry=True)
    report = same_robot(text, urdf)
    assert report.same
    assert any("states no sensors" in each for each in report.notes)
    assert not any(each.kind == "sensor" for each in report.attributes)


@pytest.mark.parametrize("first", [True, False])
def test_a_sensor_of_one_file_is_listed_with_its_line(first: bool) -> None:
    files = document('<clock name="g"/>'), document("")
    (found,) = listed(*(files if first else files[::-1]))
    lines = (8, None) if first else (None, 8)
    assert (found.first_line, found.second_line) == lines
    assert {found.first, found.second} == {"clock", "none"}
