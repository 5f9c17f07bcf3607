"""Declaration of ``dynx view``."""

from __future__ import annotations

import click

from dynx.cli.shell.lazy import runs
from dynx.cli.shell.options import FiniteRange, GroupedCommand, group, name_list, sample_option


@click.command(cls=GroupedCommand)
@click.argument("targets", metavar="TARGET...", nargs=-1, required=True)
@group(
    "What is shown",
    click.option(
        "--compare",
        is_flag=True,
        help="Lay two motions over each other: two rollouts, or one scene in two engines.",
    ),
    click.option(
        "--engine",
        "engines",
        type=name_list,
        metavar="A,B",
        help="Engine of a scene (two with --compare), or the backend that computes for a robot.",
    ),
    click.option(
        "--duration",
        type=FiniteRange(min=0.0, min_open=True),
        help="Time for which a scene is recorded, with --compare or --export [s] (default: 2).",
    ),
    click.option(
        "--dt", type=FiniteRange(min=0.0, min_open=True), help="Step of a scene [s] (default: 0.001)."
    ),
    click.option(
        "--base", type=click.Choice(["fixed", "floating"]), help="Base of a robot (default: fixed)."
    ),
    sample_option("q", "Configuration of a robot (default: neutral)"),
    click.option(
        "--shapes",
        metavar="ROBOT",
        help="Robot whose shapes a rollout is drawn with; a file of a rollout has none (default: the robot "
        "of `dynx robots` with that name and those joints).",
    ),
    click.option("--collisions", is_flag=True, help="Begin with the collision shapes of a robot."),
    click.option(
        "--whole-meshes",
        is_flag=True,
        help="Draw every triangle, also where no graphics processor is found.",
    ),
    click.option("--play", is_flag=True, help="Begin to play at once."),
    click.option("--dark", is_flag=True, help="Dark page."),
)
@group(
    "Page",
    click.option(
        "--host",
        default="127.0.0.1",
        show_default=True,
        help="Address to listen on; 0.0.0.0 lets other machines in, without encryption: whoever has the "
        "address of the page sees and moves what it shows.",
    ),
    click.option(
        "--port",
        type=click.IntRange(0, 65535),
        default=8080,
        show_default=True,
        help="Port to listen on; 0 for any that is free.",
    ),
    click.option("--no-browser", is_flag=True, help="Print the address, and open no browser."),
    click.option(
        "--export",
        "export_path",
        metavar="FILE",
        help="Write a file and end: .html plays without a server and without a network, .gif is a film, "
        ".png a picture, both drawn without a browser.",
    ),
)
@runs("dynx.cli.view.run:view")
def view() -> None:
    """Show a robot, a rollout or a scene in the browser.

    TARGET is a robot (a URDF or xacro file, or a name), a rollout (.npz or .mcap of `dynx sim --save`), or a
    scene (TOML or JSON, or the name of a scene of dynx). A robot has sliders and a handle that moves a frame
    by inverse kinematics; a rollout has a timeline; a scene is stepped live, or recorded first for --compare
    and --export.

    The page is served until Ctrl-C. Exit code 0; 2 for input that cannot be shown, or a port that is taken.

    \b
    Examples:
      dynx view panda
      dynx view run.npz --shapes panda --export run.html
      dynx view run.npz --export run.gif
      dynx view stack --engine mujoco
      dynx view --compare a.npz b.npz
      dynx view --compare stack --engine pybullet,mujoco
    """
