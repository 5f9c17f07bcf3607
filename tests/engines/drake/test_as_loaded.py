"""Drake as it loads a file, in the coordinates of dynx."""

from __future__ import annotations

import logging
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.errors import EngineError
from dynx.loaded import LoadedRobot
from dynx.loaded.difference import Deviation, model_difference
from dynx.model import Inertial, JointDynamics, Model
from dynx.model.tree import Base
from dynx.rules.registry import find_trap
from tests.backends.robots import chain, motion
from tests.loaded.files import TILTED, assert_alike, clean_robots, loaded
from tests.loaded.fork import BASES, BODY, check_loaded_as_written, forked

pytest.importorskip("pydrake")
from dynx.engines.drake.as_loaded import MAX_LINKS, LoadedDrake
from dynx.engines.drake.library import MultibodyForces, MultibodyPlant, Parser


@given(st.data())
def test_clean_robots_are_loaded_as_dynx_reads_them(data: st.DataObject) -> None:
    drawn = data.draw(clean_robots())
    # Drake's own name for the world is the one name that no link may have.
    text = drawn.to_urdf().replace('"world"', '"the world"')
    model = dynx.load(text, base=drawn.base, gravity=TILTED)
    with loaded(LoadedDrake, model) as robot:
        assert_alike(robot, model, data.draw(st.integers(0, 99)))
        assert {(row.part, row.property) for row in _differences(model, robot)} <= {("joint", "friction")}


def _differences(model: Model, robot: LoadedRobot) -> list[Deviation]:
    return list(model_difference(model, [robot.describe()]))


@pytest.mark.parametrize("base", BASES)
def test_joints_are_in_the_order_of_dynx(base: Base) -> None:
    model = forked(base)
    with loaded(LoadedDrake, model) as robot:
        assert_alike(robot, model)


@pytest.mark.parametrize("base", BASES)
def test_what_it_holds_comes_link_by_link(base: Base) -> None:
    model = forked(base)
    held = check_loaded_as_written(LoadedDrake, model)
    assert list(held.links) == [link.name for link in model.links]
    assert all(link.mass == BODY.mass and link.merged == () for link in held.links.values())
    # Drake has no effort limit of a joint, and no losses are in this file.
    assert (held.joints["z_joint"].effort, held.joints["z_joint"].damping) == (None, 0.0)


@pytest.mark.parametrize("name", ["ur5", "solo12", "centauro"])
def test_real_robots_are_loaded_as_dynx_reads_them(name: str) -> None:
    model = dynx.load(name, gravity=TILTED)
    with LoadedDrake(Path(model.source), model) as robot:
        assert_alike(robot, model, solve=name != "centauro")


def test_a_joint_that_the_model_lacks_is_held_at_zero() -> None:
    model = forked("floating")
    locked = dynx.load(model, lock={"a_joint": 0.0})
    with loaded(LoadedDrake, locked, model.to_urdf()) as robot:
        assert_alike(robot, locked)


# -- what Drake reads otherwise, and the calls that undo it -----------------------------------


def changed(model: Model, link: str, inertial: Inertial | None) -> Model:
    """Return the robot with another inertial for one link."""
    links = tuple(replace(each, inertial=inertial) if each.name == link else each for each in model.links)
    return replace(model, links=links)


def assert_call_mends(model: Model, call: str, *, solve: bool = True) -> None:
    """Without the call Drake's inverse dynamics is not that of the file; with it, all is."""
    q, v, a = motion(model)
    with loaded(LoadedDrake, model) as spoiled, loaded(LoadedDrake, model, None, [call]) as mended:
        got, wanted = spoiled.inverse_dynamics(q, v, a), mended.inverse_dynamics(q, v, a)
        assert np.max(np.abs(got - wanted)) > 1e-6 * np.max(np.abs(wanted))
        assert_alike(mended, model, solve=solve)


