"""Springs, gains of motors and dry friction that are too stiff for the steps of a robot.

A spring k and a damper d that act with the state at the beginning of a step let a joint of the inertia I obey
v' = v - h (k q + d v) / I and q' = q + h v' (semi-implicit Euler). That is stable up to
h d / I + h^2 k / (2 I) = 2. Of several joints the largest eigenvalue of h^2 M^-1 K or h M^-1 D counts. What
acts at the end of a step raises the bound: the one without is given.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from dynx.errors import ArgumentError, shown
from dynx.model import Model
from dynx.model.elements import JointSprings
from dynx.spatial.scalar import Floats
from dynx.steppers.forces import JointLaw


class StabilityBounds(NamedTuple):
    """Largest stable stiffness and damping of an integrator."""

    stiffness: float
    """Bound of h^2 k / I."""
    damping: float
    """Bound of h d / I."""


SEMI_IMPLICIT = StabilityBounds(4.0, 2.0)

_BOUNDS = {"rk4": StabilityBounds(8.0, 2.78), "adaptive": StabilityBounds(np.inf, np.inf)}


def stability_bounds(integrator: str | None) -> StabilityBounds:
    """Return the bounds of an integrator of dynx; those of semi-implicit Euler for all others and for
    engines."""
    return _BOUNDS.get(integrator or "", SEMI_IMPLICIT)


def notes_on_springs(
    model: Model, springs: JointSprings, M: Floats, h: float, integrator: str | None = None, robot: str = ""
) -> Iterator[str]:
    """Yield the joint whose spring is unstable in steps of `h` [s], with the mass matrix `M` (nv, nv),
    armature included."""
    bound = stability_bounds(integrator).stiffness
    root = h * np.sqrt(np.maximum(springs.stiffness, 0.0))
    values, vectors = np.linalg.eigh(root[:, None] * np.linalg.pinv(M, hermitian=True) * root)
    ratio = float(values[-1])
    if ratio > bound:
        joint = _largest_joint(model, vectors)
        most = h * np.sqrt(bound / ratio)
        yield (
            f"the spring of {shown(robot + joint)} is stiff for steps of {h:.3g} s: k dt^2 is {ratio:.3g} "
            f"times the inertia, and without damping it is unstable above {bound:g}; wanted steps of at most "
            f"{0.99 * most:.3g} s"
        )


def notes_on_gains(
    robot: str, names: Sequence[str], law: JointLaw, implicit: Floats, mobility: Floats, h: float
) -> Iterator[str]:
    """Yield the joint whose motor at the beginning of a step of `h` [s] is unstable, all other joints being
    free to move (`mobility_of`)."""
    damping = (1.0 - implicit) * h * law.kd * mobility
    stiffness = (1.0 - implicit) * h * h * law.kp * mobility
    k = int(np.argmax(damping + 0.5 * stiffness))
    if damping[k] + 0.5 * stiffness[k] <= SEMI_IMPLICIT.damping:
        return
    if damping[k] >= 0.5 * stiffness[k]:
        gain, ratio, most = "kd dt", damping[k], SEMI_IMPLICIT.damping
    else:
        gain, ratio, most = "kp dt^2", stiffness[k], SEMI_IMPLICIT.stiffness
    yield (
        f"the gains of {shown(f'{robot}/{names[k]}')} are stiff for steps of {h:.3g} s: {gain} is "
        f"{ratio:.3g} times the inertia, and such a motor is unstable above {most:g}; use a PositionMotor, "
        "which has no such bound, smaller gains or more substeps"
    )


def mobility_of(M: Floats) -> Floats:
    """Return the acceleration of each coordinate (nv,) for a unit of its own torque."""
    return np.asarray(np.linalg.pinv(M, hermitian=True).diagonal().copy() if len(M) else np.zeros(0))


def refuse_unstable_slip(
    model: Model,
    slip: float,
    h: float,
    M: Floats,
    dry: Floats,
    integrator: str | None = None,
    first: int | None = None,
) -> None:
    """Raise ArgumentError where h f / (M s) is too large in any of n rollouts.

    Over a slip speed s dry friction acts near rest like a damper f / s, so that a joint obeys
    v' = v (1 - h f / (M s)): above 2 every step reverses and enlarges v, until friction jumps between f and
    -f from step to step.

    `M` (n, nv, nv) are mass matrices with armature, `dry` (n, nv) is dry friction; `first` is the number of
    the first rollout, if there are several.
    """
    most = stability_bounds(integrator).damping
    root = np.sqrt(dry * (h / slip))
    try:
        scaled = root[:, :, None] * np.linalg.inv(M) * root[:, None, :]
        largest = np.linalg.eigvalsh(scaled)[:, -1]
    except np.linalg.LinAlgError:
        return
    row = int(np.argmax(np.where(np.isfinite(largest), largest, -np.inf)))
    ratio = float(largest[row])
    if not ratio > most:
        return
    _, vectors = np.linalg.eigh(scaled[row])
    joint = _largest_joint(model, vectors)
    where = joint if first is None else f"{joint} in rollout {first + row}"
    raise ArgumentError(
        f"friction_slip is {slip:g}, so small that dry friction oscillates from step to step: "
        f"dt f / (M friction_slip) is {ratio:.3g} at {where}, and {most:g} is the largest stable value; give "
        f"friction_slip {1.01 * slip * ratio / most:.3g} or more, a smaller dt, or friction_slip 0, with "
        "which joints stick and slide at any dt"
    )


def _largest_joint(model: Model, vectors: Floats) -> str:
    """Return the joint that moves most in the eigenvector of the largest eigenvalue."""
    return model.coordinate_names[int(np.argmax(np.abs(vectors[6 * model.floating :, -1])))]
