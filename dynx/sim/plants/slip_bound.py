"""Bound on the slip speed of smoothed dry friction, below which it oscillates from step to step.

Over a slip speed s dry friction acts near rest like a damper f / s, so that a joint obeys
v' = v (1 - h f / (M s)): above 2 every step reverses and enlarges v, until friction jumps between f and -f
from step to step.
"""

from __future__ import annotations

import numpy as np

from dynx.backends import backend
from dynx.errors import ArgumentError
from dynx.sim.plants.disturbances import Disturbances
from dynx.spatial.scalar import Floats

STABLE = {"rk4": 2.78, "adaptive": np.inf}
"""Largest h f / (M s) by integrator; 2 for all others."""


def refuse_small_slip(
    disturbances: Disturbances, integrator: str, h: float, q: Floats, friction: Floats | None = None
) -> None:
    """Raise ArgumentError for a slip speed too small for steps of `h` [s], at configuration `q` (nq,).

    `friction` (joints,) replaces that of the disturbances.
    """
    model, slip = disturbances.model, disturbances.friction.slip
    base = 6 if model.floating else 0
    dry = disturbances.friction.dry if friction is None else np.concatenate([np.zeros(base), friction])
    if not slip or not dry.any():
        return
    with backend("reference", model, validate=False) as engine:
        M = engine.mass_matrix(q) + disturbances.armature
    root = np.sqrt(dry * h / slip)
    try:
        values, vectors = np.linalg.eigh(root[:, None] * np.linalg.inv(M) * root)
    except np.linalg.LinAlgError:
        return
    ratio, most = float(values[-1]), STABLE.get(integrator, 2.0)
    if not ratio > most:
        return
    joint = model.joint_names[int(np.argmax(np.abs(vectors[base:, -1])))]
    raise ArgumentError(
        f"friction_slip is {slip:g}, so small that dry friction oscillates from step to step: "
        f"dt f / (M friction_slip) is {ratio:.3g} at {joint}, and {most:g} is the largest stable value; give "
        f"friction_slip {1.01 * slip * ratio / most:.3g} or more, a smaller dt, or friction_slip 0, with "
        "which joints stick and slide at any dt"
    )
