"""Checks of a controller before and during a simulation, and its numbers for the record."""

from __future__ import annotations

import copy
from collections.abc import Hashable, Iterable, Mapping
from contextlib import suppress
from hashlib import sha256
from typing import Any, TypeVar

import numpy as np

from dynx.backends import Backend
from dynx.backends.dynamics import Dynamics
from dynx.control.base import Controller, chain_of
from dynx.control.content import attributes_of, entered, is_foreign
from dynx.errors import ArgumentError, shown
from dynx.model import Model
from dynx.model.numbers import whole_number
from dynx.steppers.clock import TIME_ROUNDING, Clock
from dynx.trajectory.base import Trajectory

Part = TypeVar("Part", bound=Controller[Any] | Trajectory)

MAX_DEPTH = 4
"""Depth to which objects inside the attributes of a controller are compared."""

MAX_LISTED_NUMBERS = 64
"""Size of the largest array that a record lists; it keeps a checksum of a larger one."""

_SHARED = (Model, Backend, Dynamics)
"""Classes whose objects a copy of a controller shares with it."""

_UNCHANGING = (bool, int, float, str, bytes, type(None), *_SHARED)
"""Classes whose objects have the same content as long as they are the same object."""


def check_controller(model: Model, controller: Controller[Any], clock: Clock) -> None:
    """Raise ArgumentError for a controller of another robot or one made for another control step."""
    known = getattr(controller, "model", None)
    if not isinstance(known, Model):
        raise ArgumentError(
            f"{controller.name} has no model; a controller sets self.model to the robot it is for"
        )
    if (known.joint_names, known.base) != (model.joint_names, model.base):
        raise ArgumentError(
            f"the controller is one of {shown(known)}, whose joints are not those of {shown(model)}"
        )
    made_for = controller.control_dt
    if made_for is not None and abs(made_for - clock.control_dt) > TIME_ROUNDING * clock.control_dt:
        raise ArgumentError(
            f"{controller.name} was made for control_dt = {made_for:.12g} s; it is {clock.control_dt:.12g} s"
        )
    refuse_wrong_random_size(controller)


def refuse_wrong_random_size(controller: Controller[Any]) -> None:
    """Raise ArgumentError for an invalid number of random numbers, or one that an inner controller lacks."""
    outer = whole_number(f"random_size of {controller.name}", controller.random_size, 0)
    for each in chain_of(controller):
        wanted = whole_number(f"random_size of {each.name}", each.random_size, 0)
        if wanted not in (0, outer):
            raise ArgumentError(
                f"{each.name} needs {wanted} random numbers; {controller.name}, which passes its measurement "
                f"to it, has {outer}: give {controller.name} the same random_size"
            )


def controller_numbers(controller: Controller[Any]) -> dict[str, Any]:
    """Return the public numbers and texts of a controller and of its inner one, such as gains, and the names
    of its backends, in types that JSON has; attributes of other kinds are left out."""
    found: dict[str, Any] = {}
    for name, value in sorted(attributes_of(controller).items()):
        if name.startswith("_"):
            continue
        if isinstance(value, Controller):
            with entered(controller), entered(value) as place:
                inside = {} if place is not None else controller_numbers(value)
            found[name] = {"law": value.name, **inside}
        elif isinstance(value, Backend):
            found[name] = value.name
        elif value is None or isinstance(value, bool | int | float | str):
            found[name] = value
        elif (array := _array_of_numbers(value)) is not None:
            digest = sha256(np.ascontiguousarray(array).tobytes())
            found[name] = (
                array.tolist() if array.size <= MAX_LISTED_NUMBERS else f"sha256 {digest.hexdigest()}"
            )
    return found


def _array_of_numbers(value: Any) -> np.ndarray[Any, Any] | None:
    """Return an array, list, tuple or scalar of NumPy as an array of numbers; None for anything else."""
    if isinstance(value, list | tuple):
        # Rows of unequal length are no array.
        with suppress(ValueError, OverflowError):
            value = np.array(value)
    if isinstance(value, np.ndarray | np.generic) and value.dtype.kind in "biuf":
        return np.asarray(value)
    return None


def copy_for_record(part: Part) -> Part:
    """Return a controller or a trajectory that stays as it is if the user changes `part` later.

    One of dynx, which cannot change, is returned itself. A copy shares models and backends with `part`, and
    attributes that cannot be copied, such as an open file.
    """
    inner = getattr(part, "inner", None)
    if not is_foreign(type(part)) and not isinstance(inner, Controller):
        return part
    kept_inner = copy_for_record(inner) if isinstance(inner, Controller) else inner
    if kept_inner is inner and not is_foreign(type(part)):
        return part
    try:
        twin = copy.copy(part)
        attributes = attributes_of(part)
    except TypeError:
        return part
    copied = {id(part): twin, id(inner): kept_inner}
    copied |= {id(each): each for each in attributes.values() if isinstance(each, _SHARED)}
    for name, value in attributes.items():
        # The user's classes may raise any exception.
        with suppress(Exception):
            object.__setattr__(twin, name, copy.deepcopy(value, copied))
    return twin


def is_row(state: Any) -> bool:
    """Check whether a controller's state is an array (n,) of float64, as kernels require."""
    return isinstance(state, np.ndarray) and state.dtype == np.float64 and state.ndim == 1


