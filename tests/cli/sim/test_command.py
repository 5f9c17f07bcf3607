"""`dynx sim`: the simulation, its table and its document."""

from __future__ import annotations

import inspect
import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import dynx
from dynx import control, trajectory
from dynx.backends import installed_backends
from dynx.cli.commands.sim import sim as command
from dynx.cli.shell.inputs import default_frame
from dynx.errors import ArgumentError
from dynx.sim import Rollout, simulate
from dynx.sim.named_controllers import CONTROLLERS
from tests.cli.sim.command import SHORT, document, sim

needs_bullet = pytest.mark.skipif("pybullet" not in installed_backends(), reason="PyBullet is not installed")
MOTORS = ("position-motor", "velocity-motor", "pd-motor")
KEYS = """
    schema dynx robot source base base_pose gravity nq nv law backend gains motor_limits frame frame_given
    motion settings payload mass_scale total_mass passive status error overshoot dt steps steps_asked
    simulated seconds max_error max_error_joint max_error_time rms_error final_error base_error frame_error
    energy_change energy_drift max_kinetic_energy saturated joints final files notes
"""
"""Keys of the document, schema 1."""


def test_the_options_are_those_of_the_library() -> None:
    options = {param.name: param for param in command.params}
    taken = command.make_context("sim", ["ur5"]).params
    for name, parameter in inspect.signature(simulate).parameters.items():
        default = parameter.default
        if name in options and isinstance(default, int | float | str) and not isinstance(default, bool):
            if name == "mass_scale":  # several factors, each 1 by default
                continue
            assert taken[name] in (None, default), name
            written = default if isinstance(default, str) else f"{default:g}"
            assert f"(default: {written})" in options[name].to_info_dict()["help"], name


def test_every_option_stands_under_one_heading_of_the_help() -> None:
    text = sim("--help").stdout
    headings = ["Robot", "Reference motion", "Controller", "Plant and time steps", "Joint dynamics, limits"]
    headings += ["Model error and sensor noise", "Results", "All controllers of the tutorial"]
    headings.append("Other options")
    places = [text.index(f"\n{title}") for title in headings]
    assert places == sorted(places)
    assert text[places[-1] :].count("\n  -") == 1, "the last heading is that of --help alone"
    assert all(name in text for name in ("none", *CONTROLLERS) if name != "feed-forward-pd")


def test_the_table_has_a_line_for_each_joint() -> None:
    result = sim("ur5", *SHORT, "--effort-limits", "urdf")
    assert result.exit_code == 0
    assert result.stderr == ""
    assert "ur5, fixed base: computed-torque computed by pinocchio, on pinocchio" in result.stdout
    assert "cycloidal motion of 0.05 s; 50 steps of 0.001 s" in result.stdout
    rows = [line.split() for line in result.stdout.splitlines() if line.startswith(" ")]
    lines = {row[0]: row for row in rows if "_joint" in row[0]}
    assert len(lines) == 6
    made = document("ur5", *SHORT, "--effort-limits", "urdf")
    elbow = made["joints"][2]
    assert lines["elbow_joint"][1:] == [
        "rad",
        f"{elbow['max_error']:.1e}",
        f"{elbow['rms_error']:.1e}",
        f"{elbow['max_speed']:.4f}",
        f"{elbow['max_torque']:.2f}",
        "150",
        f"{elbow['max_torque'] / 1.5:.0f}",
        "%",
    ]
    assert "largest error " in result.stdout
    assert "energy changed by " in result.stdout
    assert "torques were saturated in 0 % of the steps" in result.stdout
    assert "simulated 0.05 s in " in result.stdout


