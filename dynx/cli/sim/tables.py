"""Tables of the document of one simulation: everything shown is a function of the document alone."""

from __future__ import annotations

from typing import Any

from rich.console import Console

from dynx.cli.shell.exits import one_line
from dynx.cli.shell.inputs import default_frame_note
from dynx.cli.shell.tables import Table
from dynx.cli.shell.terminal import counted, number
from dynx.cli.sim.numbers import column_text, error_text, share_text
from dynx.cli.sim.perturbed import perturbed, spread

Entry = dict[str, Any]

AT_REST = 1e-20
"""Kinetic energy [J] that is nothing but rounding: at most 1e-10 m/s for each kilogram."""

_STEPPERS = {
    "engine": "its own stepper",
    "semi_implicit": "semi-implicit Euler",
    "rk4": "Runge-Kutta 4",
    "adaptive": "adaptive steps",
}
"""What an integrator is called."""


def show(out: Console, made: Entry) -> None:
    """What was simulated, a table with a line for each joint, and what is to be said of all."""
    _show_header(out, made)
    out.print(_joint_table(made))
    out.print(_worst(made))
    for what, error in (("base", made["base_error"]), (made["frame"], made["frame_error"])):
        if error is not None:
            out.print(_body_error(one_line(what), error))
    out.print(_energy(made))
    if made["law"] != "none":
        out.print(_saturation(made))
    if made["overshoot"] is not None:
        out.print(_overshoot(made))
    out.print(f"simulated {number(made['simulated'])} s in {made['seconds']:.2f} s")


def _show_header(out: Console, made: Entry) -> None:
    settings = made["settings"]
    law = "no motors" if made["law"] == "none" else made["law"]
    if made["frame"] is not None and made["motion"]["line"] is None:
        law += f" of {one_line(made['frame'])}"
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
    if made["frame"] is not None and not made["frame_given"]:
        out.print(default_frame_note(made["frame"]))
    gains = [f"{name} {spread(gain)}" for name, gain in made["gains"].items() if gain]
    if gains:
        out.print(", ".join(gains))
    differs = perturbed(made)
    if differs:
        out.print(differs)


def _motion(made: Entry) -> str:
    motion = made["motion"]
    if motion["profile"] == "hold":
        return "nothing to follow" if motion["to"] is None else "a configuration to hold"
    where = "" if motion["line"] is None else f", {one_line(made['frame'])} along a straight line"
    return f"{motion['profile']} motion of {number(motion['duration'])} s{where}"


def _joint_table(made: Entry) -> Table:
    """Errors are of positions, in the unit that the first column says."""
    joints: list[Entry] = made["joints"]
    right = ("max\nerror", "RMS\nerror", "max\nspeed", "max\ntorque", "limit", "of it")
    table = Table("joint", "unit", *right, right=right, keys=1)
    base = 6 if made["base"] == "floating" else 0
    speeds = column_text([joint["max_speed"] for joint in joints])
    torques = column_text([joint["max_torque"] for joint in joints])
    for k, (joint, speed, torque) in enumerate(zip(joints, speeds, torques, strict=True)):
        limit = joint["effort_limit"]
        table.add_row(
            one_line(joint["name"]) + " (base axes)" * (k < base),
            joint["unit"],
            error_text(joint["max_error"]),
            error_text(joint["rms_error"]),
            speed,
            torque,
            "-" if limit is None else f"{limit:.4g}",
            "-" if not limit else share_text(joint["max_torque"] / limit),
        )
    return table


def _worst(made: Entry) -> str:
    if made["motion"]["to"] is None:
        return "no error: there was nothing to follow"
    if made["max_error"] is None:
        return "no error of joints: there are none"
    units = {joint["name"]: joint["unit"] for joint in made["joints"]}
    joint = made["max_error_joint"]
    return (
        f"largest error {error_text(made['max_error'])} {units[joint]} of {one_line(joint)} at "
        f"{number(made['max_error_time'])} s, {error_text(made['final_error'])} at the end"
    )


def _body_error(what: str, error: Entry) -> str:
    """Of the base or of a frame, which have metres and radians."""
    parts = [
        f"{error_text(error[name]['max'])} {unit} at {number(error[name]['max_time'])} s, "
        f"{error_text(error[name]['final'])} at the end"
        for name, unit in (("position", "m"), ("rotation", "rad"))
    ]
    return f"error of {what}: position {parts[0]}\n{' ' * len(f'error of {what}')}  rotation {parts[1]}"


def _energy(made: Entry) -> str:
    """A ratio only where it tells how well the energy was kept: of a robot on which nothing did work."""
    kinetic = made["max_kinetic_energy"]
    if kinetic < AT_REST:
        return "nothing moved"
    largest = f"largest kinetic energy {kinetic:.3g} J"
    if made["passive"]:
        return f"energy drifted by {made['energy_drift']:.2g} times the {largest}"
    return f"energy changed by up to {made['energy_change']:.3g} J; {largest}"


def _saturation(made: Entry) -> str:
    if made["motor_limits"] is not None:
        return "PyBullet held its motors to the limits; how often is not known"
    if made["settings"]["effort_limits"] is None:
        return "torques were not cut to limits (--effort-limits urdf does)"
    return f"motors were at their limits in {100.0 * made['saturated']:.3g} % of the steps"


def _overshoot(made: Entry) -> str:
    settings, found = made["settings"], made["overshoot"]
    step = "--dt" if settings["control_dt"] == settings["dt"] else "--control-dt"
    kd = "damping" if made["law"] == "impedance" else "kd"
    return (
        f"smaller gains or a smaller {step}: {kd} {step[2:].replace('-', '_')} / inertia is "
        f"{found['ratio']:.3g} at {one_line(found['joint'])}, and above 2 a step overshoots"
    )
