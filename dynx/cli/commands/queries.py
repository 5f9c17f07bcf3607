"""Declarations of the commands that compute or list something at once."""

from __future__ import annotations

from collections.abc import Callable

import click

from dynx.cli.shell.lazy import runs
from dynx.cli.shell.options import (
    F,
    FiniteRange,
    configuration_option,
    frame_option,
    gravity_option,
    json_option,
    model_options,
    number_list,
    one_of,
    payload_option,
    robot_options,
    sample_option,
    silent_option,
    wrench_on_frame,
)

_q_option = configuration_option("Configuration (default: neutral)")
_v_option = sample_option("v", "Velocity (default: zero)")


def reference_option(default: str, quantity: str) -> Callable[[F], F]:
    """Return the option ``--reference`` for a quantity of a frame."""
    return click.option(
        "--reference",
        type=one_of("local_world_aligned", "local", "world"),
        default=default,
        show_default=True,
        metavar="NAME",
        help=f"Reference point and axes of the {quantity}: local-world-aligned, the frame's origin in world "
        "axes; local, its origin in its own axes; or world, the world's origin and axes.",
    )


@click.command
@json_option
@silent_option
@runs("dynx.cli.queries.listings:backends")
def backends() -> None:
    """List every backend: whether its engine is installed, and its version or how to install it.

    \b
    Examples:
      dynx backends
      dynx backends --json
    """


@click.command
@click.argument("words", nargs=-1, metavar="[WORD]...")
@json_option
@silent_option
@runs("dynx.cli.queries.listings:robots")
def robots() -> None:
    """List every robot that has a name: the package it comes from, and its file.

    With WORDs, list only the robots whose name or path contains one of them.

    \b
    Examples:
      dynx robots
      dynx robots ur talos
      dynx robots --json
    """


@click.command
@click.argument("robot")
@model_options
@gravity_option
@json_option
@silent_option
@runs("dynx.cli.queries.listings:info")
def info() -> None:
    """Show a robot description as dynx reads it: tree, joints, masses, frames, notes.

    A note reports something in the file that dynx ignored or interpreted, and that could matter.

    \b
    Examples:
      dynx info ur5
      dynx info path/to/robot.urdf --base floating
      dynx info panda --lock panda_finger_joint1=0.02 --json
    """


@click.command
@click.argument("rule", required=False)
@json_option
@silent_option
@runs("dynx.cli.queries.explain:explain")
def explain() -> None:
    """Print the page of a RULE, given by its id or name: cause, behaviour of each engine, remedy.

    Without RULE, list all rules. A rule of kind "difference" makes engines compute different numbers or
    refuse the file; one of kind "practice" is bad practice, or concerns a single engine.

    \b
    Examples:
      dynx explain
      dynx explain DX101
      dynx explain link-without-inertial --json
    """


@click.command
@robot_options
@_q_option
@frame_option
@runs("dynx.cli.queries.evaluate:fk")
def fk() -> None:
    """Compute forward kinematics: the pose of a frame in the world.

    \b
    Examples:
      dynx fk ur5 --q 0,-1.57,1.57,0,0,0 --frame tool0
      dynx fk panda --q panda_joint4=-1.5,panda_joint6=1.5 --json
    """


@click.command
@robot_options
@_q_option
@frame_option
@reference_option("local-world-aligned", "velocity")
@runs("dynx.cli.queries.evaluate:jacobian")
def jacobian() -> None:
    """Compute the Jacobian J (6, nv) of a frame: J v is the frame's velocity, linear rows first.

    \b
    Examples:
      dynx jacobian ur5 --q 0,-1.57,1.57,0,0,0 --frame tool0
      dynx jacobian panda --reference local --json
    """


_force_option = click.option(
    "--force",
    "forces",
    type=wrench_on_frame,
    multiple=True,
    metavar="FRAME:fx,fy,fz[,mx,my,mz]",
    help="External force [N] and moment [N m] at the origin of a frame (three numbers are the force alone), "
    "in world axes; may be given several times.",
)


