"""The backend `drake`: every quantity that Drake's `MultibodyPlant` computes, by Drake (Tedrake et al.).

The plant is made body by body from the moving bodies of the `Model` (`multibody_plant`), without Drake's file
reader. It has no geometry, actuators, damping or limits and is continuous.

Several threads may use it: the plant is never changed after it is made, and each thread has its own context,
made on its first call. Calls hold the GIL, so threads do not make it faster.

Jacobian derivatives and Coriolis matrices are derived: Drake has J v and dJ/dt v, not dJ/dt. Forward dynamics
is Drake's articulated-body algorithm. If that raises because a body's inertia is not positive definite (which
a file may state, and the mass matrix may still be regular), the acceleration is solved from the mass matrix.
"""

from __future__ import annotations

from threading import local
from typing import Any, ClassVar

import numpy as np

from dynx.backends.base import Backend
from dynx.backends.engine_errors import engine_errors
from dynx.engines.drake.build import build_plant
from dynx.engines.drake.library import (
    DRAKE_FAILURES,
    JacobianWrtVariable,
    MultibodyForces,
    drake_version,
    error_message,
)
from dynx.errors import DynxError, EngineError
from dynx.model import Model
from dynx.rbd.jacobians import Reference
from dynx.spatial.scalar import Floats

_V = JacobianWrtVariable.kV
_ORIGIN: Floats = np.zeros(3)
_AT_WORLD = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


class _Workspace(local):
    """The context and the forces of one thread."""

    def __init__(self, plant: Any) -> None:
        self.context = plant.CreateDefaultContext()
        self.forces = MultibodyForces(plant)
        self.no_forces = MultibodyForces(plant)


