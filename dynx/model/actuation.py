"""Generalised forces of the actuators that a robot description states, by the equations of MuJoCo.

With the command u of an actuator, limited to its control range, and the length l of its transmission (gear
times position of the joint, or times length of the tendon), the force is

    f = gain u + bias[0] + bias[1] l + bias[2] dl/dt

If a tendon limits the sum of the forces of its actuators, they are scaled to that limit. Then each f is
limited to the range of its actuator. The generalised force is the sum of f dl/dq, in each joint limited to
the effort of the joint. MuJoCo calls it ``qfrc_actuator``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, ShapeError, shown
from dynx.model.configuration import checked_q
from dynx.model.model import Model
from dynx.model.numbers import checked_array
from dynx.model.stated_parts import Actuator
from dynx.spatial.scalar import Array, Floats, maximum, minimum, where_less


@dataclass(frozen=True)
class Actuation:
    """The nu actuators of a robot as arrays, and the n joints on which they act."""

    gain: Floats
    bias: Floats
    """(3, nu)"""
    control_range: tuple[Floats, Floats]
    """Lower and upper ends, each (nu,)."""
    force_range: tuple[Floats, Floats]
    moments: Floats
    """Derivative (n, nu) of the lengths by the positions of the joints."""
    positions: Floats
    """Derivative (n, nq) of the positions of the joints by q. Joints that follow another one, and locked
    joints, have no coordinate of their own."""
    offsets: Floats
    """Positions (n,) at q = 0."""
    velocities: Floats
    """Derivative (n, nv) of the velocities of the joints by v."""
    efforts: Floats
    """Largest effort (n,) of each joint."""
    tendons: tuple[tuple[tuple[int, ...], tuple[float, float]], ...]
    """Indices of the actuators on each tendon that limits the sum of their forces, with that range."""

    def forces(self, ctrl: Array, q: Array, v: Array) -> Array:
        """Return the generalised force (..., nv), for any scalar."""
        lengths = (q @ self.positions.T + self.offsets) @ self.moments
        rates = (v @ self.velocities.T) @ self.moments
        constant, by_length, by_rate = self.bias
        force = (
            self.gain * _clipped(ctrl, *self.control_range) + constant + by_length * lengths + by_rate * rates
        )
        for indices, ends in self.tendons:
            columns = list(indices)
            force = _scaled(force, columns, ends)
        joints = _clipped(force, *self.force_range) @ self.moments.T
        return np.asarray(_clipped(joints, -self.efforts, self.efforts) @ self.velocities)


def _clipped(x: Array, lower: Array | float, upper: Array | float) -> Array:
    """Return x (..., n) within [lower, upper], (n,) or scalars, whose ends may be infinite."""
    if x.dtype != object:
        return np.minimum(np.maximum(x, lower), upper)

    def clip_one(element: Any, low: Any, high: Any) -> Any:
        element = element if np.isinf(low) else maximum(element, low)
        return element if np.isinf(high) else minimum(element, high)

    return np.asarray(np.frompyfunc(clip_one, 3, 1)(x, lower, upper), dtype=object)


def _has_symbols(x: object) -> bool:
    """Check whether an array, or what becomes one, has traced symbols as its entries."""
    array = np.asarray(x)
    return array.dtype == object and any(hasattr(each, "traced_operation") for each in array.flat)


def _scaled(force: Array, columns: list[int], ends: tuple[float, float]) -> Array:
    """Return forces (..., nu), of which those of `columns` are scaled so that their sum is within `ends`."""
    own = force[..., columns]
    total = own.sum(axis=-1)
    size = abs(total)
    factor = where_less(0.0, size, _clipped(total, *ends) / where_less(0.0, size, total, 1.0), 1.0)
    scaled = np.array(force)
    scaled[..., columns] = own * factor[..., None]
    return scaled


def actuation_of(model: Model) -> Actuation:
    """Return the actuators of a robot as arrays. Raises ArgumentError if its description states none."""
    actuators = model.actuators
    if actuators is None:
        raise ArgumentError(
            f"{model.name} has no actuators, since its description is not in MJCF; give torques, or motors "
            "of dynx.world"
        )
    terms = [dict(_terms(model, each)) for each in actuators]
    joints = {
        name: index for index, name in enumerate(dict.fromkeys(name for each in terms for name in each))
    }
    moments = np.zeros((len(joints), len(actuators)))
    for column, each in enumerate(terms):
        for name, moment in each.items():
            moments[joints[name], column] = moment
    positions, velocities = np.zeros((len(joints), model.nq)), np.zeros((len(joints), model.nv))
    offsets, efforts = np.zeros(len(joints)), np.full(len(joints), np.inf)
    for name, row in joints.items():
        joint = model.joint(name)
        # An effort limit of 0 is an unknown one, which MuJoCo does not have.
        efforts[row] = joint.limits.effort if joint.limits.effort > 0.0 else np.inf
        leader, multiplier = name, 1.0
        if joint.mimic is not None:
            leader, multiplier, offsets[row] = joint.mimic.joint, joint.mimic.multiplier, joint.mimic.offset
        if joint.locked_at is not None:
            offsets[row] = joint.locked_at
        elif joint.moves:
            positions[row, model.position_index(leader)] = multiplier
            velocities[row, model.coordinate_index(leader)] = multiplier
    limited = {
        each.name: each.force_range
        for each in model.tendons or ()
        if each.name and each.force_range != (-np.inf, np.inf)
    }
    return Actuation(
        np.array([each.gain for each in actuators]),
        np.array([each.bias for each in actuators]).reshape(-1, 3).T,
        _ends([each.control_range for each in actuators]),
        _ends([each.force_range for each in actuators]),
        moments,
        positions,
        offsets,
        velocities,
        efforts,
        tuple(
            (tuple(k for k, each in enumerate(actuators) if each.tendon == name), ends)
            for name, ends in limited.items()
            if any(each.tendon == name for each in actuators)
        ),
    )


def _terms(model: Model, actuator: Actuator) -> Iterator[tuple[str, float]]:
    """Yield the joints on which an actuator acts, with the derivative of its length by each position."""
    if not actuator.tendon:
        yield actuator.joint, actuator.gear
        return
    found = next((each for each in model.tendons or () if each.name == actuator.tendon), None)
    if found is None:
        raise ArgumentError(
            f"actuator {shown(actuator.name)} of {model.name} acts on the tendon {shown(actuator.tendon)}, "
            "which the model does not have"
        )
    for joint, coefficient in found.terms:
        yield joint, actuator.gear * coefficient


def _ends(ranges: list[tuple[float, float]]) -> tuple[Floats, Floats]:
    lower, upper = np.array(ranges).reshape(-1, 2).T
    return lower, upper


def _known_actuation(model: Model) -> Actuation:
    """Return the actuators of a robot as arrays, which its first call keeps as a cached property would."""
    known: Actuation | None = vars(model).get("_actuation")
    if known is None:
        known = vars(model)["_actuation"] = actuation_of(model)
    return known


def actuator_forces(model: Model, ctrl: ArrayLike, q: ArrayLike, v: ArrayLike) -> Floats:
    """Return the generalised force of the actuators; see `Model.actuator_forces`."""
    actuation = _known_actuation(model)
    if isinstance(q, str) or not any(map(_has_symbols, (ctrl, q, v))):
        controls = _checked_controls(model, ctrl, len(actuation.gain))
        return actuation.forces(controls, checked_q(model, q), checked_array("v", v, model.nv))
    sizes = {"ctrl": len(actuation.gain), "q": model.nq, "v": model.nv}
    arrays = [np.asarray(each) for each in (ctrl, q, v)]
    for (name, size), array in zip(sizes.items(), arrays, strict=True):
        if array.ndim == 0 or array.shape[-1] != size:
            raise ShapeError(f"{name} has shape {array.shape}; wanted (..., {size})")
    kind = next(type(each) for each in (ctrl, q, v) if _has_symbols(each))
    forces = actuation.forces(*arrays)
    return forces.view(kind) if issubclass(kind, np.ndarray) else forces


def _checked_controls(model: Model, ctrl: ArrayLike, count: int) -> Floats:
    try:
        return checked_array("ctrl", ctrl, count)
    except ShapeError as error:
        actuators = ", ".join(shown(each.name) for each in (model.actuators or ())[:8]) + ", ..." * (
            count > 8
        )
        left = [
            str(each)
            for each in model.notes
            if each.message.startswith("not read") and "<actuator>" in each.message
        ]
        raise ShapeError(
            f"{error}: one number for each of model.actuators ({actuators})"
            f"{'; the file has others, which dynx does not compute: ' if left else ''}{'; '.join(left)}"
        ) from None
