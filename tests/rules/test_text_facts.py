"""Statements of the text rules about engines beyond their traps, checked with the installed engines."""

from __future__ import annotations

import pytest

from dynx.doctor.examination import temporary_document
from dynx.engines.silence import silence
from dynx.errors import EngineError
from dynx.loaded import LoadedInertial, LoadedJoint, installed_engines, load_as
from dynx.model.xml.source import XmlSource
from tests.rules.documents import LIMIT, case_of, joint, link

SOUND = case_of(
    link("base"),
    link("arm", mass=2.5, moments=(0.1, 0.2, 0.25), center=(0.3, 0.0, 0.0)),
    joint("elbow", "base", "arm"),
)
TRANSMISSION = (
    '<transmission name="t"><type>transmission_interface/SimpleTransmission</type>'
    '<joint name="elbow"/><actuator name="motor"/></transmission>'
)

needs_pinocchio = pytest.mark.skipif("pinocchio" not in installed_engines(), reason="says what it does")


def held(engine: str, old: str, new: str) -> tuple[LoadedInertial, LoadedJoint]:
    """Return the arm and its joint in an engine that loads the sound robot with `new` in place of `old`."""
    text = SOUND.source.text.replace(old, new)
    assert text != SOUND.source.text
    with temporary_document(XmlSource(text)) as path, silence(), load_as(engine, path, SOUND.model) as robot:
        found = robot.describe()
    return found.links["arm"], found.joints["elbow"]


@needs_pinocchio
@pytest.mark.parametrize("mass", ["2,5", "2.5kg", "2.5 ", "2.5\u00a0", "\u00a02.5", "heavy"])
def test_pinocchio_drops_the_whole_inertial_for_a_bad_mass(mass: str) -> None:
    inertial, _ = held("pinocchio", 'value="2.5"', f'value="{mass}"')
    assert (inertial.mass, abs(inertial.inertia).max()) == (0.0, 0.0)


@needs_pinocchio
@pytest.mark.parametrize("xyz", ["0,3 0 0", "0.3, 0, 0", "0.3m 0 0", "0.3 0", "0.3\t0 0", ""])
def test_pinocchio_drops_the_whole_inertial_for_a_bad_origin(xyz: str) -> None:
    inertial, _ = held("pinocchio", '<origin xyz="0.3 0.0 0.0"/>', f'<origin xyz="{xyz}"/>')
    assert (inertial.mass, abs(inertial.inertia).max()) == (0.0, 0.0)


@needs_pinocchio
@pytest.mark.parametrize("written_as", ['iyy="0,2"', 'iyy="0.2kg"', 'iyy="0.2 "', 'iyy="heavy"', ""])
def test_pinocchio_drops_the_tensor_alone_for_a_bad_number_of_it(written_as: str) -> None:
    inertial, _ = held("pinocchio", 'iyy="0.2"', written_as)
    assert (inertial.mass, abs(inertial.inertia).max()) == (2.5, 0.0)
    assert inertial.center.tolist() == [0.3, 0.0, 0.0]


@needs_pinocchio
def test_pinocchio_makes_a_point_mass_of_an_inertial_without_tensor() -> None:
    tensor = '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.25"/>'
    inertial, _ = held("pinocchio", tensor, "")
    assert (inertial.mass, abs(inertial.inertia).max()) == (2.5, 0.0)
    inertial, _ = held("pinocchio", '<mass value="2.5"/>', "")
    assert inertial.mass == 0.0


@pytest.mark.parametrize("engine", installed_engines())
@pytest.mark.parametrize("space", [" ", "\t", "\n", "  "])
def test_white_space_in_front_of_a_number_is_read_by_all(space: str, engine: str) -> None:
    inertial, _ = held(engine, 'value="2.5"', f'value="{space}2.5"')
    assert inertial.mass == 2.5
    _, elbow = held(engine, LIMIT, LIMIT.replace('="', f'="{space}'))
    assert elbow.limits == (-1.0, 1.0)


@pytest.mark.parametrize("engine", sorted({"pybullet", "mujoco", "drake"} & set(installed_engines())))
@pytest.mark.parametrize("space", [" ", "\t", "\n"])
def test_white_space_behind_a_number_is_read_by_all_but_pinocchio(space: str, engine: str) -> None:
    inertial, _ = held(engine, 'value="2.5"', f'value="2.5{space}"')
    assert inertial.mass == 2.5


@pytest.mark.parametrize(
    ("engine", "mass", "read"),
    [
        ("pybullet", "\u00a02.5", 0.0),
        ("pybullet", "2.5\u00a0", 2.5),
        ("drake", "\u00a02.5", None),
        ("drake", "2.5\u00a0", 2.5),
        ("mujoco", "\u00a02.5", None),
        ("mujoco", "2.5\u00a0", None),
    ],
)
def test_a_no_break_space_is_no_blank(engine: str, mass: str, read: float | None) -> None:
    if engine not in installed_engines():
        pytest.skip(f"{engine} is not installed")
    if read is None:
        with pytest.raises(EngineError, match="value"):
            held(engine, 'value="2.5"', f'value="{mass}"')
    else:
        assert held(engine, 'value="2.5"', f'value="{mass}"')[0].mass == read


@pytest.mark.skipif("drake" not in installed_engines(), reason="says what Drake does")
def test_a_negative_effort_matters_to_drake_where_the_joint_has_an_actuator() -> None:
    held("drake", 'effort="10"', 'effort="-10"')
    driven = f'effort="-10" velocity="5"/></joint>{TRANSMISSION}'
    with pytest.raises(EngineError, match="negative effort limit"):
        held("drake", 'effort="10" velocity="5"/></joint>', driven)


@pytest.mark.skipif("mujoco" not in installed_engines(), reason="says what MuJoCo does")
def test_mujoco_takes_the_sign_off_an_effort() -> None:
    assert held("mujoco", 'effort="10"', 'effort="-10"')[1].effort == 10.0
