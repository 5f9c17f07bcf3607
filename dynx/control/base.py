"""Controllers: functions of a measurement, a setpoint and the controller's state.

The state is an argument of `torque` and part of its result: equal arguments give equal torques, whatever was
evaluated before. So a rollout can be resumed at any step, replayed, and distributed over processes.
"""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from dynx.argument_types import checks_types
from dynx.backends import Backend, backend
from dynx.backends.dynamics import Dynamics, EngineDynamics
from dynx.control.content import attributes_of, content_of, fields_of
from dynx.errors import ArgumentError, DTypeError, ShapeError, UnsupportedFeatureError, shown
from dynx.model import Model
from dynx.model.elements import JointCoefficients
from dynx.rbd.parameters import Parameters
from dynx.registry import DEFAULT_ENGINE
from dynx.spatial.scalar import Array, Floats, sign
from dynx.trajectory.base import Setpoint

ControllerState = TypeVar("ControllerState")
Self = TypeVar("Self", bound="Controller[Any]")
Evaluation = TypeVar("Evaluation", bound="ModelEvaluation")
Copied = TypeVar("Copied")


class _TimedState(NamedTuple):
    t: float
    q: Floats
    v: Floats


class Measurement(_TimedState):
    """Configuration `q` (nq,) and velocity `v` (nv,) as measured at time `t` [s]."""

    random: Floats = np.zeros(0)
    """Independent standard normal numbers of this control step; `Controller.random_size` is their number."""

    def with_random(self, random: Floats) -> Measurement:
        """Return the measurement with these random numbers."""
        found = Measurement(*self)
        found.random = random
        return found

    def _replace(self, **changes: Any) -> Measurement:
        return Measurement(*super()._replace(**changes)).with_random(self.random)


def gain(unit: str) -> Any:
    """Return the dataclass field for a gain: an array of numbers in `unit`, which may differ between the
    rollouts of a batch."""
    return field(metadata={"unit": unit, "gain": True})


def parameter(unit: str, *, argument: str | None = None) -> Any:
    """Return the dataclass field for a number or an array of numbers in `unit` that is not a gain.

    `argument` is its name in the constructor, if that differs.
    """
    return field(metadata={"unit": unit, "argument": argument})


class Controller(ABC, Generic[ControllerState]):
    """A controller of one robot; `ControllerState` is the type of its state (None for most).

    Your own controller is a subclass with `torque`, and with `initial_state` if it has a state:

    - The best form is a frozen dataclass, which dynx compares, prints and serialises by its fields.
    - If the controller modifies the torque of another controller, its attribute `inner` is the other one.
    - If the controller evaluates the dynamics of a model, the result of `model_dynamics` is an attribute.
    - The controller must not change its own attributes.
    - Several threads may share the controller if they may share its backend.
    """

    lead: int = 0
    """Number of control steps by which the setpoint is ahead of the measurement."""

    needs_setpoint: bool = True
    """True if the controller uses its setpoint; one that does not runs without a reference."""

    control_dt: float | None = None
    """The control step that the controller was made for [s], where it matters."""

    random_size: int = 0
    """Number of random numbers in `Measurement.random`, for a controller of your own that needs some. They
    follow from the seed and the rollout of `dynx.Noise` (0 without one) and the control step."""

    model: Model
    """The robot as the controller knows it; the model of the plant may differ."""

    is_pure: bool = False
    """True if `torque` and `initial_state` are array code that depends on fields and arguments alone."""

    def __init_subclass__(cls, *, pure: bool = False, **options: Any) -> None:
        """Set `is_pure` for this class to `pure`. Subclasses do not inherit it: they may do anything."""
        super().__init_subclass__(**options)
        cls.is_pure = pure
        # `dataclass` generates its own versions of these methods unless a class defines them.
        for name in ("__eq__", "__hash__", "__repr__"):
            setattr(cls, name, getattr(cls, name))

    def initial_state(self) -> Any:
        """Return the state before the first step; None for a controller without one."""
        return None

    @abstractmethod
    def torque(
        self, measurement: Measurement, setpoint: Setpoint, state: ControllerState
    ) -> tuple[Floats, ControllerState]:
        """Return the torque tau (nv,) to apply until the next control step, and the controller state for that
        step.

        The given arrays must not be modified; returned arrays must be new or never change.
        """

    @checks_types
    def on(self: Self, engine: str | Backend) -> Self:
        """Return this controller with another backend; `self` if the controller evaluates no model."""
        changes = _with_dynamics(self, lambda own: EngineDynamics(engine_of(own.model, engine)))
        inner = getattr(self, "inner", None)
        if isinstance(inner, Controller):
            changes["inner"] = inner.on(engine)
        return substitute(self, **changes) if changes else self

    @property
    def name(self) -> str:
        """The controller's name in a record."""
        return type(self).__name__

    def content_key(self) -> tuple[Any, ...]:
        """Return the key that is equal for equal controllers of one class: their attributes.

        Raises TypeError for attributes that cannot be compared.
        """
        ignored = {name for name, each in fields_of(self).items() if not each.compare}
        kept = ((name, value) for name, value in attributes_of(self).items() if name not in ignored)
        return tuple((name, content_of(value)) for name, value in kept)

    def _wrap(self, inner: Controller[ControllerState]) -> None:
        """Take robot and timing from an inner controller. Raises ArgumentError for anything else."""
        refuse_other_than_controller("the inner controller", inner)
        self._set(inner=inner, model=inner.model, lead=inner.lead, control_dt=inner.control_dt)
        self._set(needs_setpoint=inner.needs_setpoint)
        if inner.random_size:
            self._set(random_size=inner.random_size)

    def _set(self, **values: Any) -> None:
        """Set attributes in the constructor of a frozen dataclass, arrays as read-only copies: what a record
        says of a controller must not change."""
        for name, value in values.items():
            if isinstance(value, np.ndarray):
                value = value.copy()
                value.setflags(write=False)
            object.__setattr__(self, name, value)

    def __eq__(self, other: object) -> bool:
        if self is other or not isinstance(other, Controller) or type(self) is not type(other):
            return self is other
        try:
            return self.content_key() == other.content_key()
        except TypeError:
            return False

    def __hash__(self) -> int:
        return hash((type(self), getattr(self, "model", None)))

    def __repr__(self) -> str:
        known = fields_of(self)
        robot = getattr(getattr(self, "model", None), "name", "no model")
        parts = [f"{type(self).__name__} of {robot}"]
        for name, value in attributes_of(self).items():
            if name in known and known[name].repr and not isinstance(value, Model):
                unit = known[name].metadata.get("unit", "")
                parts.append(f"{name} {_in_words(value)} {unit}".rstrip())
        return f"<{', '.join(parts)}>"

    def _repr_html_(self) -> str:
        title, *parts = repr(self)[1:-1].split(", ")
        from dynx.files.pages import html_grid  # most are shown on no page

        return html_grid(title, (), ([part] for part in parts))


