"""Deviations of a simulation from the nominal one, as one line of text."""

from __future__ import annotations

from typing import Any

from dynx.cli.shell.exits import one_line
from dynx.cli.shell.terminal import number

Entry = dict[str, Any]

_MAX_LISTED = 3
"""Largest number of links, payloads or pushes that are named; if there are more, they are counted."""


def deviations(report: Entry) -> str:
    """Make ``plant: payload 2 kg on tool0, ...; controller: noise ..., delay ...``; empty if nominal."""
    sides = {"plant": _plant_deviations(report), "controller": _controller_deviations(report)}
    return "; ".join(f"{side}: {', '.join(parts)}" for side, parts in sides.items() if parts)


def value_range(values: float | list[float]) -> str:
    """Write one number where all are equal, else the smallest and the largest."""
    numbers = values if isinstance(values, list) else [values]
    smallest, largest = f"{min(numbers):.3g}", f"{max(numbers):.3g}"
    return smallest if smallest == largest else f"{smallest} to {largest}"


def _plant_deviations(report: Entry) -> list[str]:
    settings = report["settings"]
    payloads = [
        f"payload {number(each['mass'])} kg on {one_line(each['frame'])}" for each in report["payload"]
    ]
    parts = _listed(payloads, "payloads") + _mass_parts(report["mass_scale"])
    # A floating base has no damping, friction or armature.
    base = 6 if report["base"] == "floating" else 0
    joints = {name: settings["joints"][name][base:] for name in ("damping", "friction", "armature")}
    parts += [f"{name} {value_range(each)}" for name, each in joints.items() if any(each)]
    parts += _listed([_push(each) for each in settings["pushes"]], "pushes")
    if settings["position_limits"]:
        parts.append("stops at the position limits")
    if settings["substeps"] > 1:
        parts.append(f"{settings['substeps']} substeps")
    return parts


def _controller_deviations(report: Entry) -> list[str]:
    settings = report["settings"]
    parts = []
    noise = settings["noise"]
    if noise is not None:
        noises = [f"{value_range(noise[name])} in {name}" for name in ("q", "v") if _any(noise[name])]
        parts.append(f"noise {' and '.join(noises) or '0'}")
    if settings["delay"]:
        parts.append(f"delay {number(settings['delay'])} s")
    if settings["control_dt"] != settings["dt"]:
        parts.append(f"period {number(settings['control_dt'])} s")
    return parts


def _mass_parts(scale: float | dict[str, float]) -> list[str]:
    if not isinstance(scale, dict):
        return [] if scale == 1.0 else [f"masses times {number(scale)}"]
    named = [f"mass of {one_line(link)} times {number(x)}" for link, x in scale.items() if x != 1.0]
    return named if len(named) <= _MAX_LISTED else [f"masses times {value_range(list(scale.values()))}"]


def _push(push: Entry) -> str:
    # JSON has no infinity: None is a push until the end.
    duration = "" if push["duration"] is None else f" for {number(push['duration'])} s"
    return f"push on {one_line(push['frame'])} from {number(push['start'])} s{duration}"


def _listed(parts: list[str], plural: str) -> list[str]:
    return parts if len(parts) <= _MAX_LISTED else [f"{len(parts)} {plural}"]


def _any(values: float | list[float]) -> bool:
    return any(values) if isinstance(values, list) else values != 0.0
