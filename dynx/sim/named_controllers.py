"""Controllers by name, with default gains that suit any robot, for the command line and the tutorial.

The default gains make the error obey e'' + kd e' + kp e = 0 with kp = 400 and kd = 40 (natural frequency 20
rad/s, critically damped). For controllers whose gains are in N m, they are multiplied by the inertia of each
joint at the start, the diagonal of the mass matrix.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields
from inspect import signature
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from dynx import control
from dynx.backends import Backend
from dynx.control import registry
from dynx.control.base import Controller
from dynx.control.gains import feedback_gains
from dynx.errors import GainError, UnknownNameError, UnsupportedFeatureError, nearest, shown
from dynx.model import Model
from dynx.model.numbers import checked_gain
from dynx.registry import DEFAULT_ENGINE
from dynx.sim.overshoot import joint_inertia
from dynx.spatial.scalar import Floats

NATURAL_FREQUENCY = 20.0
"""Default natural frequency of the error [rad/s]."""


@dataclass(frozen=True)
class Gains:
    """Gains of a controller: one number or one for each joint, None for the default.

    If only `kp` is given, `kd` follows from `damping_ratio`. For controllers with gains in N m,
    `natural_frequency` is that of each joint alone with its inertia at the start. `ki` is by default kp^2 /
    (2 kd).
    """

    kp: ArrayLike | None = None
    kd: ArrayLike | None = None
    ki: ArrayLike | None = None
    natural_frequency: ArrayLike | None = None
    damping_ratio: ArrayLike | None = None
    posture_kp: ArrayLike | None = None
    posture_kd: ArrayLike | None = None

    def given(self) -> dict[str, ArrayLike]:
        """Return the gains that are not None, by name."""
        pairs = ((field.name, getattr(self, field.name)) for field in fields(self))
        return {name: gain for name, gain in pairs if gain is not None}


@dataclass(frozen=True)
class ControllerRequest:
    """Arguments from which a named controller is made.

    Gains in N m are scaled by the inertia at `start` (nq,). `limit` is the effort limit of the motors [N m or
    N], for PID and PyBullet's motors; `frame` is the frame of task-space controllers. With `joint_dynamics`
    the model of the controller has the armature, damping and dry friction of the description.
    """

    model: Model
    start: Floats
    control_dt: float
    gains: Gains = Gains()
    frame: str | None = None
    limit: ArrayLike | None = None
    backend: str | Backend = DEFAULT_ENGINE
    joint_dynamics: bool = False

    @property
    def computing(self) -> dict[str, Any]:
        """Options of a controller that computes with a model (`dynx.control.ModelBased`)."""
        return {"backend": self.backend, "joint_dynamics": self.joint_dynamics}

    @property
    def n_joints(self) -> int:
        """Number of coordinates with motors."""
        return self.model.nv - (6 if self.model.floating else 0)

    def rates(self, n: int | None = None) -> dict[str, Any]:
        """Return kp [1/s^2] and kd [1/s] of an error (n,), by default one for each coordinate."""
        return self._feedback(np.ones(self.model.nv if n is None else n))

    def torques(self) -> dict[str, Any]:
        """Return kp [N m/rad or N/m] and kd [N m s/rad or N s/m] of the joints."""
        return self._feedback(joint_inertia(self.model, self.start))

    def _feedback(self, inertia: Floats) -> dict[str, Floats]:
        gains, n = self.gains, len(inertia)
        kp, kd, w, ratio = gains.kp, gains.kd, gains.natural_frequency, gains.damping_ratio
        if w is not None or (kp is None and kd is None):
            w = NATURAL_FREQUENCY if w is None else w
            p, d = feedback_gains(n, kp, kd, w, 1.0 if ratio is None else ratio)
            return {"kp": p * inertia, "kd": d * inertia}
        if kp is None:
            raise GainError("kd is given without kp; wanted both, or natural_frequency")
        if kd is not None and ratio is not None:
            raise GainError("damping is given twice: wanted kd, or damping_ratio")
        p = checked_gain("kp", kp, n)
        if kd is not None:
            return {"kp": p, "kd": checked_gain("kd", kd, n)}
        z = checked_gain("damping_ratio", 1.0 if ratio is None else ratio, n)
        return {"kp": p, "kd": 2.0 * z * np.sqrt(p * inertia)}


@dataclass(frozen=True)
class NamedController:
    """One entry of `CONTROLLERS`."""

    what: str
    """The control law in a few words."""
    takes: tuple[str, ...]
    """Names of the fields of `Gains` that it takes."""
    make: Callable[[ControllerRequest], Controller[Any]]
    controls: Literal["joints", "frame"] = "joints"
    """Object of the control law: all joints, or one frame."""


def named_controller(name: str, request: ControllerRequest) -> Controller[Any]:
    """Return the controller of that name, one of `CONTROLLERS`.

    Raises UnknownNameError for another name, GainError for gains that the controller does not take, and
    UnsupportedFeatureError for `joint_dynamics` of a controller that computes without a model.
    """
    if name not in CONTROLLERS:
        raise UnknownNameError(f"no controller is called {shown(name)}{nearest(name, CONTROLLERS)}")
    named = CONTROLLERS[name]
    for gain in request.gains.given():
        if gain not in named.takes:
            takes = f"it takes {', '.join(named.takes)}" if named.takes else "it has no gains"
            raise GainError(f"{name} takes no {gain}; {takes}")
    if named.controls == "frame" and request.frame is None:
        raise UnknownNameError(f"{name} controls a frame, and none is given")
    controller = named.make(request)
    if request.joint_dynamics and not getattr(controller, "joint_dynamics", False):
        raise UnsupportedFeatureError(
            f"{name} computes without the dynamics of the joints, so it takes no joint_dynamics; wanted a "
            "controller with a model, such as computed-torque or gravity-pd"
        )
    return controller


class NamedControllers(Mapping[str, NamedController]):
    """The controllers of `BUILT_IN`, and those that programs and installed packages register."""

    def __getitem__(self, name: str) -> NamedController:
        if name in BUILT_IN:
            return BUILT_IN[name]
        if name not in self:
            raise KeyError(name)
        return _of_class(registry.controller_class(name))

    def __iter__(self) -> Iterator[str]:
        yield from BUILT_IN
        yield from (name for name in registry.controller_names() if name not in registry.BUILT_IN)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __contains__(self, name: object) -> bool:
        # Entry points are read only for other names, because reading them takes some milliseconds.
        return name in BUILT_IN or name in tuple(self)


CONTROLLERS = NamedControllers()
"""Controllers that ``dynx sim --controller`` takes, by name."""


def _of_class(kind: type[Controller[Any]]) -> NamedController:
    """Make the entry of a registered class, whose constructor gets the arguments that it declares."""
    parameters = signature(kind).parameters
    constructor: Callable[..., Controller[Any]] = kind

    def make(request: ControllerRequest) -> Controller[Any]:
        options = {"frame": request.frame, "limit": request.limit, **request.computing}
        options |= {"control_dt": request.control_dt, **request.gains.given()}
        try:
            return constructor(
                request.model, **{name: x for name, x in options.items() if name in parameters}
            )
        except TypeError as error:
            raise GainError(f"{kind.__name__} cannot be made: {error}") from None

    takes = tuple(each.name for each in fields(Gains) if each.name in parameters)
    what = (kind.__doc__ or kind.__name__).strip().splitlines()[0].rstrip(".")
    return NamedController(what, takes, make, "frame" if "frame" in parameters else "joints")


def _pid(request: ControllerRequest) -> Controller[Any]:
    gains = request.torques()
    ki: ArrayLike | None = request.gains.ki
    if ki is None:
        if (gains["kd"] <= 0.0).any():
            raise GainError("ki is not given, and kd is 0; wanted one of them")
        ki = 0.5 * gains["kp"] ** 2 / gains["kd"]
    options: Any = {**gains, "ki": ki, "control_dt": request.control_dt, "limit": request.limit}
    return control.PID(request.model, **options)


def _velocity(request: ControllerRequest) -> Controller[Any]:
    if request.gains.kd is not None:
        kd = checked_gain("kd", request.gains.kd, request.n_joints)
    else:
        kd = request.torques()["kd"]
    return control.Velocity(request.model, kd=kd)


def _position_motor(request: ControllerRequest) -> Controller[Any]:
    names = {"kp": "position_gain", "kd": "velocity_gain"}
    fractions: Any = {names[gain]: given for gain, given in request.gains.given().items()}
    return control.BulletPositionMotor(request.model, **fractions, force=request.limit)


def _operational_space(request: ControllerRequest) -> Controller[Any]:
    posture = {name: gain for name, gain in request.gains.given().items() if name.startswith("posture")}
    options: Any = {**request.rates(6), **posture, **request.computing}
    return control.OperationalSpace(request.model, str(request.frame), **options)


def _impedance(request: ControllerRequest) -> Controller[Any]:
    gains = request.gains
    if gains.kp is None or gains.kd is None:
        raise GainError("impedance needs kp [N/m, N m/rad] and kd [N s/m, N m s/rad] of the frame")
    return control.Impedance(
        request.model,
        str(request.frame),
        stiffness=gains.kp,
        damping=gains.kd,
        joint_damping=0.0 if gains.posture_kd is None else gains.posture_kd,
        **request.computing,
    )


_FEEDBACK = ("kp", "kd", "natural_frequency", "damping_ratio")

BUILT_IN: dict[str, NamedController] = {
    "position-motor": NamedController(
        "PyBullet's POSITION_CONTROL, default gains", ("kp", "kd"), _position_motor
    ),
    "velocity-motor": NamedController(
        "PyBullet's VELOCITY_CONTROL", (), lambda r: control.BulletVelocityMotor(r.model, force=r.limit)
    ),
    "pd-motor": NamedController(
        "PyBullet's PD_CONTROL: pd inside the engine",
        _FEEDBACK,
        lambda r: control.BulletPDMotor(r.model, **r.torques(), force=r.limit),
    ),
    "velocity": NamedController("kd (v* - v): positions drift", _FEEDBACK[1:], _velocity),
    "pd": NamedController(
        "kp (q* - q) + kd (v* - v), no model", _FEEDBACK, lambda r: control.PD(r.model, **r.torques())
    ),
    "pid": NamedController("pd plus integral, saturated at the limits", ("ki", *_FEEDBACK), _pid),
    "gravity-pd": NamedController(
        "pd plus gravity compensation g(q)",
        _FEEDBACK,
        lambda r: control.GravityCompensatedPD(r.model, **r.torques(), **r.computing),
    ),
    "feed-forward": NamedController(
        "ID(q*, v*, a*), no feedback",
        (),
        lambda r: control.FeedForward(r.model, **r.computing),
    ),
    "feed-forward-pd": NamedController(
        "ID(q*, v*, a*) and pd",
        _FEEDBACK,
        lambda r: control.FeedForward(r.model, **r.torques(), **r.computing),
    ),
    "computed-torque": NamedController(
        "ID(q, v, a* + kd (v* - v) + kp (q* - q))",
        _FEEDBACK,
        lambda r: control.ComputedTorque(r.model, **r.rates(), **r.computing),
    ),
    "discrete-computed-torque": NamedController(
        "inverse of the step of the plant",
        (),
        lambda r: control.DiscreteComputedTorque(r.model, control_dt=r.control_dt, **r.computing),
    ),
    "operational-space": NamedController(
        "computed torque of a frame",
        (*_FEEDBACK, "posture_kp", "posture_kd"),
        _operational_space,
        "frame",
    ),
    "impedance": NamedController(
        "spring and damper of a frame", ("kp", "kd", "posture_kd"), _impedance, "frame"
    ),
}
"""Controllers of dynx: first those that need least knowledge of the robot, last those of a frame."""
