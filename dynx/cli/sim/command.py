"""Declaration of ``dynx sim``."""

from __future__ import annotations

import click

from dynx.cli.shell.lazy import runs
from dynx.cli.shell.options import GroupedCommand
from dynx.cli.sim import options as sim_options


@click.command(cls=GroupedCommand)
@click.argument("robot", required=False)
@sim_options.robot
@sim_options.motion
@sim_options.controller
@sim_options.plant
@sim_options.disturbances
@sim_options.model_errors
@sim_options.results
@sim_options.tutorial
@runs("dynx.cli.sim.run:sim")
def sim() -> None:
    """Simulate a robot under a controller, which can compute on one engine while the robot moves on another.

    The reference motion goes from --from to --to, or moves a frame on a straight line to --to-pose;
    without either the controller holds the initial configuration. Units are s, rad, m, kg and N; NUMBERS
    is one number for all joints, or one for each joint, separated by commas. Controllers (--controller),
    where * marks the reference and ID is inverse dynamics:

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
