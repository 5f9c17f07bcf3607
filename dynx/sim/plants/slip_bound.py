"""Bound on the slip speed of smoothed dry friction, below which it oscillates from step to step.

Over a slip speed s dry friction acts near rest like a damper f / s, so that a joint obeys
v' = v (1 - h f / (M s)): above 2 every step reverses and enlarges v, until friction jumps between f and -f
from step to step.
"""

from __future__ import annotations

import numpy as np

from dynx.backends import backend
from dynx.errors import ArgumentError
from dynx.model import Model
from dynx.sim.plants.disturbances import Disturbances
from dynx.spatial.scalar import Floats

STABLE = {"rk4": 2.78, "adaptive": np.inf}
"""Largest h f / (M s) by integrator; 2 for all others."""


def refuse_small_slip(disturbances: Disturbances, integrator: str, h: float, q: Floats) -> None:
    """Raise ArgumentError for a slip speed too small for steps of `h` [s], at configuration `q` (nq,)."""
    model, slip, dry = disturbances.model, disturbances.friction.slip, disturbances.friction.dry
    if not slip or not dry.any():
        return
    with backend("reference", model, validate=False) as engine:
        M = engine.mass_matrix(q) + disturbances.armature
    refuse_unstable(model, slip, STABLE.get(integrator, 2.0), h, M[None], dry[None])


def refuse_unstable(
    model: Model, slip: float, most: float, h: float, M: Floats, dry: Floats, first: int | None = None
) -> None:
    """Raise ArgumentError where h f / (M s) is above `most` in any of n rollouts.

    `M` (n, nv, nv) are mass matrices with armature, `dry` (n, nv) is dry friction; `first` is the number of
    the first rollout, if there are several.
    """
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
    base = 6 if model.floating else 0
    _, vectors = np.linalg.eigh(scaled[row])
    joint = model.joint_names[int(np.argmax(np.abs(vectors[base:, -1])))]
    where = joint if first is None else f"{joint} in rollout {first + row}"
    raise ArgumentError(
        f"friction_slip is {slip:g}, so small that dry friction oscillates from step to step: "
        f"dt f / (M friction_slip) is {ratio:.3g} at {where}, and {most:g} is the largest stable value; give "
        f"friction_slip {1.01 * slip * ratio / most:.3g} or more, a smaller dt, or friction_slip 0, with "
        "which joints stick and slide at any dt"
    )
