"""The entry point `dynx`: the group of commands, and the one place where errors become exit codes."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

import click

from dynx._version import __version__
from dynx.cli.agree.command import agree
from dynx.cli.bench.command import bench
from dynx.cli.doctor.command import doctor
from dynx.cli.queries.backends import backends
from dynx.cli.queries.evaluate import fd, fk, id_, jacobian, mass
from dynx.cli.queries.explain import explain
from dynx.cli.queries.ik import ik
from dynx.cli.queries.info import info
from dynx.cli.queries.robots import robots
from dynx.cli.shell.exits import DONE, closed_pipe_raised, report_failure
from dynx.cli.sim.command import sim
from dynx.errors import TRACEBACK_VARIABLE


class CommandLine(click.Group):
    """The group of commands; whatever is raised below leaves as one line and an exit code."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Commands in the order in which they were added, the main one first."""
        return list(self.commands)

    def make_context(self, *args: Any, **extra: Any) -> click.Context:
        """Read the options of the group; ``--help`` writes here already."""
        with closed_pipe_raised():
            return super().make_context(*args, **extra)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command that is asked for."""
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
    """A character that the terminal cannot show is escaped rather than raised."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _show_traceback(ctx: click.Context, option: click.Parameter, wanted: bool) -> None:
    if wanted:
        os.environ[TRACEBACK_VARIABLE] = "1"


@click.group(
    cls=CommandLine,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="""
    \b
    Examples:
      dynx agree ur5               do the installed engines agree on the UR5?
      dynx agree all --json a.json every robot of example-robot-data
      dynx doctor my.urdf          why do engines differ on my file, and how is it mended?
      dynx sim --tutorial          how closely does each mode of control follow a motion?
      dynx bench panda             how fast are they on this machine?
      dynx explain DX101           what a cause means, and what each engine does
      dynx info panda              joints, limits, masses, frames
      dynx id ur5 --q 0,-1,1,0,0,0 torque that holds the arm there

    \b
    Exit codes: 0 done (all agree), 1 the answer is no (some differ, target not reached,
    simulation diverged), 2 some input cannot be used, 70 a defect of dynx,
    74 the output cannot be written.
    """,
)
@click.version_option(__version__, prog_name="dynx", message="%(prog)s %(version)s")
@click.option(
    "--traceback",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_show_traceback,
    help=f"Show where an error was raised (also: {TRACEBACK_VARIABLE}=1).",
)
@click.pass_context
def cli(ctx: click.Context) -> None:
    """One interface over several rigid-body engines, proven to give one answer.

    ROBOT is always a path to a URDF file or a name of the library (see `dynx robots`).
    """
    if ctx.invoked_subcommand is None:
        click.echo(ctx.get_help())


for _command in (agree, doctor, sim, bench, explain, info, robots, backends, fk, jacobian, id_, fd, mass, ik):
    cli.add_command(_command)


def main() -> None:
    """Run the command line on ``sys.argv``."""
    cli.main(prog_name="dynx")


if __name__ == "__main__":
    main()
