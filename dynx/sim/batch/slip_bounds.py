"""Bound on the slip speed of smoothed dry friction (`dynx.sim.plants.slip_bound`) in every rollout."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from dynx.backends import backend
from dynx.compiled.parametric import ParametricDynamics
from dynx.sim.loop_step import ArrayDisturbances
from dynx.sim.plants.slip_bound import refuse_unstable
from dynx.spatial.scalar import Floats

BLOCK = 1024
"""Number of rollouts whose mass matrices are in memory at a time."""

SEMI_IMPLICIT = 2.0
"""Largest stable h f / (M s) of semi-implicit Euler."""


def refuse_small_slips(
    acting: ArrayDisturbances,
    parametric: ParametricDynamics | None,
    h: float,
    q: Floats,
    rows: Mapping[str, Floats],
) -> None:
    """Raise ArgumentError for a slip speed too small for steps of `h` [s] in any rollout.

    `q` (nq,) or (n, nq) is where rollouts start; `rows` are the inputs of the kernel that do not change
    during a rollout, (size,) or (n, size).
    """
    model, slip = acting.model, acting.joint_friction.slip
    if not slip or not (acting.joint_friction.present or (parametric and parametric.has_joint_dynamics)):
        return
    inputs = ("friction", "armature", "parameters")
    given = {"q": q, **{name: rows[name] for name in inputs if name in rows}}
    spread = {name: np.atleast_2d(array) for name, array in given.items()}
    n = max(map(len, spread.values()))
    with backend("reference", model, validate=False) as engine:
        for first in range(0, n, BLOCK):
            part = {name: each[first : first + BLOCK] for name, each in spread.items() if len(each) > 1}
            here = {**spread, **part}
            dry, armature = _coefficients(acting, here)
            if parametric is None:
                M = engine.mass_matrix(here["q"])
            else:
                M = parametric.mass_matrix(here["q"], here["parameters"])
                dry = dry + parametric.dry_friction(here["parameters"])
            M, dry = M + armature, np.broadcast_to(dry, (max(len(M), len(dry)), model.nv))
            refuse_unstable(model, slip, SEMI_IMPLICIT, h, M, dry, first if n > 1 else None)


def _coefficients(acting: ArrayDisturbances, rows: Mapping[str, Floats]) -> tuple[Floats, Floats]:
    """Return dry friction (n, nv) and the armature matrices (n, nv, nv) of rollouts."""
    own = acting.joint_friction
    friction, armature = (
        np.array([_in_place(constant, row) for row in rows[name]]) if name in rows else constant[None]
        for name, constant in (("friction", own.friction), ("armature", acting.armature))
    )
    dry = np.array([own.dry_for(row) for row in friction])
    return dry, armature[:, :, None] * np.eye(acting.model.nv)


def _in_place(constant: Floats, row: Floats) -> Floats:
    """Replace placeholders, which are not zero, by the coefficients of a rollout."""
    found = np.zeros(len(constant))
    found[np.flatnonzero(constant)] = row
    return found
