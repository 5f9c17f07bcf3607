"""Text of `dynx sim`: deviations from the nominal run, energy, errors, refused input."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import dynx
from dynx import control
from dynx.cli.sim.report import column_text, percent_text
from dynx.sim import simulate
from dynx.sim.named_controllers import CONTROLLERS
from tests.cli.sim.command import SHORT, document, sim

ELBOW = ["ur5", "--to", "elbow_joint=1"]
FALLING = ["solo12", "--base", "floating", "--controller", "pd", "--duration", "0.05"]


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--payload", "tool0:2"], "plant: payload 2 kg on tool0"),
        (["--payload", "tool0:1"] * 4, "plant: 4 payloads"),
        (["--mass-scale", "1.1"], "plant: masses times 1.1"),
        (["--mass-scale", "forearm_link=1.1"], "plant: mass of forearm_link times 1.1"),
        (["--mass-scale", "1.1", "--mass-scale", "forearm_link=2"], "plant: masses times 1.1 to 2"),
        (
            ["--joint-friction", "0.5", "--joint-damping", "1,2,1,1,1,1"],
            "plant: damping 1 to 2, friction 0.5",
        ),
        (["--joint-armature", "0.1"], "plant: armature 0.1"),
        (["--push", "tool0:1,0,0"], "plant: push on tool0 from 0 s"),
        (["--push", "tool0:1,0,0:0.01:0.02"], "plant: push on tool0 from 0.01 s for 0.02 s"),
        (["--no-joint-limits"], "plant: no stops at the position limits"),
        (["--substeps", "2"], "plant: 2 substeps"),
        (["--noise-q", "1e-4", "--noise-v", "0.01"], "controller: noise 0.0001 in q and 0.01 in v"),
        (["--delay", "0.002"], "controller: delay 0.002 s"),
        (["--control-dt", "0.002"], "controller: period 0.002 s"),
        (["--joint-friction", "0.5", "--delay", "0.002"], "plant: friction 0.5; controller: delay 0.002 s"),
    ],
)
def test_the_header_lists_the_deviations_from_the_nominal_run(arguments: list[str], expected: str) -> None:
    assert expected in sim("ur5", *SHORT, *arguments).stdout.splitlines()


def test_losses_of_a_floating_robot_are_those_of_its_joints() -> None:
    losses = ["--joint-friction", "0.5", "--joint-armature", "0.1"]
    assert "plant: friction 0.5, armature 0.1" in sim(*FALLING, *losses).stdout.splitlines()


def test_the_header_of_a_nominal_run_has_no_deviations() -> None:
    lines = sim("ur5", *SHORT).stdout.splitlines()
    assert lines[2] == "kp 400, kd 40"
    assert not any(line.startswith(("plant:", "controller:")) for line in lines)


def test_a_step_begins_where_every_profile_begins() -> None:
    made = document("ur5", "--to", "elbow_joint=0.2", "--profile", "hold", "--duration", "0.5")
    assert made["motion"]["from"] == [0.0] * 6
    assert made["max_error"] == pytest.approx(0.2)
    assert made["final_error"] < 0.02
    assert made["max_error_time"] == 0.0
    assert made["joints"][2]["max_speed"] > 0.5


SWING = ["pendulum", "--controller", "none", "--q0", "1", "--duration", "0.1"]


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ([*SWING, "--no-joint-dynamics"], "energy drift "),
        (SWING, "energy changed by up to "),
        (FALLING, "energy changed by up to "),
        (["pendulum", "--controller", "none", "--duration", "0.1"], "the robot stayed at rest"),
        # Motion by rounding alone has no kinetic energy with which to compare a change.
        (["ur5", "--controller", "gravity-pd", "--duration", "0.05"], "the robot stayed at rest"),
    ],
)
def test_energy_drift_is_reported_only_for_a_passive_robot(arguments: list[str], expected: str) -> None:
    lines = sim(*arguments).stdout.splitlines()
    energy = [line for line in lines if line.startswith(("energy", "the robot stayed at rest"))]
    assert len(energy) == 1
    assert energy[0].startswith(expected)
    assert "work" not in energy[0]
    assert (" times " in energy[0]) == (expected == "energy drift ")


def test_the_change_of_energy_is_that_of_the_record() -> None:
    made = document(*SWING, "--joint-damping", "1")
    pendulum = dynx.load("pendulum")
    energy = simulate(pendulum, q0=[1.0], duration=0.1, joint_damping=1.0).energy
    assert made["energy_change"] == np.abs(energy - energy[0]).max()
    assert not made["passive"]


def test_every_violated_limit_is_listed() -> None:
    motion = ["--to", "elbow_joint=3,wrist_1_joint=3", "--duration", "0.1"]
    result = sim("ur5", *motion)
    assert result.exit_code == 2
    assert result.stderr == (
        "dynx: error: the motion violates 2 limits of ur5: "
        "velocity of 'elbow_joint' is 60 rad/s at 0.05 s, limit 3.15 rad/s; "
        "velocity of 'wrist_1_joint' is 60 rad/s at 0.05 s, limit 3.2 rad/s "
        "(a longer --duration lowers velocities; --ignore-limits simulates it nevertheless)\n"
    )
    tutorial = sim("--tutorial", "--duration", "0.2").stderr
    assert "; velocity of " in tutorial
    assert "--ignore-limits" not in tutorial
    assert tutorial.endswith("(a longer --duration lowers velocities)\n")


def test_noise_and_pushes_are_objects_in_the_document() -> None:
    noise = ["--noise-q", "1e-5", "--noise-v", "1e-3", "--seed", "7", "--joint-armature", "0.1"]
    pushes = ["--push", "tool0:1,2,3", "--push", "tool0:0,0,0,0,0,1:0.01:0.02"]
    settings = document("ur5", *SHORT, *noise, *pushes)["settings"]
    assert settings["noise"] == {"q": 1e-5, "v": 1e-3, "seed": 7}
    always, briefly = settings["pushes"]
    assert always == {
        "frame": "tool0",
        "wrench": [1.0, 2.0, 3.0, 0.0, 0.0, 0.0],
        "start": 0.0,
        "duration": None,
        "reference": always["reference"],
    }
    assert (briefly["start"], briefly["duration"]) == (0.01, 0.02)
    assert settings["joints"]["armature"] == [0.1] * 6
    assert document("ur5", *SHORT)["settings"]["noise"] is None


def test_the_document_of_an_interrupted_run_has_that_status(monkeypatch: pytest.MonkeyPatch) -> None:
    @contextmanager
    def impatient(total: int, words: str) -> Iterator[Callable[[int, str], None]]:
        def advance(taken: int, words: str) -> None:
            if 0 < taken < total:
                raise KeyboardInterrupt

        yield advance

    monkeypatch.setattr("dynx.cli.sim.run.progress_bar", impatient)
    made = document("ur5", "--to", "elbow_joint=1", "--dt", "0.0001", "--noise-q", "1e-5", code=130)
    assert made["status"] == "interrupted"
    error = made["error"]
    assert (error["type"], error["step"]) == ("Interrupted", made["steps"])
    assert error["message"] == f"interrupted after {made['steps']} of 20000 steps"
    assert error["time"] == made["simulated"]
    assert error["q"] == made["final"]["q"]


def test_numbers_of_one_column_are_of_one_style() -> None:
    assert column_text([0.000789, 0.01312, 0.9691]) == ["0.0008", "0.0131", "0.9691"]
    assert column_text([0.3081, 76.84]) == ["0.31", "76.84"]
    assert column_text([99.0, 12345.6]) == ["99", "12346"]
    assert column_text([0.0, 3.5e-20]) == ["0.0e+00", "3.5e-20"]
    assert column_text([1.5, 1.5e6]) == ["1.5e+00", "1.5e+06"]
    assert column_text([0.0, 0.0]) == ["0", "0"]
    assert column_text([]) == []


@pytest.mark.parametrize(
    ("ratio", "expected"),
    [
        (0.0, "0 %"),
        (3.5e-17, "<0.01 %"),
        (9.9e-5, "<0.01 %"),
        (7.3e-4, "0.07 %"),
        (0.0021, "0.21 %"),
        (0.06, "6.0 %"),
        (0.51, "51 %"),
        (0.997, "100 %"),
        (290.0, ">9999 %"),
    ],
)
def test_percentages_are_at_most_seven_characters_wide(ratio: float, expected: str) -> None:
    assert percent_text(ratio) == expected


@pytest.mark.parametrize("motion", [["--to", "panda_joint1=0.3"], ["--controller", "pd"]])
def test_a_row_of_the_panda_fits_a_terminal_of_80(motion: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    lines = sim("panda", *motion, "--duration", "0.5").stdout.splitlines()
    table = [line for line in lines if line.startswith(" ")]
    assert len(table) == 2 + 1 + 8
    assert all(len(line) <= 80 for line in table)


def test_errors_of_a_floating_base_are_apart_from_those_of_joints() -> None:
    arguments = [*FALLING, "--kp", "3", "--q0", "FL_KFE=0.1"]
    made = document(*arguments)
    assert made["max_error_joint"] == "FL_KFE"
    assert made["max_error"] == pytest.approx(0.1)
    dog = dynx.load("solo12", base="floating")
    q0 = dog.neutral()
    q0[7 + dog.joint_names.index("FL_KFE")] = 0.1
    controller = control.PD(dog, kp=3.0, kd=np.array(made["gains"]["kd"]))
    error = simulate(dog, controller, dog.neutral(), q0=q0, duration=0.05).error
    position, rotation = (np.linalg.norm(error[:, part], axis=1) for part in (slice(3), slice(3, 6)))
    assert made["base_error"]["position"]["max"] == pytest.approx(position.max(), rel=1e-9)
    assert made["base_error"]["position"]["final"] == pytest.approx(position[-1], rel=1e-9)
    assert made["base_error"]["rotation"]["max"] == pytest.approx(rotation.max(), rel=1e-9)
    text = sim(*arguments).stdout
    assert "largest error 1.0e-01 rad of FL_KFE at 0 s" in text
    assert f"error of base: position {position.max():.1e} m at " in text
    rows = [line for line in text.splitlines() if line.startswith(" base ")]
    assert len(rows) == 6
    assert all("(base axes)" in row for row in rows)


def test_a_fixed_base_has_no_error() -> None:
    made = document("ur5", *SHORT)
    assert made["base_error"] is made["frame_error"] is None


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ([*ELBOW, "--controller", "pd", "--kp", "400", "--kd", "40"], "wrist_3_joint"),
        (
            ["panda", "--to", "panda_joint1=1", "--controller", "impedance", "--kp", "500", "--kd", "50"],
            "panda_joint7",
        ),
        ([*ELBOW, "--dt", "0.1"], "shoulder_pan_joint"),
    ],
)
def test_gains_too_large_for_the_step_are_named(arguments: list[str], name: str) -> None:
    arguments = [*arguments, "--no-joint-limits"]
    result = sim(*arguments)
    assert result.exit_code == 1
    assert (
        f" at {name}, and a step is unstable above 2; smaller gains or a smaller dt can help" in result.stderr
    )
    made = document(*arguments, code=1)
    assert made["overshoot"]["joint"] == name
    assert made["overshoot"]["ratio"] > 2.0


def test_an_oscillation_within_the_limits_is_named_though_nothing_diverges() -> None:
    arguments = [*ELBOW, "--controller", "pd", "--kp", "400", "--kd", "500", "--effort-limits", "urdf"]
    result = sim(*arguments)
    assert result.exit_code == 0
    finding = "the torque of wrist_3_joint reverses in every control step, because kd control_dt / inertia is"
    assert finding in " ".join(result.stdout.split())
    made = document(*arguments)
    assert made["status"] == "done"
    assert made["overshoot"]["finding"].startswith(finding)
    assert made["overshoot"]["ratio"] > 20.0


def test_divergence_for_another_reason_has_no_overshoot() -> None:
    diverging = ["ur5", "--controller", "none", "--v0", "1e4,1e4,1e4,1e4,1e4,1e4", "--no-joint-limits"]
    assert document(*diverging, code=1)["overshoot"] is None
    assert "smaller gains" not in sim(*diverging).stderr
    assert document("ur5", *SHORT)["overshoot"] is None


LINE = ["ur5", "--from", "0.2,-1.4,1.2,0.1,0.5,0.2", "--to-pose", "0.4,0.2,0.5", "--duration", "0.5"]


def test_the_default_frame_is_in_the_header() -> None:
    note = "frame tool0 ends the longest chain of moving joints; --frame chooses another"
    assert note in sim(*LINE).stdout.splitlines()
    named = sim(*LINE, "--frame", "wrist_3_link").stdout
    assert "wrist_3_link along a straight line" in named
    assert "longest chain" not in named
    header = sim("ur5", *SHORT, "--controller", "operational-space", "--frame", "wrist_3_link").stdout
    assert "operational-space of wrist_3_link computed by" in header


def test_the_error_of_the_frame_itself() -> None:
    beside = [0.25, -1.4, 1.2, 0.1, 0.5, 0.2]
    arguments = [*LINE, "--q0", ",".join(map(str, beside))]
    made = document(*arguments)
    arm = dynx.load("ur5")
    bodies = dynx.backend("pinocchio", arm)
    wanted, actual = bodies.forward_kinematics(np.array([made["motion"]["from"], beside]), "tool0")
    error = made["frame_error"]
    assert error["position"]["max"] == pytest.approx(np.linalg.norm(wanted[:3, 3] - actual[:3, 3]), rel=0.02)
    assert error["rotation"]["max"] == pytest.approx(0.05, rel=0.02)  # about the first joint's axis
    assert error["position"]["final"] < 0.1 * error["position"]["max"]
    ended = bodies.forward_kinematics(np.array(made["final"]["q"]), "tool0")[:3, 3]
    assert error["position"]["final"] == pytest.approx(np.linalg.norm(ended - [0.4, 0.2, 0.5]), rel=1e-3)
    text = sim(*arguments).stdout
    assert f"error of tool0: position {error['position']['max']:.1e} m at " in text
    assert f" rotation {error['rotation']['max']:.1e} rad at " in text


def test_an_unknown_controller_lists_all() -> None:
    result = sim(*ELBOW, "--controller", "lqr")
    assert result.exit_code == 2
    assert f"there is no 'lqr'; known: {', '.join(['none', *CONTROLLERS])} " in result.stderr


def test_the_help_states_that_contacts_are_not_simulated() -> None:
    assert "there is no ground, and links do not collide" in " ".join(sim("--help").stdout.split())


def test_the_plot_of_a_floating_base_names_its_axes() -> None:
    pytest.importorskip("matplotlib")
    dog = dynx.load("solo12", base="floating")
    figure = simulate(dog, control.PD(dog, kp=1.0, kd=0.1), dog.neutral(), duration=2e-3).plot()
    labels = [axis.get_ylabel() for axis in figure.axes]
    assert "position [m] (world axes)" in labels
    assert "error q* - q [m] (base axes)" in labels
    assert "force [N] (base axes)" in labels
    assert sum("axes" in label for label in labels) == 3


def test_a_velocity_limit_of_zero_is_named_as_the_cause(tmp_path: Path) -> None:
    robot = tmp_path / "still.urdf"
    robot.write_text(
        '<robot name="still"><link name="a"/><joint name="j" type="revolute"><parent link="a"/>'
        '<child link="b"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="9" velocity="0"/></joint>'
        '<link name="b"><inertial><mass value="1"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>',
        encoding="utf-8",
    )
    said = sim(str(robot), "--to", "0.5").output
    assert "<limit velocity=\"0\"> of 'j' means that it must not move: write its largest speed" in said
    assert "longer --duration" not in said
