"""Run of ``dynx world``: the scene in each engine, with progress, JSON document, tables, files and exit code.

The document has lengths in m, angles in rad, forces in N, times in s, and world axes.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, TypedDict

import numpy as np
from rich.console import Console

from dynx.cli.shell.exits import (
    DONE,
    INTERRUPTED,
    complain,
    exit_code,
    failure_of,
    interruptible,
    one_line,
)
from dynx.cli.shell.inputs import settings_by_engine
from dynx.cli.shell.output import (
    Entry,
    check_json,
    check_writable,
    console,
    counted,
    entry_of,
    present,
    simulated_time_bar,
)
from dynx.cli.shell.tables import MAX_ROWS, Table, print_rest
from dynx.errors import ArgumentError, DynxError, nearest, shown
from dynx.files.figures import literal, new_figure, picture_format, save_figure
from dynx.files.links import refuse_links
from dynx.files.writing import write_bytes
from dynx.spatial.so3 import quat_from_rotation
from dynx.steppers.registry import installed_worlds
from dynx.steppers.settings import Setting
from dynx.world import Scene, World, body_to_urdf, read_scene, write_scene
from dynx.world.comparison import (
    SEPARATIONS,
    ComparisonInterrupted,
    EngineRun,
    WorldComparison,
    compare_engines,
)
from dynx.world.mjcf import mjcf_remarks, scene_to_mjcf
from dynx.world.separation import Separation
from dynx.world.snapshot import check_world_suffix

OPTIONS = {"joint_limits": Setting(True, "False: joints pass their limits")}
"""Options of a world that ``--set`` gives besides the settings of the engines."""


def world(
    scene: str,
    engines: tuple[str, ...] | None,
    duration: float,
    dt: float,
    substeps: int,
    settings: Sequence[tuple[str, str]],
    keyframe: str | None,
    contact_interval: float | None,
    within: float | None,
    json_path: str | None,
    plot_path: str | None,
    save_path: str | None,
    export_path: str | None,
    quiet: bool,
) -> int:
    """Export the scene, or run it in each engine and compare; return the exit code."""
    if export_path is not None:
        given_options = {
            "--json": json_path,
            "--plot": plot_path,
            "--save": save_path,
            "--contact-interval": contact_interval,
        }
        for option, value in given_options.items():
            if value is not None:
                raise ArgumentError(f"{option} is given with --export, which runs nothing")
        described = read_scene(scene, keyframe=keyframe)
        return _export(described, export_path, engines, dt, substeps, settings, quiet=quiet)
    check_json(json_path)
    for path in (plot_path, save_path):
        if path is not None:
            check_writable(path)
    if save_path is not None:
        check_world_suffix(save_path)
    if plot_path is not None:
        picture_format(plot_path)
    chosen = engines or installed_worlds()
    described = read_scene(scene, keyframe=keyframe)
    given = settings_by_engine(chosen, settings, OPTIONS)
    if save_path is not None:
        for engine in chosen:
            own_path(save_path, engine, len(chosen))  # Before the run, not after it.
    errors: list[DynxError | None] = []

    def save(world: World) -> None:
        if save_path is not None:
            errors.append(failure_of(world.write, own_path(save_path, world.engine, len(chosen))))

    with interruptible() as interruption:
        with simulated_time_bar(len(chosen), duration, enabled=not quiet) as progress:
            ended: ComparisonInterrupted | None = None
            try:
                comparison = compare_engines(
                    described,
                    chosen,
                    duration,
                    dt,
                    substeps=substeps,
                    settings=given,
                    contact_interval=contact_interval,
                    leave_out=engines is None,
                    finish=save,
                    progress=progress,
                )
            except ComparisonInterrupted as early:
                ended, comparison = early, early.comparison
        interruption.finishing = True
        if plot_path is not None:
            errors.append(failure_of(plot, comparison, plot_path))
        errors.append(present(document(comparison), show, json_path, quiet=quiet))
        if ended is not None:
            complain(f"{ended} of {len(chosen)}")
    code = exit_code(*errors, negative=_is_negative(comparison, within))
    return code if ended is None else interruption.code or INTERRUPTED


def _export(
    scene: Scene,
    path: str,
    engines: Sequence[str] | None,
    dt: float,
    substeps: int,
    settings: Sequence[tuple[str, str]],
    *,
    quiet: bool,
) -> int:
    check_suffix(path)
    check_writable(path)
    if engines is not None and len(engines) > 1:
        raise ArgumentError(
            f"--export writes the scene of one world, and --engine has {len(engines)} engines"
        )
    engine = engines[0] if engines else "mujoco"
    given = settings_by_engine(tuple(dict.fromkeys((engine, "mujoco"))), settings)
    files, notes = export(scene, path, engine, dt, substeps, given)
    if (engines or settings or substeps > 1) and not is_mjcf(path):
        notes = ["the engine, its steps and its settings are those of a world; MJCF alone has them"]
    if not quiet:
        for file in files:
            console().print(f"wrote {one_line(file)}")
        for note in (*map(str, scene.notes), *notes):
            console().print(f"note: {one_line(note)}", style="yellow")
    return DONE


def _is_negative(comparison: WorldComparison, within: float | None) -> bool:
    if any(run.error is not None for run in comparison.runs):
        return True
    return within is not None and any(max(each.distance) > within for each in comparison.separations)


SCHEMA: Literal["dynx.world/1"] = "dynx.world/1"


class RobotEntry(TypedDict):
    """State of a robot in the coordinates of its model."""

    name: str
    joints: list[str]
    q: list[float]
    v: list[float]


class BodyEntry(TypedDict):
    """State of a body: position and quaternion (x, y, z, w) of its frame, linear and angular velocity."""

    name: str
    position: list[float]
    quat_xyzw: list[float]
    twist: list[float]


class ContactEntry(TypedDict):
    """A contact of the last step; the force on `a` is normal_force * normal + friction_force."""

    a: str
    b: str
    point: list[float]
    normal: list[float]
    distance: float
    normal_force: float
    friction_force: list[float]


class MeanContactEntry(TypedDict):
    """Mean over the contact interval of what two parts that touched exert on each other: force on `a`, its
    moment about the origin of the world, normal force, and the share of time in which they touched."""

    a: str
    b: str
    force: list[float]
    moment: list[float]
    normal_force: float
    touching: float


class SensorEntry(TypedDict):
    """Last reading of a sensor, taken at time `t` [s]; values by what they are, such as ``force:x``."""

    name: str
    kind: str
    t: float
    values: dict[str, float]


class EngineEntry(TypedDict):
    """Run of the scene by one engine; `error` is why it ended early, `notes` name overlaps and violated
    constraints of the start."""

    engine: str
    version: str
    settings: dict[str, Any]
    time: float
    error: str | None
    notes: list[str]
    robots: list[RobotEntry]
    bodies: list[BodyEntry]
    contacts: list[ContactEntry]
    mean_contacts: list[MeanContactEntry]
    sensors: list[SensorEntry]


class PartedEntry(TypedDict):
    """First of the compared times at which two engines are farther apart than `distance`; null for never."""

    distance: float
    time: float | None


class SeparationEntry(TypedDict):
    """Largest distance between the positions of a body or moving link in two engines, over time."""

    engines: list[str]
    times: list[float]
    distance: list[float]
    farthest: list[str]
    parted: list[PartedEntry]


class RefusalEntry(TypedDict):
    """An engine that refuses the scene and was left out, and why."""

    engine: str
    reason: str


class WorldDocument(TypedDict):
    """One scene run by one engine or several."""

    schema: Literal["dynx.world/1"]
    scene: str
    dt: float
    substeps: int
    duration: float
    contact_interval: float | None
    engines: list[EngineEntry]
    separations: list[SeparationEntry]
    left_out: list[RefusalEntry]


def document(comparison: WorldComparison) -> WorldDocument:
    """Return the document of a comparison."""
    return entry_of(
        WorldDocument,
        comparison,
        schema=SCHEMA,
        scene=comparison.scene.name,
        engines=[_engine(comparison, run) for run in comparison.runs],
        separations=[_separation(each) for each in comparison.separations],
        left_out=[RefusalEntry(engine=each.engine, reason=each.reason) for each in comparison.left_out],
    )


def _engine(comparison: WorldComparison, run: EngineRun) -> EngineEntry:
    last, scene = run.states[-1], comparison.scene
    moving = [body.name for body in scene.bodies if not body.fixed]
    return {
        "engine": run.engine,
        # Most versions begin with the name of the engine.
        "version": run.version.removeprefix(run.engine).strip(),
        "settings": dict(run.settings),
        "time": last.time,
        "error": "interrupted" if run.interrupted else None if run.error is None else str(run.error),
        "notes": list(run.notes),
        "robots": [
            entry_of(RobotEntry, last.robots[each.name], name=each.name, joints=each.model.position_names)
            for each in scene.robots
        ],
        "bodies": [
            entry_of(
                BodyEntry,
                last.bodies[name],
                name=name,
                position=last.bodies[name].T_world_body[:3, 3],
                quat_xyzw=quat_from_rotation(last.bodies[name].T_world_body[:3, :3]),
            )
            for name in moving
        ],
        "contacts": [entry_of(ContactEntry, each) for each in run.contacts],
        "mean_contacts": [entry_of(MeanContactEntry, each) for each in run.mean_contacts],
        "sensors": [
            {
                "name": name,
                "kind": reading.sensor.kind,
                "t": reading.t,
                "values": dict(zip(reading.sensor.value_names, reading.values.tolist(), strict=True)),
            }
            for name, reading in run.sensors.items()
        ],
    }


def _separation(separation: Separation) -> SeparationEntry:
    parted = [_parted(separation, each) for each in SEPARATIONS]
    return entry_of(
        SeparationEntry, separation, engines=separation.records, farthest=separation.parts, parted=parted
    )


def _parted(separation: Separation, distance: float) -> PartedEntry:
    time, _ = separation.first_beyond(distance) or (None, "")
    return {"distance": distance, "time": time}


def show(out: Console, report: Entry) -> None:
    """Print the final states, the contacts, and the distances between the engines."""
    engines: Sequence[Entry] = report["engines"]
    names = ", ".join(f"{each['engine']} {each['version']}" for each in engines)
    step = f"dt {report['dt']:g} s" + (f" in {report['substeps']} steps" if report["substeps"] > 1 else "")
    out.print(
        f"{one_line(report['scene'])}: {report['duration']:g} s, {step}, by {one_line(names)}", style="bold"
    )
    for each in engines:
        if each["error"] is not None:
            out.print(
                f"{each['engine']} ended at {each['time']:.6g} s: {one_line(each['error'])}", style="red"
            )
    for each in report["left_out"]:
        out.print(f"note: without {each['engine']}: {one_line(each['reason'])}", style="yellow")
    _show_notes(out, engines)
    _show_bodies(out, engines)
    _show_robots(out, engines)
    _show_contacts(out, engines, "contacts", "contacts of the last step: normal force")
    if report["contact_interval"] is not None:
        interval = min(report["contact_interval"], report["duration"])
        mean = f"contacts, mean of the last {interval:g} s: normal force"
        _show_contacts(out, engines, "mean_contacts", mean)
    _show_sensors(out, engines)
    _show_separations(out, report["separations"])


def _show_notes(out: Console, engines: Sequence[Entry]) -> None:
    """Print the notes on the start, once where the engines have the same."""
    found: dict[str, list[str]] = defaultdict(list)
    for each in engines:
        for note in each["notes"]:
            found[note].append(each["engine"])
    for note, names in list(found.items())[:MAX_ROWS]:
        where = "" if len(names) == len(engines) else f" ({', '.join(names)})"
        out.print(f"note: {one_line(note)}{where}", style="yellow")


def _show_bodies(out: Console, engines: Sequence[Entry]) -> None:
    count = len(engines[0]["bodies"])
    if not count:
        return
    table = Table(
        "body", "engine", "x [m]", "y [m]", "z [m]", "speed [m/s]", right=("x [m]", "y [m]", "z [m]")
    )
    for k in range(min(count, MAX_ROWS)):
        for each in engines:
            body = each["bodies"][k]
            speed = float(np.linalg.norm(body["twist"][:3]))
            place = (f"{x:.4f}" for x in body["position"])
            table.add_row(one_line(body["name"]), each["engine"], *place, f"{speed:.3g}")
    out.print("\nbodies at the end")
    out.print(table)
    print_rest(out, count - MAX_ROWS, "body", "bodies")


def _show_robots(out: Console, engines: Sequence[Entry]) -> None:
    for k, robot in enumerate(engines[0]["robots"]):
        columns = [each["engine"] for each in engines]
        table = Table("coordinate", *columns, right=tuple(columns))
        states = [each["robots"][k] for each in engines]
        base = ["base x", "base y", "base z", "base qx", "base qy", "base qz", "base qw"]
        floating = len(robot["q"]) > len(robot["joints"])
        names = [*(base if floating else []), *robot["joints"]]
        for row, name in enumerate(names[:MAX_ROWS]):
            table.add_row(one_line(name), *(f"{state['q'][row]:.5f}" for state in states))
        out.print(f"\n{one_line(robot['name'])} at the end [m; rad]")
        out.print(table)
        print_rest(out, len(names) - MAX_ROWS, "coordinate", "coordinates")


def _show_contacts(out: Console, engines: Sequence[Entry], kind: str, title: str) -> None:
    pairs: dict[tuple[str, str], list[list[float]]] = defaultdict(lambda: [[] for _ in engines])
    for k, each in enumerate(engines):
        for contact in each[kind]:
            pairs[min(contact["a"], contact["b"]), max(contact["a"], contact["b"])][k].append(
                contact["normal_force"]
            )
    if not pairs:
        out.print(f"\n{title}: none" if kind == "mean_contacts" else "\nno contacts at the end")
        return
    columns = [f"{each['engine']} [N]" for each in engines]
    table = Table("between", *columns, right=tuple(columns))
    for (a, b), forces in sorted(pairs.items())[:MAX_ROWS]:
        cells = (f"{sum(each):.5g}{_points(kind, each)}" if each else "-" for each in forces)
        table.add_row(f"{one_line(a)}, {one_line(b)}", *cells)
    out.print(f"\n{title}")
    out.print(table)
    print_rest(out, len(pairs) - MAX_ROWS, "pair", "pairs")


def _points(kind: str, forces: Sequence[float]) -> str:
    """Return the number of points of the contacts of a step; a mean is of all of them."""
    return f" at {counted(len(forces), 'point')}" if kind == "contacts" else ""


def _show_sensors(out: Console, engines: Sequence[Entry]) -> None:
    values: dict[tuple[str, str], list[str]] = defaultdict(lambda: ["-" for _ in engines])
    for k, each in enumerate(engines):
        for sensor in each["sensors"]:
            for name, value in sensor["values"].items():
                values[sensor["name"], name][k] = f"{value:.5g}"
    if not values:
        return
    columns = [each["engine"] for each in engines]
    table = Table("sensor", "value", *columns, right=tuple(columns))
    for (sensor_name, name), cells in [*values.items()][:MAX_ROWS]:
        table.add_row(one_line(sensor_name), name, *cells)
    out.print("\nlast readings of sensors [SI units]")
    out.print(table)
    print_rest(out, len(values) - MAX_ROWS, "value", "values")


def _show_separations(out: Console, separations: Sequence[Entry]) -> None:
    if not separations:
        return
    distances = [parted["distance"] for parted in separations[0]["parted"]]
    headings = [f"> {1e3 * distance:g} mm" for distance in distances]
    table = Table(
        "engines",
        *headings,
        "first",
        "largest [m]",
        "end [m]",
        "of",
        right=(*headings, "largest [m]", "end [m]"),
    )
    for each in separations:
        times = (
            f"{parted['time']:.3g} s" if parted["time"] is not None else "never" for parted in each["parted"]
        )
        table.add_row(
            ", ".join(each["engines"]),
            *times,
            _first_apart(each, distances[0]),
            f"{max(each['distance']):.2e}",
            f"{each['distance'][-1]:.2e}",
            one_line(each["farthest"][int(np.argmax(each["distance"]))]),
        )
    out.print("\ndistance of the motions, the largest of all bodies and moving links, and when it exceeds")
    out.print(table)


def _first_apart(separation: Entry, distance: float) -> str:
    """Return the part that is farther apart than `distance` first; empty if none is."""
    beyond = np.array(separation["distance"]) > distance
    return one_line(separation["farthest"][int(np.argmax(beyond))]) if beyond.any() else ""


FLOOR = 1e-9
"""Smallest distance drawn [m], unless all are smaller: below it there is rounding alone."""

SPAN = 1e-4
"""Smallest distance drawn, relative to the largest, where all are below `FLOOR`."""


def plot(comparison: WorldComparison, path: str) -> None:
    """Draw the distances between the engines, or for one engine the heights of what moves.

    Raises ArgumentError for a file that cannot be written, NotInstalledError without matplotlib.
    """
    figure = new_figure(7.0, 4.0)
    axes = figure.subplots()
    if comparison.separations:
        bottom = _lowest(max(float(each.distance.max()) for each in comparison.separations))
        for each in comparison.separations:
            distance = np.maximum(each.distance, bottom)
            axes.semilogy(each.times, distance, lw=1.3, label=" - ".join(each.records))
        axes.set_ylim(bottom=bottom)
        axes.set_ylabel("largest distance [m]")
    else:
        run = comparison.runs[0]
        for body in comparison.scene.bodies:
            if not body.fixed:
                heights = [state.bodies[body.name].T_world_body[2, 3] for state in run.states]
                axes.plot(run.times, heights, lw=1.3, label=literal(body.name))
        for robot in comparison.scene.robots:
            if robot.model.floating:
                heights = [state.robots[robot.name].q[2] for state in run.states]
                axes.plot(run.times, heights, lw=1.3, label=literal(robot.name))
        axes.set_ylabel("height [m]")
    axes.set_xlabel("time [s]")
    axes.set_title(literal(comparison.scene.name), fontsize=11)
    axes.grid(visible=True, color="0.9")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=8)
    save_figure(figure, path)


def _lowest(largest: float) -> float:
    """Return the lower limit of the logarithmic axis for a largest distance [m]."""
    return FLOOR if largest > FLOOR or largest == 0.0 else SPAN * largest


SUFFIXES = (".xml", ".mjcf", ".urdf", ".toml", ".json")


def is_mjcf(path: str) -> bool:
    """Check whether a file is exported as MJCF."""
    return Path(path).suffix.lower() in (".xml", ".mjcf")


def check_suffix(path: str) -> None:
    """Raise ArgumentError unless the suffix of a file is that of a format to which scenes are exported."""
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise ArgumentError(
            f"--export {shown(path, 300)}: wanted a file in .xml or .mjcf (MJCF), .urdf, .toml or .json"
            f"{nearest(suffix, SUFFIXES)}"
        )


def export(
    scene: Scene,
    path: str,
    engine: str,
    dt: float,
    substeps: int,
    settings: Mapping[str, Mapping[str, Any]],
) -> tuple[list[str], Sequence[str]]:
    """Write a scene in the format of the suffix of a file; return the files written, and notes on what they
    cannot carry.

    MJCF has the step [s] and the settings of the world in an engine. In URDF each robot and body has a file
    of its own, whose name stands before the suffix unless it is the only one. Raises the errors of `World`
    and of `World.to_mjcf`, `body_to_urdf`, `Model.to_urdf` and `write_scene`.
    """
    check_suffix(path)
    if is_mjcf(path):
        text = _mjcf(scene, engine, dt, substeps, settings)
        write_bytes(path, text.encode())
        return [path], mjcf_remarks(text)
    if Path(path).suffix.lower() != ".urdf":
        write_scene(scene, path)
        return [path], ()
    texts = {robot.name: robot.model.to_urdf(geometry=True) for robot in scene.robots}
    texts |= {body.name: body_to_urdf(body) for body in scene.bodies}
    files = [own_path(path, name, len(texts)) for name in texts]
    for file, text in zip(files, texts.values(), strict=True):
        write_bytes(file, text.encode())
    return files, ()


def _mjcf(
    scene: Scene, engine: str, dt: float, substeps: int, settings: Mapping[str, Mapping[str, Any]]
) -> str:
    """Return the document of the world in an engine."""
    of_mujoco = settings.get("mujoco", {})
    if engine == "mujoco":
        return scene_to_mjcf(scene, dt, substeps=substeps, **of_mujoco)
    with World(scene, engine, dt, substeps=substeps, **settings.get(engine, {})) as world:
        return world.to_mjcf(**of_mujoco)


def own_path(path: str, name: str, count: int) -> str:
    """Return the file of one of several: its name stands before the suffix. ArgumentError for a link."""
    if count == 1:
        return path
    file = Path(path)
    own = file.with_name(f"{file.stem}.{name}{file.suffix}")
    refuse_links(own.parent, [own.name])
    return str(own)