@click.command("id")
@robot_options
@_q_option
@_v_option
@sample_option("a", "Acceleration (default: zero)")
@click.option(
    "--joint-dynamics", is_flag=True, help="Include damping, friction, armature and springs of the joints."
)
@payload_option
@_force_option
@click.option(
    "--wrenches",
    is_flag=True,
    help="Also the wrenches that the parents of all joints exert on their children, and that of the base: "
    "force [N], then moment [N m].",
)
@click.option(
    "--frame",
    metavar="NAME",
    help="Frame in which the wrenches are expressed (default: that of the child link of each joint).",
)
@reference_option("local", "wrenches")
@runs("dynx.cli.queries.evaluate:inverse_dynamics")
def id_() -> None:
    """Compute inverse dynamics: the torque tau (nv) that gives the acceleration a.

    Without --v and --a it is the torque that holds the robot against gravity. With --wrenches the forces that
    its joints and its base transmit are listed too.

    \b
    Examples:
      dynx id ur5 --q 0,-1.57,1.57,0,0,0
      dynx id ur5 --q 0,-1,1,0,0,0 --v 0,0.1,0,0,0,0 --a 1,0,0,0,0,0 --json
      dynx id ur5 --q 0,-1,1,0,0,0 --payload tool0:3:0,0,0.05
      dynx id ur5 --q 0,-1,1,0,0,0 --force tool0:0,0,-20 --wrenches
    """


@click.command
@robot_options
@_q_option
@_v_option
@sample_option("tau", "Torque (default: zero)")
@click.option(
    "--joint-dynamics", is_flag=True, help="Include damping, friction, armature and springs of the joints."
)
@payload_option
@_force_option
@runs("dynx.cli.queries.evaluate:forward_dynamics")
def fd() -> None:
    """Compute forward dynamics: the acceleration a (nv) that the torque tau gives.

    \b
    Examples:
      dynx fd ur5 --q 0,-1.57,1.57,0,0,0
      dynx fd ur5 --tau shoulder_pan_joint=10 --json
      dynx fd ur5 --q 0,-1,1,0,0,0 --force tool0:0,0,-20
    """


@click.command
@robot_options
@_q_option
@click.option("--joint-dynamics", is_flag=True, help="Include the armature of the joints.")
@payload_option
@runs("dynx.cli.queries.evaluate:mass_matrix")
def mass() -> None:
    """Compute the mass matrix M (nv, nv).

    \b
    Examples:
      dynx mass ur5 --q 0,-1.57,1.57,0,0,0
      dynx mass solo12 --base floating --json
    """


@click.command
@robot_options
@click.option(
    "--to-pose",
    "--target",
    "target",
    type=number_list,
    required=True,
    metavar="NUMBERS",
    help="Target position x,y,z [m], alone (any rotation) or followed by roll,pitch,yaw [rad] or "
    "qx,qy,qz,qw; or the 16 numbers of T_world_target, row by row.",
)
@click.option(
    "--free",
    type=one_of("position", "rotation"),
    metavar="PART",
    help="Part of the target that may be anything: rotation (only the position of a pose counts), or "
    "position (only the rotation counts; alone it is roll,pitch,yaw [rad], qx,qy,qz,qw, or 9 numbers).",
)
@frame_option
@configuration_option("Configuration at which the search starts (default: chosen by the solver)")
@click.option(
    "--all-solutions",
    "every",
    is_flag=True,
    help="Show every solution of a pose and the name of its branch, for arms that have a closed form; with "
    "--avoid also which of them are in collision.",
)
@click.option(
    "--given",
    type=number_list,
    metavar="JOINT=VALUE",
    help="Positions [rad or m] of joints that --all-solutions takes as given, such as one of seven.",
)
@click.option(
    "--avoid",
    metavar="SCENE",
    help="Scene whose bodies and robots the robot keeps away from, as its links do from one another: a file, "
    "or a name of the library. A scene without robots has this one. A .xacro file of a "
    "scene is expanded, which evaluates expressions as Python code: name only scenes that you trust.",
)
@click.option(
    "--margin",
    type=float,
    metavar="METRES",
    help="Distance [m] that --avoid keeps (default: 0.01)",
)
@click.option(
    "--timeout",
    type=FiniteRange(min=0.0, min_open=True),
    metavar="SECONDS",
    help="Time [s] after which the search stops with the best configuration found so far (default: none)",
)
@runs("dynx.cli.queries.ik:ik")
def ik() -> None:
    """Compute inverse kinematics: a configuration, within limits, that brings a frame to a target.

    Exit code 0 if the frame reaches the target, which forward kinematics checks; 1 if not, and then the
    best configuration found is shown. With --all-solutions, 1 if the pose has no solution, or with --avoid
    none that keeps all margins.

    \b
    Examples:
      dynx ik ur5 --to-pose 0.4,0.2,0.3 --frame tool0
      dynx ik ur5 --to-pose 0.4,0.2,0.3,3.14,0,0 --frame tool0 --json
      dynx ik ur5 --to-pose 3.14,0,0 --free position --frame tool0
      dynx ik ur5 --to-pose 0.4,0.2,0.3,3.14,0,0 --frame tool0 --all-solutions
    """
