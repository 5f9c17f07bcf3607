"""Laws by name, with gains that suit any robot: what the command line and the tutorial choose from.

Gains in N m depend on what a joint has to move. Where none are given they are those of an error that obeys
e'' + kd e' + kp e = 0 with kp = 400 and kd = 40 (natural frequency 20 rad/s, critically damped), times the
inertia that each joint sees at the start: the diagonal of the mass matrix there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from dynx import control
from dynx.backends import Backend, backend
from dynx.control.base import Controller
from dynx.control.gains import checked_gain, feedback_gains
from dynx.errors import GainError, UnknownNameError, nearest, shown
from dynx.model import Model
from dynx.spatial.scalar import Floats

NATURAL_FREQUENCY = 20.0
"""Of the error where no gains are given [rad/s]."""


@dataclass(frozen=True)
class Gains:
    """What is known of a law's gains; None for what is left to it. Each is one number, or one for each joint.

    `kp` alone comes with the `kd` of `damping_ratio`. For laws of torque `natural_frequency` is that of
    each joint alone, with the inertia that it sees at the start. `ki` is by default kp^2 / (2 kd).
    """

    kp: ArrayLike | None = None
    kd: ArrayLike | None = None
    ki: ArrayLike | None = None
    natural_frequency: ArrayLike | None = None
    damping_ratio: ArrayLike | None = None
    posture_kp: ArrayLike | None = None
    posture_kd: ArrayLike | None = None

    def given(self) -> dict[str, ArrayLike]:
        """Those that are not None, by name."""
        pairs = ((field.name, getattr(self, field.name)) for field in fields(self))
        return {name: gain for name, gain in pairs if gain is not None}


@dataclass(frozen=True)
class ControllerRequest:
    """What a law is made from; `start` (nq,) is where the inertia is looked at for gains of torque.

    `limit` is the most that motors give [N m or N], for the laws that want to know (PID, PyBullet's
    motors); `frame` is that of the task-space laws.
    """

    model: Model
    start: Floats
    control_dt: float
    gains: Gains = Gains()
    frame: str | None = None
    limit: ArrayLike | None = None
    backend: str | Backend = "pinocchio"

    @property
    def n_joints(self) -> int:
        """How many coordinates have motors."""
        return self.model.nv - (6 if self.model.floating else 0)

    def rates(self, n: int | None = None) -> dict[str, Floats]:
        """kp [1/s^2] and kd [1/s] of an error, (n,); n is by default that of the coordinates."""
        return self._feedback(np.ones(self.model.nv if n is None else n))

    def torques(self) -> dict[str, Floats]:
        """kp [N m/rad or N/m] and kd [N m s/rad or N s/m] of the joints."""
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
    """One entry of `CONTROLLERS`: what the law is, which `Gains` it takes, and how it is made."""

    what: str
    takes: tuple[str, ...]
    make: Callable[[ControllerRequest], Controller[Any]]
    wants: Literal["joints", "frame"] = "joints"


def joint_inertia(model: Model, q: Floats) -> Floats:
    """The inertia (n,) [kg m^2 or kg] that each joint sees at `q`, while the others hold still.

    A floating base yields, and the other joints with it: then it is 1 / (M^-1)_ii, the least that a joint
    sees whatever the others do, so that gains which suit it do not overshoot.
    """
    with backend("reference", model, validate=False) as bodies:
        M: Floats = bodies.mass_matrix(q)
    if not model.floating:
        return np.maximum(np.diag(M), 0.0)
    yielding = np.diag(np.linalg.pinv(M))[6:]
    return np.divide(1.0, yielding, out=np.zeros_like(yielding), where=yielding > 0.0)


def named_controller(name: str, request: ControllerRequest) -> Controller[Any]:
    """The law of that name. Raises UnknownNameError for another, GainError for gains it does not take."""
    law = CONTROLLERS.get(name)
    if law is None:
        raise UnknownNameError(f"no law is called {shown(name)}{nearest(name, CONTROLLERS)}")
    for gain in request.gains.given():
        if gain not in law.takes:
            takes = f"it takes {', '.join(law.takes)}" if law.takes else "it has no gains"
            raise GainError(f"{name} takes no {gain}; {takes}")
    if law.wants == "frame" and request.frame is None:
        raise UnknownNameError(f"{name} is about a frame, and none is given")
    return law.make(request)


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
    return control.PositionMotor(request.model, **fractions, force=request.limit)


def _operational_space(request: ControllerRequest) -> Controller[Any]:
    posture = {name: gain for name, gain in request.gains.given().items() if name.startswith("posture")}
    options: Any = {**request.rates(6), **posture, "backend": request.backend}
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
        backend=request.backend,
    )


_FEEDBACK = ("kp", "kd", "natural_frequency", "damping_ratio")

CONTROLLERS: dict[str, NamedController] = {
    "position-motor": NamedController(
        "PyBullet's POSITION_CONTROL, its own gains", ("kp", "kd"), _position_motor
    ),
    "velocity-motor": NamedController(
        "PyBullet's VELOCITY_CONTROL", (), lambda r: control.VelocityMotor(r.model, force=r.limit)
    ),
    "pd-motor": NamedController(
        "PyBullet's PD_CONTROL: pd inside the engine",
        _FEEDBACK,
        lambda r: control.PDMotor(r.model, **r.torques(), force=r.limit),
    ),
    "velocity": NamedController("kd (v* - v): positions drift", _FEEDBACK[1:], _velocity),
    "pd": NamedController(
        "kp (q* - q) + kd (v* - v), no model", _FEEDBACK, lambda r: control.PD(r.model, **r.torques())
    ),
    "pid": NamedController("pd and an integral, cut to the effort limits", ("ki", *_FEEDBACK), _pid),
    "gravity-pd": NamedController(
        "pd and the weight g(q)",
        _FEEDBACK,
        lambda r: control.GravityCompensatedPD(r.model, **r.torques(), backend=r.backend),
    ),
    "feed-forward": NamedController(
        "ID(q*, v*, a*), no feedback",
        (),
        lambda r: control.FeedForward(r.model, backend=r.backend),
    ),
    "feed-forward-pd": NamedController(
        "ID(q*, v*, a*) and pd",
        _FEEDBACK,
        lambda r: control.FeedForward(r.model, **r.torques(), backend=r.backend),
    ),
    "computed-torque": NamedController(
        "ID(q, v, a* + kd (v* - v) + kp (q* - q))",
        _FEEDBACK,
        lambda r: control.ComputedTorque(r.model, **r.rates(), backend=r.backend),
    ),
    "discrete-computed-torque": NamedController(
        "the plant's own step, inverted",
        (),
        lambda r: control.DiscreteComputedTorque(r.model, control_dt=r.control_dt, backend=r.backend),
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
"""From little knowledge of the robot to much, the task-space laws last."""
