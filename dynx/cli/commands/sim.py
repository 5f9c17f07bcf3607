"""Declaration of ``dynx sim``: its options under the headings of its ``--help``, and its help."""

from __future__ import annotations

from functools import partial

import click

from dynx.cli.shell.kinds import gain, option_groups
from dynx.cli.shell.lazy import runs
from dynx.cli.shell.options import (
    CONFIGURATION_FORM,
    GroupedCommand,
    configuration_text,
    engine_option,
    finite_number,
    gravity_option,
    group,
    json_option,
    model_options,
    number_list,
    one_of,
    silent_option,
)
from dynx.registry import DEFAULT_ENGINE
from dynx.sim.scenario import options as declared

PROFILES = ("cycloidal", "cubic", "quintic", "trapezoidal", "s-curve", "hold")

_seconds_option = partial(click.option, type=finite_number, metavar="SECONDS")
_gain_option = partial(click.option, type=gain, metavar="NUMBERS")
_configuration_option = partial(click.option, type=configuration_text, metavar="Q")

_robot = group(
    "Robot",
    model_options,
    gravity_option,
)

_motion = (
    _configuration_option(
        "--to",
        help=f"Target configuration [rad or m]: {CONFIGURATION_FORM} (default: that of --from).",
    ),
    click.option(
        "--to-pose",
        "--target",
        "to_pose",
        type=number_list,
        metavar="NUMBERS",
        help="Target position or pose of --frame, reached on a straight line, as x,y,z[,roll,pitch,yaw] "
        "[m, rad]; instead of --to.",
    ),
    click.option(
        "--frame",
        metavar="NAME",
        help="Frame of --to-pose and of the controllers operational-space and impedance "
        "(default: the end of the longest chain of moving joints).",
    ),
    _configuration_option(
        "--from", "start", help="Configuration at which the motion begins [rad or m] (default: neutral)."
    ),
    click.option(
        "--profile",
        type=one_of(*PROFILES),
        metavar="NAME",
        help=f"Time profile of the motion: {', '.join(PROFILES[:-1])} or {PROFILES[-1]}, a step to --to "
        "(default: cycloidal).",
    ),
    _seconds_option(
        "--duration",
        help="Duration of the motion [s] (default: 2; for trapezoidal and s-curve the shortest possible).",
    ),
    _seconds_option(
        "--settle", default=0.0, help="Time at rest after the end of the motion [s] (default: 0)."
    ),
    _gain_option(
        "--velocity",
        help="Velocity limit of trapezoidal and s-curve [rad/s or m/s] (default: the robot's).",
    ),
    _gain_option(
        "--acceleration",
        help="Acceleration limit of trapezoidal and s-curve [rad/s^2 or m/s^2]; required for both.",
    ),
    _gain_option("--jerk", help="Jerk limit of s-curve [rad/s^3 or m/s^3]; required for it."),
    click.option(
        "--ignore-limits",
        is_flag=True,
        help="Allow a motion that violates the robot's position or velocity limits.",
    ),
)

_controller = (
    click.option(
        "--controller",
        type=one_of("none", source="dynx.sim.named_controllers:CONTROLLERS"),
        default="computed-torque",
        metavar="NAME",
        help="Name of the controller, see above (default: computed-torque).",
    ),
    engine_option(
        "backend",
        "Engine with which the controller computes (default: pinocchio); --plant chooses the one that moves "
        "the robot.",
        default=DEFAULT_ENGINE,
        metavar="NAME",
    ),
    _gain_option(
        "--kp",
        help="Position gain [N m/rad or N/m]; of computed-torque and operational-space [1/s^2], of "
        "impedance [N/m, N m/rad], of position-motor a fraction. One number, or one for each joint (6 for "
        "a frame).",
    ),
    _gain_option(
        "--kd",
        help="Velocity gain [N m s/rad or N s/m]; of computed-torque and operational-space [1/s], of "
        "impedance [N s/m, N m s/rad].",
    ),
    _gain_option("--ki", help="Integral gain of pid [N m/(rad s) or N/(m s)] (default: kp^2 / (2 kd))."),
    _gain_option(
        "--natural-frequency",
        help="Natural frequency of the error dynamics [rad/s], instead of --kp and --kd (default: 20, so "
        "that kp is 400 and kd 40). Gains in N m are these numbers times the inertia of each joint at the "
        "start.",
    ),
    _gain_option("--damping-ratio", help="Damping ratio of the error dynamics (1 = critical; default: 1)."),
    _gain_option(
        "--posture-kp", help="Position gain of operational-space for the posture [1/s^2] (default: 0)."
    ),
    _gain_option(
        "--posture-kd",
        help="Velocity gain of operational-space for the posture [1/s] (default: 1); of impedance a damper "
        "on the joints [N m s/rad] (default: 0).",
    ),
    click.option(
        "--friction-compensation",
        is_flag=True,
        help="Compensation of the plant's damping and friction by the controller.",
    ),
    click.option(
        "--controller-joint-dynamics",
        is_flag=True,
        help="Armature, damping, friction and springs of the description in the model of the controller "
        "(default: rigid bodies).",
    ),
)

