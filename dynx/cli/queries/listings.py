"""Bodies of ``dynx info``, ``robots`` and ``backends``: what dynx reads and knows."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from itertools import groupby
from typing import Any

from rich.text import Text
from rich.tree import Tree

from dynx.backends.registry import backend, backend_names
from dynx.cli.shell.exits import one_line
from dynx.cli.shell.inputs import load_robot
from dynx.cli.shell.output import PIPE_WIDTH, console, counted, number, write_json
from dynx.cli.shell.tables import Table
from dynx.errors import BackendError
from dynx.model import Joint, Link, Model, library
from dynx.model.documents import pose_numbers
from dynx.model.elements import IDENTITY
from dynx.model.stated_parts import StatedSensor
from dynx.model.xml.several_files import file_of_line


def info(json_path: str | None, **robot: Any) -> None:
    """Print the model as a tree and a table, or as a model_document."""
    model = load_robot(**robot)
    if not write_json(model_document(model), json_path):
        _show(model)


def model_document(model: Model) -> dict[str, Any]:
    """Make the JSON model_document of a model; infinite limits become null."""
    return {
        "schema": 1,
        "name": model.name,
        "source": model.source,
        "base": model.base,
        "base_pose": pose_numbers(model.base_pose),
        "root": model.root,
        "gravity": list(model.gravity),
        "nq": model.nq,
        "nv": model.nv,
        "joint_names": list(model.joint_names),
        "frame_names": list(model.frame_names),
        "total_mass": model.total_mass,
        "joints": [_joint_entry(joint) for joint in model.joints],
        "links": [
            {
                "name": link.name,
                "mass": 0.0 if link.inertial is None else link.inertial.mass,
                "has_inertial": link.inertial is not None,
                "line": link.line,
                "file": file_of_line(link.line),
            }
            for link in model.links
        ],
        **{name: _records(getattr(model, name)) for name in DATA},
        "initial_configuration": model.initial_configuration.tolist(),
        "configurations": {name: q.tolist() for name, q in model.configurations.items()},
        "notes": [asdict(note) for note in model.notes],
    }


DATA = ("actuators", "sensors", "tendons", "equalities", "gravity_compensation")
"""Fields of a model with what its description states as data."""


def _records(parts: Iterable[Any] | None) -> list[dict[str, Any]] | None:
    """Return data of a model as JSON; a bound that is infinite becomes null."""
    if parts is None:
        return None
    return [
        {**{name: _finite(value) for name, value in asdict(each).items()}, "file": file_of_line(each.line)}
        for each in parts
    ]


def _finite(value: Any) -> Any:
    if isinstance(value, tuple | list):
        return [_finite(each) for each in value]
    return None if isinstance(value, float) and math.isinf(value) else value


def _joint_entry(joint: Joint) -> dict[str, Any]:
    return {
        "name": joint.name,
        "type": joint.type,
        "parent": joint.parent,
        "child": joint.child,
        "axis": list(joint.axis) if joint.moves else None,
        **asdict(joint.limits),
        **asdict(joint.dynamics),
        "mimic": None if joint.mimic is None else asdict(joint.mimic),
        "locked_at": joint.locked_at,
        "line": joint.line,
        "file": file_of_line(joint.line),
    }


def _show(model: Model) -> None:
    out = console()
    out.print(f"{one_line(model.name)}  ({one_line(model.source)})", style="bold")
    out.print(
        f"{model.base} base, nq {model.nq}, nv {model.nv}, {counted(len(model.links), 'link')}, "
        f"{counted(len(model.frame_names), 'frame')}, {model.total_mass:.6g} kg, "
        f"gravity {_vector(model.gravity)} m/s^2"
    )
    if model.base_pose != IDENTITY:
        pose = model.base_pose
        out.print(f"base at xyz {_vector(pose.xyz)} m, rpy {_vector(pose.rpy)} rad")
    out.print()
    wide = console()
    wide.width = PIPE_WIDTH  # rich would truncate the lines of a tree
    wide.print(_tree(model))
    if any(joint.moves for joint in model.joints):
        out.print()
        out.print(_joint_table(model))
        out.print()
    added = [frame.name for frame in model.extra_frames]
    if added:
        out.print(f"frames besides the links: {', '.join(map(one_line, added))}")
    for what, words in _data_lines(model):
        if words:
            out.print(f"{what} ({len(words)}): {', '.join(map(one_line, words))}")
    for note in model.notes:
        out.print(f"note: {one_line(note)}", style="yellow")


def _tree(model: Model) -> Tree:
    def label(link: str, joint: Joint | None) -> Text:
        inertial = model.link(link).inertial
        text = Text(one_line(link))
        text.append("  no mass" if inertial is None else f"  {number(inertial.mass)} kg", style="dim")
        if joint is not None:
            kind = joint.type if joint.locked_at is None else f"locked at {number(joint.locked_at)}"
            text.append(f"  <- {one_line(joint.name)} ({kind})", style="cyan" if joint.moves else "dim")
        return text

    # Joints are in depth-first order, so the parent's branch exists before its children.
    branches = {model.root: Tree(label(model.root, None))}
    for joint in model.joints:
        branches[joint.child] = branches[joint.parent].add(label(joint.child, joint))
    return branches[model.root]


def _joint_table(model: Model) -> Table:
    right = ("q", "lower", "upper", "velocity", "effort")
    table = Table("q", "joint", "type", "axis", *right[1:], "follows", right=right, keys=2)
    index = {name: model.position_index(name) for name in model.joint_names}
    for joint in model.joints:
        if not joint.moves:
            continue
        limits = joint.limits
        # The limit of a ball joint is its largest angle alone.
        lower = -math.inf if joint.type == "ball" else limits.lower
        bounds = (lower, limits.upper, limits.velocity, limits.effort)
        table.add_row(
            str(index.get(joint.name, "")),
            one_line(joint.name),
            joint.type,
            "" if joint.type == "ball" else _vector(joint.axis),
            *(f"{bound:.4g}" if math.isfinite(bound) else "-" for bound in bounds),
            _mimic_rule(joint),
        )
    return table


def _mimic_rule(joint: Joint) -> str:
    if joint.mimic is None:
        return ""
    offset = "" if joint.mimic.offset == 0.0 else f" {joint.mimic.offset:+.6g}"
    return f"{number(joint.mimic.multiplier)} * {one_line(joint.mimic.joint)}{offset}"


def _data_lines(model: Model) -> Iterator[tuple[str, list[str]]]:
    """Yield each kind of data that the description states, with what stands for each of them."""
    yield "actuators", [_named(each.name, each.joint or each.tendon) for each in model.actuators or ()]
    yield "sensors", [_sensor(each) for each in model.sensors or ()]
    yield "tendons", [_named(each.name, " ".join(each.joints)) for each in model.tendons or ()]
    yield (
        "equality constraints",
        [_named(each.name, " ".join((each.type, *each.objects))) for each in model.equalities or ()],
    )
    yield (
        "gravity compensation",
        [f"{each.link} ({number(each.factor)})" for each in model.gravity_compensation or ()],
    )
    yield "named configurations", list(model.configurations)


def _named(name: str, words: str) -> str:
    return f"{name} ({words})" if name else words


def _sensor(sensor: StatedSensor) -> str:
    """Write name, type and objects of a sensor."""
    words = [sensor.type, *(name for _, name in sensor.objects)]
    return _named(sensor.name, " ".join(words))


def _vector(values: tuple[float, ...]) -> str:
    return " ".join(f"{value + 0.0:.4g}" for value in values)


def robots(words: tuple[str, ...], json_path: str | None) -> None:
    """Print the robots whose name or path contains one of `words`, or all."""
    entries = [
        entry
        for entry in library.robots()
        if not words or any(word.lower() in f"{entry.name} {entry.path}".lower() for word in words)
    ]
    if json_path is not None:
        listed = [
            {
                "name": entry.name,
                "aliases": list(entry.aliases),
                "source": entry.source,
                "path": str(entry.path),
            }
            for entry in entries
        ]
        if write_json({"schema": 1, "robots": listed}, json_path):
            return
    out = console()
    for source, group in groupby(entries, key=lambda entry: entry.source):
        members = list(group)
        folder = os.path.commonpath([entry.path.parent for entry in members])
        out.print(f"{source}: {folder}", style="bold")
        # The whole list fits 80 columns; a part of it shows where each file is.
        table = Table("name", "file")
        for entry in members:
            table.add_row(entry.name, os.path.relpath(entry.path, folder) if words else entry.path.name)
        out.print(table)
        out.print()
    out.print(f"{counted(len(entries), 'robot')}; dynx robots WORD shows the folders of those with WORD")


def backends(json_path: str | None) -> None:
    """Print the table or the document of the backends."""
    entries = [_backend_entry(name) for name in backend_names()]
    if write_json({"schema": 1, "backends": entries}, json_path):
        return
    table = Table("backend", "installed", "engine")
    for each in entries:
        mark = "yes" if each["installed"] else "no"
        table.add_row(each["name"], mark, one_line(each["version"] or each["reason"]))
    console().print(table)


def _backend_entry(name: str) -> dict[str, Any]:
    try:
        with backend(name, Model.build("probe", [Link("base")], [])) as engine:
            return {"name": name, "installed": True, "version": engine.engine_version, "reason": None}
    except BackendError as error:
        return {"name": name, "installed": False, "version": None, "reason": str(error)}
