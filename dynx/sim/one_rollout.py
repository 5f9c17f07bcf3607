"""`simulate`: one scenario from its start to its end."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from numpy.typing import ArrayLike

from dynx.control.base import Controller
from dynx.control.friction import SLIP, Coefficients
from dynx.errors import ArgumentError
from dynx.model import Model
from dynx.sim.loop.noise import Noise
from dynx.sim.plants.disturbances import Push
from dynx.sim.plants.model_error import MassScale, Payload
from dynx.sim.record.rollout import Rollout
from dynx.sim.scenario.keywords import scenario_of
from dynx.sim.scenario.scenario import Scenario
from dynx.sim.setup import require_duration
from dynx.sim.simulation import Progress, Simulation
from dynx.trajectory.base import Trajectory


class RolloutInterrupted(KeyboardInterrupt):
    """Ctrl-C in a simulation; `rollout` is the record until then."""

    def __init__(self, rollout: Rollout, wanted: int) -> None:
        super().__init__(f"interrupted after {len(rollout)} of {wanted} steps")
        self.rollout = rollout


def simulate(
    model: Model | Scenario,
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

    The first argument may also be a `Scenario`, which has all that follows but `resume`, `step` and
    `progress`; the arguments here are its fields.

    The engine of the plant and that of the controller (``controller_backend``, otherwise its own) are
    chosen apart, so the effect of an error of one can be studied.

    **What moves.** `plant` names a backend. ``plant="pybullet"`` is PyBullet's own stepper; any other
    is a backend's forward dynamics under an `integrator` of dynx: ``semi_implicit`` (the default: v then
    q, the scheme of Bullet), ``rk4``, or ``adaptive`` (SciPy's `method` with `rtol`, `atol`).
    ``plant="pybullet", integrator="rk4"`` is PyBullet's forward dynamics under RK4.
    `controller` None is a robot without motors. `reference` is a trajectory, one configuration (nq,) to
    hold, or None. The start is `q0`, `v0`, or where the reference begins, or the neutral configuration.

    **Time** [s]. `dt` is the step of the record; the plant takes `substeps` steps in each. The controller
    runs every `control_dt` (by default `dt`), its torque is held in between, and it measures the state of
    `delay` ago (before the start: the state at the start). `duration` is by default the reference's.
    All are multiples of `dt`.

    **Joints**, alike in every plant: `damping`, dry `friction` (over the speed `friction_slip`, see
    `JointFriction`) and `armature`, each True for those of the description, one number or one for each
    joint; `effort_limits`, True for the model's, saturate torques and are recorded; `position_limits` are
    stops without a bounce (`Stops`); `pushes` are external wrenches.

    **Model error.** A `payload`, and `mass_scale` for all links or some, are the plant's and not the
    controller's; `noise` is on the measurements.

    **Resuming.** With `resume` the first `step` steps (by default all) are taken from that record, and
    the rest is computed: the outcome is that of one run, to the last bit. The record's scenario must be
    equal to this one in every field but `duration`. A controller must keep its state in what it returns.

    **Long runs.** `progress` is called now and then with the steps taken and that of all. Ctrl-C raises
    RolloutInterrupted, which has the record until then in ``.rollout`` and can be resumed.

    Raises ArgumentError for a scenario that cannot be simulated, or another one than that of the record
    to resume; LimitError for a reference outside the limits of position and velocity (unless
    `check_reference` is False) or an effort limit of 0; DivergedError and ControlError in a step, with
    the record until then in ``error.rollout``.
    """
    given: dict[str, Any] = {
        name: value
        for name, value in locals().items()
        if name not in ("model", "controller_backend", "resume", "step", "progress")
    }
    scenario = scenario_of(model, controller_backend, given)
    require_duration(scenario)
    if step is not None and resume is None:
        raise ArgumentError("step is that of a rollout to resume, which is not given")
    with Simulation(scenario, progress=progress) as simulation:
        if resume is not None:
            simulation.take_over(resume, step)
        try:
            return simulation.run()
        except KeyboardInterrupt:
            raise RolloutInterrupted(simulation.rollout, simulation.n_steps or 0) from None