@engine_errors(error_message, DRAKE_FAILURES)
class DrakeBackend(Backend):
    """Drake behind the interface of `Backend`.

    A batch is a Python loop over the engine's calls. For batches the backend ``compiled`` gives the same
    numbers, to rounding, about 400 times as fast: inverse dynamics of UR5, one thread, to one significant
    figure (``dynx bench ur5 --batch 65536 --threads 1``, which measures the other quantities too).

    To open a robot of thousands of joints, Drake itself takes seconds, more than in proportion to them
    (Drake 1.51, a chain of 5,000: 13 s of 14 s are `Finalize` and the first context).
    """

    name: ClassVar[str] = "drake"

    def __init__(self, model: Model, *, validate: bool = True) -> None:
        super().__init__(model, validate=validate)
        try:
            self._built = build_plant(self._mechanism)
            self._plant = self._built.plant
            self._workspace = _Workspace(self._plant)
        except DynxError:
            raise
        except DRAKE_FAILURES as error:
            raise EngineError(f"drake cannot represent {model.name}: {error_message(error)}") from error
        self._coordinates = self._built.coordinates
        self._world = self._plant.world_frame()
        self._gravity: Floats = np.array(model.gravity)
        self._torque = self._plant.get_applied_generalized_force_input_port()
        self._acceleration = self._plant.get_generalized_acceleration_output_port()
        # Drake divides by the total mass, and refuses one that is zero or negative.
        self._has_mass = float(self._plant.CalcTotalMass(self._workspace.context)) > 0.0

    @property
    def engine_version(self) -> str:
        """``drake`` and the version of its distribution."""
        return f"drake {drake_version()}"

    def _release(self) -> None:
        # Calls in progress in other threads keep their own reference until they return.
        del self._workspace, self._torque, self._acceleration, self._world, self._plant, self._built

    # -- kinematics ---------------------------------------------------------------------------

    def _frame_placements(self, q: Floats) -> Floats:
        context, _ = self._set_positions(q)
        where = self._plant.EvalBodyPoseInWorld
        bodies = np.array([where(context, body).GetAsMatrix4() for body in self._built.bodies])
        return np.asarray(bodies[self._built.body_of_frame] @ self._built.T_body_frame)

    def _frame_placement(self, q: Floats, frame: int) -> Floats:
        context, _ = self._set_positions(q)
        T: Floats = self._built.frames[frame].CalcPoseInWorld(context).GetAsMatrix4()
        return T

    def _jacobian(self, q: Floats, frame: int, reference: Reference) -> Floats:
        context, R = self._set_positions(q)
        on_robot = self._built.frames[frame]
        axes = on_robot if reference == "local" else self._world
        point = _ORIGIN
        if reference == "world":
            point = on_robot.CalcPoseInWorld(context).inverse().translation()
        J = self._plant.CalcJacobianSpatialVelocity(context, _V, on_robot, point, self._world, axes)
        return self._coordinates.forces_back(R, _linear_first(J))

    def _frame_velocity(self, q: Floats, v: Floats, frame: int, reference: Reference) -> Floats:
        context, _ = self._set_state(q, v)
        on_robot = self._built.frames[frame]
        velocity = _linear_first(on_robot.CalcSpatialVelocityInWorld(context).get_coeffs())
        return self._convert_to_reference(velocity, on_robot, context, reference)

    def _frame_acceleration(
        self, q: Floats, v: Floats, a: Floats, frame: int, reference: Reference
    ) -> Floats:
        context, R = self._set_state(q, v)
        on_robot, world = self._built.frames[frame], self._world
        J = self._plant.CalcJacobianSpatialVelocity(context, _V, on_robot, _ORIGIN, world, world)
        bias = self._plant.CalcBiasSpatialAcceleration(context, _V, on_robot, _ORIGIN, world, world)
        wanted = self._coordinates.accelerations(R, v, a)
        # Drake returns the classical acceleration of the origin; the spatial acceleration does not include w
        # x v.
        acceleration = _linear_first(J.dot(wanted) + bias.get_coeffs())
        if reference != "local_world_aligned":
            velocity = on_robot.CalcSpatialVelocityInWorld(context)
            acceleration[:3] -= np.cross(velocity.rotational(), velocity.translational())
        return self._convert_to_reference(acceleration, on_robot, context, reference)

    def _convert_to_reference(self, motion: Floats, frame: Any, context: Any, reference: Reference) -> Floats:
        """Convert a spatial vector at the frame's origin, in world axes, to `reference`."""
        if reference == "local_world_aligned":
            return motion
        T = frame.CalcPoseInWorld(context)
        if reference == "local":
            R = T.rotation().matrix()
            return np.concatenate([motion[:3] @ R, motion[3:] @ R])
        motion[:3] += np.cross(T.translation(), motion[3:])
        return motion

    # -- dynamics -----------------------------------------------------------------------------

    def _inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        if self.model.floating:
            # Gravity is replaced by an opposite acceleration of the base; see `_upright`.
            a = a.copy()
            a[:3] -= self._gravity @ self._coordinates.attitude(q)
            context, R = self._set_state(_upright(q), v)
            wanted = self._coordinates.accelerations(R, v, a)
            tau = self._plant.CalcInverseDynamics(context, wanted, self._workspace.no_forces)
            return self._coordinates.forces_back(R, tau)
        context, R = self._set_state(q, v)
        plant, forces, coordinates = self._plant, self._workspace.forces, self._coordinates
        plant.CalcForceElementsContribution(context, forces)
        wanted = coordinates.accelerations(R, v, a)
        return coordinates.forces_back(R, plant.CalcInverseDynamics(context, wanted, forces))

    def _forward_dynamics(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        context, R = self._set_state(q, v)
        self._torque.FixValue(context, self._coordinates.forces(R, tau))
        try:
            vdot = self._acceleration.Eval(context)
        except RuntimeError:
            # The inertia that a joint moves is not positive; see the module docstring.
            return super()._forward_dynamics(q, v, tau)
        return self._coordinates.accelerations_back(R, v, vdot)

    def _mass_matrix(self, q: Floats) -> Floats:
        context, R = self._set_positions(_upright(q) if self.model.floating else q)
        if self._built.counterweighted:
            # The composite inertia of a body of parts with opposite masses cannot be divided by its mass.
            M = self._plant.CalcMassMatrixViaInverseDynamics(context)
        else:
            M = self._plant.CalcMassMatrix(context)
            if not self.model.floating:
                # Drake copies one triangle to the other.
                return self._coordinates.matrix_back(R, M)
        M = self._coordinates.matrix_back(R, M)
        return np.asarray(0.5 * (M + M.T))

    def _bias_torque(self, q: Floats, v: Floats) -> Floats:
        if self.model.floating:
            # A zero acceleration in base axes need not be zero in the world axes that Drake uses.
            return self._inverse_dynamics(q, v, np.zeros(v.shape))
        context, R = self._set_state(q, v)
        bias = self._plant.CalcBiasTerm(context) - self._plant.CalcGravityGeneralizedForces(context)
        return self._coordinates.forces_back(R, bias)

    def _gravity_torque(self, q: Floats) -> Floats:
        context, R = self._set_positions(q)
        return self._coordinates.forces_back(R, -self._plant.CalcGravityGeneralizedForces(context))

    # -- the whole body -----------------------------------------------------------------------

    def _center_of_mass(self, q: Floats) -> Floats:
        if not self._has_mass:
            return self._derive("center_of_mass", q)
        context, _ = self._set_positions(q)
        center: Floats = self._plant.CalcCenterOfMassPositionInWorld(context)
        return center

    def _center_of_mass_jacobian(self, q: Floats) -> Floats:
        if not self._has_mass:
            return self._derive("center_of_mass_jacobian", q)
        context, R = self._set_positions(q)
        J = self._plant.CalcJacobianCenterOfMassTranslationalVelocity(context, _V, self._world, self._world)
        return self._coordinates.forces_back(R, J)

    def _centroidal_momentum(self, q: Floats, v: Floats) -> Floats:
        if not self._has_mass:
            return self._derive("centroidal_momentum", q, v)
        context, _ = self._set_state(q, v)
        center = self._plant.CalcCenterOfMassPositionInWorld(context)
        momentum = self._plant.CalcSpatialMomentumInWorldAboutPoint(context, center)
        return _linear_first(momentum.get_coeffs())

    def _kinetic_energy(self, q: Floats, v: Floats) -> Floats:
        context, _ = self._set_state(q, v)
        return np.asarray(self._plant.CalcKineticEnergy(context))

    def _potential_energy(self, q: Floats) -> Floats:
        context, _ = self._set_positions(q)
        return np.asarray(self._plant.CalcPotentialEnergy(context))

    # -- the state of the engine --------------------------------------------------------------

    def _set_positions(self, q: Floats) -> tuple[Any, Floats]:
        """Set the configuration of this thread's context; return the context and the attitude of the base."""
        context = self._workspace.context
        self._plant.SetPositions(context, self._coordinates.positions(q))
        return context, self._coordinates.attitude(q)

    def _set_state(self, q: Floats, v: Floats) -> tuple[Any, Floats]:
        """Set the state of this thread's context; return the context and the attitude of the base."""
        context, R = self._set_positions(q)
        self._plant.SetVelocities(context, self._coordinates.velocities(R, v))
        return context, R


def _upright(q: Floats) -> Floats:
    """Return the configuration with the base frame at the world frame. Mass matrix and torques do not depend
    on the pose of the base.

    Drake computes in world axes. Rotating the inertia of a slender robot into them and results back would
    lose digits of its smallest moment.
    """
    q = q.copy()
    q[:7] = _AT_WORLD
    return q


def _linear_first(spatial: Floats) -> Floats:
    """Reorder Drake's (angular, linear) vector (6, ...) to linear first."""
    return np.concatenate([spatial[3:], spatial[:3]])
