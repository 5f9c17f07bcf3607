"""Entry point `dynx`: the table of commands, and the one place where errors become exit codes."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

import click

from dynx._version import __version__
from dynx.cli.shell.exits import DONE, closed_pipe_raised, report_failure
from dynx.cli.shell.lazy import LazyCommand, LazyGroup
from dynx.errors import TRACEBACK_VARIABLE
from dynx.safe_path import isolate_children

COMMANDS = {
    name: LazyCommand(f"dynx.cli.commands.{target}", line)
    for name, target, line in (
        ("agree", "comparison:agree", "Compare the results of all engines on robots."),
        ("doctor", "comparison:doctor", "Find, prove and mend the causes of differences between engines."),
        ("convert", "conversion:convert", "Write a robot as URDF, MJCF or SDF, with its meshes."),
        ("same", "comparison:same", "Decide whether two files describe the same robot; mend one."),
        ("sim", "sim:sim", "Simulate a robot under a controller."),
        ("world", "motion:world", "Run a scene with contacts on several engines, and compare them."),
        ("compare", "motion:compare", "Compare two rollouts, and find out why they part."),
        ("view", "motion:view", "Show a robot, a rollout or a scene in the browser."),
        ("env", "learning:env", "List tasks of reinforcement learning; compare the engines on one."),
        ("train", "learning:train", "Train a policy on a task, with checkpoints."),
        ("play", "learning:play", "Judge, show or film a trained policy."),
        ("contacts", "motion:contacts", "Measure errors of contacts against closed forms; find causes."),
        ("bench", "comparison:bench", "Time the engines on a robot and this machine."),
        ("explain", "queries:explain", "Explain a rule of the doctor, such as DX101."),
        ("info", "queries:info", "Show the links, joints, masses and frames of a robot."),
        ("robots", "queries:robots", "List the robots that have a name."),
        ("backends", "queries:backends", "List the backends and their versions."),
        ("fk", "queries:fk", "Forward kinematics: the pose of a frame."),
        ("jacobian", "queries:jacobian", "The Jacobian of a frame."),
        ("id", "queries:id_", "Inverse dynamics: the torque that gives an acceleration."),
        ("fd", "queries:fd", "Forward dynamics: the acceleration that a torque gives."),
        ("mass", "queries:mass", "The mass matrix."),
        ("ik", "queries:ik", "Inverse kinematics: a configuration that reaches a target."),
    )
}
"""The commands of dynx in the order of the list, each with its line there."""

SYNONYMS = {
    "compute-torque": "id",
    "diagnose": "doctor",
    "export": "convert",
    "evaluate": "play",
    "fix": "doctor",
    "forward-dynamics": "fd",
    "forward-kinematics": "fk",
    "inverse-dynamics": "id",
    "inverse-kinematics": "ik",
    "list": "robots",
    "mass-matrix": "mass",
    "rules": "explain",
    "simulate": "sim",
    "show": "view",
    "torque": "id",
    "visualize": "view",
}
"""Words of the field, and names of functions of dynx, for commands."""


class CommandLine(LazyGroup):
    """The group of commands, which turns every error into one line and an exit code."""

    def make_context(self, *args: Any, **extra: Any) -> click.Context:
        """Read the options of the group; ``--help`` and ``--version`` already write here."""
        with closed_pipe_raised():
            return super().make_context(*args, **extra)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command."""
        with closed_pipe_raised():
            return super().invoke(ctx)

    def main(
        self,
        args: Sequence[str] | None = None,
        prog_name: str | None = None,
        complete_var: str | None = None,
        standalone_mode: bool = True,
        **extra: Any,
    ) -> NoReturn:
        """Run a command and end the process with its exit code."""
        _tolerate_unencodable()
        name = prog_name or "dynx"
        try:
            code = super().main(args, name, complete_var, standalone_mode=False, **extra)
        except (Exception, KeyboardInterrupt) as error:
            code = report_failure(error, name)
        sys.exit(code if isinstance(code, int) else DONE)


def _tolerate_unencodable() -> None:
    """Escape characters that the terminal cannot show instead of raising an error."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _show_traceback(ctx: click.Context, option: click.Parameter, wanted: bool) -> None:
    if wanted:
        os.environ[TRACEBACK_VARIABLE] = "1"


@click.group(
    "dynx",
    cls=CommandLine,
    table=COMMANDS,
    synonyms=SYNONYMS,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="""
    \b
    Examples:
      dynx agree ur5               compare the engines on the UR5
      dynx agree all               compare them on all of example-robot-data
      dynx doctor my.urdf          find out why engines differ on a file
      dynx sim --tutorial          compare the tracking errors of all controllers
      dynx bench panda             time the engines on this machine
      dynx explain DX101           read about a rule of the doctor
      dynx info panda              list joints, limits, masses and frames
      dynx id ur5 --q 0,-1,1,0,0,0 torque that holds the arm still

    \b
    Exit codes: 0 success; 1 negative result (engines differ, target not reached,
    simulation diverged); 2 unusable input; 70 defect of dynx; 74 output not
    writable.
    """,
)
@click.version_option(__version__, prog_name="dynx", message="%(prog)s %(version)s")
@click.option(
    "--traceback",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_show_traceback,
    help=f"Print the Python traceback of an error (also with {TRACEBACK_VARIABLE}=1).",
)
@click.pass_context
def cli(ctx: click.Context) -> None:
    """One interface over several rigid-body dynamics engines, and tests that they agree.

    ROBOT is the path of a URDF, xacro, MJCF or SDF file, or a name from `dynx robots`.
    Arguments of a xacro file follow in the same word: "ur.xacro name:=ur".
    """
    if ctx.invoked_subcommand is None:
        click.echo(ctx.get_help())


def main() -> None:
    """Run the command line on ``sys.argv``; no process that it starts imports from the current folder."""
    isolate_children()
    cli.main(prog_name="dynx")


if __name__ == "__main__":
    main()
