"""`simulate`: one controller, one plant, one rollout."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.backends import backend
from dynx.control.base import Controller
from dynx.control.engine_motors import EngineMotor
from dynx.control.friction import SLIP, Coefficients
from dynx.control.saturation import checked_limit
from dynx.errors import ArgumentError, SimulationError, shown
from dynx.model import Model
from dynx.model.configuration import checked_array, checked_q
from dynx.sim.loop.clock import Clock
from dynx.sim.loop.controller_checks import check_controller, controller_numbers
from dynx.sim.loop.plain import Loop
from dynx.sim.loop.references import SetpointOf, checked_reference, setpoints_of
from dynx.sim.loop.sensors import Noise, Sensors
from dynx.sim.loop.staged import glued
from dynx.sim.loop.stops import Stops
from dynx.sim.plants.disturbances import Disturbances, Push
from dynx.sim.plants.model_error import MassScale, Payload, plant_model
from dynx.sim.plants.registry import default_integrator, make_plant
from dynx.sim.record.record import Record
from dynx.sim.record.rollout import Rollout
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Trajectory

Progress = Callable[[int, int], object]
"""Called with the steps taken and those asked for."""


class RolloutInterrupted(KeyboardInterrupt):
    """Ctrl-C in a simulation; `rollout` is what was computed until then."""

    def __init__(self, rollout: Rollout, wanted: int) -> None:
        super().__init__(f"interrupted after {len(rollout)} of {wanted} steps")
        self.rollout = rollout


def simulate(
    model: Model,
    controller: Controller[Any] | None = None,
    reference: Trajectory | ArrayLike | None = None,
    *,
    plant: str = "pinocchio",
    integrator: str | None = None,
    controller_backend: str | None = None,
    dt: float = 1e-3,
    duration: float | None = None,
    q0: ArrayLike | None = None,
    v0: ArrayLike | None = None,
    substeps: int = 1,
    control_dt: float | None = None,
    delay: float = 0.0,
    noise: Noise | None = None,
    damping: Coefficients = False,
    friction: Coefficients = False,
    friction_slip: float = SLIP,
    armature: Coefficients = False,
    effort_limits: bool | ArrayLike = False,
    position_limits: bool = False,
    payload: Payload | Sequence[Payload] | None = None,
    mass_scale: MassScale = 1.0,
    pushes: Sequence[Push] = (),
    check_reference: bool = True,
    method: str = "DOP853",
    rtol: float = 1e-10,
    atol: float = 1e-12,
    resume: Rollout | None = None,
    step: int | None = None,
    progress: Progress | None = None,
) -> Rollout:
    """Let `model` move under `controller` along `reference`, and record it.

    The engine of the plant and that of the controller (``controller_backend``, otherwise its own) are
    chosen apart, so the effect of one being wrong can be studied.

    **What moves.** `plant` names a backend. ``plant="pybullet"`` is PyBullet's own stepper; any other
    is a backend's forward dynamics under an `integrator` of dynx: ``semi_implicit`` (the default: v then
    q, the scheme of Bullet), ``rk4``, or ``adaptive`` (SciPy's `method` with `rtol`, `atol`).
    ``plant="pybullet", integrator="rk4"`` is PyBullet's forward dynamics under RK4.
    `controller` None is a robot without motors. `reference` is a trajectory, one configuration (nq,) to
    hold, or None. The start is `q0`, `v0`, or where the reference begins, or the neutral configuration.

    **Time** [s]. `dt` is the step of the record; the plant takes `substeps` steps in each. The controller
    is asked every `control_dt` (by default `dt`), which holds its torque in between, and sees the state
    of `delay` ago (before the start: the state at the start). `duration` is by default the reference's.
    All are multiples of `dt`.

    **What the joints feel**, alike in every plant: `damping`, dry `friction` (over the speed
    `friction_slip`, see `JointFriction`) and `armature`, each True for those of the description, one
    number or one for each joint; `effort_limits`, True for the model's, cut torques and are recorded;
    `position_limits` are stops without a bounce (`Stops`); `pushes` from outside.

    **Where the model is wrong.** A `payload`, and `mass_scale` for all links or some, are the plant's and
    not the controller's; `noise` is on what the controller sees.

    **Resuming.** With `resume` the first `step` steps (by default all) are taken from that record, and
    the rest computed, with all else given as then: the outcome is that of one run, to the last bit. That
    takes a controller whose state is an argument and a result of `torque`, not kept in itself.

    **Long runs.** `progress` is called now and then with the steps taken and those asked for. Ctrl-C
    raises RolloutInterrupted, which has what was computed in ``.rollout`` and can be resumed.

    Raises ArgumentError for what cannot be simulated, LimitError for a reference outside the limits of
    position and velocity (unless `check_reference` is False) or an effort limit of 0, DivergedError and
    ControlError in a step, with what was computed in ``error.rollout``.
    """
    if controller is not None and not isinstance(controller, Controller):
        raise ArgumentError(f"controller is of type {type(controller).__name__}; wanted a dynx.control law")
    if controller is not None and controller_backend is not None:
        controller = controller.on(controller_backend)
    span = reference.duration if duration is None and isinstance(reference, Trajectory) else duration
    if span is None:
        raise ArgumentError("duration is not given, and the reference is no trajectory that has one")
    clock = Clock.of(dt, span, control_dt, delay)
    moved = plant_model(model, payload, mass_scale)
    if controller is not None:
        check_controller(model, controller, clock)
    setpoint_of = checked_reference(model, reference, within_limits=check_reference)
    disturbances = Disturbances(moved, damping, friction, friction_slip, armature, pushes, dt)
    limit = _effort_limits(model, controller, effort_limits)
    sensors = Sensors(model, clock, noise)
    record = Record.begin(*_start(moved, setpoint_of, q0, v0), clock.n_steps)
    settings: dict[str, Any] = {
        "plant": plant,
        "integrator": integrator or default_integrator(plant),
        "controller": "none" if controller is None else controller.name,
        "law": {} if controller is None else controller_numbers(controller),
        "dt": clock.dt,
        "control_dt": clock.control_dt,
        "delay": clock.delay_steps * clock.dt,
        "substeps": substeps,
        "effort_limits": None if limit is None else limit.tolist(),
        "position_limits": position_limits,
        "joints": {
            "damping": disturbances.friction.damping.tolist(),
            "friction": disturbances.friction.friction.tolist(),
            "slip": disturbances.friction.slip,
        },
        "noise": None if noise is None else repr(noise),
        "pushes": [repr(push) for push in disturbances.pushes],
    }
    if resume is not None:
        _take_over(record, resume, len(resume) if step is None else step, moved, settings)
        _refuse_other_reference(resume, record.steps, setpoint_of, clock)
    elif step is not None:
        raise ArgumentError("step is that of a rollout to resume, which is not given")
    options = {"method": method, "rtol": rtol, "atol": atol}
    setpoints = setpoints_of(setpoint_of, clock, controller)
    made = make_plant(
        plant,
        moved,
        disturbances,
        clock.dt,
        integrator=settings["integrator"],
        substeps=substeps,
        options=options,
    )

    def so_far() -> Rollout:
        n = record.steps
        times, tau = clock.times()[: n + 1], record.tau[:n]
        at_limit = np.zeros(tau.shape, dtype=bool) if limit is None else np.abs(tau) >= limit
        return Rollout(
            moved,
            times,
            record.q[: n + 1],
            record.v[: n + 1],
            record.a[:n],
            tau,
            at_limit,
            None if setpoint_of is None else setpoint_of(times),
            disturbances.armature,
            settings,
        )

    try:
        made.refuse(controller)
        stops = Stops(moved, _mass_matrix(moved, disturbances)) if position_limits else None
        told = None if progress is None else partial(_tell, progress, clock.n_steps)
        loop = Loop(made, controller, setpoints, clock, sensors, limit, stops, told)
        # A state that runs away is seen by the loop, which says more than NumPy's warning.
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            quick = glued(loop, record)
            if quick is not None:
                quick.run(record)
            loop.run(record)
        if told is not None:
            told(record.steps)
    except SimulationError as error:
        error.rollout = so_far()
        raise
    except KeyboardInterrupt:
        raise RolloutInterrupted(so_far(), clock.n_steps) from None
    finally:
        made.close()
    return so_far()


def _tell(progress: Progress, wanted: int, taken: int) -> None:
    progress(taken, wanted)


def _effort_limits(
    model: Model, controller: Controller[Any] | None, effort_limits: bool | ArrayLike
) -> Floats | None:
    if effort_limits is False:
        return None
    if isinstance(controller, EngineMotor):
        raise ArgumentError(f"effort_limits do not reach {controller.name}: give it `force`")
    return checked_limit(model, None if effort_limits is True else effort_limits)


def _start(
    model: Model, setpoint_of: SetpointOf | None, q0: ArrayLike | None, v0: ArrayLike | None
) -> tuple[Floats, Floats]:
    q, v = model.neutral(), np.zeros(model.nv)
    if setpoint_of is not None:
        first = setpoint_of(np.zeros(1))
        q, v = first.q[0], first.v[0]
    if q0 is not None:
        q, v = checked_q(model, q0, "q0"), np.zeros(model.nv)
    if v0 is not None:
        v = checked_array("v0", v0, model.nv)
    if q.ndim != 1 or v.ndim != 1:
        raise ArgumentError(f"q0 has shape {q.shape} and v0 {v.shape}; wanted one state")
    return q, v


def _take_over(record: Record, rollout: Rollout, step: int, model: Model, settings: dict[str, Any]) -> None:
    """Begin where `rollout` was at `step`, if it is a record of the same simulation."""
    if not isinstance(step, int) or not 0 <= step <= min(len(rollout), len(record)):
        raise ArgumentError(
            f"step is {shown(step)}; the rollout to resume has {len(rollout)} and this one {len(record)}"
        )
    if rollout.model != model:
        raise ArgumentError(f"the rollout to resume is of {shown(rollout.model)}, not of {shown(model)}")
    for name, now in settings.items():
        then = rollout.settings.get(name)
        if then != now:
            raise ArgumentError(f"the rollout to resume had {name} {shown(then)}; now it is {shown(now)}")
    if not (np.array_equal(record.q[0], rollout.q[0]) and np.array_equal(record.v[0], rollout.v[0])):
        raise ArgumentError("the rollout to resume started somewhere else: its q0 and v0 are others")
    record.q[: step + 1], record.v[: step + 1] = rollout.q[: step + 1], rollout.v[: step + 1]
    record.a[:step], record.tau[:step] = rollout.a[:step], rollout.tau[:step]
    record.steps = step


def _refuse_other_reference(
    rollout: Rollout, step: int, setpoint_of: SetpointOf | None, clock: Clock
) -> None:
    then = rollout.reference
    if setpoint_of is None or then is None:
        same = setpoint_of is None and then is None
    else:
        now = setpoint_of(clock.times()[: step + 1])
        pairs = zip(then, now, strict=True)
        same = all(np.allclose(old[: step + 1], new, rtol=1e-12, atol=1e-12) for old, new in pairs)
    if not same:
        raise ArgumentError("the rollout to resume followed another reference")


def _mass_matrix(model: Model, disturbances: Disturbances) -> Callable[[Floats], Floats]:
    """M of the plant for the stops, by the same text whatever the plant."""
    bodies = backend("reference", model, validate=False)
    return lambda q: bodies.mass_matrix(q) + disturbances.armature
