"""Targets of several frames at once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, UnknownNameError, shown
from dynx.ik.options import Options
from dynx.option_names import checks_field_names


@checks_field_names
@dataclass(frozen=True, eq=False)
class FrameTarget:
    """Target of one frame among several that are to be reached at once.

    `target` is a pose T_world_target (..., 4, 4), a position (..., 3) [m] or a rotation (..., 3, 3), as for
    one frame. The other fields are those of `dynx.ik.options.Options`; tolerances and axes that are None are
    those of the call.
    """

    frame: str
    target: ArrayLike
    free: str | Sequence[str] | None = None
    point: ArrayLike | None = None
    weights: ArrayLike | None = None
    position_tolerance: ArrayLike | None = None
    rotation_tolerance: ArrayLike | None = None
    axes: str | None = None

    def options(self, of_call: Options) -> Options:
        """Return the options of the call with those of this frame."""
        own: dict[str, Any] = {"free": self.free, "point": self.point, "weights": self.weights}
        for name in ("position_tolerance", "rotation_tolerance", "axes"):
            value = getattr(self, name)
            if value is not None:
                own[name] = value
        return replace(of_call, **own)


def frame_targets(target: Any, frame: str | None, options: Options) -> list[tuple[str, ArrayLike, Options]]:
    """Return frame, target and options of every frame: of one, or of a mapping or sequence of several.

    Raises ArgumentError for several frames that are not all different, or for options of the call that each
    `FrameTarget` has itself.
    """
    found: list[tuple[str, ArrayLike, Options]]
    if isinstance(target, FrameTarget):
        target = [target]
    if isinstance(target, Mapping):
        _refuse_frame(frame)
        found = [(name, value, options) for name, value in target.items()]
    elif isinstance(target, Iterable) and not hasattr(target, "shape"):
        entries = list(target)
        if not any(isinstance(entry, FrameTarget) for entry in entries):
            found = [(_one_frame(frame), entries, options)]
            return found
        _refuse_frame(frame)
        for entry in entries:
            if not isinstance(entry, FrameTarget):
                raise ArgumentError(f"target has {shown(entry)} among FrameTarget; wanted FrameTarget only")
        for name in ("free", "point", "weights"):
            if getattr(options, name) is not None:
                raise ArgumentError(f"{name} of several frames is given in each FrameTarget")
        found = [(entry.frame, entry.target, entry.options(options)) for entry in entries]
    else:
        return [(_one_frame(frame), target, options)]
    names = [name for name, _, _ in found]
    if not names:
        raise ArgumentError("target names no frame")
    for name in names:
        if names.count(name) > 1:
            raise ArgumentError(f"target names the frame {shown(name)} twice")
    return found


def _one_frame(frame: str | None) -> str:
    if frame is None:
        raise UnknownNameError("no frame is given; name it, or give targets of frames {name: target}")
    return frame


def _refuse_frame(frame: str | None) -> None:
    if frame is not None:
        raise ArgumentError(f"frame {shown(frame)} is given in addition to targets that name their frames")