def test_the_document_has_every_option_and_result() -> None:
    made = document(
        *(
            "ur5",
            *SHORT,
            "--payload",
            "tool0:2:0,0,0.1",
            "--mass-scale",
            "forearm_link=1.1",
            "--settle",
            "0.01",
        ),
        *(
            "--noise-q",
            "1e-5",
            "--delay",
            "0.002",
            "--push",
            "tool0:1,0,0,0,0,0:0.01",
            "--joint-damping",
            "0.5",
        ),
    )
    assert made["schema"] == 1
    assert set(made) == set(KEYS.split())
    assert (made["robot"], made["base"], made["nq"], made["nv"]) == ("ur5", "fixed", 6, 6)
    assert (made["law"], made["backend"], made["status"], made["error"]) == (
        "computed-torque",
        "pinocchio",
        "done",
        None,
    )
    assert made["gains"] == {"kp": [400.0] * 6, "kd": [40.0] * 6}
    assert made["motion"]["profile"] == "cycloidal"
    assert made["motion"]["to"] == [0.0, 0.0, 0.01, 0.0, 0.0, 0.0]
    assert (made["steps"], made["steps_asked"], made["simulated"]) == (60, 60, pytest.approx(0.06))
    assert made["payload"] == [{"frame": "tool0", "mass": 2.0, "center": [0.0, 0.0, 0.1]}]
    assert made["total_mass"] == pytest.approx(dynx.load("ur5").total_mass + 2.0 + 0.1 * 2.275, rel=1e-2)
    assert made["settings"]["plant"] == "pinocchio"
    assert made["settings"]["delay"] == 0.002
    assert len(made["settings"]["pushes"]) == 1
    assert made["seconds"] > 0.0
    assert not made["passive"]
    assert [joint["name"] for joint in made["joints"]] == list(dynx.load("ur5").joint_names)
    keys = "name unit max_error rms_error final_error max_speed max_torque effort_limit saturated"
    assert all(set(joint) == set(keys.split()) for joint in made["joints"])
    assert made["max_error"] == max(joint["max_error"] for joint in made["joints"])
    largest = next(joint for joint in made["joints"] if joint["name"] == made["max_error_joint"])
    assert largest["max_error"] == made["max_error"]
    assert made["final_error"] == max(abs(joint["final_error"]) for joint in made["joints"])
    assert len(made["final"]["q"]) == 6


@needs_bullet
def test_the_record_is_that_of_the_library(tmp_path: Path) -> None:
    target = tmp_path / "out.npz"
    arm = dynx.load("ur5", gravity=(0, 0, -9.8))
    there = [-1.5, -1.0, 1.0, -1.57, -1.57, -1.57]
    arguments = ["--to", ",".join(map(str, there)), "--plant", "pybullet", "--gravity", "0,0,-9.8"]
    made = document("ur5", *arguments, "--dt", "0.002", "--save", str(target))
    motion = trajectory.cycloidal(np.zeros(6), there, duration=2.0)
    controller = control.ComputedTorque(arm, kp=400, kd=40, backend="pinocchio")
    rollout = simulate(arm, controller, motion, plant="pybullet", dt=2e-3)
    saved = Rollout.load(target)
    np.testing.assert_array_equal(saved.q, rollout.q)
    np.testing.assert_array_equal(saved.tau, rollout.tau)
    assert made["max_error"] == np.abs(rollout.error).max()
    assert made["files"] == [str(target)]


@pytest.mark.parametrize("name", ["none", *CONTROLLERS])
def test_every_controller_runs(name: str) -> None:
    if name in MOTORS and "pybullet" not in installed_backends():
        pytest.skip("PyBullet is not installed")
    start = "0.2,-1.4,1.2,0.1,0.5,0.2"
    arguments = ["--from", start, "--duration", "0.05", "--frame", "tool0"]
    arguments = arguments[:4] if name not in ("operational-space", "impedance") else arguments
    gains = ["--kp", "300,300,300,30,30,30", "--kd", "30,30,30,3,3,3"] if name == "impedance" else []
    plant = ["--plant", "pybullet"] if name in MOTORS else []
    made = document("ur5", *arguments, "--controller", name, *gains, *plant)
    assert made["steps"] == 50
    assert made["law"] == name
    if name == "none":
        assert made["max_error"] is None
    else:
        assert made["max_error"] < 0.05


