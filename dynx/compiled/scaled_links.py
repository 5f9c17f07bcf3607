"""Forward dynamics of a robot with scaled links and a point payload, as array code with both as inputs.

`dynx.compiled.parametric` has all ten parameters of a link as inputs; a factor on a link takes a tenth of the
operations, because the constants of the link are placed in its body before they are scaled.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from dynx.compiled.parameters import Selection, point_mass
from dynx.compiled.parametric import solve_forward_dynamics
from dynx.compiled.simplification import simplify_mechanism
from dynx.model import Mechanism, Model
from dynx.model.mechanism import ROOT
from dynx.rbd.regressor import link_inertia
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Array


class ScaledLinks:
    """A robot whose links are scaled in mass and inertia, and which carries a point mass on a frame."""

    def __init__(self, model: Model, links: Sequence[str], payload: str | None = None) -> None:
        """Raises UnknownNameError for a link or a frame, ArgumentError for a link that is named twice."""
        self._selection = Selection(model, tuple(links), None, payload, joint_dynamics=False)

    @cached_property
    def _constant(self) -> Mechanism:
        return simplify_mechanism(self._selection.remainder())

    @cached_property
    def _placed(self) -> list[tuple[int, RigidInertia]]:
        """The body of each link, and the link's inertia in it."""
        model, mechanism, placed = self._selection.model, self._constant, []
        for link in self._selection.links:
            frame = mechanism.frames[model.frame_index(link)]
            placed.append((frame.body, link_inertia(model, link).transform(frame.R, frame.p)))
        return placed

    def forward_dynamics(
        self, factors: Sequence[Any], payload: Sequence[Any], q: Array, v: Array, tau: Array
    ) -> Array:
        """Return the acceleration (nv,), for one factor of each link, and mass [kg] and place [m] (4,) of the
        payload in its frame; arrays of symbols of a trace."""
        mechanism = self._constant
        inertia = {ROOT: mechanism.root, **{k: body.inertia for k, body in enumerate(mechanism.bodies)}}
        for (body, own), factor in zip(self._placed, factors, strict=True):
            inertia[body] = inertia[body] + RigidInertia(
                own.mass * factor, own.first_moment * factor, own.rotational_inertia * factor
            )
        if self._selection.point_payload is not None:
            frame = mechanism.frames[self._selection.model.frame_index(self._selection.point_payload)]
            carried = point_mass(payload[0], np.array(payload[1:], dtype=object))
            inertia[frame.body] = inertia[frame.body] + carried.transform(frame.R, frame.p)
        bodies = tuple(replace(body, inertia=inertia[k]) for k, body in enumerate(mechanism.bodies))
        varied = replace(mechanism, root=inertia[ROOT], bodies=bodies)
        return solve_forward_dynamics(varied, None, q, v, tau)
