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
from dynx.model import Model
from dynx.model.elements import JointCoefficients
from dynx.option_names import checks_field_names
from dynx.rbd.joint_friction import FrictionLaw
from dynx.sim.step import with_disturbances
from dynx.spatial.scalar import Floats
from dynx.steppers.forces import ExternalForce
from dynx.steppers.implicit_joints import ImplicitJoints
from dynx.steppers.robot_step import AddLoad


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
    from dynx.steppers import stability  # most robots have none

    with backend("reference", model, validate=False) as engine:
        M = engine.mass_matrix(q) + disturbances.armature
    return [*stability.notes_on_springs(model, springs, M, h, integrator)]


def refuse_small_slip(disturbances: Disturbances, integrator: str, h: float, q: Floats) -> None:
    """Raise ArgumentError for a slip speed too small for steps of `h` [s], at configuration `q` (nq,)."""
    model, slip, dry = disturbances.model, disturbances.friction.slip, disturbances.friction.dry
    if not slip or not dry.any():
        return
    from dynx.steppers.stability import refuse_unstable_slip

    with backend("reference", model, validate=False) as engine:
        M = engine.mass_matrix(q) + disturbances.armature
    refuse_unstable_slip(model, slip, h, M[None], dry[None], integrator)