@needs_bullet
def test_motors_of_the_engine_are_saturated_at_limits() -> None:
    motor = ["pendulum", "--to", "1", "--controller", "position-motor", "--plant", "pybullet", "--dt", "0.01"]
    refused = sim(*motor)
    assert (refused.exit_code, "give joint_friction=False" in refused.stderr) == (2, True)
    motor += ["--joint-friction", "0"]
    free, described, weak = (
        document(*motor, *limits) for limits in ([], ["--effort-limits", "urdf"], ["--effort-limits", "1"])
    )
    # The description has no limit, which is no limit for the motor either.
    assert free["max_error"] == described["max_error"] < 1e-3
    assert (free["motor_limits"], described["motor_limits"], weak["motor_limits"]) == (None, [None], [1.0])
    assert weak["joints"][0]["max_torque"] == pytest.approx(1.0)
    assert weak["max_error"] > 0.5
    assert "PyBullet saturated its motors at the limits" in sim(*motor, "--effort-limits", "1").stdout


@pytest.mark.parametrize(
    ("arguments", "duration"),
    [
        (["--profile", "cubic"], 0.5),
        (["--profile", "quintic"], 0.5),
        (["--profile", "cubic", "--settle", "0.01"], 0.5003),
        (["--profile", "trapezoidal", "--acceleration", "2"], None),
        (["--profile", "s-curve", "--acceleration", "2", "--jerk", "20", "--velocity", "0.3"], None),
    ],
)
def test_every_profile_ends_at_the_target(arguments: list[str], duration: float | None) -> None:
    given = [] if duration is None else ["--duration", str(duration)]
    made = document("ur5", "--to", "elbow_joint=0.2", *arguments, *given)
    assert made["final"]["q"][2] == pytest.approx(0.2, abs=1e-3)
    took = made["motion"]["duration"]
    assert duration is None or took == duration
    # The simulation lasts until the step in which the motion, and the time after it, ends.
    asked = took + made["motion"]["settle"]
    assert asked <= made["simulated"] < asked + 1e-3


def test_joints_that_are_not_named_stay() -> None:
    made = document("ur5", "--from", "wrist_1_joint=0.3", "--to", "elbow_joint=0.01", "--duration", "0.05")
    assert made["motion"]["to"] == [0.0, 0.0, 0.01, 0.3, 0.0, 0.0]


def test_a_frame_moves_on_a_straight_line(tmp_path: Path) -> None:
    target = tmp_path / "line.npz"
    start = "0.2,-1.4,1.2,0.1,0.5,0.2"
    made = document(
        "ur5", "--from", start, "--to-pose", "0.4,0.2,0.5", "--duration", "0.5", "--save", str(target)
    )
    assert made["frame"] == default_frame(dynx.load("ur5"))
    rollout = Rollout.load(target)
    engine = dynx.backend("pinocchio", dynx.load("ur5"))
    places = engine.forward_kinematics(rollout.q, made["frame"])[:, :3, 3]
    np.testing.assert_allclose(places[-1], [0.4, 0.2, 0.5], atol=1e-3)
    along = (places[-1] - places[0]) / np.linalg.norm(places[-1] - places[0])
    off = places - places[0] - np.outer((places - places[0]) @ along, along)
    assert np.abs(off).max() < 1e-3


def test_friction_compensation_removes_the_error() -> None:
    losses = ["--joint-friction", "0.5", "--controller", "discrete-computed-torque"]
    without = document("ur5", *SHORT, *losses)
    given = document("ur5", *SHORT, *losses, "--friction-compensation")
    # In the last step the setpoint is at rest, and the elbow is not.
    assert given["rms_error"] < 0.3 * without["rms_error"]
    assert given["settings"]["controller"].endswith("friction compensated")
    smooth = [*losses, "--friction-slip", "5", "--friction-compensation"]
    assert document("ur5", *SHORT, *smooth)["max_error"] < 1e-10


def test_a_controller_knows_the_joint_dynamics_of_the_description() -> None:
    move = ("six_axis_arm", "--to", "joint1=0.3,joint2=0.2", "--duration", "0.5", "--ignore-limits")
    without = document(*move)
    given = document(*move, "--controller-joint-dynamics")
    assert given["rms_error"] < 0.3 * without["rms_error"]
    assert given["settings"]["controller"] == f"{without['settings']['controller']}, joint dynamics known"


