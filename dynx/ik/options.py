"""Options of `inverse_kinematics`: their names, defaults and meaning, once for all backends."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, TypedDict, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, UnknownNameError, nearest, shown
from dynx.ik.axes import checked_tolerance
from dynx.ik.search import SearchLimits
from dynx.model.numbers import whole_number

if TYPE_CHECKING:
    from dynx.distance.avoidance import AvoidanceSource

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
    decide what is given up where not everything can be reached."""
    position_tolerance: ArrayLike = 1e-6
    """Greatest distance [m]; or three bounds along x, y, z, which may be infinite."""
    rotation_tolerance: ArrayLike = 1e-6
    """Greatest angle [rad]; or three bounds on the rotation about x, y, z, which may be infinite."""
    axes: str = "target"
    """Axes of free axes, weights and tolerances: those of the ``"target"`` pose, with which the frame's
    coincide when it is reached, or of the ``"world"``, as always for positions (..., 3)."""
    limit_margin: ArrayLike = 0.0
    """Least distance from the position limits [rad or m]: one number, or one for each coordinate (nq,)."""
    nearest: ArrayLike | None = None
    """Configurations (..., nq): of several solutions the one whose joints have the least distance (root of
    the sum of squares [rad, m]) is returned, and redundant joints come as near as the target permits."""
    maximize: str | None = None
    """What the choice among solutions and the redundant joints make great: ``"manipulability"`` (square root
    of det J J') or ``"limit_distance"`` (minus the sum, over joints with two limits, of the squared distance
    from the middle of the range in units of half the range)."""
    avoid: AvoidanceSource | None = None
    """What the robot is to keep away from: a `dynx.world.Scene`, or a `World` as it stands now, with a margin
    of 0.01 m; or what their method `avoidance` returns for other margins [m]. Links of the robot keep away
    from one another as well."""
    max_iterations: int = 50
    """Most steps of each start."""
    max_restarts: int = 200
    """Most starts after the first."""
    rng: np.random.Generator | int | None = 0
    """Seed or generator of the random starts."""
    method: str = "dynx"
    """``"dynx"``, or ``"engine"``: the backend's own solver, without restarts."""
    all_solutions: bool = False
    """Whether to return every solution, from the closed form (`dynx.ik.closed_form`)."""
    given: Mapping[str, float] | None = None
    """Positions [rad or m] of joints that the closed form takes as given."""

    @classmethod
    def of(cls, options: Mapping[str, Any]) -> Options:
        """Make options from keyword arguments. Raises UnknownNameError for an unknown one."""
        for name in options:
            if name not in _NAMES:
                raise UnknownNameError(
                    f"inverse_kinematics has no option {shown(name)}{nearest(name, _NAMES)}"
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
        return SearchLimits(position, rotation, *counts)

    def checked_rng(self) -> np.random.Generator | int | None:
        """Return the seed or generator. Raises ArgumentError."""
        rng = self.rng
        if rng is None or isinstance(rng, np.random.Generator):
            return rng
        if isinstance(rng, int | np.integer) and not isinstance(rng, bool) and rng >= 0:
            return int(rng)
        raise ArgumentError(f"rng is {shown(rng)}; wanted a generator, a seed (at least 0) or None")


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
