"""Options of `inverse_kinematics`: their names, defaults and meaning, once for all backends.

Free axes, weights and tolerances count along the axes of the target or of the world. Several frames may be
reached at once, each with options of its own.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, TypedDict, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, ShapeError, UnknownNameError, nearest, shown
from dynx.model.numbers import is_whole, real_array, whole_number
from dynx.model.targets import FREE, Targets
from dynx.option_names import right_name
from dynx.time_limit import UNLIMITED, TimeLimit

if TYPE_CHECKING:
    from dynx.distance.avoidance import AvoidanceSource


@dataclass(frozen=True)
class SearchLimits:
    """Tolerances within which a target counts as reached, and limits on the number of steps and starts
    and on the time."""

    position_tolerance: float  # [m]
    rotation_tolerance: float  # [rad]
    max_iterations: int  # of each start
    max_restarts: int
    time_limit: TimeLimit = UNLIMITED


AXIS_NAMES = ("position_x", "position_y", "position_z", "rotation_x", "rotation_y", "rotation_z")
"""Names of single axes, which `free` takes, in the order of `weights`."""

AXES = ("target", "world")
"""Axes along which free axes, weights and tolerances count."""

Six = tuple[float, float, float, float, float, float]


@dataclass(frozen=True)
class AxisRequirement:
    """Weights and tolerances of the error along six axes: position [m], then rotation vector [rad].

    An axis of weight 0 is free. If exactly one rotation is free, the error of the others is the smallest
    rotation that turns the frame's axis to that of the target: any rotation about the axis is allowed. Other
    rotation errors are the components of the rotation vector from the frame to the target.
    """

    weights: Six
    position_tolerances: tuple[float, float, float] | None
    """Bounds on the components [m]; None for a bound on their norm."""
    rotation_tolerances: tuple[float, float, float] | None
    """Bounds on the components [rad]; None for a bound on their norm."""
    of_target: bool
    """True if x, y and z are the axes of the target; False if they are those of the world."""

    @property
    def free_rotation(self) -> int | None:
        """The only axis about which rotation is free: 0, 1 or 2, or None."""
        free = [k for k in range(3) if self.weights[3 + k] == 0.0]
        return free[0] if len(free) == 1 else None

    def for_targets(self, targets: Targets) -> AxisRequirement:
        """Return the requirement for targets of which a part may be absent, which is free then.

        Raises ArgumentError if no axis remains.
        """
        present = [targets.positions is not None] * 3 + [targets.rotations is not None] * 3
        w = [weight * there for weight, there in zip(self.weights, present, strict=True)]
        if not any(w):
            raise ArgumentError("every axis of the target is free; nothing remains to be reached")
        weights: Six = (w[0], w[1], w[2], w[3], w[4], w[5])
        return AxisRequirement(
            weights,
            self.position_tolerances,
            self.rotation_tolerances,
            self.of_target and targets.rotations is not None,
        )


def checked_axes(
    free: str | Sequence[str] | None,
    weights: ArrayLike | None,
    position_tolerance: ArrayLike,
    rotation_tolerance: ArrayLike,
    axes: str,
) -> tuple[str | None, AxisRequirement | None]:
    """Return the free part of a target, and the requirement per axis if there is one.

    Raises ArgumentError, ShapeError or DTypeError for options that cannot be used, with the nearest name.
    """
    if not isinstance(axes, str) or axes not in AXES:
        raise ArgumentError(f"axes is {shown(axes)}{nearest(axes, AXES)}")
    names = _free_names(free)
    along = [
        checked_tolerance("position_tolerance", position_tolerance),
        checked_tolerance("rotation_tolerance", rotation_tolerance),
    ]
    per_axis = [bound if isinstance(bound, tuple) else None for bound in along]
    if (
        weights is None
        and per_axis == [None, None]
        and (len(names) == 0 or names in (("rotation",), ("position",)))
    ):
        return (names[0] if names else None), None
    w = [1.0] * 6 if weights is None else _checked_weights(weights)
    for part, bounds in enumerate(per_axis):
        for k, bound in enumerate(bounds or ()):
            if bound == math.inf:
                w[3 * part + k] = 0.0
    for name in names:
        if name in FREE:
            first = 0 if name == "position" else 3
            w[first : first + 3] = [0.0] * 3
        else:
            w[AXIS_NAMES.index(name)] = 0.0
    if not any(w):
        raise ArgumentError("every axis of the target is free; nothing remains to be reached")
    six: Six = (w[0], w[1], w[2], w[3], w[4], w[5])
    return None, AxisRequirement(six, per_axis[0], per_axis[1], axes == "target")


def _free_names(free: Any) -> tuple[str, ...]:
    """Return the names of what is free."""
    names: tuple[Any, ...] = ()
    if isinstance(free, str):
        names = (free,)
    elif isinstance(free, Sequence):
        names = tuple(free)
    elif free is not None:
        raise ArgumentError(
            f"free is {shown(free)}; wanted a name or several: {', '.join(FREE + AXIS_NAMES)}"
        )
    for name in names:
        if not isinstance(name, str) or name not in FREE + AXIS_NAMES:
            raise ArgumentError(f"free is {shown(name)}{nearest(name, FREE + AXIS_NAMES)}")
    return names


def checked_tolerance(name: str, tolerance: ArrayLike) -> float | tuple[float, float, float]:
    """Return a tolerance as a number, or as three numbers along the axes, of which some may be infinite."""
    if isinstance(tolerance, int | float | np.number) and not isinstance(tolerance, bool):
        if 0.0 < tolerance < math.inf:
            return float(tolerance)
    elif isinstance(tolerance, Sequence | np.ndarray) and not isinstance(tolerance, str | bytes):
        array = real_array(name, tolerance)
        if array.shape != (3,):
            raise ShapeError(f"{name} has shape {array.shape}; wanted a number, or (3,) along x, y and z")
        if (array > 0.0).all():
            x, y, z = array.tolist()
            return x, y, z
    raise ArgumentError(f"{name} is {shown(tolerance)}; wanted a positive number, or three")


def _checked_weights(weights: ArrayLike) -> list[float]:
    array = real_array("weights", weights)
    if array.shape != (6,):
        raise ShapeError(
            f"weights has shape {array.shape}; wanted (6,): position x, y, z [1/m], rotation x, y, z [1/rad]"
        )
    if not (np.isfinite(array).all() and (array >= 0.0).all()):
        raise ArgumentError(f"weights is {shown(array.tolist())}; wanted finite numbers, at least 0")
    found: list[float] = array.tolist()
    return found


F = TypeVar("F", bound=Callable[..., Any])


class IKOptions(TypedDict, total=False):
    """Keyword arguments of `inverse_kinematics`; `Options` describes them."""

    free: str | Sequence[str] | None
    point: ArrayLike | None
    weights: ArrayLike | None
    position_tolerance: ArrayLike
    rotation_tolerance: ArrayLike
    axes: str
    limit_margin: ArrayLike
    nearest: ArrayLike | None
    maximize: str | None
    avoid: AvoidanceSource | None
    max_iterations: int
    max_restarts: int
    timeout: float | None
    rng: np.random.Generator | int | None
    method: str
    all_solutions: bool
    given: Mapping[str, float] | None


@dataclass(frozen=True, eq=False)
class Options:
    """Options of `inverse_kinematics` with their defaults."""

    free: str | Sequence[str] | None = None
    """Part of the target that need not be reached: ``"rotation"`` or ``"position"``, single axes
    (``"rotation_z"``, ``"position_x"``, ...), or several of these."""
    point: ArrayLike | None = None
    """Point (3,) [m], in the axes of the frame, that reaches the target position instead of its origin."""
    weights: ArrayLike | None = None
    """Weights (6,) of the errors in position x, y, z [1/m] and rotation x, y, z [1/rad]; 0 is free. They
    decide which errors remain if not all can be zero."""
    position_tolerance: ArrayLike = 1e-6
    """Greatest distance [m]; or three bounds along x, y, z, which may be infinite."""
    rotation_tolerance: ArrayLike = 1e-6
    """Greatest angle [rad]; or three bounds on the rotation about x, y, z, which may be infinite."""
    axes: str = "target"
    """Axes to which free axes, weights and tolerances refer: those of the ``"target"`` pose or of the
    ``"world"``. For positions (..., 3) they are always those of the world."""
    limit_margin: ArrayLike = 0.0
    """Least distance from the position limits [rad or m]: one number, or one for each coordinate (nq,)."""
    nearest: ArrayLike | None = None
    """Configurations (..., nq): the search returns the solution nearest to it (root of the sum of squares
    [rad, m]), and redundant joints come as near to it as the target permits."""
    maximize: str | None = None
    """Quantity that the choice among solutions and the redundant joints maximise: ``"manipulability"``
    (square root of det J J') or ``"limit_distance"`` (minus the sum, over joints with two limits, of the
    squared distance from the middle of the range in units of half the range)."""
    avoid: AvoidanceSource | None = None
    """Obstacles: a `dynx.world.Scene`, or a `World` in its present state, with a margin of 0.01 m; or the
    result of their method `avoidance`, for other margins [m]. Links of the robot also keep away from one
    another."""
    max_iterations: int = 50
    """Largest number of steps from each start."""
    max_restarts: int = 200
    """Largest number of starts after the first."""
    timeout: float | None = None
    """Time [s] after which the search stops with the best configuration found so far (status TIMED_OUT), to
    within 10 %; None for no limit. Compiling or loading the kernels of a robot, once, does not count."""
    rng: np.random.Generator | int | None = 0
    """Seed or generator of the random starts."""
    method: str = "dynx"
    """``"dynx"``, or ``"engine"``: the backend's own solver, without restarts."""
    all_solutions: bool = False
    """Whether to return every solution, from the closed form (`dynx.ik.closed_form`)."""
    given: Mapping[str, float] | None = None
    """Positions [rad or m] of joints that the closed form takes as given."""

    @classmethod
    @checks_types
    def of(cls, options: Mapping[str, Any]) -> Options:
        """Make options from keyword arguments. Raises UnknownNameError for an unknown one."""
        for name in options:
            if name not in _NAMES:
                raise UnknownNameError(
                    f"inverse_kinematics has no option {shown(name)}{right_name(name, ('q0', *_NAMES))}"
                )
        return cls(**options)

    def search_limits(self) -> SearchLimits:
        """Return the checked limits of the search; a tolerance along axes counts by its largest bound.

        Raises ArgumentError or ShapeError.
        """
        bounds = [
            checked_tolerance("position_tolerance", self.position_tolerance),
            checked_tolerance("rotation_tolerance", self.rotation_tolerance),
        ]
        position, rotation = (max(bound) if isinstance(bound, tuple) else bound for bound in bounds)
        counts = (
            whole_number("max_iterations", self.max_iterations, 0),
            whole_number("max_restarts", self.max_restarts, 0),
        )
        return SearchLimits(position, rotation, *counts, TimeLimit(self.timeout))

    def checked_rng(self) -> np.random.Generator | int | None:
        """Return the seed or generator. Raises ArgumentError."""
        return None if self.rng is None else checked_rng(self.rng)


