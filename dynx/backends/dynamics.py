"""Dynamics of one robot at one sample, which a controller or a plant evaluates in each step.

Arguments are not checked: arrays must have the right shape and type, in the coordinates of the model. The
methods of `Backend` check their arguments, broadcast batch axes and expand mimic joints, which would take
half of the time in a loop of ten microseconds per step.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cached_property, partial
from typing import Any

from dynx.backends.base import Backend
from dynx.backends.hooks import untranslated
from dynx.model import Model
from dynx.model.elements import JointCoefficients
from dynx.spatial.scalar import Floats

Evaluation = Callable[..., Any]
"""Function of arrays that returns one array; quantities of a frame take its name after the arrays."""

MATRICES = ("mass_matrix", "coriolis_matrix")
"""Quantities (nv, nv); others of `QUANTITIES` are (nv,)."""
QUANTITIES = ("inverse_dynamics", "forward_dynamics", "bias_torque", "gravity_torque", *MATRICES)
FRAME_QUANTITIES = ("forward_kinematics", "jacobian", "jacobian_derivative", "frame_acceleration")


class Dynamics(ABC):
    """Quantities of a robot as callables, for arrays of floats or of symbols."""

    inverse_dynamics: Evaluation
    """tau (nv,) of q (nq,), v (nv,), a (nv,)."""
    forward_dynamics: Evaluation
    """a (nv,) of q, v, tau; not finite where the mass matrix is singular."""
    bias_torque: Evaluation
    """C v + g (nv,) of q, v."""
    gravity_torque: Evaluation
    """g (nv,) of q."""
    mass_matrix: Evaluation
    """M (nv, nv) of q."""
    coriolis_matrix: Evaluation
    """C (nv, nv) of q, v."""
    forward_kinematics: Evaluation
    """T_world_frame (4, 4) of q, frame."""
    jacobian: Evaluation
    """J (6, nv) of q, frame."""
    jacobian_derivative: Evaluation
    """dJ/dt (6, nv) of q, v, frame."""
    frame_acceleration: Evaluation
    """J a + dJ/dt v (6,) of q, v, a, frame."""
    joints: JointCoefficients | None = None
    """Damping, dry friction and armature (nv,) with which the robot moves, where it has any. The quantities
    are those of rigid bodies all the same."""

    def __init__(self, model: Model) -> None:
        self.model = model
        for quantity in QUANTITIES + FRAME_QUANTITIES:
            setattr(self, quantity, self.evaluation(quantity))

    @abstractmethod
    def evaluation(self, quantity: str) -> Evaluation:
        """Return the callable for a quantity of that name."""


class EngineDynamics(Dynamics):
    """Dynamics evaluated by a backend."""

    def __init__(self, backend: Backend) -> None:
        self.backend = backend
        super().__init__(backend.model)

    def evaluation(self, quantity: str) -> Evaluation:
        """Return the engine's hook if its coordinates are the model's, otherwise the backend's method."""
        backend = self.backend
        method: Evaluation = getattr(backend, quantity)
        if quantity in FRAME_QUANTITIES or not self._calls_hook(quantity):
            return method
        hook: Evaluation = getattr(backend, f"_{quantity}")
        # The wrapper that translates the engine's exceptions is left out, because the loop translates them
        # for the whole step.
        bare = untranslated(hook)
        return hook if bare is hook else partial(bare, backend)

    def bound_to_thread(self, quantity: str) -> Evaluation:
        """Return a callable for the calling thread alone, which some engines make faster.

        Its result may be overwritten by its next call.
        """
        backend = self.backend
        replaced = any(name in vars(backend) for name in (quantity, f"_{quantity}"))
        quick = None
        if not replaced and _defines_first(type(backend), "_unchecked_callable", (quantity, f"_{quantity}")):
            quick = backend._unchecked_callable(quantity)
        usual: Evaluation = getattr(self, quantity)
        return quick or usual

    @cached_property
    def mass_matrix_and_bias(self) -> Callable[[Floats, Floats], tuple[Floats, Floats]]:
        """M (nv, nv) and C v + g (nv,) of q, v: by the engine's hook for both, if its class has one that is
        not older than its hooks for either."""
        backend, parts = self.backend, ("mass_matrix", "bias_torque")
        if all(map(self._calls_hook, parts)) and _defines_first(
            type(backend), "_mass_matrix_and_bias", ("_inverse_dynamics", *(f"_{part}" for part in parts))
        ):
            return partial(untranslated(type(backend)._mass_matrix_and_bias), backend)
        M, bias = self.mass_matrix, self.bias_torque
        return lambda q, v: (M(q), bias(q, v))

    def content_key(self) -> tuple[Any, ...]:
        """Return the key that is equal for equal models in engines of one kind."""
        return type(self.backend), self.backend.name, self.model

    def _calls_hook(self, quantity: str) -> bool:
        """Check whether the backend's method only passes its arguments to the hook of its engine."""
        backend, hook = self.backend, f"_{quantity}"
        unchanged = _function(backend, quantity) is getattr(Backend, quantity)
        if not hasattr(type(backend), hook):
            return False
        own_hook = _function(backend, hook) is getattr(type(backend), hook)
        return unchanged and own_hook and backend.model.mechanism.coupling is None

    def __reduce__(self) -> tuple[Any, ...]:
        return EngineDynamics, (self.backend,)


def _function(backend: Backend, name: str) -> object:
    """Return the function of a method; None if an attribute of the object itself replaces it."""
    return getattr(getattr(backend, name), "__func__", None)


def _defines_first(kind: type, name: str, others: tuple[str, ...]) -> bool:
    """Check whether no class defines one of the `others` that overrides the class which defines `name`."""
    order = [vars(each) for each in kind.__mro__]
    return next(k for k, own in enumerate(order) if name in own) <= min(
        next((k for k, own in enumerate(order) if other in own), len(order)) for other in others
    )
