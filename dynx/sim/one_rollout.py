"""`simulate`: one scenario from its start to its end."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from numpy.typing import ArrayLike

from dynx.control.base import Controller
from dynx.control.friction import Coefficients
from dynx.errors import ArgumentError
from dynx.model import Model
from dynx.model.package_paths import StrPath
from dynx.option_names import checks_option_names
from dynx.registry import DEFAULT_ENGINE
from dynx.sim.loop.noise import Noise
from dynx.sim.plants.disturbances import Push
from dynx.sim.plants.model_error import MassScale, Payload
from dynx.sim.plants.scene_plant import ScenePlant
from dynx.sim.record.rollout import Rollout
from dynx.sim.scenario.keywords import scenario_of
from dynx.sim.scenario.scenario import Scenario
from dynx.sim.setup import require_duration
from dynx.sim.simulation import Progress, Simulation
from dynx.trajectory.base import Trajectory


class RolloutInterrupted(KeyboardInterrupt):
    """Interruption of a simulation by Ctrl-C; `rollout` is the record until then."""

    def __init__(self, rollout: Rollout, wanted: int) -> None:
        super().__init__(f"interrupted after {len(rollout)} of {wanted} steps")
        self.rollout = rollout


@checks_option_names
def simulate(
    model: Model | Scenario | StrPath,
    controller: Controller[Any] | None = None,
    reference: Trajectory | ArrayLike | None = None,
    *,
    plant: str | ScenePlant = DEFAULT_ENGINE,
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
    friction_slip: float = 0.0,
    armature: Coefficients = False,
    effort_limits: Coefficients = False,
    position_limits: bool = False,
    payload: Payload | Sequence[Payload] | None = None,
    mass_scale: MassScale = 1.0,
    pushes: Push | Sequence[Push] = (),
    check_reference: bool = True,
    method: str = "DOP853",
    rtol: float = 1e-10,
    atol: float = 1e-12,
    resume: Rollout | None = None,
    step: int | None = None,
    progress: Progress | None = None,
) -> Rollout:
    """Simulate `model` under `controller` along `reference`, and return the record.

    The first argument may also be a robot's name or file, which `dynx.load` reads, or a `Scenario`, whose
    fields are the other arguments except `resume`, `step` and `progress`; beside it only those can be given.

    The plant and the controller can use different engines (``controller_backend`` replaces the controller's
    own), so that the effect of an error in one of them can be studied.

    **Plant.** ``plant="pybullet"`` is PyBullet's own stepper. Any other name is a backend whose forward
    dynamics an `integrator` of dynx integrates: ``semi_implicit`` (the default: v then q, the scheme of
    Bullet), ``rk4``, or ``adaptive`` (SciPy's `method` with `rtol`, `atol`). ``plant="pybullet",
    integrator="rk4"`` is PyBullet's forward dynamics under RK4. Without a controller (None) the robot has no
    motors. A `ScenePlant` is the robot in a scene, with contacts; the rollout then has `surroundings`.
    `reference` is a trajectory, one configuration (nq,) to hold, or None. The initial state is `q0`,
    `v0`; by default that of the scene, the start of the reference, or the neutral configuration.

    **Time** [s]. `dt` is the step of the record; the plant takes `substeps` steps in each. The controller
    runs every `control_dt` (by default `dt`), and its torque is held in between. It measures the state as it
    was `delay` earlier, or the initial state if that is before the start; `control_dt` and `delay` are
    multiples of `dt`. The default `duration` is that of the reference. It is rounded up to a multiple of
    `dt`; a reference that has ended before is held at its end.

    **Joints**, the same in every plant: `damping`, dry `friction` and `armature`, each True for those of the
    description, one number, one for each joint, or numbers by joint, ``{"elbow_joint": 0.5}``, where joints
    that are not named have none. Dry friction holds a joint at rest up to its magnitude and opposes the
    motion beyond (`dynx.sim.plants.friction_law`), at any step; with `friction_slip` [rad/s or m/s] above 0
    it is smoothed over that speed instead, so that loaded joints creep (`JointFriction`).
    `effort_limits`, True for the model's, saturate torques and are recorded; `position_limits` are inelastic
    stops (`Stops`); `pushes` are external wrenches.

    **Model error.** The plant has a `payload` and masses scaled by `mass_scale` (all links, or some) that the
    controller does not know; `noise` is added to the measurements.

    **Resuming.** With `resume` the first `step` steps (by default all) are taken from that record and the
    rest is computed, with the same result as one run, to the last bit. The record's scenario must be equal to
    this one in every field but `duration`. The controller must have no state but the one that it returns.

    **Long runs.** `progress` is called regularly with the number of steps taken and the total number. Ctrl-C
    raises RolloutInterrupted, which has the record until then in ``.rollout`` and can be resumed.

    Raises ArgumentError for a scenario that cannot be simulated, or that differs from the scenario of the
    record to resume; LimitError for a reference outside the limits of position and velocity (unless
    `check_reference` is False) or an effort limit of 0; DivergedError and ControlError in a step, with the
    record until then in ``error.rollout``.
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
