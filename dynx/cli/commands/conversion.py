"""Declaration of ``dynx convert``: robots written in another format."""

from __future__ import annotations

import click

from dynx.cli.shell.lazy import runs
from dynx.cli.shell.options import gravity_option, json_option, model_options, one_of, silent_option


@click.command
@click.argument("robot")
@click.option(
    "--to",
    "to",
    type=one_of("mjcf", "sdf", "urdf"),
    metavar="FORMAT",
    help="Format of the document: mjcf, sdf or urdf (default: by the suffix of the output file).",
)
@click.option(
    "-o",
    "--out",
    "out",
    metavar="FILE",
    help="File for the document; meshes and images are written beside it, into NAME_assets. Without it the "
    "document is printed, and names meshes where they are.",
)
@click.option("--overwrite", is_flag=True, help="Replace files that exist; the robot's own files never are.")
@model_options
@gravity_option
@json_option
@silent_option
@runs("dynx.cli.convert:convert")
def convert() -> None:
    """Write ROBOT as MJCF, SDF or URDF, with its meshes and materials.

    The document is read back and compared before it is written: links, joints, frames, inertias, limits and
    coefficients are the same to rounding, and both are one robot in every state (dynx same). What the format
    cannot say is listed with its effect. Meshes that MuJoCo or Drake do not read become OBJ files.

    Exit code 0 if the document is written, 1 if it would be another robot, 2 if the robot cannot be used or
    the format cannot express it.

    \b
    Examples:
      dynx convert robot.urdf --to mjcf -o robot.xml
      dynx convert panda -o panda.xml --lock panda_finger_joint1=0.02
      dynx convert robot.xml --to urdf
      dynx convert ur5 -o ur5.sdf
    """
