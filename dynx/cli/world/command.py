"""Declaration of ``dynx world``."""

from __future__ import annotations

import click

from dynx.cli.shell.lazy import runs
from dynx.cli.shell.options import (
    FiniteRange,
    GroupedCommand,
    engines_option,
    group,
    json_option,
    quiet_option,
    settings_option,
)


@click.command(cls=GroupedCommand)
@click.argument("scene", metavar="SCENE")
@group(
    "Run",
    engines_option("Engines that run the scene"),
    click.option(
        "--duration",
        type=FiniteRange(min=0.0, min_open=True),
        default=1.0,
        show_default=True,
        help="Time to simulate [s].",
    ),
    click.option(
        "--dt",
        type=FiniteRange(min=0.0, min_open=True),
        default=1e-3,
        show_default=True,
        help="Step of the world [s].",
    ),
    click.option(
        "--substeps",
        type=click.IntRange(min=1),
        default=1,
        show_default=True,
        help="Number of steps of the engine in each step.",
    ),
    settings_option("Setting of an engine (docs/world.md)"),
    click.option(
        "--within",
        type=FiniteRange(min=0.0),
        metavar="METRES",
        help="Largest distance between two engines' motions; beyond it the exit code is 1.",
    ),
)
@group(
    "Output",
    json_option,
    click.option("--plot", "plot_path", metavar="FILE", help="File for a plot of the distances over time."),
    click.option(
        "--save",
        "save_path",
        metavar="FILE",
        help="File, with the suffix .world or none, for the final state of the world, which "
        "dynx.world.World.read continues; with several engines the name of each stands before the suffix.",
    ),
    click.option(
        "--export",
        "export_path",
        metavar="FILE",
        help="File to which the scene is written in another format, instead of a run: .xml or .mjcf (MJCF), "
        ".toml, .json, or .urdf, with a file for each robot and body, whose name stands before the suffix.",
    ),
    quiet_option,
)
@runs("dynx.cli.world.run:world")
def world() -> None:
    """Run a scene of robots and bodies with contacts, and compare the engines.

    SCENE is a scene file (TOML or JSON) or the name of a scene of dynx: bowling, duck, lifting, pushing,
    rolling, slope, stack or standing.
    The final states are printed, the contacts of the last step, and for every two engines how far apart
    their motions are over time. Notes name parts that overlap at the start, and constraints that it violates.

    Exit code 0; 1 if an engine ended early or the engines are farther apart than --within; 2 for a scene
    that cannot be run. After Ctrl-C the results so far are shown and written; the exit code is 130.

    \b
    Examples:
      dynx world stack
      dynx world bowling --engine pybullet,mujoco --duration 3 --plot apart.png
      dynx world my_scene.toml --engine mujoco --set impratio=100 --json
      dynx world my_scene.toml --export my_scene.xml
    """