_joint_dynamics = click.option(
    "--no-joint-dynamics",
    is_flag=True,
    help="Joints without the damping, friction, armature and springs of the robot description.",
)

_results = group(
    "Results",
    click.option(
        "--save",
        multiple=True,
        metavar="FILE",
        help="File for the record: .npz (complete, for --resume), .csv or .mcap; may be given several times.",
    ),
    click.option(
        "--plot", metavar="FILE", help="File for a plot of joints, errors and torques: .png, .pdf, .svg, ..."
    ),
    json_option,
    silent_option,
    click.option(
        "--resume",
        metavar="FILE.npz",
        help="Record of an earlier run of the same simulation, which is continued.",
    ),
    click.option(
        "--resume-step",
        type=click.IntRange(min=0),
        metavar="N",
        help="Number of steps to take over from the record of --resume (default: all).",
    ),
)

_tutorial = group(
    "All controllers of the tutorial",
    click.option(
        "--tutorial",
        is_flag=True,
        help="Comparison of every controller on PyBullet's stepper and on that of dynx, instead of one "
        "simulation. Takes ROBOT (ur5), --lock, --gravity (0,0,-9.8), --to, --from, --duration, --dt, "
        "--engine, --plot and --json.",
    ),
)


@click.command(cls=GroupedCommand)
@click.argument("robot", required=False)
@_robot
@option_groups(
    {
        declared.REFERENCE: _motion,
        declared.CONTROL: _controller,
        declared.CLOCK: (),
        declared.JOINTS: (_joint_dynamics,),
        declared.ERRORS: (),
    }
)
@_results
@_tutorial
@runs("dynx.cli.sim.run:sim")
def sim() -> None:
    """Simulate a robot under a controller, which can compute on one engine while the robot moves on another.

    The reference motion goes from --from to --to, or moves a frame on a straight line to --to-pose;
    without either the controller holds that of --from (neutral by default), also if the robot begins at
    another (--q0). --controller none lets the robot move without motors. Units are s, rad, m, kg and N;
    NUMBERS is one number for all joints, or one for each joint, separated by commas. Controllers
    (--controller), where * marks the reference and ID is inverse dynamics:

    \b
      computed-torque           ID(q, v, a* + kd (v* - v) + kp (q* - q))
      discrete-computed-torque  torque that reaches the next reference sample in
                                one step
      pd, gravity-pd, pid       kp (q* - q) + kd (v* - v); plus gravity
                                compensation; plus an integral with anti-windup
      velocity                  kd (v* - v)
      feed-forward[-pd]         ID(q*, v*, a*); plus pd
      operational-space         computed torque of a frame; --posture-kp acts on
                                the remaining degrees of freedom
      impedance                 spring --kp and damper --kd between a frame and
                                its reference
      position-motor, velocity-motor, pd-motor
                                motors of PyBullet; with --plant pybullet
      none                      no torque

    Torque tables and your own controllers need Python: dynx.simulate.

    Contacts are not simulated: there is no ground, and links do not collide.

    The table shows for each joint the maximum and the root mean square tracking error, the maximum speed,
    and the maximum torque beside its limit.

    Exit code 0 when the simulation reached its end; 1 when it diverged or the controller returned an
    invalid torque, and then the results so far are shown and written; 2 when some input cannot be used.
    Ctrl-C ends it with the results so far and exit code 130; --resume continues it.

    \b
    Examples:
      dynx sim ur5 --to -1.5,-1,1,-1.57,-1.57,-1.57 --plant pybullet
      dynx sim ur5 --to elbow_joint=1 --controller pid --plot out.png
      dynx sim panda --from 0,-0.8,0,-2.4,0,1.6,0.8,0 --to-pose 0.5,0.2,0.4
      dynx sim ur5 --to elbow_joint=1 --payload tool0:3 --noise-q 1e-4
      dynx sim pendulum --q0 1.5 --controller none --duration 10 --save x.npz
      dynx sim --tutorial
    """
