"""Joint friction, springs, external forces and armature of a plant.

Every plant uses this code. External forces and springs become a torque, as a function of time and state,
which is added to that of the motors; joint friction is solved for the velocity at the end of a step
(`dynx.rbd.joint_friction`). So a push or a brake has the same effect in every engine.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from dynx.backends import Backend, backend
from dynx.backends.joint_dynamics import JointDynamicsTerms
from dynx.backends.joint_friction import Coefficients, JointFriction, armature_matrix
from dynx.errors import ArgumentError
from dynx.model import Model
from dynx.model.elements import JointCoefficients
from dynx.option_names import checks_field_names
from dynx.rbd.joint_friction import FrictionLaw
from dynx.sim.step import with_disturbances
from dynx.spatial.scalar import Floats
from dynx.steppers.forces import ExternalForce
from dynx.steppers.implicit_joints import ImplicitJoints
from dynx.steppers.robot_step import AddLoad

STABLE = {"rk4": 2.78, "adaptive": np.inf}
"""Largest h f / (M s) by integrator; 2 for all others."""


@checks_field_names(damping="joint_damping", friction="joint_friction", armature="joint_armature")
class Disturbances:
    """Friction, springs, armature and pushes that act on a plant, from the arguments of `dynx.simulate`.

    `step` is the time from one evaluation of `torque` to the next [s].
    """

    def __init__(
        self,
        model: Model,
        joint_damping: Coefficients = True,
        joint_friction: Coefficients = True,
        slip: float = 0.0,
        joint_armature: Coefficients = True,
        pushes: Sequence[ExternalForce] = (),
        step: float = 0.0,
        *,
        joint_springs: bool = True,
    ) -> None:
        """Raises GainError and ArgumentError for coefficients and pushes that `model` cannot have."""
        self.model = model
        self.friction = JointFriction.of_options(model, joint_damping, joint_friction, slip)
        self.pushes = tuple(push.checked(model) for push in pushes)
        self.armature = armature_matrix(model, joint_armature, "joint_armature")
        """Armature (nv, nv), added to the mass matrix."""
        self.has_armature = bool(self.armature.any())
        self.springs = JointDynamicsTerms(model).springs if joint_springs else None
        """Springs of the coordinates; None if none acts."""
        self._step = step

    if not TYPE_CHECKING:  # type checkers report an unknown attribute themselves

        def __getattr__(self, name: str) -> Any:
            if name == "names":
                raise AttributeError("Disturbances.names is now friction.present, pushes and has_armature")
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    @cached_property
    def sticks(self) -> bool:
        """True if joint friction is solved for at the end of each step (`JointFriction.sticks`)."""
        return self.friction.sticks

    @cached_property
    def has_torque(self) -> bool:
        """True if pushes, springs or friction with a slip speed add a torque, a function of time and
        state."""
        return self.friction.smooth or bool(self.pushes) or self.springs is not None

    def slowed(self, M: Floats, v: Floats, h: float) -> Floats:
        """Return the velocity (nv,) that joint friction leaves of `v` in a step of `h` [s].

        `v` is the velocity that the step would reach without friction, `M` (nv, nv) the mass matrix with
        armature. For plants of your own.
        """
        if not self.sticks:
            return np.asarray(v - h * np.linalg.solve(M, self.friction(v)))
        solver = self._solvers.get(h)
        if solver is None:
            friction, law = self.friction, FrictionLaw.of(self.model, self.friction.dry)
            solver = ImplicitJoints(law, friction.dry, h, damping=friction.viscous)
            self._solvers[h] = solver
        nothing = np.zeros(len(v))
        a, moves = solver.step(M, nothing, nothing, v)
        return np.asarray((v + h * a) * moves)

    @cached_property
    def _solvers(self) -> dict[float, ImplicitJoints]:
        return {}

    @property
    def joints(self) -> JointCoefficients:
        """Coefficients (nv,) that are solved for in each step: armature, and damping and dry friction without
        a slip speed. Springs are a torque (`torque`)."""
        # Each joint depends on at most one coordinate, so the armature matrix is diagonal.
        armature = self.armature.diagonal().copy()
        if not self.sticks:
            return JointCoefficients(0.0 * armature, 0.0 * armature, armature)
        return JointCoefficients(self.friction.viscous, self.friction.dry, armature)

    def load_on(self, engine: Backend) -> AddLoad | None:
        """Return the function that adds the torque of pushes and springs, and subtracts that of friction with
        a slip speed, on a robot in `engine`; None without all of them."""
        if not self.has_torque:
            return None
        return lambda tau, q, v, t: self.added_to(tau, engine, t, q, v)

    def torque(self, engine: Backend, t: float, q: Floats, v: Floats) -> Floats:
        """Return the torque (nv,) of pushes and springs in a step that began at `t`, minus that of friction
        with a slip speed."""
        return self.added_to(np.zeros(len(v)), engine, t, q, v)

    def added_to(self, tau: Floats, engine: Backend, t: float, q: Floats, v: Floats) -> Floats:
        """Return the torque `tau` (nv,) plus `torque`."""
        if self.springs is not None:
            tau = tau + self.springs.torque(q)
        shares = ((push, push.share(t, self._step)) for push in self.pushes)
        return with_disturbances(
            tau,
            self.friction(v) if self.friction.smooth else None,
            (push.at_frame(engine, push.on, q, share) for push, share in shares if share),
        )


def notes_on_springs(disturbances: Disturbances, integrator: str | None, h: float, q: Floats) -> list[str]:
    """Return one sentence for springs that are unstable in steps of `h` [s] at configuration `q` (nq,)."""
    model, springs = disturbances.model, disturbances.springs
    if springs is None:
        return []
    from dynx.steppers import stiff_springs  # most robots have none

    with backend("reference", model, validate=False) as engine:
        M = engine.mass_matrix(q) + disturbances.armature
    bound = stiff_springs.STABLE.get(integrator or "", stiff_springs.SEMI_IMPLICIT)
    return [*stiff_springs.notes_on_springs(model, springs, M, h, bound)]


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

    Over a slip speed s dry friction acts near rest like a damper f / s, so that a joint obeys
    v' = v (1 - h f / (M s)): above 2 every step reverses and enlarges v, until friction jumps between f and
    -f from step to step.

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
    joint = model.coordinate_names[int(np.argmax(np.abs(vectors[base:, -1])))]
    where = joint if first is None else f"{joint} in rollout {first + row}"
    raise ArgumentError(
        f"friction_slip is {slip:g}, so small that dry friction oscillates from step to step: "
        f"dt f / (M friction_slip) is {ratio:.3g} at {where}, and {most:g} is the largest stable value; give "
        f"friction_slip {1.01 * slip * ratio / most:.3g} or more, a smaller dt, or friction_slip 0, with "
        "which joints stick and slide at any dt"
    )
