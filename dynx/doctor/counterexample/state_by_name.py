"""A state by the names of the joints, so that it fits a robot from which joints were taken."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from dynx.doctor.examine.right_answers import States
from dynx.model import Model
from dynx.spatial.scalar import Floats

Slot = tuple[str, int]
"""A part of a state: the joint, or "" for the base, and the number of the part."""

Value = tuple[float, ...]
"""One number, or the four of an attitude."""

ATTITUDE: Slot = ("", 3)
UPRIGHT: Value = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class NamedState:
    """The parts of a state that are not at rest at zero.

    A joint has the parts 0 (position), 1 (velocity) and 2 (acceleration). A floating base has its
    position in 0-2, its attitude (quaternion xyzw) in 3, its velocity in 4-9, its acceleration in 10-15.
    """

    parts: Mapping[Slot, Value]

    @classmethod
    def of(cls, model: Model, q: Floats, v: Floats, a: Floats) -> NamedState:
        """The state (q (nq,), v (nv,), a (nv,)) of `model`."""
        parts: dict[Slot, Value] = {}
        nb = 6 if model.floating else 0
        if model.floating:
            base = [*q[:3], None, *v[:6], *a[:6]]
            parts = {("", k): (float(x),) for k, x in enumerate(base) if x is not None}
            parts[ATTITUDE] = tuple(float(x) for x in q[3:7])
        for k, name in enumerate(model.joint_names):
            values = (q[k + model.nq - len(model.joint_names)], v[nb + k], a[nb + k])
            parts.update({(name, number): (float(x),) for number, x in enumerate(values)})
        return cls({slot: value for slot, value in parts.items() if value != neutral(slot)})

    def on(self, model: Model) -> tuple[Floats, Floats, Floats]:
        """(q, v, a) for `model`; what it has not is left out, what this state lacks is at rest."""
        nb = 6 if model.floating else 0
        q, v, a = model.neutral(), np.zeros(model.nv), np.zeros(model.nv)
        if model.floating:
            q[3:7] = self.parts.get(ATTITUDE, UPRIGHT)
            flat = [self.parts.get(("", k), (0.0,))[0] for k in range(16) if k != ATTITUDE[1]]
            q[:3], v[:6], a[:6] = flat[:3], flat[3:9], flat[9:]
        for k, name in enumerate(model.joint_names):
            values = [self.parts.get((name, number), (0.0,))[0] for number in range(3)]
            q[nb + k + (1 if nb else 0)], v[nb + k], a[nb + k] = values
        return q, v, a

    def within(self, model: Model) -> NamedState:
        """The parts that `model` has."""
        known = {*model.joint_names, *([""] if model.floating else [])}
        return NamedState({slot: value for slot, value in self.parts.items() if slot[0] in known})

    def having(self, changed: Mapping[Slot, Value]) -> NamedState:
        """The state with some parts changed."""
        parts = {**self.parts, **changed}
        return NamedState({slot: value for slot, value in parts.items() if value != neutral(slot)})

    @property
    def key(self) -> tuple[tuple[Slot, Value], ...]:
        """The same for equal states."""
        return tuple(sorted(self.parts.items()))


def neutral(slot: Slot) -> Value:
    """What a part is at rest at zero."""
    return UPRIGHT if slot == ATTITUDE else (0.0,)


def named_states(model: Model, states: States) -> Iterator[NamedState]:
    """Each of the states."""
    for q, v, a in zip(states.q, states.v, states.a, strict=True):
        yield NamedState.of(model, q, v, a)
