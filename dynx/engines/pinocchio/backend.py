"""The backend `pinocchio`: every quantity by Pinocchio's own algorithms (Carpentier et al., 2019).

The engine's model is built from the links and joints of the `Model`, so Pinocchio merges fixed joints and
inertias, independently of `dynx.model.mechanism`. Coordinates need no conversion: Pinocchio's free-flyer and
spherical joint have the conventions of dynx, and tree coordinates are added in the same depth-first order.

Several threads may use it: each has its own workspace of the engine (`Data`), made on its first call. A
`Data` takes 64 nv^3 bytes (measured, Pinocchio 4.1: 0.5 GB at 200 degrees of freedom), hence `MAX_NV`.

Every array that the binding returns is a copy which the caller owns (a test proves it). Its mass matrix is
symmetric, because the binding fills the triangle that CRBA does not compute.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, partial
from threading import local
from typing import Any, ClassVar

import numpy as np

from dynx.backends.base import Backend
from dynx.backends.engine_errors import engine_errors
from dynx.backends.straight import BindingCall
from dynx.engines.pinocchio.engine_model import (
    WORLD,
    LinkForces,
    LinkRegressor,
    engine_model,
    error_message,
    refuse_large,
)
from dynx.engines.pinocchio.library import pin
from dynx.model import Model
from dynx.rbd.jacobians import Reference
from dynx.spatial.scalar import Floats

_FUNCTIONS: dict[str, Callable[..., Floats]] = {
    "inverse_dynamics": pin.rnea,
    "forward_dynamics": pin.aba,
    "bias_torque": pin.nonLinearEffects,
    "gravity_torque": pin.computeGeneralizedGravity,
}
"""Functions of the binding that take arrays and return one array, by quantity."""


_AXES: dict[str, Any] = {
    "local_world_aligned": pin.LOCAL_WORLD_ALIGNED,
    "local": pin.LOCAL,
    "world": pin.WORLD,
}
"""The binding's name of each reference."""


# d(J v)/dt is the classical acceleration if the origin moves with the frame and the axes do not rotate, and
# the spatial acceleration in the other two references.
_ACCELERATION: dict[str, tuple[Callable[..., Any], Any]] = {
    "local_world_aligned": (pin.getFrameClassicalAcceleration, pin.LOCAL_WORLD_ALIGNED),
    "local": (pin.getFrameAcceleration, pin.LOCAL),
    "world": (pin.getFrameAcceleration, pin.WORLD),
}
"""Function of the binding that returns the acceleration of a frame, and its axes, by reference."""


class _Workspace(local):
    """The engine's `Data`, for one thread."""

    def __init__(self, engine: Any) -> None:
        self.data = engine.createData()


