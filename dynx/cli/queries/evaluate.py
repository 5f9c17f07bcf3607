"""Bodies of ``dynx fk``, ``jacobian``, ``id``, ``fd`` and ``mass``: quantities at one sample."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from dynx.backends.base import Backend
from dynx.cli.shell.exits import one_line
from dynx.cli.shell.inputs import (
    Numbers,
    chosen_frame,
    configuration,
    default_frame_note,
    open_backend,
    velocity,
    velocity_names,
)
from dynx.cli.shell.options import PayloadInput, spelled
from dynx.cli.shell.output import Entry, console, number, write_json
from dynx.cli.shell.tables import Table, listing
from dynx.errors import ArgumentError
from dynx.model import Model
from dynx.rbd.jacobians import LOCAL
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import quat_from_rotation, rpy_from_rotation


def fk(q: Numbers, frame: str | None, json_path: str | None, **robot: Any) -> None:
    """Print the pose of a frame."""
    with open_backend(**robot) as engine:
        at, name = configuration(engine.model, q), chosen_frame(engine.model, frame)
        T = engine.forward_kinematics(at, name)
        result = {
            **document_head(engine),
            "frame": name,
            "q": at.tolist(),
            "T_world_frame": T.tolist(),
            "position": T[:3, 3].tolist(),
            "rpy": rpy_from_rotation(T[:3, :3]).tolist(),
            "quat_xyzw": quat_from_rotation(T[:3, :3]).tolist(),
        }
    if write_json(result, json_path):
        return
    out = console()
    out.print(f"{title(result)}: pose of {one_line(name)} in the world", style="bold")
    if frame is None:
        out.print(default_frame_note(name))
    table = Table("", "x", "y", "z", "w", right=("x", "y", "z", "w"), show_header=False)
    for key, unit in (("position", "m"), ("rpy", "rad"), ("quat_xyzw", "")):
        table.add_row(f"{key} {f'[{unit}]' if unit else ''}".strip(), *map(number, result[key]))
    for row, label in zip(result["T_world_frame"], ("T_world_frame", "", "", ""), strict=True):
        table.add_row(label, *map(number, row))
    out.print(table)


def jacobian(q: Numbers, frame: str | None, reference: str, json_path: str | None, **robot: Any) -> None:
    """Print the Jacobian of a frame."""
    with open_backend(**robot) as engine:
        at, name = configuration(engine.model, q), chosen_frame(engine.model, frame)
        result = {
            **document_head(engine),
            "frame": name,
            "reference": reference,
            "q": at.tolist(),
            "velocity_names": velocity_names(engine.model),
            "jacobian": engine.jacobian(at, name, reference=reference).tolist(),
        }
    if write_json(result, json_path):
        return
    rows = ("linear x", "linear y", "linear z", "angular x", "angular y", "angular z")
    heading = f"{title(result)}: Jacobian of {one_line(name)}, {reference}"
    note = default_frame_note(name) if frame is None else None
    _print_matrix(heading, rows, result["velocity_names"], result["jacobian"], note)


def inverse_dynamics(
    q: Numbers,
    v: Numbers,
    a: Numbers,
    joint_dynamics: bool,
    payload: Sequence[PayloadInput],
    forces: Sequence[tuple[str, list[float]]],
    wrenches: bool,
    frame: str | None,
    reference: str,
    json_path: str | None,
    **robot: Any,
) -> None:
    """Print the torque that gives an acceleration, and the wrenches that joints transmit."""
    if (frame is not None or reference != LOCAL) and not wrenches:
        raise ArgumentError("--frame and --reference are those of the wrenches; give --wrenches too")
    with open_backend(**robot, payload=payload) as engine:
        sample, result = _sample(engine, q, payload, v=v, a=a)
        options = _external_forces(forces, result)
        result["tau"] = engine.inverse_dynamics(*sample, joint_dynamics=joint_dynamics, **options).tolist()
        if wrenches:
            options |= {"frame": frame, "reference": reference}
            result |= {
                "frame": frame,
                "reference": reference,
                "joint_names_of_wrenches": [joint.name for joint in engine.model.joints],
                "joint_wrenches": engine.joint_wrenches(*sample, **options).tolist(),
                "base_wrench": engine.base_wrench(*sample, **options).tolist(),
            }
    if _report_vectors(result, json_path, "inverse dynamics", ("v", "a", "tau")) or not wrenches:
        return
    out = console()
    where = "its child link" if frame is None else one_line(frame)
    out.print(
        f"wrench of the parent of each joint on its child, at {where}, {spelled(reference)} axes and point"
    )
    columns = ("fx [N]", "fy [N]", "fz [N]", "mx [N m]", "my [N m]", "mz [N m]")
    table = Table("joint", *columns, right=columns, keys=1)
    rows = zip(result["joint_names_of_wrenches"], result["joint_wrenches"], strict=True)
    for name, wrench in (("(base)", result["base_wrench"]), *rows):
        table.add_row(one_line(name), *(f"{value + 0.0:.6g}" for value in wrench))
    out.print(table)


def forward_dynamics(
    q: Numbers,
    v: Numbers,
    tau: Numbers,
    joint_dynamics: bool,
    payload: Sequence[PayloadInput],
    forces: Sequence[tuple[str, list[float]]],
    json_path: str | None,
    **robot: Any,
) -> None:
    """Print the acceleration that a torque gives."""
    with open_backend(**robot, payload=payload) as engine:
        sample, result = _sample(engine, q, payload, v=v, tau=tau)
        options = _external_forces(forces, result)
        result["a"] = engine.forward_dynamics(*sample, joint_dynamics=joint_dynamics, **options).tolist()
    _report_vectors(result, json_path, "forward dynamics", ("v", "tau", "a"))


def mass_matrix(
    q: Numbers, joint_dynamics: bool, payload: Sequence[PayloadInput], json_path: str | None, **robot: Any
) -> None:
    """Print the mass matrix."""
    with open_backend(**robot, payload=payload) as engine:
        sample, result = _sample(engine, q, payload)
        result["mass_matrix"] = engine.mass_matrix(*sample, joint_dynamics=joint_dynamics).tolist()
    if not write_json(result, json_path):
        names = result["velocity_names"]
        _print_matrix(f"{title(result)}: mass matrix", names, names, result["mass_matrix"])


def _external_forces(forces: Sequence[tuple[str, list[float]]], result: dict[str, Any]) -> dict[str, Any]:
    """Return the forces of ``--force`` as an argument of a quantity, those on one frame added up, and list
    them in the document."""
    on_frames: dict[str, Floats] = {}
    for name, wrench in forces:
        on_frames[name] = on_frames.get(name, np.zeros(6)) + wrench
    result["external_forces"] = {name: wrench.tolist() for name, wrench in on_frames.items()}
    return {"external_forces": on_frames or None}


def document_head(engine: Backend) -> dict[str, Any]:
    """Make the first entries of the JSON document of a query."""
    model: Model = engine.model
    return {"schema": 1, "robot": model.name, "base": model.base, "backend": engine.name}


def title(result: Entry) -> str:
    """Make the first words above the table of a query: robot, base and backend."""
    return f"{one_line(result['robot'])}, {result['base']} base, {result['backend']}"


def _sample(
    engine: Backend, q: Numbers, payload: Sequence[PayloadInput], **vectors: Numbers
) -> tuple[list[Any], dict[str, Any]]:
    """Return the arguments of an engine call, and the document that contains them."""
    model = engine.model
    sample = {"q": configuration(model, q)}
    sample |= {name: velocity(model, given, f"--{name}") for name, given in vectors.items()}
    names = {"velocity_names": velocity_names(model)}
    listed = {name: values.tolist() for name, values in sample.items()}
    bodies = {"payload": [each._asdict() for each in payload]}
    return list(sample.values()), {**document_head(engine), **bodies, **names, **listed}


def _report_vectors(result: Entry, json_path: str | None, quantity: str, columns: Sequence[str]) -> bool:
    """Print a table with one row for each entry of v; return True if the document was written instead."""
    if write_json(result, json_path):
        return True
    out = console()
    out.print(f"{title(result)}: {quantity}", style="bold")
    out.print(f"q = {' '.join(map(number, result['q']))}")
    table = Table("joint", *columns, right=columns, keys=1)
    for name, *values in zip(result["velocity_names"], *(result[key] for key in columns), strict=True):
        table.add_row(one_line(name), *map(number, values))
    out.print(table)
    return False


def _print_matrix(
    heading: str,
    rows: Sequence[str],
    columns: Sequence[str],
    matrix: Sequence[Sequence[float]],
    note: str | None = None,
) -> None:
    """Print a table under numbered columns, in blocks that fit the terminal, and the columns' names."""
    out = console()
    out.print(heading, style="bold")
    if note is not None:
        out.print(note)
    numbers = [str(k) for k in range(len(columns))]
    table = Table("", *numbers, right=numbers, keys=1)
    for name, row in zip(rows, matrix, strict=True):
        table.add_row(one_line(name), *(f"{value + 0.0:.5g}" for value in row))
    out.print(table)
    out.print()
    out.print(listing("columns", (f"{k} {one_line(name)}" for k, name in enumerate(columns)), out.width))
