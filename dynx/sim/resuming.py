"""Comparison of a record's scenario with the scenario that shall continue it."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

from dynx.errors import ArgumentError, shown
from dynx.model import Model
from dynx.sim.plants.scene_plant import ScenePlant
from dynx.sim.record.rollout import Rollout
from dynx.sim.scenario.documents import in_words
from dynx.sim.scenario.scenario import Scenario


def require_rollout(rollout: object) -> None:
    """Raise ArgumentError for anything but a `Rollout`, such as the name of its file."""
    if not isinstance(rollout, Rollout):
        raise ArgumentError(
            f"the rollout to resume is of type {type(rollout).__name__}; wanted a dynx.Rollout, which "
            "dynx.Rollout.load reads from a file"
        )


def refuse_scene(scenario: Scenario) -> None:
    """Raise ArgumentError for a scenario in a scene, which a record does not determine."""
    if isinstance(scenario.plant, ScenePlant):
        raise ArgumentError(
            "a rollout in a scene cannot be resumed, because its record does not have the engine's contact "
            "forces: Simulation.save and restore continue exactly"
        )


def refuse_other_scenario(rollout: Rollout, scenario: Scenario) -> None:
    """Raise ArgumentError if the scenario of `rollout` differs from `scenario` in more than the duration."""
    then = rollout.scenario
    if then is None:
        raise ArgumentError("the rollout to resume has no scenario, so it cannot be compared")
    if rollout.departures:
        raise ArgumentError(
            f"the rollout to resume does not follow from its scenario alone: {'; '.join(rollout.departures)}"
        )
    if then.model != scenario.model:
        name, old, new = model_difference(then.model, scenario.model)
        raise ArgumentError(
            f"the rollout to resume is not of this model {shown(scenario.model.name)}: it had {name} {old}; "
            f"now it is {new}"
        )
    for name, old, new in then.differences(scenario):
        if name != "duration":
            raise ArgumentError(
                f"the rollout to resume had {name} {in_words(old)}; now it is {in_words(new)}"
            )


def changed_parts(theirs: Scenario, ours: Scenario) -> list[str]:
    """Return the names of the fields in which two scenarios differ, with the fields inside them; a
    controller is one field."""
    names = (each.field for each in theirs.differences(ours))
    return list(dict.fromkeys("controller" if name.startswith("controller.") else name for name in names))


def model_difference(ours: Model, theirs: Model) -> tuple[str, str, str]:
    """Return the first attribute in which two models differ, as its name and its two values."""
    for name in ("name", "base", "base_pose", "gravity", "links", "joints", "extra_frames"):
        pair = getattr(ours, name), getattr(theirs, name)
        if pair[0] != pair[1]:
            return _innermost(name, *pair)
    return "model", shown(ours), shown(theirs)


def _innermost(name: str, ours: Any, theirs: Any) -> tuple[str, str, str]:
    """Find the innermost attribute in which two values differ."""
    if is_dataclass(ours) and type(ours) is type(theirs):
        for each in fields(ours):
            pair = getattr(ours, each.name), getattr(theirs, each.name)
            if each.compare and pair[0] != pair[1]:
                return _innermost(f"{each.name} of {name}", *pair)
    if name in ("links", "joints", "extra_frames"):
        known = [[each.name for each in side] for side in (ours, theirs)]
        if known[0] != known[1]:
            mine, its = (shown(", ".join(names)) for names in known)
            return name, mine, its
        word = {"links": "link", "joints": "joint", "extra_frames": "frame"}[name]
        one, other = next(pair for pair in zip(ours, theirs, strict=True) if pair[0] != pair[1])
        return _innermost(f"{word} {shown(one.name)}", one, other)
    return name, str(ours), str(theirs)