@dataclass(frozen=True)
class ModelBased(Controller[ControllerState]):
    """A controller that evaluates the dynamics of its model with a backend.

    By default the controller computes with rigid bodies alone. With `joint_dynamics=True` it includes the
    damping, dry friction, armature and springs of the description. It then compensates dry friction along the
    velocity of the setpoint. This moves joints that stick, and cannot make a joint unstable. The controller
    needs a motor on every coordinate, so it refuses a floating base.
    """

    model: Model
    backend: str | Backend = field(compare=False)
    dynamics: Dynamics = field(init=False, repr=False)
    joint_dynamics: bool = field(default=False, kw_only=True, repr=False)
    joints: JointCoefficients | None = field(init=False, repr=False, compare=False, default=None)
    """Coefficients (nv,) of the joint dynamics that the controller includes; None if all are 0."""

    @checks_types
    def __init__(
        self, model: Model, backend: str | Backend = DEFAULT_ENGINE, joint_dynamics: bool = False
    ) -> None:
        """`backend` is a name, or a backend of an equal model.

        Raises UnsupportedFeatureError for a floating base, ArgumentError for a backend of another robot.
        """
        if model.floating:
            raise UnsupportedFeatureError(
                f"{type(self).__name__} commands every coordinate, but {model.name} has a floating base, "
                "which has no motor; joint-space controllers (PD, PID, Velocity) leave the base alone"
            )
        self._set(model=model, backend=backend, dynamics=EngineDynamics(engine_of(model, backend)))
        self._set(joint_dynamics=joint_dynamics, joints=known_joints(model) if joint_dynamics else None)

    @property
    def name(self) -> str:
        """Name of the class, followed by words for the joint dynamics that the controller knows."""
        return super().name + (", joint dynamics known" if self.joint_dynamics else "")

    def with_joint_dynamics(
        self, tau: Array, q: Array, v: Array, a: Array, v_wanted: Array, h: Array | float = 0.0
    ) -> Array:
        """Return a torque (nv,) plus the torques of springs at q, of armature and damping at velocity `v` and
        acceleration `a`, and of dry friction along `v_wanted`. The damping torque is the one after a step of
        `h` [s]."""
        joints = self.joints
        if joints is None:
            return tau
        dry = joints.friction * sign(v_wanted)
        total = tau + joints.armature * a + joints.damping * (v + h * a) + dry
        return np.asarray(total if joints.springs is None else total - joints.springs.torque(q))

    @checks_types
    def on(self: Self, engine: str | Backend) -> Self:
        """Return a controller whose model another backend evaluates."""
        return substitute(self, backend=engine, dynamics=EngineDynamics(engine_of(self.model, engine)))


class ModelEvaluation(ABC):
    """An attribute of a controller that evaluates a model, and so gets other dynamics as the controller
    does."""

    @abstractmethod
    def with_dynamics(self: Evaluation, change: Callable[[Dynamics], Dynamics]) -> Evaluation:
        """Return a copy whose dynamics are those that `change` returns for its own."""


