"""The options of ``dynx sim``, under the headings of its ``--help``."""

from __future__ import annotations

from functools import partial

import click

from dynx.cli.shell.option_groups import stacked
from dynx.cli.shell.options import finite_number, number_list, one_of
from dynx.cli.sim.values import coefficients, gain, payload, push, scale, vector

CONTROLLERS = (
    "none",
    "position-motor",
    "velocity-motor",
    "pd-motor",
    "velocity",
    "pd",
    "pid",
    "gravity-pd",
    "feed-forward",
    "feed-forward-pd",
    "computed-torque",
    "discrete-computed-torque",
    "operational-space",
    "impedance",
)
"""A test holds them to those of `dynx.sim.named_controllers`, which is slow to import."""

PROFILES = ("cycloidal", "cubic", "quintic", "trapezoidal", "s-curve", "hold")
INTEGRATORS = ("semi_implicit", "rk4", "adaptive", "engine")
METHODS = ("RK23", "RK45", "DOP853", "Radau", "BDF", "LSODA")
"""A test holds these two to those of `dynx.sim`."""

GROUPS = {
    "The robot": ("base", "lock", "gravity"),
    "Where it is to go": (
        "to",
        "to_pose",
        "frame",
        "start",
        "profile",
        "duration",
        "settle",
        "velocity",
        "acceleration",
        "jerk",
        "ignore_limits",
    ),
    "The controller": (
        "controller",
        "backend",
        "kp",
        "kd",
        "ki",
        "natural_frequency",
        "damping_ratio",
        "posture_kp",
        "posture_kd",
        "friction_compensation",
        "control_dt",
        "delay",
    ),
    "What moves": ("plant", "dt", "substeps", "integrator", "method", "rtol", "atol", "q0", "v0"),
    "What acts on the joints": (
        "joint_dynamics",
        "damping",
        "friction",
        "friction_slip",
        "armature",
        "effort_limits",
        "position_limits",
        "pushes",
    ),
    "What the controller does not know": ("payload", "mass_scale", "noise_q", "noise_v", "seed"),
    "What is kept": ("save", "plot", "as_json", "resume", "resume_step"),
    "All modes of control": ("tutorial",),
}

OF_TUTORIAL = {
    *("tutorial", "robot", "lock", "gravity", "to", "start", "duration", "dt", "backend"),
    *("plot", "as_json"),
}
"""What takes part in ``--tutorial``."""

_number_option = partial(click.option, type=finite_number, metavar="NUMBER")
_seconds_option = partial(click.option, type=finite_number, metavar="SECONDS")
_gain_option = partial(click.option, type=gain, metavar="NUMBERS")
_coefficients_option = partial(click.option, type=coefficients, metavar="urdf|NUMBERS")
_configuration_option = partial(click.option, type=number_list, metavar="Q")

robot = stacked(
    click.option(
        "--gravity", type=vector, metavar="X,Y,Z", help="In the world [m/s^2] (default: 0,0,-9.81)."
    ),
)

motion = stacked(
    _configuration_option(
        "--to",
        help="The configuration [rad or m] to go to: 0,1.5,... or joint=value,... (default: stay).",
    ),
    _configuration_option(
        "--to-pose",
        help="Instead of --to: where --frame goes on a straight line, as x,y,z[,roll,pitch,yaw] [m, rad].",
    ),
    click.option(
        "--frame",
        metavar="NAME",
        help="Of --to-pose and the laws of a frame (default: the end of the longest chain of joints).",
    ),
    _configuration_option("--from", "start", help="Where the motion begins (default: neutral)."),
    click.option(
        "--profile",
        type=one_of(PROFILES),
        metavar="NAME",
        help=f"{', '.join(PROFILES[:-1])} or {PROFILES[-1]}, which wants --to at once: the response to "
        "a step (default: cycloidal).",
    ),
    _seconds_option(
        "--duration",
        help="Of the motion (default: 2; the shortest there is for trapezoidal and s-curve).",
    ),
    _seconds_option("--settle", default=0.0, help="Time after the motion, at rest at its end (default: 0)."),
    _gain_option(
        "--velocity",
        help="Limit for trapezoidal and s-curve [rad/s or m/s] (default: the robot's).",
    ),
    _gain_option("--acceleration", help="Limit for the same two [rad/s^2 or m/s^2]; they need it."),
    _gain_option("--jerk", help="Limit for s-curve [rad/s^3 or m/s^3]; it needs it."),
    click.option(
        "--ignore-limits",
        is_flag=True,
        help="Follow a motion that leaves the robot's limits of position or velocity.",
    ),
)

