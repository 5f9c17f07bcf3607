"""Targets of ``dynx view``: what each is, and the options that have an effect on it."""

from __future__ import annotations

import os
from collections.abc import Mapping

from dynx.errors import ArgumentError, RobotNotFoundError, nearest, shown
from dynx.model import Model
from dynx.model.library import robots, scene_names
from dynx.model.loading import load
from dynx.model.tree import Base

_SCENES = (".toml", ".json")
_ROLLOUTS = (".npz", ".mcap")
_TABLE = ".csv"

_OPTIONS = {
    "robot": ("--engine", "--base", "--q", "--collisions"),
    "rollout": ("--shapes", "--play"),
    "comparison of rollouts": ("--shapes", "--play"),
    "scene": ("--engine", "--duration", "--dt", "--play"),
}
"""Options that have an effect on each kind of target."""


def check_options(kind: str, given: Mapping[str, object]) -> None:
    """Raise ArgumentError for an option that is given (not None) and has no effect on a kind of target."""
    for option, value in given.items():
        if value is not None and option not in _OPTIONS[kind]:
            raise ArgumentError(f"{option} has no effect on a {kind}; it takes {', '.join(_OPTIONS[kind])}")


def kind_of_targets(targets: tuple[str, ...], compare: bool) -> str:
    """Return what the targets are, a key of `_OPTIONS`. Raises ArgumentError for targets that do not fit."""
    kinds = [_kind_of(target) for target in targets]
    if compare and kinds == ["rollout", "rollout"]:
        return "comparison of rollouts"
    if compare and kinds != ["scene"]:
        found = " and ".join(f"{shown(t, 300)}, a {kind}" for t, kind in zip(targets, kinds, strict=True))
        raise ArgumentError(
            f"--compare takes two rollouts (.npz or .mcap), or one scene in two engines; got {found}"
        )
    if len(targets) != 1:
        raise ArgumentError(f"{len(targets)} targets; wanted one, or two rollouts with --compare")
    return kinds[0]


def _kind_of(target: str) -> str:
    suffix = os.path.splitext(target)[1].lower()
    if suffix == _TABLE:
        raise ArgumentError(
            f"{shown(target, 300)}: a rollout is shown from .npz or .mcap, as dynx sim --save FILE.npz "
            "writes it: that has the robot and every digit"
        )
    if suffix in _ROLLOUTS:
        return "rollout"
    return "scene" if suffix in _SCENES or target in scene_names() else "robot"


def load_robot(target: str, base: Base) -> Model:
    """Load a robot; where there is none of that name, the error names a scene with a similar one."""
    try:
        return load(target, base=base)
    except RobotNotFoundError as error:
        if os.sep not in target and "." not in target:
            similar = nearest(target, [*scene_names(), *(entry.name for entry in robots())])
            raise RobotNotFoundError(f"no robot and no scene {shown(target)}{similar}") from error
        raise


def single_engine(engines: tuple[str, ...] | None) -> str | None:
    """Return the engine named, or None; ArgumentError for several."""
    if engines is not None and len(engines) != 1:
        raise ArgumentError(f"--engine names {', '.join(engines) or 'no engine'}; wanted one")
    return engines[0] if engines else None
