"""Declarations of ``dynx world``, ``contacts``, ``compare`` and ``view``: motions of scenes and rollouts."""

from __future__ import annotations

from fractions import Fraction

import click

from dynx.cli.shell.lazy import runs
from dynx.cli.shell.options import (
    FiniteRange,
    GroupedCommand,
    configuration_option,
    engine_option,
    engines_option,
    finite_number,
    group,
    json_option,
    name_list,
    quiet_option,
    settings_option,
    silent_option,
)
from dynx.errors import shown


@click.command(cls=GroupedCommand)
@click.argument("scene", metavar="SCENE")
@group(
    "Run",
    engine_option(
        "engines",
        "Engines that run the scene (default: all that are installed and do not refuse it).",
        type=name_list,
        metavar="A,B,C",
    ),
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
    settings_option("Setting of an engine, or joint_limits"),
    click.option(
        "--keyframe",
        metavar="NAME",
        help="Keyframe of a scene in MJCF at which it starts (default: the pose of the file, at rest).",
    ),
    click.option(
        "--contact-interval",
        type=FiniteRange(min=0.0, min_open=True),
        metavar="SECONDS",
        help="Time at the end over which contact forces are averaged: those of one step rattle.",
    ),
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
        help="File to which the scene is written in another format, instead of a run: .xml or .mjcf (MJCF, "
        "with the step and the settings of MuJoCo), .toml, .json, or .urdf, with a file for each robot and "
        "body, whose name stands before the suffix.",
    ),
    quiet_option,
)
@runs("dynx.cli.world:world")
def world() -> None:
    """Run a scene of robots and bodies with contacts, and compare the engines.

    SCENE is a scene file (TOML or JSON), a file in MJCF (.xml or .mjcf), or the name of a scene of dynx:
    bowling, duck, landing, lifting, pushing, rolling, slope, stack or standing. Notes name what of MJCF is
    not read. Robots of a scene in .xacro files are expanded, which evaluates expressions of them as Python
    code: run only scenes with such files that you trust.

    The final states are printed, the contacts of the last step, and for every two engines how far apart
    their motions are over time. Notes name parts that overlap at the start, and constraints that it violates.

    Without --engine, engines that refuse the scene are left out, with a note.

    Exit code 0; 1 if an engine ended early or the engines are farther apart than --within; 2 for a scene that
    cannot be run, or that an engine of --engine refuses. After Ctrl-C the results so far are shown and
    written; the exit code is 130.

    \b
    Examples:
      dynx world stack
      dynx world bowling --engine pybullet,mujoco --duration 3 --plot apart.png
      dynx world my_scene.toml --engine mujoco --set impratio=100 --json
      dynx world my_scene.toml --export my_scene.xml
      dynx world table.xml --keyframe home --export table.toml
    """


def steps(text: str) -> tuple[float, ...]:
    """Read steps [s] separated by commas, each a number or a fraction such as 1/240."""
    found = []
    for word in text.replace(",", " ").split():
        try:
            number = float(Fraction(word)) if "/" in word else finite_number(word)
        except (ValueError, ZeroDivisionError):
            raise click.BadParameter(f"{shown(word)} is not a number [s], such as 0.002 or 1/480") from None
        if not number > 0.0:
            raise click.BadParameter(f"{shown(word)} is not positive")
        found.append(number)
    if not found:
        raise click.BadParameter("wanted steps [s] separated by commas, such as 1/240,1/480")
    return tuple(found)


@click.command(cls=GroupedCommand)
@group(
    "Measurement",
    engines_option("Engines to measure"),
    click.option(
        "--case",
        "cases",
        type=name_list,
        metavar="A,B,C",
        help="Cases to run; all of their figures are printed (default: all cases, and of each case the worst "
        "figure of every engine).",
    ),
    click.option(
        "--dt",
        "steps",
        type=steps,
        metavar="A,B,C",
        help="Steps of 1e-6 to 0.1 s, numbers or fractions such as 1/240 (default: 0.004,0.002,0.001). With "
        "a single step no error can fall.",
    ),
    settings_option("Setting of an engine, or substeps"),
    click.option(
        "--jobs",
        type=click.IntRange(min=1),
        help="Number of runs at a time, each in its own process (default: one per processor).",
    ),
)
@group(
    "Output",
    click.option(
        "--list", "only_list", is_flag=True, help="List of the cases with their laws, without a run."
    ),
    json_option,
    click.option(
        "--html", "html_path", metavar="FILE", help="File for the results as one HTML page with plots."
    ),
    quiet_option,
)
@runs("dynx.cli.contacts.run:contacts")
def contacts() -> None:
    """Measure the errors of engines where bodies touch, against closed forms, and find their causes.

    Each case is a scene whose motion or forces are known in closed form. Every engine runs it at several
    steps, and each figure gets a verdict: its error is within the tolerance; it falls with the step, at the
    order printed; a rerun with another setting of the engine removes it or makes it fall; the engine cannot
    avoid it, because it lacks the coefficient; or it is unexplained. The table has the relative errors at the
    largest and at the smallest step.

    Exit code 0 if every error is explained, 1 if one is not, if an engine failed or if nothing was measured,
    2 for input that cannot be used. Ctrl-C ends the run with the results so far and exit code 130.

    \b
    Examples:
      dynx contacts
      dynx contacts --engine mujoco --case slope --set impratio=1000
      dynx contacts --dt 1/240,1/480,1/960 --html page.html --json all.json
      dynx contacts --list
    """


