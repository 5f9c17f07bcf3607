"""``dynx ik``: the configuration that brings a frame to a target."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from dynx.cli.shell.heading import head, title
from dynx.cli.shell.options import frame_option, number_list, robot_options, sample_option
from dynx.cli.shell.target_input import POSE_HELP, target_pose

if TYPE_CHECKING:
    from dynx.cli.shell.configuration_input import Numbers


@click.command(short_help="Inverse kinematics: the configuration that reaches a target.")
@robot_options
@click.option(
    "--target",
    type=number_list,
    required=True,
    metavar="NUMBERS",
    help=POSE_HELP,
)
@frame_option
@sample_option("q", "Where to start (default: chosen by the solver)")
def ik(target: Numbers, frame: str | None, q: Numbers, as_json: bool, **robot: Any) -> int:
    """Inverse kinematics: the configuration, within limits, that brings a frame to a target.

    Exit code 0 if the target was reached, as forward kinematics says; 1 if not, and then the best
    configuration that was found is shown.

    \b
    Examples:
      dynx ik ur5 --target 0.4,0.2,0.3 --frame tool0
      dynx ik ur5 --target 0.4,0.2,0.3,3.14,0,0 --frame tool0 --json
    """
    from dynx.cli.shell import terminal
    from dynx.cli.shell.configuration_input import chosen_frame, configuration, default_said, open_backend
    from dynx.cli.shell.exits import ANSWER_IS_NO, DONE

    wanted = target_pose(target, "--target")
    with open_backend(**robot) as engine:
        model = engine.model
        name = chosen_frame(model, frame)
        start = None if q is None else configuration(model, q)
        found = engine.inverse_kinematics(wanted, name, start)
        result = {
            **head(engine),
            "frame": name,
            "target": wanted.tolist(),
            "success": bool(found.success),
            "q": found.q.tolist(),
            "position_error": float(found.position_error),
            "rotation_error": None if wanted.ndim == 1 else float(found.rotation_error),
            "iterations": int(found.iterations),
            "restarts": int(found.restarts),
        }
        joints = dict(zip(model.joint_names, result["q"][model.nq - len(model.joint_names) :], strict=True))
    code = DONE if result["success"] else ANSWER_IS_NO
    if as_json:
        terminal.echo_json(result)
        return code
    from dynx.cli.shell.exits import one_line
    from dynx.cli.shell.tables import Table

    out = terminal.console()
    out.print(f"{title(result)}: {one_line(name)} to its target", style="bold")
    if frame is None:
        out.print(default_said(name))
    out.print(_outcome(result), style="green" if result["success"] else "red")
    table = Table("joint", "q", right=("q",))
    for joint, value in joints.items():
        table.add_row(one_line(joint), terminal.number(value))
    out.print(table)
    out.print(f"--q {','.join(format(value, '.17g') for value in result['q'])}")
    return code


def _outcome(result: dict[str, Any]) -> str:
    """Whether the target was reached, how nearly, and after how much searching."""
    from dynx.cli.shell.terminal import counted

    off = f"{result['position_error']:.3g} m"
    if result["rotation_error"] is not None:
        off += f" and {result['rotation_error']:.3g} rad"
    steps, restarts = counted(result["iterations"], "step"), counted(result["restarts"], "restart")
    if result["success"]:
        return f"reached: {off} off, after {steps} and {restarts}"
    return f"not reached: the best that was found is {off} off, after {steps} and {restarts}"
