"""Every public door of dynx, given a robot with a ball joint: a right answer, or dynx's own error that names
the joint. None gives a wrong number or a traceback."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import dynx
from dynx import control, trajectory
from dynx.backends import backend_names
from dynx.backends.quantities import QUANTITIES
from dynx.backends.registry import backend_class
from dynx.errors import DynxError, NotInstalledError, UnsupportedFeatureError
from dynx.model import Inertial, Joint, Limits, Link, Model
from tests.error_bounds import ErrorBounds, samples_at

BODY = Inertial(1.0, ixx=0.1, iyy=0.2, izz=0.25)
LINKS = (Link("base"), Link("upper", BODY), Link("hand", BODY))
MODEL = Model.build(
    "arm",
    LINKS,
    [
        Joint("shoulder", "ball", "base", "upper", limits=Limits(0.0, 2.0)),
        Joint(
            "elbow",
            "revolute",
            "upper",
            "hand",
            dynx.Pose((0.0, 0.0, 0.4)),
            limits=Limits(-2.0, 2.0, 1.0, 9.0),
        ),
    ],
)
Q, V = MODEL.random(0), np.array([0.3, -0.4, 0.5, 0.6])
TAKING = [name for name in backend_names() if backend_class(name).takes_ball_joints]


def engine() -> dynx.Backend:
    return dynx.backend("reference", MODEL)


def pose() -> Any:
    return engine().forward_kinematics(Q, "hand")


def of_file(act: Callable[[str], object]) -> Callable[[Path], object]:
    """Return the function of a folder that calls `act` on a file of the robot in it."""

    def called(folder: Path) -> object:
        path = folder / "arm.xml"
        path.write_text(MODEL.to_mjcf())
        return act(str(path))

    return called


def loaded(path: str) -> object:
    from dynx.loaded import load_as

    return load_as("pinocchio", path, MODEL)


def raised(report: dynx.DoctorReport | dynx.AgreementReport) -> object:
    """Raise the error that a report has instead of results."""
    if report.error is not None:
        raise UnsupportedFeatureError(report.error.message)
    return report


def reach(robot: str) -> object:
    from dynx.envs.registration import make_environment

    return make_environment("dynx/Reach-v0", robot=robot)


def velocity_ik() -> object:
    from dynx.ik.velocity import VelocityTask

    return engine().velocity_ik(Q, VelocityTask("hand", target=pose()), dt=0.01)


def world_on(engine: str) -> object:
    scene = dynx.world.Scene("arm", robots=(dynx.world.SceneRobot("arm", MODEL),))
    return dynx.world.World(scene, engine, dt=1e-3)


REFUSED: dict[str, Callable[[Path], object]] = {
    "to_urdf": lambda folder: MODEL.to_urdf(),
    "to_urdf with shapes": lambda folder: MODEL.to_urdf(geometry=True),
    "all solutions": lambda folder: engine().inverse_kinematics(pose(), "hand", all_solutions=True),
    "closed_form": lambda folder: dynx.ik.closed_form(MODEL, "hand"),
    "velocity_ik with limits": lambda folder: velocity_ik(),
    "inverse_kinematics with nearest": lambda folder: engine().inverse_kinematics(pose(), "hand", nearest=Q),
    "inverse_kinematics with a margin": lambda folder: engine().inverse_kinematics(
        pose(), "hand", limit_margin=0.1
    ),
    "line": lambda folder: trajectory.line(MODEL, "hand", Q, np.zeros(3), 1.0, backend="reference"),
    "time_optimal": lambda folder: trajectory.time_optimal(
        Q, MODEL.neutral(), acceleration=1.0, jerk=1.0, model=MODEL
    ),
    "excitation": lambda folder: trajectory.excitation(MODEL, 1.0),
    "Identifiability": lambda folder: trajectory.Identifiability(MODEL, backend="reference"),
    "time_optimal_path": lambda folder: trajectory.time_optimal_path(
        [Q, MODEL.neutral()], velocity=1.0, acceleration=1.0, model=MODEL
    ),
    "agree with PyBullet": lambda folder: raised(dynx.agree(MODEL, ["reference", "pybullet"])),
    "load_as Pinocchio": of_file(loaded),
    "a world on PyBullet": lambda folder: world_on("pybullet"),
    "a world on Drake": lambda folder: world_on("drake"),
    "a motor": lambda folder: dynx.world.SceneRobot("arm", MODEL, motors=dynx.world.VelocityMotor(0.0, 1.0)),
    "an encoder": lambda folder: dynx.world.Scene(
        "arm",
        robots=(dynx.world.SceneRobot("arm", MODEL),),
        sensors=(dynx.world.Encoder("angle", "shoulder"),),
    ),
    "Encoders": lambda folder: control.Encoders(
        control.PD(MODEL, kp=1.0, kd=1.0), resolution=0.1, control_dt=0.01
    ),
    "diagnose a model": lambda folder: raised(dynx.diagnose(MODEL)),
    "dynx/Reach": of_file(reach),
    "lock": lambda folder: dynx.load(MODEL, lock={"shoulder": 0.1}),
}

COMMANDS_THAT_COMPUTE = (
    ("info", "ROBOT"),
    ("fk", "ROBOT", "--q", "shoulder.qz=1,shoulder.qw=0,elbow=0.5"),
    ("jacobian", "ROBOT"),
    ("id", "ROBOT", "--v", "shoulder.x=1,elbow=2"),
    ("fd", "ROBOT", "--tau", "1,2,3,4"),
    ("mass", "ROBOT"),
    ("convert", "ROBOT", "--to", "sdf"),
    ("same", "ROBOT", "ROBOT"),
    ("agree", "ROBOT", "--backends", "reference,compiled"),
    ("agree", "ROBOT", "--samples", "3"),
    ("sim", "ROBOT", "--duration", "0.1"),
    ("doctor", "ROBOT"),
    ("world", "ROBOT", "--duration", "0.05", "--engine", "dynx"),
    ("ik", "ROBOT", "--target", "0,0,0.4", "--frame", "hand"),
)
COMMANDS_THAT_REFUSE = (
    ("id", "ROBOT", "--v", "shoulder=1"),
    ("convert", "ROBOT", "--to", "urdf"),
)


@pytest.mark.parametrize("door", REFUSED)
def test_a_door_that_takes_no_ball_joint_names_it(door: str, tmp_path: Path) -> None:
    with pytest.raises(DynxError) as raising:
        REFUSED[door](tmp_path)
    if isinstance(raising.value, NotInstalledError):
        pytest.skip(str(raising.value))
    assert "'shoulder'" in str(raising.value)
    assert "ball joint" in str(raising.value)


@pytest.mark.parametrize("name", backend_names())
def test_each_backend_computes_every_quantity_or_refuses_the_robot(name: str) -> None:
    if name not in TAKING:
        with pytest.raises((dynx.errors.EngineLimitError, NotInstalledError), match=r"'shoulder'|install"):
            dynx.backend(name, MODEL)
        return
    pytest.importorskip({"pinocchio": "pinocchio", "mujoco": "mujoco"}.get(name, "numpy"))
    arguments = {"q": Q, "v": V, "a": V[::-1].copy(), "tau": V}
    bounds = ErrorBounds(samples_at(MODEL, Q, V, arguments["a"], V))
    with dynx.backend(name, MODEL) as one, engine() as other:
        for quantity in QUANTITIES.values():
            own = [arguments[each] for each in quantity.arguments]
            details = ["hand"] if quantity.of_frame else []
            got, wanted = (getattr(each, quantity.name)(*own, *details) for each in (one, other))
            if not quantity.solves:
                bounds.check(quantity.name, got, wanted)
            else:
                bounds.check("inverse_dynamics", other.inverse_dynamics(Q, V, got), V)


def command(arguments: tuple[str, ...], folder: Path) -> Any:
    from dynx.cli.shell.main import cli

    path = folder / "arm.xml"
    path.write_text(MODEL.to_mjcf())
    return CliRunner().invoke(cli, [str(path) if each == "ROBOT" else each for each in arguments])


@pytest.mark.parametrize("arguments", COMMANDS_THAT_COMPUTE, ids=lambda each: each[0])
def test_commands_compute(arguments: tuple[str, ...], tmp_path: Path) -> None:
    result = command(arguments, tmp_path)
    assert result.exit_code == 0, result.output


@pytest.mark.parametrize("arguments", COMMANDS_THAT_REFUSE, ids=" ".join)
def test_commands_refuse_by_name(arguments: tuple[str, ...], tmp_path: Path) -> None:
    result = command(arguments, tmp_path)
    assert result.exit_code in (1, 2), result.output
    words = " ".join(result.output.split())
    assert "ball joint" in words, result.output
