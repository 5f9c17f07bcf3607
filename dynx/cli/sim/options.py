"""Options of ``dynx sim`` under the headings of its ``--help``."""

from __future__ import annotations

from functools import partial

import click

from dynx.cli.shell.options import finite_number, group, json_option, model_options, number_list, one_of
from dynx.cli.sim.values import coefficients, gain, payload, push, scale, vector
from dynx.registry import DEFAULT_ENGINE

PROFILES = ("cycloidal", "cubic", "quintic", "trapezoidal", "s-curve", "hold")

TUTORIAL_OPTIONS = {
    *("tutorial", "robot", "lock", "gravity", "to", "start", "duration", "dt", "backend"),
    *("plot", "json_path"),
}
"""Parameters that have an effect with ``--tutorial``."""

_number_option = partial(click.option, type=finite_number, metavar="NUMBER")
_seconds_option = partial(click.option, type=finite_number, metavar="SECONDS")
_gain_option = partial(click.option, type=gain, metavar="NUMBERS")
_coefficients_option = partial(click.option, type=coefficients, metavar="urdf|NUMBERS|joint=NUMBER,...")
_configuration_option = partial(click.option, type=number_list, metavar="Q")

robot = group(
    "Robot",
    model_options,
    click.option(
        "--gravity",
        type=vector,
        metavar="X,Y,Z",
        help="Gravitational acceleration in the world [m/s^2] (default: 0,0,-9.81).",
    ),
)

motion = group(
    "Reference motion",
    _configuration_option(
        "--to",
        help="Target configuration [rad or m]: 0,1.5,... or joint=value,... (default: the initial one).",
    ),
    _configuration_option(
        "--to-pose",
        "--target",
        "to_pose",
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

controller = group(
    "Controller",
    click.option(
        "--controller",
        type=one_of("none", source="dynx.sim.named_controllers:CONTROLLERS"),
        default="computed-torque",
        metavar="NAME",
        help="Name of the controller, see above (default: computed-torque).",
    ),
    click.option(
        "--backend",
        default=DEFAULT_ENGINE,
        metavar="NAME",
        help="Backend with which the controller computes (default: pinocchio).",
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
    _seconds_option("--control-dt", help="Period of the controller [s], a multiple of --dt (default: --dt)."),
    _seconds_option(
        "--delay", default=0.0, help="Delay of the measurements [s], a multiple of --dt (default: 0)."
    ),
)

plant = group(
    "Plant and time steps",
    click.option(
        "--plant",
        default=DEFAULT_ENGINE,
        metavar="NAME",
        help="Backend or plant that moves the robot; pybullet is PyBullet's stepper (default: pinocchio).",
    ),
    _seconds_option("--dt", default=1e-3, help="Time step of the record [s] (default: 0.001)."),
    click.option(
        "--substeps",
        type=click.IntRange(min=1),
        default=1,
        metavar="N",
        help="Number of steps of the plant in each time step (default: 1).",
    ),
    click.option(
        "--integrator",
        type=one_of(source="dynx.sim.plants.registry:INTEGRATORS"),
        metavar="NAME",
        help="Integrator: semi-implicit, rk4, adaptive, or engine (PyBullet's stepper) (default: engine for "
        "the plant pybullet, else semi-implicit).",
    ),
    click.option(
        "--method",
        type=one_of(source="dynx.sim.plants.integrators:METHODS"),
        metavar="NAME",
        help="SciPy method of the integrator adaptive (default: DOP853).",
    ),
    _number_option("--rtol", help="Relative tolerance of the integrator adaptive (default: 1e-10)."),
    _number_option("--atol", help="Absolute tolerance of the integrator adaptive (default: 1e-12)."),
    _configuration_option(
        "--q0", help="Initial configuration of the robot [rad or m] (default: where the motion begins)."
    ),
    click.option(
        "--v0",
        type=number_list,
        metavar="V",
        help="Initial velocity of the robot [rad/s or m/s] (default: that of the motion).",
    ),
)

disturbances = group(
    "Joint dynamics, limits and disturbances",
    click.option(
        "--joint-dynamics",
        is_flag=True,
        help="Damping, friction and armature of the joints as in the robot description.",
    ),
    _coefficients_option(
        "--damping",
        help="Viscous damping of the joints [N m s/rad or N s/m]: urdf for that of the description, numbers, "
        "or numbers by joint, the others having none (default: 0).",
    ),
    _coefficients_option(
        "--friction",
        help="Coulomb friction of the joints [N m or N], which holds them at rest up to its magnitude: urdf "
        "for that of the description, numbers, or numbers by joint, the others having none (default: 0).",
    ),
    _number_option(
        "--friction-slip",
        help="Velocity over which Coulomb friction is smoothed, so that joints never stick [rad/s or m/s] "
        "(default: 0).",
    ),
    _coefficients_option(
        "--armature",
        help="Rotor inertia of the joints [kg m^2 or kg]: urdf for that of the description, numbers, or "
        "numbers by joint, the others having none (default: 0).",
    ),
    _coefficients_option(
        "--effort-limits",
        help="Limits at which torques are saturated [N m or N]: urdf for those of the description, numbers, "
        "or numbers by joint, the others being unlimited (default: unlimited).",
    ),
    click.option(
        "--position-limits", is_flag=True, help="Inelastic stops at the position limits of the joints."
    ),
    click.option(
        "--push",
        "pushes",
        type=push,
        multiple=True,
        metavar="FRAME:fx,fy,fz,mx,my,mz[:START[:DURATION]]",
        help="External force [N] and moment [N m] on a frame, in world axes, from START [s] (default 0) for "
        "DURATION [s] (default: until the end); may be given several times.",
    ),
)

model_errors = group(
    "Model error and sensor noise",
    click.option(
        "--payload",
        type=payload,
        multiple=True,
        metavar="FRAME:MASS[:x,y,z]",
        help="Point mass [kg] on a frame, at x,y,z [m] in it (default: 0,0,0), unknown to the controller; "
        "may be given several times.",
    ),
    click.option(
        "--mass-scale",
        type=scale,
        multiple=True,
        metavar="[LINK=]FACTOR",
        help="Factor for the masses and inertias of all links, or of one, unknown to the controller; may be "
        "given several times.",
    ),
    _gain_option(
        "--noise-q", help="Standard deviation of the noise of measured positions [rad or m] (default: 0)."
    ),
    _gain_option(
        "--noise-v",
        help="Standard deviation of the noise of measured velocities [rad/s or m/s] (default: 0).",
    ),
    click.option("--seed", type=click.IntRange(min=0), metavar="N", help="Seed of the noise (default: 0)."),
)

results = group(
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

tutorial = group(
    "All controllers of the tutorial",
    click.option(
        "--tutorial",
        is_flag=True,
        help="Comparison of every controller on PyBullet's stepper and on that of dynx, instead of one "
        "simulation. Takes ROBOT (ur5), --lock, --gravity (0,0,-9.8), --to, --from, --duration, --dt, "
        "--backend, --plot and --json.",
    ),
)
