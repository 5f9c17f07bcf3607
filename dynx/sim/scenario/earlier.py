"""Documents of scenarios of earlier versions, whose options had another name or default."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dynx.errors import ArgumentError
from dynx.sim.scenario.options import COEFFICIENTS, FORMER_NAMES, OPTIONS


def of_present_schema(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return the document of a scenario of the first schema with the present names of its options, and False
    for joint dynamics that it does not have."""
    former = {present: name for name, present in FORMER_NAMES.items()}
    wrong = [name for name in former if name in document]
    if wrong:
        raise ArgumentError(
            f"the document of schema {document['schema']!r} has {wrong[0]}; there it is {former[wrong[0]]}"
        )
    found = {FORMER_NAMES.get(name, name): each for name, each in document.items()}
    absent = {
        name: False for name, each in OPTIONS.items() if each.kind is COEFFICIENTS and name not in found
    }
    return {**found, **absent}


def with_joint_limits(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return the document of a scenario with the option `joint_limits`.

    It was False by default. A plant in a scene had an option of its own, by default True, and that of the
    scenario did not act.
    """
    plant = document.get("plant")
    if not isinstance(plant, Mapping) or not isinstance(plant.get("fields"), Mapping):
        return {"joint_limits": False, **document}
    inside = dict(plant["fields"])
    own = {"joint_limits": inside.pop("joint_limits")} if "joint_limits" in inside else {}
    return {"joint_limits": True, **document, "plant": {**plant, "fields": inside}, **own}
