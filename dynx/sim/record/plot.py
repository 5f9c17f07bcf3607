"""Plot of a rollout on one page: positions, errors, and torques.

Robots with many joints get several columns, so that the curves in each panel can be distinguished.
"""

from __future__ import annotations

import os
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from dynx.argument_types import checks_types
from dynx.control.base import Controller, chain_of
from dynx.files.figures import LINE_STYLES, line_style, literal, new_figure, save_figure
from dynx.model import Model
from dynx.sim.record.rollout import Rollout
from dynx.sim.record.tracking_error import frame_pose_errors
from dynx.spatial.scalar import Floats

PER_COLUMN = 12
"""Largest number of curves in one panel."""

MAX_CONTACT_CURVES = 8
"""Largest number of bodies and links whose contact forces are drawn: those with the largest."""

NEAR = 0.5
"""Share of an effort limit that a torque must reach for the limit to be drawn; one far above the curves
would flatten them."""


class Column(NamedTuple):
    """Coordinates that share panels: their names, and their indices in q and in v."""

    labels: tuple[str, ...]
    q: slice | list[int]
    v: slice | list[int]
    units: tuple[str, str]
    """Units of positions and of efforts."""
    of_base: bool = False
    """True if this is the column of a floating base: position in the world, all else in its own axes."""
    of_ball: bool = False
    """True if this is the column of a ball joint: the vector part of its quaternion, all else in the axes of
    its child."""


@checks_types
def plot(rollout: Rollout, path: str | os.PathLike[str] | None = None) -> Any:
    """Plot positions, errors and torques with their limits; return the `matplotlib.figure.Figure`, and save
    it at `path` if that is given.

    Without a reference it shows velocities instead of errors, and for a controller of a frame the error of
    that frame. A limit is drawn where a torque comes near it.
    A floating base has its own column: its position in the world, and its error, velocity and force in the
    axes of the base. So has a ball joint: the vector part of its quaternion, and the rest in the axes of its
    child. The figure belongs to no window. Raises NotInstalledError without matplotlib
    (extra ``plot``), ArgumentError for a file that cannot be written.
    """
    columns, forces = _columns(rollout.model), _contact_forces(rollout)
    rows = 4 if forces else 3
    figure = new_figure(7.0 if len(columns) == 1 else 3.8 * len(columns), 8.0 if rows == 3 else 10.5)
    panels = figure.subplots(rows, len(columns), sharex=True, squeeze=False)
    frame = _controlled_frame(rollout)
    for column, axes in zip(columns, panels[-3:].T, strict=True):
        _draw(rollout, column, axes, frame if column is columns[0] else None)
    if forces:
        _draw_contacts(rollout.t[:-1], forces, panels[0])
    figure.suptitle(literal(_title(rollout)), fontsize=11)
    if path is not None:
        save_figure(figure, path)
    return figure


def _contact_forces(rollout: Rollout) -> dict[str, Floats]:
    """Return the magnitudes (n,) of the contact forces [N], of the bodies and links with the largest."""
    if rollout.surroundings is None:
        return {}
    contacts = rollout.surroundings.contacts
    # Leave out the ground: its force is the sum of the others.
    moving = {name for name in contacts.touching if "/" in name or name in rollout.surroundings.bodies}
    found = {
        name: np.linalg.norm(contacts.force_on(name), axis=1) for name in contacts.touching if name in moving
    }
    largest = sorted(found, key=lambda name: -float(np.max(found[name])))[:MAX_CONTACT_CURVES]
    return {name: found[name] for name in sorted(largest)}