def test_a_passive_robot_keeps_its_energy() -> None:
    made = document(
        *("pendulum", "--q0", "1.5", "--controller", "none", "--integrator", "rk4", "--duration", "1"),
        "--no-joint-dynamics",
    )
    assert made["passive"]
    assert made["energy_drift"] < 1e-10
    assert made["max_error"] is made["joints"][0]["effort_limit"] is None
    falling = ["pendulum", "--q0", "1.5", "--controller", "none", "--duration", "0.1"]
    text = sim(*falling, "--no-joint-dynamics").stdout
    assert "energy drift " in text
    assert "no tracking error: there is no reference" in text


def test_a_robot_without_joints_is_no_defect() -> None:
    for base in ("fixed", "floating"):
        for controller in ("none", "pd"):
            arguments = ["free_body", "--base", base, "--controller", controller, "--duration", "0.05"]
            assert sim(*arguments).exit_code == 0
            made = document(*arguments)
            assert len(made["joints"]) == (6 if base == "floating" else 0)
            assert made["steps"] == 50


def test_a_floating_base_has_six_lines() -> None:
    made = document("solo12", "--base", "floating", "--controller", "pd", "--duration", "0.05")
    assert [joint["name"] for joint in made["joints"]][:6] == [
        f"base {c}" for c in ("x", "y", "z", "rx", "ry", "rz")
    ]
    assert [joint["unit"] for joint in made["joints"]][:6] == ["m"] * 3 + ["rad"] * 3
    assert made["max_error_joint"] in dynx.load("solo12").joint_names
    assert made["base_error"]["position"]["max"] == pytest.approx(made["joints"][2]["max_error"])


def test_one_factor_for_all_links_and_another_for_one() -> None:
    arm = dynx.load("ur5")
    forearm = arm.link("forearm_link").inertial
    assert forearm is not None
    made = document("ur5", *SHORT, "--mass-scale", "1.1", "--mass-scale", "forearm_link=2")
    assert made["total_mass"] == pytest.approx(1.1 * arm.total_mass + 0.9 * forearm.mass)


def test_coefficients_by_joint_are_those_of_a_list() -> None:
    by_joint = ["--joint-friction", "elbow_joint=0.5", "--effort-limits", "elbow_joint=20,wrist_1_joint=9"]
    settings = document("ur5", *SHORT, *by_joint)["settings"]
    assert settings["joints"]["friction"] == [0.0, 0.0, 0.5, 0.0, 0.0, 0.0]
    assert settings["effort_limits"] == [None, None, 20.0, 9.0, None, None]
    refused = sim("ur5", *SHORT, "--joint-friction", "elbow=0.5")
    assert refused.exit_code == 2
    assert "joint_friction: " in refused.stderr
    assert "'elbow_joint'" in refused.stderr


ELBOW = ["ur5", "--to", "elbow_joint=0.1"]


