"""``dynx fk | jacobian | id | fd | mass``: the numbers of one configuration."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from dynx.cli.shell.exits import one_line
from dynx.cli.shell.heading import head, title
from dynx.cli.shell.options import frame_option, robot_options, sample_option

if TYPE_CHECKING:
    import numpy as np

    from dynx.cli.shell.configuration_input import Numbers
    from dynx.model import Model


q_option = sample_option("q", "Configuration (default: neutral)")
v_option = sample_option("v", "Velocity (default: zero)")


@click.command(short_help="Forward kinematics: where a frame is.")
@robot_options
@q_option
@frame_option
def fk(q: Numbers, frame: str | None, as_json: bool, **robot: Any) -> None:
    """Forward kinematics: the pose of a frame in the world.

    \b
    Examples:
      dynx fk ur5 --q 0,-1.57,1.57,0,0,0 --frame tool0
      dynx fk panda --q panda_joint4=-1.5,panda_joint6=1.5 --json
    """
    from dynx.cli.shell import terminal
    from dynx.cli.shell.configuration_input import chosen_frame, configuration, default_said, open_backend
    from dynx.cli.shell.tables import Table
    from dynx.spatial.so3 import quat_from_rotation, rpy_from_rotation

    with open_backend(**robot) as engine:
        at, name = configuration(engine.model, q), chosen_frame(engine.model, frame)
        T = engine.forward_kinematics(at, name)
        result = {
            **head(engine),
            "frame": name,
            "q": _listed(at),
            "T_world_frame": T.tolist(),
            "position": T[:3, 3].tolist(),
            "rpy": rpy_from_rotation(T[:3, :3]).tolist(),
            "quat_xyzw": quat_from_rotation(T[:3, :3]).tolist(),
        }
    if as_json:
        terminal.echo_json(result)
        return
    out = terminal.console()
    out.print(f"{title(result)}: pose of {one_line(name)} in the world", style="bold")
    if frame is None:
        out.print(default_said(name))
    table = Table("", "x", "y", "z", "w", right=("x", "y", "z", "w"), show_header=False)
    for key, unit in (("position", "m"), ("rpy", "rad"), ("quat_xyzw", "")):
        table.add_row(f"{key} {f'[{unit}]' if unit else ''}".strip(), *map(terminal.number, result[key]))
    for row, label in zip(result["T_world_frame"], ("T_world_frame", "", "", ""), strict=True):
        table.add_row(label, *map(terminal.number, row))
    out.print(table)


@click.command(short_help="The Jacobian of a frame.")
@robot_options
@q_option
@frame_option
@click.option(
    "--reference",
    type=click.Choice(["local_world_aligned", "local", "world"]),
    default="local_world_aligned",
    show_default=True,
    help="Which point and axes the velocity is expressed at and in.",
)
def jacobian(q: Numbers, frame: str | None, reference: str, as_json: bool, **robot: Any) -> None:
    """The Jacobian J (6, nv) of a frame: J v is its velocity, linear rows first.

    \b
    Examples:
      dynx jacobian ur5 --q 0,-1.57,1.57,0,0,0 --frame tool0
      dynx jacobian panda --reference local --json
    """
    from dynx.cli.shell import terminal
    from dynx.cli.shell.configuration_input import (
        chosen_frame,
        configuration,
        default_said,
        open_backend,
        velocity_names,
    )

    with open_backend(**robot) as engine:
        at, name = configuration(engine.model, q), chosen_frame(engine.model, frame)
        J = engine.jacobian(at, name, reference=reference)
        result = {
            **head(engine),
            "frame": name,
            "reference": reference,
            "q": _listed(at),
            "velocity_names": velocity_names(engine.model),
            "jacobian": J.tolist(),
        }
    if as_json:
        terminal.echo_json(result)
        return
    rows = ("linear x", "linear y", "linear z", "angular x", "angular y", "angular z")
    heading = f"{title(result)}: Jacobian of {one_line(name)}, {reference}"
    hint = default_said(name) if frame is None else None
    _print_matrix(heading, rows, result["velocity_names"], J, hint)


@click.command("id", short_help="Inverse dynamics: the torque that gives an acceleration.")
@robot_options
@q_option
@v_option
@sample_option("a", "Acceleration (default: zero)")
@click.option("--joint-dynamics", is_flag=True, help="Add damping, friction and armature of the joints.")
def id_(q: Numbers, v: Numbers, a: Numbers, joint_dynamics: bool, as_json: bool, **robot: Any) -> None:
    """Inverse dynamics: the torque tau (nv) that gives the acceleration a.

    Without --v and --a that is the torque which holds the robot against gravity.

    \b
    Examples:
      dynx id ur5 --q 0,-1.57,1.57,0,0,0
      dynx id ur5 --q 0,-1,1,0,0,0 --v 0,0.1,0,0,0,0 --a 1,0,0,0,0,0 --json
    """
    from dynx.cli.shell.configuration_input import configuration, open_backend, velocity

    with open_backend(**robot) as engine:
        model = engine.model
        sample = {
            "q": configuration(model, q),
            "v": velocity(model, v, "--v"),
            "a": velocity(model, a, "--a"),
        }
        tau = engine.inverse_dynamics(*sample.values(), joint_dynamics=joint_dynamics)
        result = {**head(engine), **_vectors(model, sample), "tau": tau.tolist()}
    _report_vectors(result, as_json, "inverse dynamics", ("v", "a", "tau"))


@click.command(short_help="Forward dynamics: the acceleration that a torque gives.")
@robot_options
@q_option
@v_option
@sample_option("tau", "Torque (default: zero)")
@click.option("--joint-dynamics", is_flag=True, help="Heed damping, friction and armature of the joints.")
def fd(q: Numbers, v: Numbers, tau: Numbers, joint_dynamics: bool, as_json: bool, **robot: Any) -> None:
    """Forward dynamics: the acceleration a (nv) that the torque tau gives.

    \b
    Examples:
      dynx fd ur5 --q 0,-1.57,1.57,0,0,0
      dynx fd ur5 --tau shoulder_pan_joint=10 --json
    """
    from dynx.cli.shell.configuration_input import configuration, open_backend, velocity

    with open_backend(**robot) as engine:
        model = engine.model
        sample = {
            "q": configuration(model, q),
            "v": velocity(model, v, "--v"),
            "tau": velocity(model, tau, "--tau"),
        }
        a = engine.forward_dynamics(*sample.values(), joint_dynamics=joint_dynamics)
        result = {**head(engine), **_vectors(model, sample), "a": a.tolist()}
    _report_vectors(result, as_json, "forward dynamics", ("v", "tau", "a"))


@click.command(short_help="The mass matrix.")
@robot_options
@q_option
@click.option("--joint-dynamics", is_flag=True, help="Add the armature of the joints.")
def mass(q: Numbers, joint_dynamics: bool, as_json: bool, **robot: Any) -> None:
    """The mass matrix M (nv, nv).

    \b
    Examples:
      dynx mass ur5 --q 0,-1.57,1.57,0,0,0
      dynx mass solo12 --base floating --json
    """
    from dynx.cli.shell import terminal
    from dynx.cli.shell.configuration_input import configuration, open_backend, velocity_names

    with open_backend(**robot) as engine:
        at = configuration(engine.model, q)
        M = engine.mass_matrix(at, joint_dynamics=joint_dynamics)
        names = velocity_names(engine.model)
        result = {**head(engine), **_vectors(engine.model, {"q": at}), "mass_matrix": M.tolist()}
    if as_json:
        terminal.echo_json(result)
    else:
        _print_matrix(f"{title(result)}: mass matrix", names, names, M)


def _vectors(model: Model, sample: dict[str, Any]) -> dict[str, Any]:
    from dynx.cli.shell.configuration_input import velocity_names

    return {"velocity_names": velocity_names(model), **{key: _listed(x) for key, x in sample.items()}}


def _listed(numbers: Any) -> list[float]:
    return [float(number) for number in numbers]


def _report_vectors(result: dict[str, Any], as_json: bool, what: str, columns: Sequence[str]) -> None:
    """A table with one row for each entry of v."""
    from dynx.cli.shell import terminal
    from dynx.cli.shell.tables import Table

    if as_json:
        terminal.echo_json(result)
        return
    out = terminal.console()
    out.print(f"{title(result)}: {what}", style="bold")
    out.print(f"q = {' '.join(map(terminal.number, result['q']))}")
    table = Table("joint", *columns, right=columns, keys=1)
    for name, *values in zip(result["velocity_names"], *(result[key] for key in columns), strict=True):
        table.add_row(one_line(name), *map(terminal.number, values))
    out.print(table)


def _print_matrix(
    heading: str,
    rows: Sequence[str],
    columns: Sequence[str],
    matrix: np.ndarray[Any, Any],
    hint: str | None = None,
) -> None:
    """A table under numbered columns, in blocks that fit the terminal, and the names of the columns."""
    from dynx.cli.shell import terminal
    from dynx.cli.shell.tables import Table, listing

    out = terminal.console()
    out.print(heading, style="bold")
    if hint is not None:
        out.print(hint)
    numbers = [str(k) for k in range(len(columns))]
    table = Table("", *numbers, right=numbers, keys=1)
    for name, row in zip(rows, matrix.tolist(), strict=True):
        table.add_row(one_line(name), *(f"{value + 0.0:.5g}" for value in row))
    out.print(table)
    out.print()
    out.print(listing("columns", (f"{k} {one_line(name)}" for k, name in enumerate(columns)), out.width))
