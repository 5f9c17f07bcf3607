"""Calls of single poses by frame and options."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from dynx.compiled.ik.solver import FrameSolver
from dynx.ik import IKResult, Options
from dynx.ik.closed_form.single_pose import single_pose_call
from dynx.model import Model

MAX_POSE_CALLS = 16
"""Most combinations of a frame and options for which single poses have a call of their own."""

_OPTIONS = frozenset(
    ("position_tolerance", "rotation_tolerance", "max_iterations", "max_restarts", "rng", "all_solutions")
)
"""Options of which each combination has a call of its own."""


Call = Callable[[Any, Any], IKResult | None]
"""Function of a target and q0 that returns None if it does not apply to them."""


class PoseCalls:
    """Calls of single poses that were made for frames and options."""

    def __init__(self) -> None:
        self._calls: dict[object, Call] = {}

    def find(self, frame: Any, options: Mapping[str, Any]) -> Call | None:
        """Return the call for a frame and options, or None."""
        try:
            return self._calls.get(_key(frame, options) if options else frame)
        except TypeError:
            # An option that cannot be hashed.
            return None

    def store(self, frame: Any, options: Mapping[str, Any], solver: FrameSolver | None, model: Model) -> None:
        """Make the call for a frame and options that were checked, if it is for poses or all solutions."""
        if not options.keys() <= _OPTIONS:
            return
        chosen = Options.of(options)
        tolerances = (chosen.position_tolerance, chosen.rotation_tolerance)
        if not isinstance(chosen.rng, int) or not all(isinstance(bound, float | int) for bound in tolerances):
            return
        if len(self._calls) >= MAX_POSE_CALLS:
            self._calls = {}
        call: Call | None = None
        if chosen.all_solutions:
            call = single_pose_call(model, frame, chosen.search_limits())
        elif solver is not None:
            call = solver.pose_call(model, chosen.search_limits(), chosen.rng)
        if call is not None:
            self._calls[_key(frame, options) if options else frame] = call


def _key(frame: Any, options: Mapping[str, Any]) -> object:
    """Return the key of a call; a truth value equals a number, but is no seed."""
    return (frame, *options.items(), *map(type, options.values()))