@dataclass(frozen=True)
class Wrapper(Controller[ControllerState]):
    """A controller that modifies the torque of another one."""

    inner: Controller[ControllerState]

    def __init__(self, inner: Controller[ControllerState]) -> None:
        self._wrap(inner)

    def initial_state(self) -> Any:
        """Return the initial state of the inner controller."""
        return self.inner.initial_state()


def refuse_other_than_controller(name: str, controller: object) -> None:
    """Raise ArgumentError for anything but a controller, such as the class of one or a function."""
    if isinstance(controller, Controller):
        return
    if isinstance(controller, type) and issubclass(controller, Controller):
        kind = controller.__name__
        raise ArgumentError(f"{name} is the class {kind}; wanted an object of it, as in {kind}(model, ...)")
    raise ArgumentError(
        f"{name} is of type {type(controller).__name__}; wanted a controller of dynx.control, or an object "
        "of a subclass of control.Controller"
    )


def chain_of(controller: Controller[Any]) -> Iterator[Controller[Any]]:
    """Yield a controller and its inner controllers, from the outermost to the innermost."""
    yield controller
    inner = getattr(controller, "inner", None)
    if isinstance(inner, Controller):
        yield from chain_of(inner)


def gains_of(controller: Controller[Any]) -> dict[str, Floats]:
    """Return the gains that a controller declares; its public arrays if it declares no fields."""
    known = fields_of(controller)
    arrays = {name: x for name, x in attributes_of(controller).items() if isinstance(x, np.ndarray)}
    return {
        name: x
        for name, x in arrays.items()
        if (known[name].metadata.get("gain") if name in known else not name.startswith("_"))
    }


def substitute(thing: Copied, **attributes: Any) -> Copied:
    """Copy a controller, or another frozen object, with some attributes replaced, without checking them."""
    twin = copy.copy(thing)
    for name, value in attributes.items():
        object.__setattr__(twin, name, value)
    return twin


def rebind(
    controller: Self,
    dynamics: Callable[[Dynamics], Dynamics],
    gains: Callable[[Controller[Any]], Mapping[str, Any]],
) -> Self:
    """Copy a controller and its inner controllers with other dynamics and other gains.

    Neither is checked: they may be symbols of a trace.
    """
    changes = dict(gains(controller))
    inner = getattr(controller, "inner", None)
    if isinstance(inner, Controller):
        changes["inner"] = rebind(inner, dynamics, gains)
    changes |= _with_dynamics(controller, dynamics)
    return substitute(controller, **changes)


def _with_dynamics(controller: Controller[Any], change: Callable[[Dynamics], Dynamics]) -> dict[str, Any]:
    """Return the attributes of a controller that evaluate a model, with the dynamics that `change` returns
    for their own."""
    changes: dict[str, Any] = {}
    for name, value in attributes_of(controller).items():
        if isinstance(value, Dynamics):
            changes[name] = change(value)
        elif isinstance(value, ModelEvaluation):
            changes[name] = value.with_dynamics(change)
    return changes


def known_joints(model: Model) -> JointCoefficients | None:
    """Return the coefficients (nv,) of a description for the coordinates of the model; None if all are 0."""
    parameters = Parameters(model, joint_dynamics=True)
    found = parameters.joints(np.array(parameters.defaults))
    return found if found is not None and found.present else None


def engine_of(model: Model, engine: str | Backend) -> Backend:
    """Return the backend of that name for `model`, or `engine` itself if its model is equal."""
    if not isinstance(engine, Backend):
        return backend(engine, model, validate=False)
    if engine.model != model:
        raise ArgumentError(f"the backend is for {shown(engine.model)}; wanted one for {shown(model)}")
    return engine


@checks_types
def model_dynamics(model: Model, backend: str | Backend = "pinocchio") -> Dynamics:
    """Return the dynamics of `model`, for a controller of your own that evaluates them in `torque`.

    `backend` is a name, or a backend of an equal model. Make the result an attribute of your controller. The
    backend evaluates the dynamics; in compiled steps and batches compiled code evaluates them. Raises
    ArgumentError for a backend of another robot.
    """
    return EngineDynamics(engine_of(model, backend))


def _in_words(value: Any) -> str:
    if isinstance(value, Backend):
        return value.name
    if isinstance(value, np.ndarray):
        if value.size and (value == value.flat[0]).all():
            return f"{value.flat[0]:g}"
        return str(value.shape) if value.ndim > 1 else f"[{', '.join(f'{x:g}' for x in value)}]"
    return f"{value:g}" if isinstance(value, float) else str(value)


def require_state(state: Floats, least: int, most: int | None = None) -> None:
    """Raise DTypeError or ShapeError for a state that has not the numbers of `initial_state`: at least
    `least`, and at most `most` unless that is None."""
    if state.dtype == object and any(each is None for each in state.flat):
        raise DTypeError("state has an entry that is None; wanted numbers")
    if state.ndim != 1 or len(state) < least or (most is not None and len(state) > most):
        raise ShapeError(f"state has shape {state.shape}; wanted one that initial_state or torque returned")
