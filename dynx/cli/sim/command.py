"""``dynx sim``: a robot in motion under a controller, and what came of it."""

from __future__ import annotations

from typing import Any

import click

from dynx.cli.shell.option_groups import GroupedCommand
from dynx.cli.shell.options import json_flag, model_options
from dynx.cli.sim import options as sim_options


@click.command(
    cls=GroupedCommand,
    groups=sim_options.GROUPS,
    short_help="Simulate a robot under a controller; all modes of control.",
)
@click.argument("robot", required=False)
@model_options
@sim_options.robot
@sim_options.motion
@sim_options.controller
@sim_options.plant
@sim_options.loads
@sim_options.unknowns
@sim_options.results
@json_flag
@click.pass_context
def sim(ctx: click.Context, /, robot: str | None, tutorial: bool, **given: Any) -> int:
    """Simulate a robot under a controller: the law computes on one engine, the robot moves on another.

    The motion goes from --from to --to, or a frame goes on a straight line to --to-pose; without either
    the robot is to stay where it is. Times are in s, angles in rad, lengths in m; NUMBERS is one number
    for all joints, or one for each, separated by commas. Laws (--controller):

    \b
      computed-torque           ID(q, v, a* + kd (v* - v) + kp (q* - q))
      discrete-computed-torque  the torque whose step ends on the next setpoint
      pd, gravity-pd, pid       kp (q* - q) + kd (v* - v); with the weight; with
                                an integral that does not wind up
      velocity                  kd (v* - v)
      feed-forward[-pd]         ID(q*, v*, a*), alone or with pd
      operational-space         computed torque of a frame; --posture-kp for the rest
      impedance                 spring --kp and damper --kd of a frame
      position-motor, velocity-motor, pd-motor
                                PyBullet's own; with --plant pybullet
      none                      no motors

    Torque tables and laws of your own are for Python: dynx.simulate.

    There are no contacts: nothing stands on the ground, and links do not collide.

    Shown for each joint are the largest and the root mean square error, the largest speed, and the largest
    torque beside its limit.

    Exit code 0 when the simulation reached its end; 1 when it did not: it diverged, or the law gave no
    torque that can be applied, and then what was computed is shown and written all the same; 2 when some
    input cannot be used. Ctrl-C ends it with what is computed so far, and 130; --resume goes on.

    \b
    Examples:
      dynx sim ur5 --to -1.5,-1,1,-1.57,-1.57,-1.57 --plant pybullet
      dynx sim ur5 --to elbow_joint=1 --controller pid --effort-limits urdf --plot out.png
      dynx sim panda --from 0,-0.8,0,-2.4,0,1.6,0.8,0 --to-pose 0.5,0.2,0.4 --frame panda_hand_tcp
      dynx sim ur5 --to elbow_joint=1 --payload tool0:3 --friction 0.5 --noise-q 1e-4 --delay 0.002
      dynx sim pendulum --q0 1.5 --controller none --integrator rk4 --duration 10 --save swing.npz
      dynx sim --tutorial
    """
    from dynx.cli.sim.outputs import Outputs

    outputs = Outputs(given.pop("save"), given.pop("plot"))
    as_json: bool = given.pop("as_json")
    if tutorial:
        from dynx.cli.sim.tutorial_run import run_tutorial

        _refuse_beside_tutorial(ctx)
        outputs.check()
        return run_tutorial(robot, given, outputs.plot, as_json=as_json)
    if robot is None:
        raise click.UsageError("ROBOT is missing; only --tutorial has one of its own", ctx)
    from dynx.cli.sim.request import prepare
    from dynx.cli.sim.run import run_sim

    outputs.check()
    return run_sim(prepare({"robot": robot, **given}), outputs, as_json=as_json)


def _refuse_beside_tutorial(ctx: click.Context) -> None:
    """Raise for an option that all modes of control have no use for: none is passed over in silence."""
    for param in ctx.command.params:
        source = ctx.get_parameter_source(param.name or "")
        given = source is not None and source is not click.core.ParameterSource.DEFAULT
        if given and param.name not in sim_options.OF_TUTORIAL:
            raise click.UsageError(
                f"{param.opts[0]} is of one simulation, and --tutorial does all modes", ctx
            )
