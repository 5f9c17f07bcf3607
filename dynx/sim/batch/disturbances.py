"""Friction, armature and pushes of many rollouts, on symbols.

They mean the same as for one rollout (`dynx.sim.plants.disturbances`). Coefficients of joints that differ
between rollouts are inputs of the kernel; all others are constants in it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dynx.compiled.kernels import evaluate_quantity
from dynx.control.friction import JointFriction
from dynx.model import Mechanism, Model
from dynx.sim.plants.disturbances import Disturbances, Push
from dynx.sim.step import with_disturbances
from dynx.spatial.scalar import Array, Floats
from dynx.steppers.clock import Clock

WRENCH = 6
"""Size of the wrench of one push."""

PLACEHOLDER = 1.0
"""Value in `Disturbances` of a coefficient that each rollout has as an input of the kernel."""


@dataclass(frozen=True)
class BatchDisturbances:
    """Friction, armature and pushes of a plant."""

    model: Model
    joint_friction: JointFriction
    armature: Floats
    """Armature (nv,) [kg m^2 or kg], added to the diagonal of the mass matrix."""
    varied: Mapping[str, int]
    """Number of joints with a coefficient that differs between rollouts, by the name of the coefficient."""
    pushes: tuple[Push, ...]

    @classmethod
    def of(cls, model: Model, disturbances: Disturbances, varied: Mapping[str, Floats]) -> BatchDisturbances:
        """Make the disturbances of a batch; `varied` has the coefficients (n, joints) for placeholders."""
        sizes = {name: rows.shape[1] for name, rows in varied.items()}
        # Each joint depends on at most one coordinate, so the armature matrix is diagonal.
        armature = disturbances.armature.diagonal().copy()
        return cls(model, disturbances.friction, armature, sizes, disturbances.pushes)

    def sizes(self, *, pushed: bool) -> dict[str, int]:
        """Return the inputs of the kernel for friction, armature and pushes, and their sizes."""
        return {**self.varied, **({"wrenches": WRENCH * len(self.pushes)} if pushed else {})}

    def wrenches(self, clock: Clock) -> Floats:
        """Return the wrenches of the pushes in each step (n_steps, 6 per push), zero for idle pushes."""
        times = clock.times()[:-1].tolist()
        shares = np.array([[push.share(t, clock.dt) for push in self.pushes] for t in times])
        strength = np.array([push.wrench for push in self.pushes], dtype=np.float64)
        return np.asarray((shares[:, :, None] * strength).reshape(clock.n_steps, -1))

    @property
    def sticks(self) -> bool:
        """True if joint friction is solved for at the end of each step."""
        return self.joint_friction.sticks

    def added_to(
        self,
        tau: Array,
        mechanism: Mechanism,
        q: Array,
        v: Array,
        given: Mapping[str, Array],
        *,
        pushed: bool,
    ) -> Array:
        """Return `tau` minus the torque of friction with a slip speed plus the torque of the pushes (nv,)."""
        friction, pushes = self.joint_friction, []
        if pushed:
            for push, wrench in zip(self.pushes, given["wrenches"].reshape(-1, WRENCH), strict=True):
                details = (self.model.frame_index(push.frame), push.reference)
                pushes.append((evaluate_quantity(mechanism, "jacobian", details, q), wrench))
        smooth = friction.torque_for(v, *self._coefficients(given)) if friction.smooth else None
        return with_disturbances(tau, smooth, pushes)

    def friction_of(self, given: Mapping[str, Array]) -> tuple[Array, Array]:
        """Return damping and dry friction (nv,) of the model's coordinates, where there is no slip speed."""
        nothing = np.zeros(self.model.nv)
        if not self.sticks:
            return nothing, nothing
        damping, friction = self._coefficients(given)
        return self.joint_friction.viscous_for(damping), self.joint_friction.dry_for(friction)

    def _coefficients(self, given: Mapping[str, Array]) -> tuple[Array, Array]:
        own = self.joint_friction
        return (
            self._in_place("damping", own.damping, given),
            self._in_place("friction", own.friction, given),
        )

    def armature_of(self, given: Mapping[str, Array]) -> Array:
        """Return the armature (nv,)."""
        return self._in_place("armature", self.armature, given)

    def _in_place(self, name: str, constant: Floats, given: Mapping[str, Array]) -> Array:
        """Replace placeholders by the coefficients of the rollout; constants stay."""
        if name not in self.varied:
            return constant
        found = np.zeros(len(constant), dtype=object)
        found[np.flatnonzero(constant)] = given[name]
        return found