@pytest.mark.parametrize(
    ("arguments", "clue"),
    [
        (["nosuchrobot"], "nosuchrobot"),
        ([], "ROBOT is missing"),
        (["ur5", "extra"], "extra"),
        ([*ELBOW, "--bogus"], "--bogus"),
        (["ur5", "--to", "0,nan,0,0,0,0"], "'--to': 'nan' is not finite"),
        (["ur5", "--to", "0,inf,0,0,0,0"], "'--to': 'inf' is not finite"),
        (["ur5", "--to", "0,1;5"], "'1;5' is not a number"),
        (["ur5", "--to", "90deg"], r"angles are in rad: 90deg are 1.5708"),
        (["ur5", "--to", "0,0,0"], "--to has 3 numbers; ur5 needs 6"),
        (["ur5", "--to", "elbow=1"], "did you mean 'elbow_joint'"),
        (["ur5", "--to", "elbow_joint=4"], "position of 'elbow_joint' is 4"),
        ([*ELBOW, "--from", "1"], "--from has 1 number"),
        ([*ELBOW, "--q0", "1,2"], "--q0 has 2 numbers"),
        ([*ELBOW, "--v0", "1,2"], "--v0 has 2 numbers"),
        ([*ELBOW, "--lock", "elbow_joint=0"], "it is locked"),
        ([*ELBOW, "--base", "floating"], "floating base"),
        ([*ELBOW, "--gravity", "1,2"], "wanted 3 numbers"),
        ([*ELBOW, "--controller", "computed-torqe"], "did you mean 'computed-torque'"),
        ([*ELBOW, "--profile", "cubik"], "did you mean 'cubic'"),
        ([*ELBOW, "--integrator", "rk5"], "did you mean 'rk4'"),
        ([*ELBOW, "--integrator", "engine"], "no stepper"),
        ([*ELBOW, "--integrator", "adaptive", "--rtol", "0"], "rtol"),
        ([*ELBOW, "--plant", "bulet"], "did you mean 'pybullet'"),
        ([*ELBOW, "--backend", "nosuch"], "no backend 'nosuch'"),
        ([*ELBOW, "--dt", "0"], "dt is '0.0'"),
        ([*ELBOW, "--dt", "nan"], "'nan' is not finite"),
        ([*ELBOW, "--dt", "1e-11"], "this machine has"),
        ([*ELBOW, "--dt", "1e-20"], "more than 1e+12 steps of dt"),
        ([*ELBOW, "--duration", "0"], "duration is '0.0'"),
        ([*ELBOW, "--settle", "-1"], "--settle is -1"),
        ([*ELBOW, "--control-dt", "0.0015"], "control_dt is 0.0015 s, which is not a multiple"),
        ([*ELBOW, "--delay", "0.0005"], "delay is 0.0005 s, which is not a multiple"),
        ([*ELBOW, "--substeps", "0"], "--substeps"),
        ([*ELBOW, "--duration", "0.05"], "velocity of 'elbow_joint' is 4"),
        ([*ELBOW, "--effort-limits", "0"], "is 0, so that no torque is allowed"),
        ([*ELBOW, "--effort-limits", "1,2"], "wanted one number, or 6"),
        ([*ELBOW, "--effort-limits", "some"], "'some' is not a number"),
        ([*ELBOW, "--kp=-1"], "kp is negative"),
        ([*ELBOW, "--kp", "1,2"], "kp has shape"),
        ([*ELBOW, "--kp", ","], "--kp"),
        ([*ELBOW, "--kd", "1"], "kd is given without kp"),
        ([*ELBOW, "--ki", "1"], "computed-torque takes no ki"),
        ([*ELBOW, "--controller", "none", "--kp", "1"], "takes no gains"),
        ([*ELBOW, "--controller", "impedance"], "impedance needs kp"),
        ([*ELBOW, "--controller", "position-motor"], "pybullet"),
        ([*ELBOW, "--controller", "none", "--controller-joint-dynamics"], "--controller none takes no"),
        ([*ELBOW, "--controller", "pd", "--controller-joint-dynamics"], "pd computes without"),
        (
            [*ELBOW, "--joint-friction", "1", "--friction-compensation", "--controller-joint-dynamics"],
            "would both compensate",
        ),
        ([*ELBOW, "--friction-compensation"], "needs damping or friction of a joint"),
        ([*ELBOW, "--damping", "1"], "no option '--damping'; it is now --joint-damping"),
        ([*ELBOW, "--friction", "1"], "no option '--friction'; it is now --joint-friction"),
        ([*ELBOW, "--armature", "1"], "no option '--armature'; it is now --joint-armature"),
        ([*ELBOW, "--position-limits"], "no option '--position-limits'; it is now --joint-limits"),
        ([*ELBOW, "--joint-dynamics"], "joints have those of the description by default"),
        ([*ELBOW, "--joint-damping=-1"], "damping is negative"),
        ([*ELBOW, "--joint-friction", "1", "--friction-slip=-1"], "slip"),
        ([*ELBOW, "--push", "tool0"], "--push"),
        ([*ELBOW, "--push", "tool0:1,2"], "--push"),
        ([*ELBOW, "--push", "tool:1,2,3"], "did you mean 'tool0'"),
        ([*ELBOW, "--push", "tool0:1,2,3:0:-1"], "is -1.0; wanted a positive number"),
        ([*ELBOW, "--payload", "tool0"], "--payload"),
        ([*ELBOW, "--payload", "tool0:1:2"], "tool0:1"),
        ([*ELBOW, "--payload", "tool0:-1"], "mass of a payload"),
        ([*ELBOW, "--mass-scale", "0"], "wanted a positive factor"),
        ([*ELBOW, "--mass-scale", "forearm=2"], "did you mean 'forearm_link'"),
        ([*ELBOW, "--mass-scale", "1.1", "--mass-scale", "1.2"], "given twice"),
        ([*ELBOW, "--noise-q=-1"], "noise.q is negative"),
        ([*ELBOW, "--seed", "-1"], "--seed"),
        ([*ELBOW, "--to-pose", "0.4,0.2,0.4"], "both given"),
        ([*ELBOW, "--frame", "tool0"], "--frame needs --to-pose"),
        (["ur5", "--to-pose", "0.4,0.2"], "--to-pose: wanted 3 numbers"),
        (["ur5", "--to-pose", "9,9,9"], "cannot follow the line"),
        (["ur5", "--to-pose", "0.4,0.2,0.4", "--profile", "hold"], "--to-pose takes --profile cycloidal"),
        (["ur5", "--profile", "cubic"], "needs --to or --to-pose"),
        ([*ELBOW, "--profile", "trapezoidal"], "needs --acceleration"),
        ([*ELBOW, "--profile", "s-curve", "--acceleration", "1"], "needs --jerk"),
        ([*ELBOW, "--profile", "trapezoidal", "--acceleration", "0"], "limit of acceleration is 0"),
        ([*ELBOW, "--jerk", "1"], "--jerk needs --profile s-curve"),
        ([*ELBOW, "--velocity", "1"], "--velocity needs --profile trapezoidal or s-curve"),
        ([*ELBOW, "--save", "/nosuch/folder/x.npz"], "/nosuch/folder"),
        ([*ELBOW, "--save", "x.txt"], "wanted one of .npz, .csv"),
        ([*ELBOW, "--save", "x.npz", "--save", "x.npz"], "twice"),
        ([*ELBOW, "--plot", "x.xyz"], "a plot is saved as .png, .pdf or .svg"),
        ([*ELBOW, "--plot", "/nosuch/folder/x.png"], "/nosuch/folder"),
        ([*ELBOW, "--resume", "/nosuch.npz"], "/nosuch.npz cannot be read"),
        ([*ELBOW, "--resume-step", "3"], "--resume-step needs --resume"),
        ([*ELBOW, "--method", "Radau"], "--method needs --integrator adaptive"),
        ([*ELBOW, "--atol", "1e-6", "--integrator", "rk4"], "--atol needs --integrator adaptive"),
        ([*ELBOW, "--friction-slip", "0.1"], "--friction-slip needs --joint-friction"),
        ([*ELBOW, "--seed", "1"], "--seed needs --noise-q or --noise-v"),
        ([*ELBOW, "--integrator", "adaptive", "--method", "DOP85"], "did you mean 'DOP853'"),
    ],
)
def test_arguments_that_cannot_be_used(arguments: list[str], clue: str) -> None:
    result = sim(*arguments)
    assert result.exit_code == 2
    assert clue in result.stderr
    assert result.stdout == ""
    assert result.stderr.startswith("dynx: error: ")
    assert result.stderr.count("\n") == 1


