"""Inputs of a batch that may have one row for each rollout."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.control.friction import coefficients_by_joint, refuse_text
from dynx.errors import ArgumentError, GainError
from dynx.model import Model
from dynx.model.numbers import checked_array, real_array, whole_number
from dynx.sim.scenario.options import COEFFICIENTS as COEFFICIENTS_KIND
from dynx.sim.scenario.options import OPTIONS
from dynx.sim.scenario.scenario import Scenario, ScenarioArguments
from dynx.spatial.scalar import Floats

COEFFICIENTS = tuple(name for name, each in OPTIONS.items() if each.rows and each.kind is COEFFICIENTS_KIND)
"""Coefficients of joints that may have one row for each rollout."""

PER_ROLLOUT = tuple(name for name, each in OPTIONS.items() if each.rows)
"""Fields of a scenario that may have one row for each rollout of a batch."""


def split_rows(given: ScenarioArguments) -> tuple[Scenario, dict[str, Any]]:
    """Return the scenario that all rollouts share, and the arguments with a row for each rollout, by name.

    If a scenario is given instead of a model, arguments of `PER_ROLLOUT` replace its fields.
    """
    own = {name: getattr(given, name) for name in PER_ROLLOUT}
    own = {name: value for name, value in own.items() if value is not None and value is not False}
    scenario = given.scenario(PER_ROLLOUT)
    own |= {
        name: coefficients_by_joint(scenario.model, name, own[name]) for name in COEFFICIENTS if name in own
    }
    joints = joints_of(scenario.model)
    rows = {name: value for name, value in own.items() if _has_rows(name, value, joints)}
    return replace(scenario, **{name: own[name] for name in own if name not in rows}), rows


def joints_of(model: Model) -> int:
    """Return the number of joints that have a coordinate."""
    return model.nv - (6 if model.floating else 0)


def _has_rows(name: str, value: Any, joints: int) -> bool:
    try:
        shape = np.shape(value)
    except ValueError:
        # Lists of different lengths are refused with the scenario.
        return False
    return len(shape) > 1 or (name in COEFFICIENTS and len(shape) == 1 and shape != (joints,))


def coefficient_rows(name: str, values: ArrayLike, joints: int) -> Floats:
    """Return the coefficients of each rollout (n, joints), from one number or one for each joint per rollout.
    Raises GainError for invalid coefficients."""
    refuse_text(name, values, joints)
    array = real_array(name, values)
    rows = array[:, None] if array.ndim == 1 else array
    if rows.ndim != 2 or rows.shape[1] not in (1, joints):
        raise GainError(
            f"{name} has shape {array.shape}; wanted one number, {joints} for the joints, "
            f"or for each rollout: (n,), (n, 1) or (n, {joints})"
        )
    if not np.isfinite(rows).all() or (rows < 0.0).any():
        raise GainError(f"{name} has entries that are negative or not finite")
    return np.ascontiguousarray(np.broadcast_to(rows, (len(rows), joints)))


def refuse_ambiguous(given: ScenarioArguments, joints: int, n: int) -> None:
    """Raise ArgumentError for coefficients in `given` that fit n joints as well as n rollouts."""
    for name in COEFFICIENTS:
        if n == joints > 1 and np.shape(getattr(given, name)) == (n,):
            raise ArgumentError(
                f"{name} has {n} numbers, and there are {n} joints and {n} rollouts: write it as (1, {n}) "
                f"for the joints or as ({n}, 1) for the rollouts"
            )


class RolloutRows:
    """Checks of arrays with one row for each rollout, which determine the number of rollouts."""

    def __init__(self, asked: int | None) -> None:
        self._asked = None if asked is None else whole_number("rollouts", asked, 1)
        self._by = "rollouts"

    @property
    def count(self) -> int:
        """Number of rollouts; 1 where no argument has several rows."""
        return 1 if self._asked is None else self._asked

    def of(self, name: str, values: ArrayLike, size: int, *, spread: bool = False) -> Floats:
        """Return `values` as a finite array (size,) or (n, size); with `spread`, one column holds for all."""
        array = real_array(name, values) if spread else checked_array(name, values, size)
        if spread and array.ndim and array.shape[-1] == 1:
            array = np.broadcast_to(array, (*array.shape[:-1], size))
        array = checked_array(name, array, size)
        if array.ndim > 2:
            raise ArgumentError(f"{name} has shape {array.shape}; wanted ({size},) or one such row a rollout")
        if array.ndim == 2 and len(array) != 1:
            if self._asked is not None and len(array) != self._asked:
                raise ArgumentError(f"{name} has {len(array)} rows, {self._by} says {self._asked}")
            self._asked, self._by = len(array), name
            if not len(array):
                raise ArgumentError(f"{name} has no rows: there would be no rollouts")
        return array

    def spread(self, array: Floats) -> Floats:
        """Return `array` with one row for each rollout (n, size)."""
        return np.array(np.broadcast_to(array, (self.count, array.shape[-1])))


def columns_of(name: str, values: ArrayLike) -> Floats:
    """Return an array (n,) as a column (n, 1); an array (n, size) stays as it is."""
    array = real_array(name, values)
    return array[:, None] if array.ndim == 1 else array
