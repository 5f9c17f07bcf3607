"""`simulate`: one scenario from its start to its end."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, replace

from dynx.backends.registry import backend_class
from dynx.control.base import Controller
from dynx.errors import ArgumentError
from dynx.option_names import takes
from dynx.sim.record.rollout import Rollout
from dynx.sim.scenario.scenario import Scenario, ScenarioArguments
from dynx.sim.setup import require_duration
from dynx.sim.simulation import Progress, Simulation


class RolloutInterrupted(KeyboardInterrupt):
    """Interruption of a simulation by Ctrl-C; `rollout` is the record until then."""

    def __init__(self, rollout: Rollout, wanted: int) -> None:
        super().__init__(f"interrupted after {len(rollout)} of {wanted} steps")
        self.rollout = rollout


@dataclass(frozen=True, eq=False, repr=False)
class SimulateArguments(ScenarioArguments):
    """Arguments of `simulate`."""

    _: KW_ONLY
    controller_backend: str | None = None
    resume: Rollout | None = None
    step: int | None = None
    progress: Progress | None = None

    def scenario_on_backend(self) -> Scenario:
        """Return the scenario, whose controller computes on `controller_backend` if that is given."""
        if self.controller_backend is None or not isinstance(self.controller, Controller):
            return self.scenario()
        if isinstance(self.controller_backend, str):
            backend_class(self.controller_backend)
        return replace(self, controller=self.controller.on(self.controller_backend)).scenario()


@takes(SimulateArguments)
def simulate(given: SimulateArguments) -> Rollout:
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
    motion beyond (`dynx.rbd.joint_friction`), at any step; with `friction_slip` [rad/s or m/s] above 0
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
    if isinstance(given.model, Scenario) and given.controller_backend is not None:
        raise ArgumentError(
            "controller_backend is given in addition to a scenario, whose controller has a backend: change "
            "it by dataclasses.replace"
        )
    scenario = given.scenario_on_backend()
    require_duration(scenario)
    if given.step is not None and given.resume is None:
        raise ArgumentError("step is that of a rollout to resume, which is not given")
    with Simulation(scenario, progress=given.progress) as simulation:
        if given.resume is not None:
            simulation.take_over(given.resume, given.step)
        try:
            return simulation.run()
        except KeyboardInterrupt:
            raise RolloutInterrupted(simulation.rollout, simulation.n_steps or 0) from None
