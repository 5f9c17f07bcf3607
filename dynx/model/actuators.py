"""Actuators that a robot description states, as data."""

from __future__ import annotations

from dataclasses import dataclass, field

from dynx.model.elements import INFINITY, ZERO, Vector


@dataclass(frozen=True)
class Actuator:
    """Actuator of a joint or tendon, as a robot description states it. It acts in no simulation by itself:
    `Model.actuator_forces` computes the torques that you pass on.

    With the command u, and the position q and velocity v of the joint, the force is
    ``f = gain u + bias[0] + bias[1] gear q + bias[2] gear v``, and the effort is ``gear f`` [N m or N], as in
    MuJoCo. MuJoCo limits u to `control_range` and f to `force_range`. `name` may be empty. If the actuator
    acts on a `tendon`, `joint` is empty, and q, v and the effort are those of the tendon: length, velocity
    and tension.
    """

    name: str
    joint: str
    gear: float = 1.0
    gain: float = 1.0
    bias: Vector = ZERO
    control_range: tuple[float, float] = (-INFINITY, INFINITY)
    force_range: tuple[float, float] = (-INFINITY, INFINITY)
    line: int | None = field(default=None, compare=False)
    tendon: str = ""
