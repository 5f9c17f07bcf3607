"""Configurations, velocities and whole samples of a given model."""

from __future__ import annotations

import math
import operator
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from hypothesis import strategies as st

from dynx.errors import DTypeError, shown
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.testing.strategies.geometry import (
    SMALL_STEPS,
    Strategy,
    checked_reach,
    numbers,
    quaternions,
    vectors,
)

RIGHT_ANGLES = tuple(n * math.pi / 2 for n in (0, 1, -1, 2, -2))
MAX_ANGLE = 20.0
"""Largest angle [rad] of a joint without limits: about three turns in either direction."""


class Sample(NamedTuple):
    """One state and acceleration of a robot: q (nq,), v (nv,), a (nv,)."""

    q: Floats
    v: Floats
    a: Floats


def configurations(model: Model, *, within_limits: bool = False) -> Strategy[Floats]:
    """Draw a configuration q (nq,) of `model`. Shrinks to the neutral one.

    A coordinate is exactly 0, at or next to a quarter turn (where arms are singular) or a limit, between the
    limits or, unless `within_limits`, anywhere, because backends compute beyond limits too. A floating base
    and ball joints have any attitude, including half turns and attitudes next to them.
    """
    checked_model(model)
    if not isinstance(within_limits, bool):
        raise DTypeError(f"within_limits is {shown(within_limits)}; wanted True or False")
    if model.ball_joints:
        return _with_ball_joints(model, within_limits)
    base = 7 if model.floating else 0
    joints = [
        _coordinate(joint.type == "prismatic", float(low), float(high), within_limits)
        for joint, low, high in zip(
            model.coordinate_joints, model.lower[base:], model.upper[base:], strict=True
        )
    ]
    values = st.tuples(*joints)
    if not model.floating:
        anywhere = values.map(lambda q: np.array(q, dtype=float))
    else:
        anywhere = st.tuples(vectors(2.0), quaternions(), values).map(np.concatenate)
    if within_limits:
        return anywhere
    return st.one_of(st.just(model).map(Model.neutral), anywhere)


def _with_ball_joints(model: Model, within_limits: bool) -> Strategy[Floats]:
    parts: list[Strategy[Any]] = [vectors(2.0), quaternions()] if model.floating else []
    for joint in model.coordinate_joints:
        if joint.type == "ball":
            parts.append(quaternions())
        else:
            k = model.position_index(joint.name)
            low, high = float(model.lower[k]), float(model.upper[k])
            own = _coordinate(joint.type == "prismatic", low, high, within_limits)
            parts.append(own.map(lambda x: np.array([x])))
    anywhere = st.tuples(*parts).map(np.concatenate)
    if within_limits:
        return anywhere.map(model.clip)
    return st.one_of(st.just(model).map(Model.neutral), anywhere)


def velocities(model: Model, reach: float = 3.0) -> Strategy[Floats]:
    """Draw v (nv,) with components within `reach` [rad/s or m/s]. Shrinks to rest."""
    return _coordinates(model, reach)


def accelerations(model: Model, reach: float = 5.0) -> Strategy[Floats]:
    """Draw a (nv,), or a torque, with components within `reach`. Shrinks to zero."""
    return _coordinates(model, reach)


def samples(model: Model) -> Strategy[Sample]:
    """Draw a `Sample` (q, v, a) of `model`. Shrinks to rest at the neutral configuration."""
    return st.tuples(configurations(model), velocities(model), accelerations(model)).map(Sample._make)


def checked_model(model: Model) -> Model:
    """Return `model`; DTypeError if it is not a Model."""
    if not isinstance(model, Model):
        raise DTypeError(f"model is {shown(type(model).__name__)}; wanted a dynx Model")
    return model


def _coordinates(model: Model, reach: float) -> Strategy[Floats]:
    return _vectors_of(checked_model(model).nv, checked_reach("reach", reach))


@lru_cache(maxsize=256)
def _vectors_of(nv: int, reach: float) -> Strategy[Floats]:
    number = numbers(reach)
    anything = st.lists(number, min_size=nv, max_size=nv).map(lambda v: np.array(v, dtype=float))
    return st.one_of(st.just(nv).map(np.zeros), anything)


@lru_cache(maxsize=256)
def _coordinate(sliding: bool, low: float, high: float, within_limits: bool) -> Strategy[float]:
    reach = 1.0 if sliding else math.pi
    span = 2.0 * reach if within_limits else 2.0 * MAX_ANGLE
    bounded_low = low if math.isfinite(low) else min(high, span / 2) - span
    bounded_high = high if math.isfinite(high) else bounded_low + span
    home = min(max(0.0, bounded_low), bounded_high)
    inside = numbers(1.0).map(lambda x: _between(home, bounded_low, bounded_high, x))
    choices = [st.just(home), inside]
    inward = st.sampled_from([abs(step) for step in SMALL_STEPS])
    if math.isfinite(low):
        choices.append(inward.map(lambda step: min(low + step, bounded_high)))
    if math.isfinite(high):
        choices.append(inward.map(lambda step: max(high - step, bounded_low)))
    if not within_limits:
        near = st.builds(operator.add, st.sampled_from(RIGHT_ANGLES), st.sampled_from(SMALL_STEPS))
        choices = [st.just(0.0), near, numbers(reach), *choices]
    return st.one_of(choices)


def _between(home: float, low: float, high: float, fraction: float) -> float:
    """Interpolate from `home` (fraction 0) to `high` (1) or `low` (-1)."""
    end = high if fraction >= 0 else low
    return min(max(home + abs(fraction) * (end - home), low), high)