@click.command(cls=GroupedCommand)
@click.argument("first", metavar="A")
@click.argument("second", metavar="B")
@group(
    "Comparison",
    click.option(
        "--tolerance",
        type=FiniteRange(min=0.0),
        help="Distance up to which the rollouts are alike [rad or m] (default: 1e-9).",
    ),
    click.option(
        "--list-only", is_flag=True, help="Differences of the scenarios only, without reruns and effects."
    ),
    click.option(
        "--robot",
        metavar="ROBOT",
        help="Robot of a .csv file (default: that of the other rollout).",
    ),
)
@group("Output", json_option, quiet_option)
@runs("dynx.cli.compare:compare_files")
def compare() -> None:
    """Find out how far apart two rollouts of a robot are, and why.

    A and B are files of rollouts: .npz (dynx sim --save), .mcap of dynx, or .csv, which may be a log of your
    own robot: a column t [s], and q:JOINT for each joint, with v:JOINT and tau:JOINT where they are known.

    The report gives the times at which the rollouts separate, and every difference of their scenarios:
    settings, gains, links and joints of the robot. For each difference, dynx simulates A with only this
    change (alone), and A with all changes except this one (without it). A with all changes must equal B,
    which proves that nothing else is a cause.

    Exit code 0 if the rollouts are alike, 1 if they separate, 2 for files that cannot be compared.
    Ctrl-C ends the run with exit code 130.

    \b
    Examples:
      dynx sim so101 --to elbow_flex=0.4 --save a.npz
      dynx sim so101 --to elbow_flex=0.4 --payload gripper_link:0.1 --save b.npz
      dynx compare a.npz b.npz
      dynx compare log.csv a.npz --tolerance 0.01
    """


@click.command(cls=GroupedCommand)
@click.argument("targets", metavar="TARGET...", nargs=-1, required=True)
@group(
    "What is shown",
    click.option(
        "--compare",
        is_flag=True,
        help="Lay two motions over each other: two rollouts, or one scene in two engines.",
    ),
    engine_option(
        "engines",
        "Engine of a scene (two with --compare), or the one that computes for a robot.",
        type=name_list,
        metavar="A,B",
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
        "--base",
        type=click.Choice(["fixed", "floating"]),
        help="Base of a robot (default: that of an MJCF or SDF file, else fixed).",
    ),
    configuration_option("Configuration of a robot (default: neutral)"),
    click.option(
        "--shapes",
        metavar="ROBOT",
        help="Robot whose shapes a rollout is drawn with; a file of a rollout has none (default: the robot "
        "of `dynx robots` with that name and those joints).",
    ),
    click.option("--collisions", is_flag=True, help="Begin with the collision shapes of robots."),
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
        help="Port to listen on; 0 for any that is free. Without it, 8080 or the next one that is free.",
    ),
    click.option("--no-browser", is_flag=True, help="Print the address, and open no browser."),
    click.option(
        "--export",
        "export_path",
        metavar="FILE",
        help="Write a file and end: .html plays without a server and without a network, .gif and .mp4 "
        "(extra film) are films, .png is a picture, drawn without a browser.",
    ),
    silent_option,
)
@runs("dynx.cli.view:view")
def view() -> None:
    """Show a robot, a rollout or a scene in the browser.

    TARGET is a robot (a URDF, xacro, MJCF or SDF file, or a name), a rollout (.npz or .mcap of `dynx sim
    --save`), or a scene (TOML or JSON, MJCF of several robots or bodies, or the name of a scene of dynx). A
    robot has sliders and a handle that moves a frame by inverse kinematics; a rollout has a timeline; a scene
    is stepped live, or recorded first for --compare and --export. A .xacro file, of a scene too, is expanded,
    which evaluates expressions of it as Python code: show only such files that you trust.

    The page is served until Ctrl-C. Exit code 0; 2 for input that cannot be shown, or a port that is taken.

    \b
    Examples:
      dynx view panda
      dynx view run.npz --shapes panda --export run.html
      dynx view run.npz --export run.mp4
      dynx view stack --engine mujoco
      dynx view --compare a.npz b.npz
      dynx view --compare stack --engine pybullet,mujoco
    """