controller = stacked(
    click.option(
        "--controller",
        type=one_of(CONTROLLERS),
        default="computed-torque",
        metavar="NAME",
        help="The law, see above (default: computed-torque).",
    ),
    click.option(
        "--backend",
        default="pinocchio",
        metavar="NAME",
        help="The engine that the law computes with (default: pinocchio).",
    ),
    _gain_option(
        "--kp",
        help="Of computed-torque and operational-space [1/s^2], of impedance [N/m, N m/rad], of "
        "position-motor a fraction, else [N m/rad or N/m]; one number or one for each joint (of a frame: 6).",
    ),
    _gain_option("--kd", help="The same for speeds, [1/s], [N s/m, N m s/rad] or [N m s/rad or N s/m]."),
    _gain_option("--ki", help="Of pid [N m/(rad s) or N/(m s)] (default: kp^2 / (2 kd))."),
    _gain_option(
        "--natural-frequency",
        help="Of the error [rad/s], instead of --kp and --kd (default: 20, so that kp is 400 and kd 40; "
        "laws of torque take that times the inertia that each joint sees at the start).",
    ),
    _gain_option("--damping-ratio", help="Of the error; 1 is critical damping (default: 1)."),
    _gain_option("--posture-kp", help="Of operational-space, for the posture [1/s^2] (default: 0)."),
    _gain_option(
        "--posture-kd",
        help="The same for speeds [1/s] (default: 1); of impedance a damper on joints [N m s/rad] "
        "(default: 0).",
    ),
    click.option(
        "--friction-compensation",
        is_flag=True,
        help="Let the law give back the damping and friction that the plant has.",
    ),
    _seconds_option("--control-dt", help="How often the law is asked; a multiple of --dt (default: --dt)."),
    _seconds_option(
        "--delay", default=0.0, help="How late measurements are; a multiple of --dt (default: 0)."
    ),
)

plant = stacked(
    click.option(
        "--plant",
        default="pinocchio",
        metavar="NAME",
        help="The engine that moves the robot; pybullet is PyBullet's own stepper (default: pinocchio).",
    ),
    _seconds_option("--dt", default=1e-3, help="The step of the record (default: 0.001)."),
    click.option(
        "--substeps",
        type=click.IntRange(min=1),
        default=1,
        metavar="N",
        help="Steps of the plant in each (default: 1).",
    ),
    click.option(
        "--integrator",
        type=one_of(INTEGRATORS),
        metavar="NAME",
        help="semi_implicit, rk4, adaptive, or engine: PyBullet's stepper (default: engine for the plant "
        "pybullet, else semi_implicit).",
    ),
    click.option(
        "--method",
        type=one_of(METHODS),
        metavar="NAME",
        help="SciPy's, of adaptive (default: DOP853).",
    ),
    _number_option("--rtol", help="Relative, of adaptive (default: 1e-10)."),
    _number_option("--atol", help="Absolute, of adaptive (default: 1e-12)."),
    _configuration_option("--q0", help="Where the robot starts, if that is not where the motion begins."),
    click.option(
        "--v0",
        type=number_list,
        metavar="V",
        help="How fast it starts [rad/s or m/s] (default: as the motion does).",
    ),
)

loads = stacked(
    click.option("--joint-dynamics", is_flag=True, help="Damping, friction and armature of the description."),
    _coefficients_option(
        "--damping",
        help="Of the joints [N m s/rad or N s/m]: urdf for the description's, or numbers (default: 0).",
    ),
    _coefficients_option("--friction", help="Dry friction [N m or N], likewise."),
    _number_option(
        "--friction-slip",
        help="Speed over which dry friction sets in [rad/s or m/s] (default: 0.01).",
    ),
    _coefficients_option("--armature", help="Inertia of the rotors [kg m^2 or kg], likewise."),
    _coefficients_option(
        "--effort-limits",
        help="Cut torques to those of the description, or to these [N m or N] (default: not cut).",
    ),
    click.option(
        "--position-limits", is_flag=True, help="Stop joints at their limits of position, without a bounce."
    ),
    click.option(
        "--push",
        "pushes",
        type=push,
        multiple=True,
        metavar="FRAME:fx,fy,fz,mx,my,mz[:START[:DURATION]]",
        help="A force [N] and moment [N m] in the axes of the world, from START [s] (0) for DURATION [s] "
        "(for ever); may be given several times.",
    ),
)

unknowns = stacked(
    click.option(
        "--payload",
        type=payload,
        multiple=True,
        metavar="FRAME:MASS[:x,y,z]",
        help="A point mass [kg] on a frame, at x,y,z [m] in it (0,0,0); may be given several times.",
    ),
    click.option(
        "--mass-scale",
        type=scale,
        multiple=True,
        metavar="[LINK=]FACTOR",
        help="Masses and inertias of all links, or of one, times a factor; may be given several times.",
    ),
    _gain_option("--noise-q", help="Standard deviation of measured positions [rad or m] (default: 0)."),
    _gain_option("--noise-v", help="The same of measured speeds [rad/s or m/s] (default: 0)."),
    click.option("--seed", type=click.IntRange(min=0), metavar="N", help="Of the noise (default: 0)."),
)

results = stacked(
    click.option(
        "--save",
        multiple=True,
        metavar="FILE",
        help="Write the record: .npz (complete, for --resume), .csv or .mcap; may be given several times.",
    ),
    click.option("--plot", metavar="FILE", help="Draw joints, errors and torques: .png, .pdf, .svg, ..."),
    click.option(
        "--resume",
        metavar="FILE.npz",
        help="Take the steps that are there from this record, and go on; all else as then.",
    ),
    click.option(
        "--resume-step", type=click.IntRange(min=0), metavar="N", help="Of its steps take the first N only."
    ),
    click.option(
        "--tutorial",
        is_flag=True,
        help="Instead: every mode of control on PyBullet's stepper and on dynx's own, and a table of errors. "
        "Takes ROBOT (ur5), --lock, --gravity (0,0,-9.8), --to, --from, --duration, --dt, --backend, "
        "--plot and --json.",
    ),
)
