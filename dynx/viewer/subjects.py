"""What can be shown, and the view of each. Views are imported when they are shown."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from dynx.errors import ArgumentError, nearest, shown
from dynx.model import Model
from dynx.model.loading import load
from dynx.viewer.drawn_robot import Look
from dynx.viewer.page import Page

if TYPE_CHECKING:
    from dynx.sim import Rollout
    from dynx.viewer.motion import Motion
    from dynx.viewer.motion_view import Series

_OPTIONS = {
    "a robot": ("q", "engine", "collisions"),
    "a motion": ("play",),
    "two rollouts": ("play", "names"),
    "a world": ("loads", "play", "steps"),
}
"""Options of the view of each kind of subject."""

_PAGE_OPTIONS = ("host", "port", "dark", "whole_meshes", "open_browser")
"""Options of `Viewer`, whatever it shows; only named in errors."""


class View(Protocol):
    """What a page shows."""

    notes: tuple[str, ...]
    """What cannot be drawn, and what is notable at the start, one sentence each."""

    @property
    def title(self) -> str:
        """Name of the subject."""

    @property
    def legend(self) -> str:
        """HTML that says which of two motions is solid; empty for one."""

    @property
    def visuals(self) -> Mapping[str, Sequence[Any]]:
        """The nodes of the visual shapes of each part."""

    @property
    def motions(self) -> tuple[Motion, ...]:
        """The motions that are shown at present; what stands still is a motion of one frame."""

    @property
    def time(self) -> float:
        """The time of these motions that is shown [s]."""

    @property
    def duration(self) -> float | None:
        """Length of the motion [s]; 0 for what stands still, None for what is not known before it happens."""

    def go_to(self, time: float) -> None:
        """Show the motion at a time from 0 to its length [s]."""


def open_subject(shown_object: object) -> object:
    """Return what is shown: a Model, a Rollout, two of them, a WorldComparison or a World.

    A Scene is opened as a World in the first engine installed, and what `dynx.load` takes is loaded. Raises
    the errors of loading, and ArgumentError for anything else.
    """
    if isinstance(shown_object, Model):
        return shown_object
    if isinstance(shown_object, str | os.PathLike | bytes):
        return load(shown_object)
    from dynx.sim import Rollout
    from dynx.world import Scene, World
    from dynx.world.comparison import WorldComparison

    if isinstance(shown_object, Rollout | World | WorldComparison):
        return shown_object
    if isinstance(shown_object, Scene):
        from dynx.steppers.registry import installed_worlds

        return World(shown_object, installed_worlds()[0])
    if isinstance(shown_object, tuple | list):
        if len(shown_object) == 2 and all(isinstance(each, Rollout) for each in shown_object):
            return tuple(shown_object)
        raise ArgumentError(f"shown is {shown(shown_object)}; wanted one object, or two rollouts")
    raise ArgumentError(
        f"shown is of type {type(shown_object).__name__}; wanted a robot, a Rollout, two of them, a "
        "WorldComparison, a World or a Scene"
    )


def is_world(opened: object) -> bool:
    """Check whether a subject is a World, without importing worlds for one that is not."""
    if isinstance(opened, Model | tuple):
        return False
    from dynx.world import World

    return isinstance(opened, World)


def check_options(opened: object, options: Mapping[str, Any]) -> None:
    """Raise ArgumentError for an option that the view of a subject does not have, or of a wrong type."""
    subject = (
        "a robot"
        if isinstance(opened, Model)
        else "two rollouts"
        if isinstance(opened, tuple)
        else "a world"
        if is_world(opened)
        else "a motion"
    )
    known = _OPTIONS[subject]
    for name, value in options.items():
        if name not in known:
            known += _PAGE_OPTIONS
            hint = "; two rollouts are compared by Viewer((a, b))" if name == "compare" else ""
            # Without a similar name `nearest` lists some, and here all are listed.
            similar = nearest(name, known)
            similar = similar if "did you mean" in similar else ""
            raise ArgumentError(
                f"no option {shown(name)} of {subject}{similar}; it has {', '.join(known)}{hint}"
            )
        if name in ("collisions", "play", "steps"):
            check_switches({name: value})
        if name == "loads" and value is not None and not callable(value):
            raise ArgumentError(f"loads is of type {type(value).__name__}; wanted a function of the world")
        if name == "names" and not (isinstance(value, tuple | list) and len(value) == 2):
            raise ArgumentError(f"names is {shown(value)}; wanted the names of two motions")


def check_switches(switches: Mapping[str, object]) -> None:
    """Raise ArgumentError for a switch, by its name, that is neither True nor False."""
    for name, value in switches.items():
        if not isinstance(value, bool):
            raise ArgumentError(f"{name} is {shown(value)}; wanted True or False")


def title_of(opened: Any) -> str:
    """Return the title of the page of a subject."""
    if isinstance(opened, Model):
        return opened.name
    if isinstance(opened, tuple):
        return "two rollouts"
    name: str = opened.scene.name if hasattr(opened, "scene") else opened.model.name
    return name


def view_of(page: Page, opened: Any, look: Look, options: dict[str, Any]) -> View:
    """Show a subject of `open_subject` on the page."""
    if isinstance(opened, Model):
        from dynx.viewer.robot_view import RobotView

        return RobotView(page, opened, look=look, **options)
    if is_world(opened):
        from dynx.viewer.world_view import WorldView

        return WorldView(page, opened, look=look, **options)
    return _motion_view(page, opened, look, options)


def _motion_view(page: Page, opened: Any, look: Look, options: dict[str, Any]) -> View:
    from dynx.sim import Rollout
    from dynx.viewer.motion import motion_of_reference, motion_of_rollout, motion_of_run
    from dynx.viewer.motion_view import MotionView

    if isinstance(opened, Rollout):
        motion, reference = motion_of_rollout(opened), motion_of_reference(opened)
        return MotionView(page, motion, reference, curves=_curves(opened), look=look, **options)
    if isinstance(opened, tuple):
        names = options.pop("names", ("first", "second"))
        first, second = (motion_of_rollout(each, name) for each, name in zip(opened, names, strict=True))
        return MotionView(page, first, second, look=look, compare=True, title=title_of(opened), **options)
    runs = opened.runs[:2]
    first, *others = (motion_of_run(opened.scene, run) for run in runs)
    notes = [
        f"{run.engine}: {note}"
        for run in runs
        for note in (*run.notes, *([] if run.error is None else [f"the motion ends early: {run.error}"]))
    ]
    options |= {"compare": bool(others), "title": title_of(opened), "notes": notes}
    return MotionView(page, first, *others, look=look, **options)


def _curves(rollout: Rollout) -> list[Series]:
    from dynx.viewer.motion_view import Series

    names = rollout.summary().coordinates
    curves = []
    if rollout.reference is not None:
        curves.append(Series("tracking error [rad or m]", rollout.t, rollout.error, names))
    if len(rollout):
        curves.append(Series("torque [N m or N]", rollout.t[:-1], rollout.tau, names))
    curves.append(Series("velocity [rad/s or m/s]", rollout.t, rollout.v, names))
    return curves
