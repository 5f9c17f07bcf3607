"""Tables of the document of one simulation: everything shown is a function of the document alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dynx.cli.exits import one_line
from dynx.cli.tables import Table
from dynx.cli.terminal import counted, number

if TYPE_CHECKING:
    from rich.console import Console

Entry = dict[str, Any]

_STEPPERS = {
    "engine": "its own stepper",
    "semi_implicit": "semi-implicit Euler",
    "rk4": "Runge-Kutta 4",
    "adaptive": "adaptive steps",
}
"""What an integrator is called."""


def show(out: Console, made: Entry) -> None:
    """What was simulated, a table with a line for each joint, and what is to be said of all."""
    settings = made["settings"]
    law = "no motors" if made["law"] == "none" else made["law"]
    engine = "" if made["backend"] is None else f" computed by {made['backend']}"
    stepper = _STEPPERS.get(settings["integrator"], settings["integrator"])
    out.print(
        f"{one_line(made['robot'])}, {made['base']} base: {law}{engine}, on {settings['plant']} "
        f"with {stepper}",
        style="bold",
    )
    out.print(
        f"{_motion(made)}; {counted(made['steps'], 'step')} of {number(made['dt'])} s, "
        f"gravity {' '.join(number(g) for g in made['gravity'])} m/s^2"
    )
    gains = [f"{name} {_gain(gain)}" for name, gain in made["gains"].items() if gain]
    if gains:
        out.print(", ".join(gains))
    out.print(_joint_table(made))
    out.print(_worst(made))
    out.print(_energy(made))
    if made["law"] != "none":
        out.print(_saturation(made))
    out.print(f"simulated {number(made['simulated'])} s in {made['seconds']:.2f} s")


def error_text(error: float | None) -> str:
    """An error in two digits, ``-`` where there is none."""
    if error is None:
        return "-"
    return "0" if error == 0.0 else f"{error:.1e}"


def _motion(made: Entry) -> str:
    motion = made["motion"]
    if motion["profile"] == "hold":
        return "nothing to follow" if motion["to"] is None else "a configuration to hold"
    where = "" if motion["line"] is None else f", {one_line(made['frame'])} along a straight line"
    return f"{motion['profile']} motion of {number(motion['duration'])} s{where}"


def _gain(gain: list[float]) -> str:
    """One number where all are the same, else the least and the largest."""
    least, largest = f"{min(gain):.3g}", f"{max(gain):.3g}"
    return least if least == largest else f"{least} to {largest}"


def _joint_table(made: Entry) -> Table:
    """Errors are of positions, in the unit that the first column says."""
    joints: list[Entry] = made["joints"]
    right = ("max\nerror", "RMS\nerror", "max\nspeed", "max\ntorque", "limit", "of it")
    table = Table("joint", "unit", *right, right=right, keys=1)
    for joint in joints:
        limit = joint["effort_limit"]
        table.add_row(
            one_line(joint["name"]),
            joint["unit"],
            error_text(joint["max_error"]),
            error_text(joint["rms_error"]),
            f"{joint['max_speed']:.3g}",
            f"{joint['max_torque']:.3g}",
            "-" if limit is None else f"{limit:.4g}",
            "-" if not limit else f"{100.0 * joint['max_torque'] / limit:.2g} %",
        )
    return table


def _worst(made: Entry) -> str:
    if made["max_error"] is None:
        return "no error: there was nothing to follow"
    return (
        f"largest error {error_text(made['max_error'])} of {one_line(made['max_error_joint'])} at "
        f"{number(made['max_error_time'])} s, {error_text(made['final_error'])} at the end"
    )


def _energy(made: Entry) -> str:
    drift = (
        f"{made['energy_drift']:.2g} times the largest kinetic energy ({made['max_kinetic_energy']:.3g} J)"
    )
    if made["max_kinetic_energy"] == 0.0:
        return "nothing moved"
    if made["passive"]:
        return f"energy drifted by {drift}"
    return f"energy changed by {drift}: motors and loads did work"


def _saturation(made: Entry) -> str:
    if made["motor_limits"] is not None:
        return "PyBullet held its motors to the limits; how often is not known"
    if made["settings"]["effort_limits"] is None:
        return "torques were not cut to limits (--effort-limits urdf does)"
    return f"motors were at their limits in {100.0 * made['saturated']:.3g} % of the steps"