def checked_rng(rng: object) -> np.random.Generator | int:
    """Return a seed or generator. Raises ArgumentError."""
    if isinstance(rng, np.random.Generator):
        return rng
    if is_whole(rng) and rng >= 0:
        return int(rng)
    raise ArgumentError(f"rng is {shown(rng)}; wanted a generator or a seed (at least 0)")


_NAMES = tuple(field.name for field in fields(Options))


def spells_options(function: F) -> F:
    """Give a function with ``**options`` the signature that lists every option with its default."""
    signature = inspect.signature(function)
    own = [p for p in signature.parameters.values() if p.kind is not inspect.Parameter.VAR_KEYWORD]
    listed = [
        inspect.Parameter(
            field.name, inspect.Parameter.KEYWORD_ONLY, default=field.default, annotation=field.type
        )
        for field in fields(Options)
    ]
    described: Any = function
    described.__signature__ = signature.replace(parameters=[*own, *listed])
    return function


@dataclass(frozen=True, eq=False)
class FrameTarget:
    """Target of one frame among several that are to be reached at once.

    `target` is a pose T_world_target (..., 4, 4), a position (..., 3) [m] or a rotation (..., 3, 3), as for
    one frame. The other fields are those of `dynx.ik.options.Options`; tolerances and axes that are None take
    the values of the call.
    """

    frame: str
    target: ArrayLike
    free: str | Sequence[str] | None = None
    point: ArrayLike | None = None
    weights: ArrayLike | None = None
    position_tolerance: ArrayLike | None = None
    rotation_tolerance: ArrayLike | None = None
    axes: str | None = None

    @checks_types
    def options(self, of_call: Options) -> Options:
        """Return the options of the call, with the options of this frame in their place."""
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
        raise ArgumentError("target names no frame; wanted at least one")
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
