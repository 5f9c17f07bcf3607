"""What makes a simulation differ from the nominal one, in one line of ``dynx sim``."""

from __future__ import annotations

from typing import Any

from dynx.cli.shell.exits import one_line
from dynx.cli.shell.terminal import number

Entry = dict[str, Any]

_LISTED = 3
"""Links, payloads or pushes that are named; of more, how many there are."""


def perturbed(made: Entry) -> str:
    """``plant: payload 2 kg on tool0, ...; law: noise ..., delay ...``; empty for a nominal simulation."""
    sides = {"plant": _of_plant(made), "law": _of_law(made)}
    return "; ".join(f"{side}: {', '.join(said)}" for side, said in sides.items() if said)


def spread(values: float | list[float]) -> str:
    """One number where all are the same, else the least and the largest."""
    numbers = values if isinstance(values, list) else [values]
    least, largest = f"{min(numbers):.3g}", f"{max(numbers):.3g}"
    return least if least == largest else f"{least} to {largest}"


def _of_plant(made: Entry) -> list[str]:
    settings = made["settings"]
    said = _few(
        [f"payload {number(each['mass'])} kg on {one_line(each['frame'])}" for each in made["payload"]],
        "payloads",
    )
    said += _masses(made["mass_scale"])
    # Nothing of this kind acts on a floating base.
    base = 6 if made["base"] == "floating" else 0
    losses = {name: settings["joints"][name][base:] for name in ("damping", "friction", "armature")}
    said += [f"{name} {spread(each)}" for name, each in losses.items() if any(each)]
    said += _few([_push(each) for each in settings["pushes"]], "pushes")
    if settings["position_limits"]:
        said.append("stops at the limits of position")
    return said + ([f"{settings['substeps']} substeps"] if settings["substeps"] > 1 else [])


def _of_law(made: Entry) -> list[str]:
    settings = made["settings"]
    said = []
    noise = settings["noise"]
    if noise is not None:
        parts = [f"{spread(noise[name])} in {name}" for name in ("q", "v") if _any(noise[name])]
        said.append(f"noise {' and '.join(parts) or '0'}")
    if settings["delay"]:
        said.append(f"delay {number(settings['delay'])} s")
    if settings["control_dt"] != settings["dt"]:
        said.append(f"asked every {number(settings['control_dt'])} s")
    return said


def _masses(scale: float | dict[str, float]) -> list[str]:
    if not isinstance(scale, dict):
        return [] if scale == 1.0 else [f"masses times {number(scale)}"]
    named = [f"mass of {one_line(link)} times {number(x)}" for link, x in scale.items() if x != 1.0]
    return named if len(named) <= _LISTED else [f"masses times {spread(list(scale.values()))}"]


def _push(push: Entry) -> str:
    # JSON has no infinity: None is for ever.
    lasts = "" if push["duration"] is None else f" for {number(push['duration'])} s"
    return f"push on {one_line(push['frame'])} from {number(push['start'])} s{lasts}"


def _few(said: list[str], what: str) -> list[str]:
    return said if len(said) <= _LISTED else [f"{len(said)} {what}"]


def _any(values: float | list[float]) -> bool:
    return any(values) if isinstance(values, list) else values != 0.0
