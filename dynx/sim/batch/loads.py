"""Friction, armature and pushes of many rollouts, on symbols.

They are those of one rollout (`dynx.sim.plants.disturbances`). Coefficients of joints may differ
from rollout to rollout; those are inputs of the kernel, all others are constants in it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dynx.backends.joint_dynamics import JointDynamicsTerms
from dynx.compiled.kernels import evaluate_quantity
from dynx.control.friction import Coefficients, JointFriction
from dynx.control.gains import checked_gain
from dynx.errors import ArgumentError, GainError
from dynx.model import Mechanism, Model
from dynx.model.configuration import real_array
from dynx.sim.clock import WHOLE, Clock
from dynx.sim.plants.disturbances import Push
from dynx.spatial.scalar import Array, Floats

WRENCH = 6
"""Size of the wrench of one push."""


@dataclass(frozen=True)
class BatchLoads:
    """Friction, armature and pushes of a plant."""

    model: Model
    losses: JointFriction
    rotors: Floats
    """Armature (nv,) [kg m^2 or kg], added to the diagonal of the mass matrix."""
    varied: Mapping[str, Floats]
    """Coefficients (n, joints) that differ from rollout to rollout, by name."""
    pushes: tuple[Push, ...]

    @classmethod
    def of(
        cls,
        model: Model,
        damping: Coefficients,
        friction: Coefficients,
        slip: float,
        armature: Coefficients,
        pushes: Sequence[Push],
    ) -> BatchLoads:
        """Raises GainError and ArgumentError as `simulate` does."""
        given = {"damping": damping, "friction": friction, "armature": armature}
        joints = model.nv - (6 if model.floating else 0)
        varied = {
            name: _rows(name, values, joints) for name, values in given.items() if _is_varied(values, joints)
        }
        # Placeholders of 1 for coefficients that are inputs of the kernel.
        plain = {name: 1.0 if name in varied else values for name, values in given.items()}
        losses = JointFriction(model, plain["damping"], plain["friction"], slip)
        rotors = _rotors(model, plain["armature"], joints)
        return cls(model, losses, rotors, varied, tuple(push.checked(model) for push in pushes))

    def ambiguous(self, n: int, asked: Mapping[str, Coefficients]) -> str | None:
        """Name of a coefficient in `asked` that fits n joints as well as n rollouts, if there is one."""
        joints = self.model.nv - (6 if self.model.floating else 0)
        if n != joints or n == 1:
            return None
        plain = (name for name, values in asked.items() if not isinstance(values, bool))
        return next((name for name in plain if np.ndim(asked[name]) == 1), None)

    def sizes(self, *, pushed: bool) -> dict[str, int]:
        """Inputs of the kernel for friction, armature and pushes, and their sizes."""
        sizes = {name: rows.shape[1] for name, rows in self.varied.items()}
        return sizes | ({"wrenches": WRENCH * len(self.pushes)} if pushed else {})

    def wrenches(self, clock: Clock) -> Floats:
        """Wrenches of the pushes in each step (n_steps, 6 of each push), zero outside their time."""
        since = clock.times()[:-1, None] - np.array([[push.start for push in self.pushes]])
        since = since + WHOLE * clock.dt
        acting = (since >= 0.0) & (since < np.array([[push.duration for push in self.pushes]]))
        strength = np.array([push.wrench for push in self.pushes], dtype=np.float64)
        return np.asarray(np.where(acting[:, :, None], strength, 0.0).reshape(clock.n_steps, -1))

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
        """The torque (nv,) of the motors, minus friction, plus that of the pushes."""
        if self.losses.present:
            damping, friction = (
                self._in_place(name, constant, given)
                for name, constant in (("damping", self.losses.damping), ("friction", self.losses.friction))
            )
            tau = tau - self.losses.lost(v, damping, friction)
        if pushed:
            for push, wrench in zip(self.pushes, given["wrenches"].reshape(-1, WRENCH), strict=True):
                details = (self.model.frame_index(push.frame), push.reference)
                tau = tau + evaluate_quantity(mechanism, "jacobian", details, q).T @ wrench
        return tau

    def rotors_of(self, given: Mapping[str, Array]) -> Array | None:
        """Armature (nv,), None without any."""
        return self._in_place("armature", self.rotors, given) if self.rotors.any() else None

    def _in_place(self, name: str, constant: Floats, given: Mapping[str, Array]) -> Array:
        """Coefficients of the rollout in the places of their placeholders, or the constants."""
        if name not in self.varied:
            return constant
        found = np.zeros(len(constant), dtype=object)
        found[np.flatnonzero(constant)] = given[name]
        return found


def _is_varied(values: Coefficients, joints: int) -> bool:
    if isinstance(values, bool):
        return False
    shape = np.shape(values)
    return len(shape) > 1 or (len(shape) == 1 and shape != (joints,))


def _rows(name: str, values: ArrayLike, joints: int) -> Floats:
    """(n, joints) of one number, or one for each joint, for every rollout."""
    array = real_array(name, values)
    rows = array[:, None] if array.ndim == 1 else array
    if rows.ndim != 2 or rows.shape[1] not in (1, joints):
        raise GainError(
            f"{name} has shape {array.shape}; wanted one number, {joints} for the joints, "
            f"or for each rollout: (n,), (n, 1) or (n, {joints})"
        )
    if not np.isfinite(rows).all() or (rows < 0.0).any():
        raise GainError(f"{name} has entries that are negative or not finite")
    return np.ascontiguousarray(np.broadcast_to(rows, (len(rows), joints)))


def _rotors(model: Model, armature: Coefficients, joints: int) -> Floats:
    """Diagonal of the armature (nv,): a joint of the tree depends on at most one coordinate."""
    if isinstance(armature, bool):
        return JointDynamicsTerms(model).rotors.diagonal().copy() if armature else np.zeros(model.nv)
    own = checked_gain("armature", armature, joints, per="one for each joint")
    return np.concatenate([np.zeros(model.nv - joints), own])


def refuse_ambiguous(loads: BatchLoads, n: int, asked: Mapping[str, Coefficients]) -> None:
    """Raise ArgumentError for coefficients that may be meant for joints or for rollouts."""
    name = loads.ambiguous(n, asked)
    if name is not None:
        raise ArgumentError(
            f"{name} has {n} numbers, and there are {n} joints and {n} rollouts: write it as (1, {n}) "
            f"for the joints or as ({n}, 1) for the rollouts"
        )
