"""Sensors in files of scenes, on the command line, and in pictures."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import dynx
from dynx.cli.shell.main import cli
from dynx.errors import ArgumentError
from dynx.world import Encoder, ForceTorqueSensor, Imu, Scene, SensorErrors, World, read_scene, write_scene
from dynx.world.sensors.plot import plot
from tests.world.engines import WORLDS

SCENE = """
schema = "dynx.scene/1"

[[robots]]
name = "arm"
robot = "ur5"

[[sensors]]
kind = "imu"
name = "imu"
on = "arm/tool0"
rate = 250.0
pose = [0.0, 0.0, 0.05, 0.1, 0.2, 0.3]
accelerometer = { noise_density = 1e-3, bias = [0.1, 0.2, 0.3], saturation = 40.0 }

[[sensors]]
kind = "force_torque"
name = "wrist"
on = "arm/wrist_3_joint"
weight = false
torque = { cross_axis = [[0.0, 0.1, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]] }

[[sensors]]
kind = "encoder"
name = "elbow"
on = "elbow_joint"
position = { resolution = 1e-3 }
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    file = tmp_path / "cell.toml"
    file.write_text(SCENE, encoding="utf-8")
    return file


@pytest.mark.parametrize("suffix", ["toml", "json"])
def test_a_file_of_a_scene_has_its_sensors(path: Path, suffix: str) -> None:
    scene = read_scene(path)
    imu, wrist, elbow = scene.sensors
    assert imu == Imu(
        "imu",
        "arm/tool0",
        rate=250.0,
        pose=dynx.Pose((0.0, 0.0, 0.05), (0.1, 0.2, 0.3)),
        accelerometer=SensorErrors(noise_density=1e-3, bias=(0.1, 0.2, 0.3), saturation=40.0),
    )
    assert isinstance(wrist, ForceTorqueSensor)
    assert not wrist.weight
    assert elbow == Encoder("elbow", "elbow_joint", position=SensorErrors(resolution=1e-3))
    again = path.with_name(f"again.{suffix}")
    write_scene(scene, again)
    assert read_scene(again).sensors == scene.sensors


@pytest.mark.parametrize(
    ("right", "wrong", "says"),
    [
        ("rate = 250.0", "rate = -1.0", r"sensors\[0\], 'imu': rate of the imu sensor 'imu' is '-1.0'"),
        ("bias = [0.1, 0.2, 0.3]", "bias = [0.1]", "bias of accelerometer of the imu sensor 'imu' has shape"),
        ('kind = "encoder"', 'kind = "encodr"', "encoder"),
        ("noise_density = 1e-3", "noise_densty = 1e-3", "no key 'noise_densty'; did you mean"),
        ('on = "elbow_joint"', 'on = "elbow"', "'elbow', which is no joint of ur5.*elbow_joint"),
    ],
)
def test_an_error_names_the_sensor_and_what_is_valid(path: Path, right: str, wrong: str, says: str) -> None:
    path.write_text(SCENE.replace(right, wrong), encoding="utf-8")
    with pytest.raises(ArgumentError, match=says):
        read_scene(path)


def test_the_command_prints_the_last_readings_of_every_engine(path: Path) -> None:
    command = ["world", str(path), "--duration", "0.02", *(x for each in WORLDS for x in ("--engine", each))]
    shown = CliRunner().invoke(cli, command)
    assert shown.exit_code == 0, shown.output
    assert "last readings of sensors" in shown.stdout
    assert "acceleration:z" in shown.stdout
    document = json.loads(CliRunner().invoke(cli, [*command, "--json"]).stdout)
    scene: Scene = read_scene(path)
    for entry in document["engines"]:
        with World(scene, entry["engine"]) as world:
            world.run(0.02)
            for sensor in entry["sensors"]:
                reading = world.read_sensors()[sensor["name"]]
                np.testing.assert_allclose(
                    list(sensor["values"].values()), reading.values, rtol=1e-9, atol=1e-9
                )
                assert tuple(sensor["values"]) == reading.sensor.value_names
                assert sensor["t"] == pytest.approx(reading.t)
        assert [sensor["name"] for sensor in entry["sensors"]] == ["imu", "wrist", "elbow"]


def test_samples_are_drawn_with_their_units(path: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    arm = dynx.load("ur5")
    rollout = dynx.simulate(arm, None, duration=0.02, sensors=[Imu("imu $x$", "tool0", rate=500.0)])
    readings = rollout.sensors["imu $x$"]
    figure = readings.plot(tmp_path / "imu.png")
    assert (tmp_path / "imu.png").stat().st_size > 1000
    assert [panel.get_ylabel() for panel in figure.axes] == [
        "acceleration [m/s^2]",
        "angular velocity [rad/s]",
    ]
    (x, *_), _ = (panel.get_lines() for panel in plot(readings).axes)
    np.testing.assert_array_equal(x.get_ydata(), readings["acceleration"][:, 0])
