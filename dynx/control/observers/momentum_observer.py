"""Momentum observer: the external torque of a robot, from its motion and the torques of its motors.

With the momentum p = M v of all coordinates and dM/dt = C + C' (`dynx.rbd.coriolis`), the equations of motion
are

    dp/dt = tau - friction + C' v - g + tau_ext,

where g is the torque that holds the robot against gravity and springs. They have no acceleration, and hold
for the twist of a floating base too, for which p is the momentum of the robot at the base frame, in its axes.
The residual

    r = gain (p(t) - p(0) - integral of (tau - friction + C' v - g + r))

obeys dr/dt = gain (tau_ext - r): each entry is the external torque of its coordinate behind a low-pass filter
of first order (De Luca and Mattone, Sensorless robot collision detection and hybrid force/motion control,
2005; Haddadin, De Luca and Albu-Schaeffer, Robot collisions: a survey, 2017, on the momentum observer).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.backends import Backend
from dynx.backends.dynamics import Dynamics, EngineDynamics
from dynx.backends.joint_dynamics import JointDynamicsTerms
from dynx.backends.joint_friction import Coefficients, JointFriction, armature_matrix, checked_slip
from dynx.control.base import ModelEvaluation, engine_of, parameter, substitute
from dynx.control.friction import kept_coefficients
from dynx.control.observers.wrench_estimate import MIN_RATIO, WrenchEstimate, estimate_wrenches
from dynx.errors import ArgumentError, GainError, ShapeError, shown
from dynx.model import Model
from dynx.model.elements import JointSprings
from dynx.model.numbers import checked_array, checked_bool, checked_entries, checked_gain, real_array
from dynx.option_names import checks_field_names
from dynx.rbd.jacobians import LOCAL_WORLD_ALIGNED
from dynx.registry import DEFAULT_ENGINE
from dynx.spatial.scalar import Array, Floats


@checks_types
@checks_field_names(damping="joint_damping", friction="joint_friction", armature="joint_armature")
@dataclass(frozen=True, eq=False, repr=False)
class MomentumObserver(ModelEvaluation):
    """Observer that estimates the external torque (nv,) of a robot from q, v and the torque of its motors.

    The estimate is called the residual. Use `residuals` for a log, and `update` in a loop. `wrench` returns
    the wrench on a link that explains a residual best.

    Between two samples the torque of the motors is constant, and the other terms are the mean of both
    samples. For a constant external torque the filter is exact. So after a sudden change of the external
    torque the error is below 1 % after 5 time constants, at any rate of samples.

    Your own controller may have the observer as an attribute. The backend then evaluates the observer, as
    with `model_dynamics`; in compiled steps and batches compiled code evaluates it.
    """

    model: Model
    gain: Floats = parameter("1/s")
    """Gain of each coordinate (nv,), the inverse of its time constant."""
    joint_damping: bool | Floats = parameter("N m s/rad or N s/m")
    joint_friction: bool | Floats = parameter("N m or N")
    friction_slip: float = parameter("rad/s or m/s")
    joint_armature: bool | Floats = parameter("kg m^2 or kg")
    joint_springs: bool = parameter("")
    losses: JointFriction = field(init=False)
    """Damping and dry friction that are subtracted from the torque of the motors."""
    armature: Floats = field(init=False)
    """Armature (nv, nv), which is added to the mass matrix."""
    springs: JointSprings | None = field(init=False)
    """Springs, whose torque is added to the torque of the motors; None if there are none."""
    dynamics: Dynamics = field(init=False)

    def __init__(
        self,
        model: Model,
        *,
        time_constant: ArrayLike | None = None,
        gain: ArrayLike | None = None,
        joint_damping: Coefficients = True,
        joint_friction: Coefficients = True,
        friction_slip: float = 0.0,
        joint_armature: Coefficients = True,
        joint_springs: bool = True,
        backend: str | Backend = DEFAULT_ENGINE,
    ) -> None:
        """`time_constant` [s] or `gain` [1/s], one number or one for each coordinate (nv,).

        `joint_damping`, `joint_friction`, `friction_slip`, `joint_armature` and `joint_springs` have the
        meaning and the defaults of `dynx.simulate`. The observer counts effects that you leave out as an
        external torque. The friction of a joint at rest also counts as an external torque.

        Raises GainError for coefficients, ArgumentError for a backend of another robot.
        """
        if (time_constant is None) is (gain is None):
            given = "neither time_constant nor gain is" if gain is None else "time_constant and gain are both"
            raise GainError(f"{given} given; wanted either time_constant [s] or gain [1/s]")
        if time_constant is not None:
            seconds = checked_gain("time_constant", time_constant, model.nv)
            if not seconds.all():
                raise GainError(f"time_constant is {shown(time_constant)}; wanted a time above 0 [s]")
            gain = 1.0 / seconds
        assert gain is not None
        values: dict[str, Any] = {
            "model": model,
            "gain": checked_gain("gain", gain, model.nv),
            "joint_damping": kept_coefficients(model, "joint_damping", joint_damping),
            "joint_friction": kept_coefficients(model, "joint_friction", joint_friction),
            "friction_slip": checked_slip("friction_slip", friction_slip),
            "joint_armature": kept_coefficients(model, "joint_armature", joint_armature),
            "joint_springs": checked_bool("joint_springs", joint_springs),
            "losses": JointFriction.of_options(model, joint_damping, joint_friction, friction_slip),
            "armature": armature_matrix(model, joint_armature, "joint_armature"),
            "springs": JointDynamicsTerms(model).springs if joint_springs else None,
            "dynamics": EngineDynamics(engine_of(model, backend)),
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)

    # -- in a loop ----------------------------------------------------------------------------

    def initial_state(self) -> Floats:
        """Return the state (3 nv + 1,) before the first measurement, whose residual is zero."""
        return np.zeros(3 * self.model.nv + 1)

    def update(self, state: Array, q: Array, v: Array, tau: Array, dt: Array | float) -> Array:
        """Return the state (3 nv + 1,) at a measurement of q (nq,) and v (nv,).

        `tau` (nv,) [N m or N] are the torques of the motors since the measurement before, `dt` [s] ago; at
        the first measurement both are ignored. The arguments are not checked, and may be symbols of a trace.
        """
        nv = self.model.nv
        residual, momentum, rate, begun = state[:nv], state[nv : 2 * nv], state[2 * nv : 3 * nv], state[-1:]
        dynamics = self.dynamics
        M, C = dynamics.mass_matrix(q), dynamics.coriolis_matrix(q, v)
        p, b = self._terms(M, C, self._static_torque(q, dynamics.gravity_torque(q)), v)
        external = (p - momentum) / dt - tau - 0.5 * (rate + b)
        left = np.exp(-dt * self.gain)
        return np.concatenate([begun * (left * residual + (1.0 - left) * external), p, b, 0.0 * begun + 1.0])

    def residual(self, state: Array) -> Array:
        """Return the estimate of the external torque (nv,) [N m or N] in a state of `update`."""
        return state[: self.model.nv]

    # -- in a log -----------------------------------------------------------------------------

    @checks_types
    def residuals(self, t: ArrayLike, q: ArrayLike, v: ArrayLike, tau: ArrayLike) -> Floats:
        """Return the estimates of the external torque (n + 1, nv) [N m or N] at the times of a log.

        The arguments are those of a `dynx.Rollout`: times t (n + 1,) [s], which may be at unequal distances,
        q (n + 1, nq), v (n + 1, nv), and the torques of the motors tau (n, nv). Row k of tau acts from t[k]
        to t[k + 1]. The first residual is zero.

        Raises ShapeError, ArgumentError for numbers that are not finite or times that do not ascend.
        """
        model = self.model
        given = {"t": t, "q": q, "v": v, "tau": tau}
        arrays = {name: checked_entries(name, real_array(name, each)) for name, each in given.items()}
        n = max(arrays["t"].size - 1, 0)
        shapes = {"t": (n + 1,), "q": (n + 1, model.nq), "v": (n + 1, model.nv), "tau": (n, model.nv)}
        for name, array in arrays.items():
            if array.shape != shapes[name]:
                raise ShapeError(f"{name} has shape {array.shape}; wanted {shapes[name]}")
        times, q, v, tau = arrays.values()
        steps = np.diff(times)
        if not (steps > 0.0).all():
            k = int(np.argmin(steps > 0.0))
            raise ArgumentError(f"t[{k + 1}] is {times[k + 1]:g}, not after t[{k}], {times[k]:g}")
        engine = self._backend
        M, C = engine.mass_matrix(q), engine.coriolis_matrix(q, v)
        p, b = self._terms(M, C, self._static_torque(q, engine.gravity_torque(q)), v)
        external = np.diff(p, axis=0) / steps[:, None] - tau - 0.5 * (b[:-1] + b[1:])
        left = np.exp(-steps[:, None] * self.gain)
        found = np.zeros((n + 1, model.nv))
        for k in range(n):
            found[k + 1] = left[k] * found[k] + (1.0 - left[k]) * external[k]
        return found

    @checks_types
    def wrench(
        self,
        q: ArrayLike,
        residual: ArrayLike,
        frame: str | Sequence[str],
        *,
        reference: str = LOCAL_WORLD_ALIGNED,
        point: ArrayLike | None = None,
        force_only: bool = False,
        tolerance: float = MIN_RATIO,
    ) -> WrenchEstimate:
        """Return the wrench on a frame that explains a residual (..., nv) at q (..., nq) best.

        It is the smallest w that minimises |J' w - residual|, where J is the Jacobian of the frame in this
        `reference`, at this `point` of the frame. For several frames, w has all their wrenches. With
        `force_only` the moment at the point is zero, as at the point of a contact. Directions with singular
        values below `tolerance` times the largest count as not observable: w is zero in these directions (see
        `WrenchEstimate`).
        """
        frames = [frame] if isinstance(frame, str) else list(frame)
        engine = self._backend
        q = checked_array("q", q, self.model.nq)
        J = [engine.jacobian(q, name, reference=reference, point=point) for name in frames]
        found = estimate_wrenches(J, frames, residual, force_only=force_only, tolerance=tolerance)
        return found.of_one_frame() if isinstance(frame, str) else found

    # -- terms of the equations of motion -----------------------------------------------------

    def _static_torque(self, q: Array, g: Array) -> Array:
        """Return the torque (..., nv) that holds the robot at rest at q against gravity `g` and springs."""
        return g if self.springs is None else g - self.springs.torque(q)

    def _terms(self, M: Array, C: Array, g: Array, v: Array) -> tuple[Array, Array]:
        """Return the momentum (..., nv) and, besides the torques, its rate (..., nv)."""
        p = ((M + self.armature) @ v[..., None])[..., 0]
        rate = (C.swapaxes(-1, -2) @ v[..., None])[..., 0] - g
        return p, rate - self.losses(v) if self.losses.present else rate

    def __repr__(self) -> str:
        low, high = (f"{x:.3g}" for x in (self.gain.min(initial=np.inf), self.gain.max(initial=0.0)))
        return (
            f"<MomentumObserver of {self.model.name}, gain {low if low == high else f'{low} to {high}'} 1/s>"
        )

    @property
    def _backend(self) -> Backend:
        if not isinstance(self.dynamics, EngineDynamics):
            raise ArgumentError("an observer inside a compiled step has no backend; call it outside")
        return self.dynamics.backend

    @checks_types
    def with_dynamics(self, change: Callable[[Dynamics], Dynamics]) -> MomentumObserver:
        """Return the observer with other dynamics."""
        return substitute(self, dynamics=change(self.dynamics))