def test_ignore_limits_simulates_a_motion_beyond_them() -> None:
    made = document("ur5", "--to", "elbow_joint=0.1", "--duration", "0.05", "--ignore-limits")
    assert made["joints"][2]["max_speed"] > 3.15


@pytest.mark.parametrize("ending", [".npz", ".csv"])
def test_files_that_are_saved(ending: str, tmp_path: Path) -> None:
    target = tmp_path / f"out{ending}"
    assert sim("ur5", *SHORT, "--save", str(target)).exit_code == 0
    assert target.stat().st_size > 1000
    assert [path.name for path in tmp_path.iterdir()] == [target.name]


def test_a_plot_is_drawn(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    target = tmp_path / "out.png"
    assert sim("ur5", *SHORT, "--plot", str(target)).exit_code == 0
    assert target.read_bytes().startswith(b"\x89PNG")


def test_a_record_is_resumed_to_the_last_bit(tmp_path: Path) -> None:
    whole, part = tmp_path / "whole.npz", tmp_path / "part.npz"
    noisy = ["--noise-v", "1e-3", "--payload", "tool0:1", "--control-dt", "0.002", "--controller", "pid"]
    assert sim("ur5", *SHORT, *noisy, "--save", str(whole)).exit_code == 0
    again = sim("ur5", *SHORT, *noisy, "--resume", str(whole), "--resume-step", "17", "--save", str(part))
    assert again.exit_code == 0
    np.testing.assert_array_equal(Rollout.load(part).q, Rollout.load(whole).q)
    other = sim("ur5", *SHORT, "--resume", str(whole))
    assert other.exit_code == 2
    assert "the rollout to resume" in other.stderr


DIVERGING = ["ur5", "--controller", "none", "--v0", "1e4,1e4,1e4,1e4,1e4,1e4", "--no-joint-limits"]


@pytest.mark.parametrize("damage", ["truncated", "compression", "header", "path"])
def test_a_record_that_is_damaged_is_refused(damage: str, tmp_path: Path) -> None:
    record = tmp_path / "out.npz"
    assert sim("ur5", *SHORT, "--save", str(record)).exit_code == 0
    data = record.read_bytes()
    changed = {
        "truncated": data[: len(data) // 2],
        # The method of compression in every header, and the text of an array's header.
        "compression": data.replace(
            b"PK\x01\x02\x2d\x03\x2d\x00\x00\x00\x00\x00", b"PK\x01\x02\x2d\x03\x2d\x00\x00\x00\x63\x00"
        ),
        "header": data.replace(b"'shape': (", b"'shape': ((("),
        "path": data.replace(b"PK", b"Pk"),
    }
    record.write_bytes(changed[damage])
    result = sim("ur5", *SHORT, "--resume", str(record))
    assert result.exit_code == 2
    assert f"{record} cannot be read as a rollout" in result.stderr


def test_a_simulation_that_diverges_keeps_its_record(tmp_path: Path) -> None:
    target = tmp_path / "out.npz"
    result = sim(*DIVERGING, "--save", str(target))
    assert result.exit_code == 1
    assert result.stderr.count("\n") == 1
    assert "diverged in step 3, at 0.003 s" in result.stderr
    assert f"the results so far are in {target}" in result.stderr
    assert "--resume" not in result.stderr
    assert "3 steps of 0.001 s" in result.stdout
    assert len(Rollout.load(target)) == 3
    made = document(*DIVERGING, code=1)
    assert (made["status"], made["steps"], made["steps_asked"]) == ("diverged", 3, 2000)
    error = made["error"]
    assert (error["type"], error["step"], error["time"], len(error["v"])) == ("DivergedError", 3, 0.003, 6)


def test_an_invalid_torque_is_not_reported_as_divergence(monkeypatch: pytest.MonkeyPatch) -> None:
    # No gain below the bound overflows.
    monkeypatch.setattr("dynx.model.numbers.MAX_MAGNITUDE", np.inf)
    made = document("ur5", *SHORT, "--kp", "1e308", "--q0", "1,1,1,1,1,1", code=1)
    assert made["status"] == "control failed"
    assert made["error"]["type"] == "ControlError"
    assert made["steps"] == 0


def test_a_record_that_cannot_be_written_leaves_the_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(self: Rollout, path: str) -> None:
        raise ArgumentError(f"{path} cannot be written: no space left")

    monkeypatch.setattr(Rollout, "save", full)
    result = sim("ur5", *SHORT, "--save", str(tmp_path / "out.npz"))
    assert result.exit_code == 2
    assert "largest error" in result.stdout
    assert result.stderr.endswith("cannot be written: no space left\n")


def test_an_output_that_cannot_be_written_does_not_lose_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save = Rollout.save
    first, second, third = (str(tmp_path / f"{k}.{suffix}") for k, suffix in enumerate(("npz", "csv", "png")))

    def full(self: Rollout, path: str) -> None:
        if path == first:
            raise ArgumentError(f"{path} cannot be written: no space left")
        save(self, path)

    monkeypatch.setattr(Rollout, "save", full)
    result = sim("ur5", *SHORT, "--save", first, "--save", second, "--plot", third, "--json")
    assert result.exit_code == 2
    assert json.loads(result.stdout)["files"] == [second, third]
    assert {str(path) for path in tmp_path.iterdir()} == {second, third}
    assert result.stderr == f"dynx: error: {first} cannot be written: no space left\n"


def test_a_plot_without_matplotlib_names_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    for arguments in (["ur5", *SHORT], ["--tutorial"]):
        result = sim(*arguments, "--plot", str(tmp_path / "out.png"))
        assert result.exit_code == 2
        assert "pip install '.[plot]'" in result.stderr
        assert result.stdout == ""


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT to a child")
def test_a_run_that_is_ended_keeps_what_is_done(tmp_path: Path) -> None:
    target = tmp_path / "out.npz"
    # A slow plant, so that the run is not complete when the signal arrives.
    start = [sys.executable, "-m", "dynx", "sim", "six_axis_arm", "--to", "joint3=1", "--plant", "reference"]
    start += ["--duration", "200", "--save", str(target)]
    for patience in (4.0, 16.0, 64.0):
        process = subprocess.Popen(start, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        time.sleep(patience)
        process.send_signal(signal.SIGTERM)
        out, err = process.communicate(timeout=60.0)
        if target.exists() and len(Rollout.load(target)):
            break
    assert process.returncode == 143
    assert "Traceback" not in err
    assert err.count("\n") == 1
    assert "interrupted after " in err
    assert f"the same command with --resume {target} continues" in err
    assert "largest error" in out
    assert 0 < len(Rollout.load(target)) < 200_000


def test_an_interrupted_run_is_resumed_to_the_last_bit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    part, rest, whole = (tmp_path / f"{name}.npz" for name in ("part", "rest", "whole"))
    arguments = ["ur5", "--to", "elbow_joint=1", "--noise-q", "1e-5", "--dt", "0.0001"]
    assert sim(*arguments, "--save", str(whole)).exit_code == 0

    @contextmanager
    def impatient(total: int, words: str) -> Iterator[Callable[[int, str], None]]:
        def advance(taken: int, words: str) -> None:
            if 0 < taken < total:
                signal.raise_signal(signal.SIGINT)

        yield advance

    with monkeypatch.context() as patched:
        patched.setattr("dynx.cli.sim.run.progress_bar", impatient)
        interrupted = sim(*arguments, "--save", str(part))
    assert interrupted.exit_code == 130
    assert "interrupted after " in interrupted.stderr
    assert 0 < len(Rollout.load(part)) < 20_000
    assert sim(*arguments, "--resume", str(part), "--save", str(rest)).exit_code == 0
    np.testing.assert_array_equal(Rollout.load(rest).q, Rollout.load(whole).q)


def test_a_recording_of_ball_joints_is_written_and_read(tmp_path: Path) -> None:
    pytest.importorskip("mcap")
    path, record = tmp_path / "arm.xml", tmp_path / "run.mcap"
    path.write_text(
        '<mujoco><worldbody><body><joint name="hip" type="ball"/><geom type="sphere" size="0.1"/></body>'
        "</worldbody></mujoco>"
    )
    result = sim(str(path), "--controller", "none", "--duration", "0.01", "--save", str(record))
    assert result.exit_code == 0
    assert [joint.name for joint in Rollout.load(record).model.ball_joints] == ["hip"]