@pytest.mark.parametrize("base", BASES)
def test_damping_is_in_inverse_dynamics(base: Base) -> None:
    model = forked(base)
    damped = tuple(replace(joint, dynamics=JointDynamics(damping=0.5)) for joint in model.joints)
    model = replace(model, joints=damped)
    assert_call_mends(model, "drake.no_damping")
    q, v, a = motion(model)
    with loaded(LoadedDrake, model) as robot, loaded(LoadedDrake, model, None, ["drake.no_damping"]) as bare:
        added = robot.inverse_dynamics(q, v, a) - bare.inverse_dynamics(q, v, a)
        assert robot.describe().joints["a_joint"].damping == 0.5
    np.testing.assert_allclose(added[-2:], 0.5 * v[-2:], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize(
    "inertial",
    [
        replace(BODY, ixx=-0.2),
        replace(BODY, izz=1.4),
        Inertial(0.0, BODY.origin, 0.2, 0.01, 0.02, 0.3, 0.03, 0.4),
    ],
    ids=["negative", "triangle", "massless"],
)
def test_an_inertia_of_no_body_is_replaced(inertial: Inertial, base: Base) -> None:
    model = changed(forked(base), "tool", inertial)
    # A negative moment may leave a joint without inertia that Drake would solve for.
    assert_call_mends(model, "drake.set_inertias", solve=inertial.ixx > 0.0)
    with loaded(LoadedDrake, model) as robot:
        held = robot.describe()
    # A solid sphere of the link's mass, or of 1 kg, and of the density of water.
    tool = held.links["tool"]
    assert tool.mass == pytest.approx(inertial.mass or 1.0)
    radius = (3.0 * tool.mass / (4.0 * np.pi * 1000.0)) ** (1.0 / 3.0)
    np.testing.assert_allclose(tool.inertia, 0.4 * tool.mass * radius**2 * np.eye(3), rtol=1e-9, atol=1e-12)
    assert any("inertia" in remark for remark in held.remarks)


def test_a_mimic_joint_is_a_constraint_that_forward_dynamics_refuses() -> None:
    model = forked()
    text = model.to_urdf().replace("<axis", '<mimic joint="z_joint" multiplier="2"/>\n    <axis', 2)
    text = text.replace('<mimic joint="z_joint" multiplier="2"/>\n    ', "", 1)
    q, v, a = motion(model)
    with loaded(LoadedDrake, model, text) as robot:
        assert_alike(robot, model, solve=False)
        remarks = robot.describe().remarks
        if "1 couplings of joints are constraints" in remarks:
            with pytest.raises(EngineError, match="does not support constraints"):
                robot.forward_dynamics(q, v, a)
        else:
            # Versions before (1.40 is one) leave the tag out of a continuous plant, with a warning.
            assert any("mimic" in remark for remark in remarks)
            assert_alike(robot, model)
    with loaded(LoadedDrake, model, text, ["drake.free_mimics"]) as robot:
        assert_alike(robot, model)


def test_a_rotor_inertia_is_in_the_mass_matrix() -> None:
    model = forked()
    actuator = (
        '<transmission name="t"><type>transmission_interface/SimpleTransmission</type><joint name="a_joint"/>'
        '<actuator name="m"><drake:gear_ratio value="50"/><drake:rotor_inertia value="0.001"/></actuator>'
        "</transmission></robot>"
    )
    text = model.to_urdf().replace("</robot>", actuator)
    q = model.neutral()
    with (
        loaded(LoadedDrake, model, text) as robot,
        loaded(LoadedDrake, model, text, ["drake.no_rotors"]) as bare,
    ):
        added = robot.mass_matrix(q) - bare.mass_matrix(q)
        held = robot.describe().joints["a_joint"]
        assert_alike(bare, model)
    np.testing.assert_allclose(added, [[0.0, 0.0], [0.0, 0.001 * 50.0**2]], rtol=1e-12, atol=1e-12)
    assert held.armature == pytest.approx(2.5)
    assert held.effort == 9.0


def test_a_joint_to_a_nested_model_is_that_of_the_file(tmp_path: Path) -> None:
    """Drake names such a joint as if the nested model stated it."""
    mass = "<inertial><mass>2</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial>"
    path = tmp_path / "robot.sdf"
    path.write_text(
        f"""<sdf version="1.9"><model name="arm"><link name="upper">{mass}</link>
        <model name="camera"><pose>0.5 0 0 0 0 0</pose><link name="lens">{mass}</link></model>
        <joint name="tilt" type="revolute"><parent>upper</parent><child>camera::lens</child>
        <axis><xyz>0 1 0</xyz></axis></joint></model></sdf>"""
    )
    model = dynx.load(path)
    with LoadedDrake(path, model) as robot:
        assert model.joint_names == ("tilt",)
        assert_alike(robot, model)


def test_the_call_that_adds_models_runs_as_it_is_shown() -> None:
    path = find_trap("DX711")
    create = LoadedDrake.load_call(True, form="sdf").splitlines()[0]
    names: dict[str, Any] = {"MultibodyPlant": MultibodyPlant, "Parser": Parser}
    names |= {"NAME": "dx711_tool", "FOLDER": str(path.parent / "dx711_tool")}
    exec(f"{create}\n{LoadedDrake.CALLS['drake.add_models']}", names)
    text = path.read_text().replace("model://dx711_tool", "model://dx711_tool/")
    names["parser"].AddModelsFromString(text, "sdf")
    assert names["plant"].num_model_instances() == 4  # the world, the default one, the robot and its tool


@pytest.mark.parametrize("call", [each for each in LoadedDrake.CALLS if each != "drake.add_models"])
def test_each_call_that_is_shown_runs_as_it_is_shown(call: str, tmp_path: Path) -> None:
    model = forked()
    path = tmp_path / "robot.urdf"
    path.write_text(model.to_urdf())
    lines = LoadedDrake.load_call(False).splitlines()
    names: dict[str, Any] = {
        "MultibodyPlant": MultibodyPlant,
        "Parser": Parser,
        "path": str(path),
        "root_link": "trunk",
    }
    exec("\n".join(lines[:-1]), names)
    if "before plant.Finalize()" in LoadedDrake.CALLS[call]:
        exec(LoadedDrake.CALLS[call], names)
    exec(lines[-1], names)
    plant = names["plant"]
    names["context"] = plant.CreateDefaultContext()
    if "Finalize" not in LoadedDrake.CALLS[call]:
        from dynx.engines.drake.library import SpatialInertia, UnitInertia

        # Any inertia will do to see that the lines fit Drake.
        stated: dict[str, Any] = {
            "m": 2.0,
            "center_of_mass": np.array([0.1, 0.0, 0.2]),
            "I": np.diag([0.3, 0.4, 0.5]),
        }
        names.update(stated, link="tool", SpatialInertia=SpatialInertia, UnitInertia=UnitInertia)
        exec(LoadedDrake.CALLS[call], names)
        held = plant.GetBodyByName("tool").CalcSpatialInertiaInBodyFrame(names["context"])
        assert held.get_mass() == 2.0
        np.testing.assert_allclose(2.0 * held.get_unit_inertia().CopyToFullMatrix3(), stated["I"])
    else:
        assert MultibodyForces(plant).num_bodies() == plant.num_bodies()
    with LoadedDrake(path, model, [call]) as robot:
        assert_alike(robot, model)


# -- what is refused ---------------------------------------------------------------------------


@pytest.mark.parametrize("base", BASES)
def test_a_root_named_world_is_the_world(base: Base) -> None:
    model = forked(base, root="world")
    if base == "floating":
        with pytest.raises(EngineError, match="for the world itself, so its base cannot float"):
            loaded(LoadedDrake, model).__enter__()
        return
    with loaded(LoadedDrake, model) as robot:
        assert_alike(robot, model)
        held = robot.describe()
    assert held.links["world"].mass == 0.0
    assert any("<inertial> tag is being ignored" in remark for remark in held.remarks)


@pytest.mark.parametrize("base", BASES)
def test_another_link_named_world_is_refused(base: Base) -> None:
    text = forked(base).to_urdf().replace('"tool"', '"world"')
    model = dynx.load(text, base=base)
    with pytest.raises(EngineError, match="attached there"):
        loaded(LoadedDrake, model, text).__enter__()


FATAL = {
    "is empty": ('name="forked"', 'name=""'),
    "lower limit 2 above its upper limit 0.7": ('lower="-0.3"', 'lower="2"'),
    "has no text": (
        "</robot>",
        '<transmission name="t"><type> <!-- none --> </type><joint name="a"/><actuator name="m"/>'
        "</transmission></robot>",
    ),
    "negative limit, velocity -2": ('velocity="2.0"', 'velocity="-2"'),
    "negative limit, drake:acceleration -1": ('velocity="2.0"', 'velocity="2" drake:acceleration="-1"'),
}


@pytest.mark.parametrize("words", FATAL)
def test_files_that_would_end_the_process_are_not_handed_over(words: str, tmp_path: Path) -> None:
    model = forked()
    text = model.to_urdf()
    spoiled = text.replace(*FATAL[words])
    assert spoiled != text
    with pytest.raises(EngineError, match=rf"drake would end the process: .*{words}"):
        loaded(LoadedDrake, model, spoiled).__enter__()
    path = tmp_path / "robot.urdf"
    path.write_text(spoiled)
    program = (
        "import sys; from pydrake.multibody.plant import MultibodyPlant as Plant; "
        "from pydrake.multibody.parsing import Parser; plant = Plant(time_step=0.0)\n"
        "try: Parser(plant).AddModels(sys.argv[1])\n"
        "except Exception: sys.exit(0)"
    )
    done = subprocess.run([sys.executable, "-c", program, str(path)], capture_output=True, check=False)
    assert done.returncode != 0


def test_files_that_drake_refuses_raise_its_message() -> None:
    model = forked()
    text = model.to_urdf()
    for spoiled, words in (
        (text.replace("0.6 0.8", "0 0"), "axis is zero"),
        (text.replace('"a_joint"', '"b_joint"'), "'a_joint' .not there"),
        (text.replace("continuous", "planar"), "'z_joint' .planar"),
        (text.replace("continuous", "floating"), "'z_joint' .not there"),
        (text.replace('"tool"', '"z_joint_parent"'), "frame named 'z_joint_parent'"),
        (text.replace("</robot>", ""), "not XML"),
    ):
        assert spoiled != text
        with pytest.raises(EngineError, match=words):
            loaded(LoadedDrake, model, spoiled).__enter__()


def test_what_is_no_file_is_not_handed_over(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "none.urdf"):
        with pytest.raises(EngineError, match="no regular file"):
            LoadedDrake(path, forked())


def test_a_robot_that_loads_too_slowly_is_refused() -> None:
    model = chain(MAX_LINKS)
    with pytest.raises(EngineError, match=f"has {MAX_LINKS + 1} links"):
        loaded(LoadedDrake, model).__enter__()


def test_what_it_warns_of_is_kept_and_reaches_no_handler(
    capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    model = forked()
    text = model.to_urdf().replace("<axis", '<dynamics friction="0.25"/><axis', 1)
    logger = logging.getLogger("drake")
    before = (logger.level, logger.handlers[:], logger.propagate)
    with loaded(LoadedDrake, model, text) as robot:
        held = robot.describe()
    assert [remark for remark in held.remarks if remark.startswith("line ") and "friction" in remark]
    assert held.joints["z_joint"].friction == 0.0
    assert not caplog.records
    assert capfd.readouterr() == ("", "")
    assert (logger.level, logger.handlers, logger.propagate) == before


@pytest.mark.parametrize("base", BASES)
def test_the_call_that_is_shown_loads_the_robot(base: Base, tmp_path: Path) -> None:
    model = forked(base)
    path = tmp_path / "robot.urdf"
    path.write_text(model.to_urdf())
    names: dict[str, Any] = {
        "MultibodyPlant": MultibodyPlant,
        "Parser": Parser,
        "path": str(path),
        "root_link": "trunk",
    }
    exec(LoadedDrake.load_call(model.floating), names)
    plant = names["plant"]
    assert (plant.num_positions(), plant.num_velocities()) == (model.nq, model.nv)
    assert plant.CalcTotalMass(plant.CreateDefaultContext()) == 4 * BODY.mass
    assert LoadedDrake.engine_version().count(".") >= 1