def _draw_contacts(t: Floats, forces: dict[str, Floats], panels: Any) -> None:
    """Draw the contact forces in the first panel of a row, and hide the others."""
    for k, (name, force) in enumerate(forces.items()):
        style = {"color": f"C{k % 10}", "linestyle": LINE_STYLES[k // 10 % len(LINE_STYLES)], "lw": 1.1}
        panels[0].step(t, force, where="post", label=literal(name), **style)
    panels[0].set_ylabel("contact force [N]")
    panels[0].grid(visible=True, color="0.9")
    panels[0].legend(fontsize=7, ncols=2)
    for panel in panels[1:]:
        panel.set_visible(False)


def _columns(model: Model) -> list[Column]:
    """Return the columns: one for a floating base, and the joints in equal shares."""
    base = Column(("base x", "base y", "base z"), slice(0, 3), slice(0, 3), ("m", "N"), of_base=True)
    columns = [base] if model.floating else []
    joints = [joint for joint in model.coordinate_joints if joint.type != "ball"]
    shares = -(-len(joints) // PER_COLUMN) or (0 if columns else 1)
    ends = np.linspace(0, len(joints), shares + 1).round().astype(int).tolist()
    for begin, end in pairwise(ends):
        sliding = [joint.unit == "m" for joint in joints[begin:end]]
        units = ("m", "N") if sliding and all(sliding) else ("rad", "N m")
        labels = [joint.name for joint in joints[begin:end]]
        if any(sliding) and not all(sliding):
            units = ("rad; m", "N m; N")
            labels = [name + " [m]" * slides for name, slides in zip(labels, sliding, strict=True)]
        names = [joint.name for joint in joints[begin:end]]
        q, v = (
            [model.position_index(each) for each in names],
            [model.coordinate_index(each) for each in names],
        )
        columns.append(Column(tuple(labels), q, v, units))
    for joint in model.ball_joints:
        # The position is the vector part of the quaternion.
        q_first, v_first = model.position_index(joint.name), model.coordinate_index(joint.name)
        labels = [f"{joint.name}.{axis}" for axis in "xyz"]
        places = slice(q_first, q_first + 3), slice(v_first, v_first + 3)
        columns.append(Column(tuple(labels), *places, ("rad", "N m"), of_ball=True))
    return columns


def _controlled_frame(rollout: Rollout) -> str | None:
    """Return the frame that the controller of the rollout controls; None for a controller of joints."""
    controller = None if rollout.scenario is None else rollout.scenario.controller
    if rollout.reference is None or not isinstance(controller, Controller):
        return None
    *_, innermost = chain_of(controller)
    frame = getattr(innermost, "frame", None)
    return frame if isinstance(frame, str) else None


def _draw_frame_error(axis: Any, t: Floats, errors: tuple[Floats, Floats]) -> None:
    """Draw position [m] and rotation vector [rad] of a frame's error, in world axes, with a legend."""
    for error, names, style in zip(errors, (("x", "y", "z"), ("rx", "ry", "rz")), ("-", "--"), strict=True):
        for k, name in enumerate(names):
            axis.plot(t, error[:, k], color=f"C{k}", linestyle=style, lw=1.3, label=name)
    axis.legend(ncols=2, fontsize=7)


def _draw(rollout: Rollout, column: Column, axes: Any, frame: str | None) -> None:
    positions, middle, efforts = axes
    t, (length, force) = rollout.t, column.units
    q = rollout.q[:, column.q]
    # A torque is held until the end of its step.
    tau = np.concatenate([rollout.tau, rollout.tau[-1:]])[:, column.v]
    limits = _effort_limits(rollout)[column.v]
    curves, limit = {}, None
    for k, label in enumerate(column.labels):
        style = {**line_style(k), "lw": 1.3}
        (curves[literal(label)],) = positions.plot(t, q[:, k], **style)
        if rollout.reference is not None:
            wanted = positions.plot(t, rollout.reference.q[:, column.q][:, k], color="0.6", lw=0.8, zorder=0)
        between = rollout.v if rollout.reference is None else rollout.error
        if frame is None:
            middle.plot(t, between[:, column.v][:, k], **style)
        efforts.step(t[: len(tau)], tau[:, k], where="post", **style)
        if np.isfinite(limits[k]) and np.max(np.abs(tau[:, k]), initial=0.0) > NEAR * limits[k]:
            for sign in (1.0, -1.0):
                limit = efforts.axhline(
                    sign * limits[k], color=style["color"], lw=0.9, linestyle=(0, (1, 3)), zorder=3
                )
    if frame is not None and rollout.reference is not None:
        _draw_frame_error(middle, t, frame_pose_errors(rollout, rollout.reference, frame))
    if rollout.reference is not None and curves:
        curves["reference"] = wanted[0]
    if limit is not None:
        curves["effort limit"] = limit
    positions.set_ylabel(f"position [{length}]")
    speed = "; ".join(f"{unit}/s" for unit in length.split("; "))
    middle.set_ylabel(f"velocity [{speed}]" if rollout.reference is None else f"error q* - q [{length}]")
    if frame is not None:
        middle.set_ylabel(f"error of {literal(frame)} [m; rad]")
    efforts.set_ylabel(f"torque [{force}]" if "N m" in force else f"force [{force}]")
    if column.of_ball:
        positions.set_ylabel("vector part of the quaternion")
    if column.of_base:
        for axis, axes_of in ((positions, "world"), (middle, "base"), (efforts, "base")):
            axis.set_ylabel(f"{axis.get_ylabel()} ({axes_of} axes)")
    efforts.set_xlabel("time [s]")
    for axis in axes:
        axis.grid(visible=True, color="0.9")
        axis.ticklabel_format(axis="y", scilimits=(-3, 4))
        if len(rollout):
            axis.set_xlim(t[0], t[-1])
    if curves:
        efforts.legend(
            list(curves.values()),
            list(curves),
            loc="upper center",
            bbox_to_anchor=(0.5, -0.2),
            ncols=min(4 if len(axes[0].figure.axes) <= 4 else 2, len(curves)),
            fontsize=8,
        )


def _title(rollout: Rollout) -> str:
    controller_name, plant = (rollout.settings.get(name, "none") for name in ("controller", "plant"))
    controller = "no controller" if controller_name == "none" else controller_name
    return f"{rollout.model.name}: {controller}" + ("" if plant == "none" else f" on {plant}")


def _effort_limits(rollout: Rollout) -> Floats:
    """Return the effort limits at which torques were saturated; if there were none, those of the robot."""
    cut = rollout.settings.get("effort_limits")
    return rollout.model.effort_limit if cut is None else np.asarray(cut, dtype=np.float64)