def defect_of_outcome(outcome: Any) -> str | None:
    """Describe what is wrong with a result of `torque` that is not a pair; return None for a pair."""
    if isinstance(outcome, tuple) and len(outcome) == 2:
        return None
    kind = f"an array of shape {outcome.shape}" if isinstance(outcome, np.ndarray) else shown(outcome)
    return f"torque must return (tau, state), with None for the state if there is none; it returned {kind}"


def defect_of_torque(tau: Any, shape: tuple[int, ...]) -> str | None:
    """Describe what is wrong with the shape of a torque; return None for `shape`."""
    return None if np.shape(tau) == shape else f"its torque has shape {np.shape(tau)}; wanted {shape}"


def defect_of_next_state(start: Any, state: Any) -> str | None:
    """Describe why compiled steps cannot pass on the `state` that `torque` returned; return None if they can.

    They keep an array of the shape of `start`, what `initial_state` returned, or no state at all.
    """
    if start is None:
        return None if state is None else "it returns a state, but its initial_state() returns None"
    if state is None:
        return "it returns None as its state, but its initial_state() returns an array"
    if np.shape(state) == start.shape:
        return None
    return f"it returns a state of shape {np.shape(state)}; that of initial_state() is {start.shape}"


class ControllerWatch:
    """Detector of changes of a controller's attributes: by its own torque, which hides its state, or by the
    caller."""

    def __init__(self, controller: Controller[Any]) -> None:
        self._before = [(each, _contents(each)) for each in chain_of(controller)]
        self._shortcuts = [
            (each, len(vars(each)), *_by_kind_of_value(contents)) for each, contents in self._before
        ]

    @classmethod
    def of(cls, controller: Controller[Any] | None) -> ControllerWatch | None:
        """Watch a controller; return None for controllers of dynx alone, which cannot change."""
        if controller is None or not any(is_foreign(type(each)) for each in chain_of(controller)):
            return None
        return cls(controller)

    @property
    def change(self) -> tuple[str, str] | None:
        """Names of the controller and of its attribute that changed since this object was made, if any."""
        if all(_is_unchanged(*each) for each in self._shortcuts):
            return None
        for each, before in self._before:
            now = _contents(each)
            for name in {**now, **before}:
                if name not in before or name not in now or before[name][1] != now[name][1]:
                    return each.name, name
        return None

    @property
    def changed(self) -> str | None:
        """Statement that the controller changed itself, if any attribute changed; read it before the caller
        can act."""
        if self.change is None:
            return None
        name, attribute = self.change
        return f"{name} changes itself (attribute {attribute}) when its torque is evaluated"


def refuse_self_changed(changed: str | None) -> None:
    """Raise ArgumentError for a controller that changed itself, which `ControllerWatch.changed` says."""
    if changed:
        raise ArgumentError(
            f"{changed}, so a rollout with it can be neither repeated nor resumed: keep what changes in the "
            "controller's state, which torque receives and returns"
        )


def _contents(controller: Controller[Any]) -> dict[str, tuple[Any, Hashable]]:
    """Return the attributes of a controller with their contents. Keeping the attributes prevents that
    Python reuses their identity."""
    return {name: (value, _content(value)) for name, value in attributes_of(controller).items()}


def _by_kind_of_value(
    contents: Mapping[str, tuple[Any, Hashable]],
) -> tuple[list[tuple[str, Any]], list[tuple[str, Hashable]]]:
    """Return the attributes whose values stay the same objects unless they change, and the contents of the
    others."""
    same = [(name, value) for name, (value, _) in contents.items() if isinstance(value, _UNCHANGING)]
    names = {name for name, _ in same}
    return same, [(name, content) for name, (_, content) in contents.items() if name not in names]


def _is_unchanged(
    controller: Controller[Any],
    count: int,
    same: Iterable[tuple[str, Any]],
    contents: Iterable[tuple[str, Hashable]],
) -> bool:
    """Return True if a controller has so many attributes, the same objects in some, and the same contents in
    the others; reading all attributes as a copy would get them takes longer than a step of the loop."""
    return (
        len(vars(controller)) == count
        and all(getattr(controller, name, None) is value for name, value in same)
        and all(_content(getattr(controller, name, None)) == kept for name, kept in contents)
    )


def _content(value: Any, depth: int = 0) -> Hashable:
    """Return the exact content of an attribute; for an object of unknown content, its identity."""
    if isinstance(value, np.ndarray) and value.dtype != object:
        return value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, float):
        return float, value.hex()
    if value is None or isinstance(value, bool | int | str | bytes):
        return type(value), value
    if depth < MAX_DEPTH and isinstance(value, list | tuple | set | frozenset):
        return type(value), tuple(_content(each, depth + 1) for each in value)
    if depth < MAX_DEPTH and isinstance(value, Mapping):
        entries = ((_content(key, depth + 1), _content(each, depth + 1)) for key, each in value.items())
        return type(value), tuple(entries)
    foreign = type(value).__module__.partition(".")[0] not in ("dynx", "builtins")
    # An inner controller is checked by itself, and an engine may change its own state.
    if depth < MAX_DEPTH and foreign and not isinstance(value, Controller | Backend | type):
        with suppress(TypeError):
            return id(value), _content(attributes_of(value), depth + 1)
    return id(value)