@engine_errors(error_message)
class PinocchioBackend(Backend):
    """Pinocchio behind the interface of `Backend`.

    A batch is a Python loop over the engine's calls. For batches the backend ``compiled`` gives the same
    numbers, to rounding, about 80 times as fast: inverse dynamics of UR5, one thread, to one significant
    figure (``dynx bench ur5 --batch 65536 --threads 1``, which measures the other quantities too).
    """

    name: ClassVar[str] = "pinocchio"
    takes_ball_joints: ClassVar[bool] = True

    def __init__(self, model: Model, *, validate: bool = True) -> None:
        """Raises EngineLimitError for a model that the engine cannot represent or that is too large."""
        refuse_large(model)
        super().__init__(model, validate=validate)
        self._engine, self._frame_ids = engine_model(model)
        self._workspace = _Workspace(self._engine)
        # With one degree of freedom the binding returns Jacobians as vectors; with none, its derivative of a
        # Jacobian ends the process.
        self._nv = self._mechanism.nv
        # The engine's whole-body quantities do not include bodies that cannot move.
        at_rest = self._engine.inertias[WORLD]
        self._rest_mass = float(at_rest.mass)
        rest_moment = self._rest_mass * np.array(at_rest.lever)
        moving_mass = float(sum(inertia.mass for inertia in self._engine.inertias[1:]))
        total_mass = moving_mass + self._rest_mass
        self._has_center = bool(moving_mass and total_mass)
        if self._has_center:
            self._moving_share, self._rest_share = moving_mass / total_mass, self._rest_mass / total_mass
            self._rest_shift: Floats = rest_moment / total_mass
        self._rest_energy = -float(np.dot(model.gravity, rest_moment))

    @property
    def engine_version(self) -> str:
        """``pinocchio`` and the version of the library."""
        return f"pinocchio {pin.__version__}"

    @cached_property
    def _link_regressor(self) -> LinkRegressor:
        """Map to the regressor of links, made when one is first needed, because that takes as long as the
        constructor."""
        return LinkRegressor(self._engine, self._frame_ids[: len(self.model.links)])

    def _release(self) -> None:
        # Calls in progress in other threads keep their own reference until they return.
        del self._workspace, self._engine

    # -- kinematics ---------------------------------------------------------------------------

    def _frame_placements(self, q: Floats) -> Floats:
        data = self._workspace.data
        pin.framesForwardKinematics(self._engine, data, q)
        placements = data.oMf
        return np.array([placements[frame].homogeneous for frame in self._frame_ids])

    def _frame_placement(self, q: Floats, frame: int) -> Floats:
        data = self._workspace.data
        pin.forwardKinematics(self._engine, data, q)
        T: Floats = pin.updateFramePlacement(self._engine, data, self._frame_ids[frame]).homogeneous
        return T

    def _jacobian(self, q: Floats, frame: int, reference: Reference) -> Floats:
        J: Floats = pin.computeFrameJacobian(
            self._engine, self._workspace.data, q, self._frame_ids[frame], _AXES[reference]
        )
        return J if self._nv > 1 else J.reshape(6, self._nv)

    def _jacobian_derivative(self, q: Floats, v: Floats, frame: int, reference: Reference) -> Floats:
        if not self._nv:
            return np.zeros((6, 0))
        dJ: Floats = pin.frameJacobianTimeVariation(
            self._engine, self._workspace.data, q, v, self._frame_ids[frame], _AXES[reference]
        )
        return dJ if self._nv > 1 else dJ.reshape(6, self._nv)

    def _frame_velocity(self, q: Floats, v: Floats, frame: int, reference: Reference) -> Floats:
        return self._velocity_function(frame, reference)(self, q, v)

    def _frame_acceleration(
        self, q: Floats, v: Floats, a: Floats, frame: int, reference: Reference
    ) -> Floats:
        return self._acceleration_function(frame, reference)(self, q, v, a)

    def _velocity_function(self, frame: int, reference: Reference) -> Callable[..., Floats]:
        """Return the function of this backend, q and v that computes the velocity of a frame."""
        number, axes = self._frame_ids[frame], _AXES[reference]
        kinematics, read = pin.forwardKinematics, pin.getFrameVelocity

        def velocity(backend: PinocchioBackend, q: Floats, v: Floats) -> Floats:
            engine, data = backend._engine, backend._workspace.data
            kinematics(engine, data, q, v)
            found: Floats = read(engine, data, number, axes).vector
            return found

        return velocity

    def _acceleration_function(self, frame: int, reference: Reference) -> Callable[..., Floats]:
        """Return the function of this backend, q, v and a that computes the acceleration of a frame."""
        number, (read, axes) = self._frame_ids[frame], _ACCELERATION[reference]
        kinematics = pin.forwardKinematics

        def acceleration(backend: PinocchioBackend, q: Floats, v: Floats, a: Floats) -> Floats:
            engine, data = backend._engine, backend._workspace.data
            kinematics(engine, data, q, v, a)
            found: Floats = read(engine, data, number, axes).vector
            return found

        return acceleration

    def _sample_hook(self, hook: str, arguments: int, details: tuple[Any, ...]) -> Callable[..., Any]:
        """Return the functions of velocities and accelerations of frames without the hooks around them."""
        prepared = _PREPARED.get(hook)
        if prepared is None or getattr(type(self), hook) is not getattr(PinocchioBackend, hook):
            return super()._sample_hook(hook, arguments, details)
        return prepared(self, *details)

    # -- dynamics -----------------------------------------------------------------------------

    def _binding_call(self, hook: str) -> BindingCall | None:
        # The hook of a subclass may do more.
        if getattr(type(self), hook) is not _HOOKS.get(hook):
            return None
        return BindingCall(_FUNCTIONS[hook.removeprefix("_")], self._engine, self._workspace)

    def _unchecked_callable(self, quantity: str) -> Callable[..., Floats] | None:
        """Return the binding's function itself, with the `Data` of the calling thread."""
        function = _FUNCTIONS.get(quantity)
        if function is None or self._mechanism.coupling is not None:
            return None
        return partial(function, self._engine, self._workspace.data)

    def _inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        tau: Floats = pin.rnea(self._engine, self._workspace.data, q, v, a)
        return tau

    def _forward_dynamics(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        a: Floats = pin.aba(self._engine, self._workspace.data, q, v, tau)
        return a

    def _mass_matrix(self, q: Floats) -> Floats:
        M: Floats = pin.crba(self._engine, self._workspace.data, q)
        return M

    def _bias_torque(self, q: Floats, v: Floats) -> Floats:
        tau: Floats = pin.nonLinearEffects(self._engine, self._workspace.data, q, v)
        return tau

    def _gravity_torque(self, q: Floats) -> Floats:
        tau: Floats = pin.computeGeneralizedGravity(self._engine, self._workspace.data, q)
        return tau

    def _coriolis_matrix(self, q: Floats, v: Floats) -> Floats:
        C: Floats = pin.computeCoriolisMatrix(self._engine, self._workspace.data, q, v)
        return C

    def _inertial_regressor(self, q: Floats, v: Floats, a: Floats) -> Floats:
        if not self._nv:
            return np.zeros((0, 10 * len(self.model.links)))
        return self._link_regressor(
            pin.computeJointTorqueRegressor(self._engine, self._workspace.data, q, v, a)
        )

    @cached_property
    def _link_forces(self) -> LinkForces:
        return LinkForces(self._engine, self.model, self._frame_ids[: len(self.model.links)])

    def _joint_wrenches(self, q: Floats, v: Floats, a: Floats) -> Floats:
        data = self._workspace.data
        pin.rnea(self._engine, data, q, v, a)
        return self._link_forces(data, range(1, len(self.model.links)))

    def _base_wrench(self, q: Floats, v: Floats, a: Floats) -> Floats:
        data = self._workspace.data
        pin.rnea(self._engine, data, q, v, a)
        return np.asarray(self._link_forces(data, range(1))[0])

    # -- the whole body -----------------------------------------------------------------------

    def _center_of_mass(self, q: Floats) -> Floats:
        if not self._has_center:
            return self._derive("center_of_mass", q)
        center: Floats = pin.centerOfMass(self._engine, self._workspace.data, q, False)
        if self._rest_mass:
            center *= self._moving_share
            center += self._rest_shift
        return center

    def _center_of_mass_jacobian(self, q: Floats) -> Floats:
        if not self._has_center:
            return self._derive("center_of_mass_jacobian", q)
        J: Floats = pin.jacobianCenterOfMass(self._engine, self._workspace.data, q, False)
        if self._rest_mass:
            J *= self._moving_share
        return J if self._nv > 1 else J.reshape(3, self._nv)

    def _centroidal_momentum(self, q: Floats, v: Floats) -> Floats:
        if not self._has_center:
            return self._derive("centroidal_momentum", q, v)
        data = self._workspace.data
        momentum: Floats = pin.computeCentroidalMomentum(self._engine, data, q, v).vector
        if self._rest_mass:
            # The moment of the linear momentum about the common centre of mass, in plain Python because
            # NumPy takes ten times as long for such small arrays.
            c, r, share = data.com[0].tolist(), self._rest_shift.tolist(), self._rest_share
            x, y, z = share * c[0] - r[0], share * c[1] - r[1], share * c[2] - r[2]
            hx, hy, hz, kx, ky, kz = momentum.tolist()
            momentum[3:] = kx + y * hz - z * hy, ky + z * hx - x * hz, kz + x * hy - y * hx
        return momentum

    def _kinetic_energy(self, q: Floats, v: Floats) -> Floats:
        return np.asarray(pin.computeKineticEnergy(self._engine, self._workspace.data, q, v))

    def _potential_energy(self, q: Floats) -> Floats:
        moving = pin.computePotentialEnergy(self._engine, self._workspace.data, q)
        return np.asarray(moving + self._rest_energy)


_HOOKS = {f"_{quantity}": getattr(PinocchioBackend, f"_{quantity}") for quantity in _FUNCTIONS}
"""Hooks that only call a function of the binding."""


_PREPARED: dict[str, Callable[..., Callable[..., Floats]]] = {
    "_frame_velocity": PinocchioBackend._velocity_function,
    "_frame_acceleration": PinocchioBackend._acceleration_function,
}
"""Methods that prepare the function of a hook for a frame and a reference."""
