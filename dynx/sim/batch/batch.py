"""`simulate_batch`: many rollouts of one robot, in fused kernels, on all processors."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from dataclasses import KW_ONLY, dataclass, replace
from math import prod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.backends.solvability import Solvability
from dynx.compiled.parametric import ParametricDynamics
from dynx.compiled.step import CompiledStep
from dynx.errors import ArgumentError, shown
from dynx.model.configuration import checked_q
from dynx.model.numbers import whole_number
from dynx.option_names import takes
from dynx.sim.batch.part import Part, PartNoise, PartOutcome, StepKernels
from dynx.sim.batch.rollouts import BatchRollouts
from dynx.sim.batch.rows import (
    COEFFICIENTS,
    RolloutRows,
    coefficient_rows,
    columns_of,
    joints_of,
    refuse_ambiguous,
    split_rows,
)
from dynx.sim.batch.slip_bounds import refuse_small_slips
from dynx.sim.batch.store import Store
from dynx.sim.loop.noise import Noise
from dynx.sim.loop_step import PLACEHOLDER, ArrayDisturbances, LoopStep, gain_shapes, innermost
from dynx.sim.plants.scene_plant import ScenePlant
from dynx.sim.scenario.options import OPTIONS, option
from dynx.sim.scenario.scenario import Scenario, ScenarioArguments
from dynx.sim.setup import Setup, require_duration
from dynx.sim.step_completion import LaneStops
from dynx.simd.machine import require_memory
from dynx.simd.threads import checked_threads
from dynx.spatial.scalar import Floats
from dynx.steppers.clock import Clock
from dynx.trajectory.base import Setpoint

PLANT = "compiled"
"""Name of the plant of `dynx.simulate` whose results a batch gives."""

PART = 1024
"""Number of rollouts in one part: small enough that their state stays in the processor's caches, and large
enough that starting a call costs little. Results do not depend on it."""

Progress = Callable[[int, int], object]
"""Called with the number of finished rollouts and the total number."""


class BatchInterrupted(KeyboardInterrupt):
    """Interruption of a batch by Ctrl-C; `rollouts` has the finished ones."""

    def __init__(self, rollouts: BatchRollouts) -> None:
        super().__init__(f"interrupted with {int(np.sum(rollouts.done))} of {len(rollouts)} rollouts done")
        self.rollouts = rollouts


@dataclass(frozen=True, eq=False, repr=False)
class BatchArguments(ScenarioArguments):
    """Arguments of `simulate_batch`."""

    _: KW_ONLY
    plant: str | ScenePlant = option(
        PLANT,
        "Plant that moves the robots; another one is refused",
        kind=OPTIONS["plant"].kind,
        group=OPTIONS["plant"].group,
    )
    rollouts: int | None = None
    parametric: ParametricDynamics | None = None
    parameters: ArrayLike | None = None
    gains: Mapping[str, ArrayLike] | None = None
    record_every: int = 0
    threads: int | None = None
    executor: Executor | None = None
    keep: str | os.PathLike[str] | None = None
    progress: Progress | None = None


@takes(BatchArguments)
def simulate_batch(given: BatchArguments) -> BatchRollouts:
    """Simulate many rollouts of `model` under `controller` along `reference`, by semi-implicit Euler.

    Controller, dynamics and integrator are compiled into one kernel, with one rollout in each vector lane.
    These arguments may have one row for each rollout:

    - `parameters` (n, p) of `parametric`, a `dynx.parametric` of the model: payloads, inertias, damping, dry
      friction and armature that the controller does not know
    - `gains`: arrays (n,) or (n, size) by the name of a gain of the controller, as ``{"kp": ...}``; of a
      controller of your own by the name of a public attribute that is a number or an array of numbers
    - `damping`, `friction`, `armature` (n,), (n, 1) or (n, joints); a number, numbers (joints,) or True hold
      for all rollouts, as in `simulate`; numbers by joint can be (n,), ``{"elbow_joint": [0.1, 0.2]}``
    - `q0` (n, nq), `v0` (n, nv); one row holds for all rollouts. The default is the start of the reference,
      and rest if `q0` is given
    - `noise` of the measurements: rollout k has the noise of ``simulate`` with ``Noise(..., rollout=k)``

    `rollouts` is the number n of rollouts; it is needed if no argument has n rows. All other options are
    those of `simulate`; an `integrator` other than semi-implicit Euler and `substeps` are refused. With a
    payload or scaled masses, `parametric` has to be made from ``plant_model(model, payload, mass_scale)``.
    With `record_every` = k every k-th state is recorded.

    The first argument may also be a robot's name or file, or a `Scenario` on the plant ``compiled``; beside
    a scenario only arguments that may differ between rollouts can be given. `BatchRollouts.scenario` is the
    scenario that all rollouts share.

    The batch is divided into parts, which run on `threads` threads (None: one per processor) or in any
    `concurrent.futures` `executor`, such as one of processes or of a cluster; results are the same bit for
    bit. `keep` is a folder in which each finished part is stored; a run that is started again with the same
    arguments continues from there. A part that cannot be stored, for example because the disk is full, is
    still in the result, and a RuntimeWarning names the reason. Ctrl-C raises BatchInterrupted, which has the
    finished rollouts. `progress` is called after each part.

    Raises ArgumentError, GainError, LimitError, SingularMassMatrixError as `simulate` does, and
    UnsupportedFeatureError for controllers that branch on their measurement. A rollout that diverges does not
    stop the others: `BatchRollouts.diverged` has the time of the step that led to it.
    """
    rollouts, parametric, parameters, gains = given.rollouts, given.parametric, given.parameters, given.gains
    record_every, executor, keep, progress = given.record_every, given.executor, given.keep, given.progress
    scenario, own = split_rows(given)
    refuse_uncompiled(scenario)
    joints = joints_of(scenario.model)
    varied = {name: coefficient_rows(name, own[name], joints) for name in COEFFICIENTS if name in own}
    stand_ins: dict[str, Any] = dict.fromkeys(varied, PLACEHOLDER)
    if "q0" in own:
        stand_ins["q0"] = scenario.model.neutral()
    setup = Setup.of(replace(scenario, **stand_ins))
    controller, moved, clock = setup.controller, setup.model, setup.clock
    limit = setup.limit
    assert controller is not None
    assert setup.setpoint_of is not None
    if parametric is not None and not isinstance(parametric, ParametricDynamics):
        kind = type(parametric).__name__
        raise ArgumentError(f"parametric is of type {kind}; wanted dynx.parametric of a model")
    if parametric is not None and parametric.model != moved:
        wanted = scenario.model.name
        if moved is not scenario.model:
            wanted += ", with its payload and scaled masses (`plant_model`)"
        raise ArgumentError(
            f"parametric is one of {parametric.model.name}; wanted dynx.parametric of {wanted}"
        )
    if parameters is not None and parametric is None:
        raise ArgumentError("parameters were given without the model that they are of: dynx.parametric(...)")
    if gains is not None and not isinstance(gains, Mapping):
        raise ArgumentError(
            f"gains is {shown(gains)}; wanted a mapping from names, as in {{'kp': [100, 200]}}"
        )
    whole_number("record_every", record_every, 0)
    if executor is not None and not isinstance(executor, Executor) and not hasattr(executor, "submit"):
        raise ArgumentError(
            f"executor is {shown(executor)}; wanted one of concurrent.futures, such as ThreadPoolExecutor(4)"
        )
    if progress is not None and not callable(progress):
        raise ArgumentError(f"progress is {shown(progress)}; wanted a function of two numbers of rollouts")
    acting = ArrayDisturbances.of(moved, setup.disturbances, varied)
    if parametric is None and not acting.armature.any():
        Solvability(moved).refuse_singular(False)
    delayed = clock.delay_steps > 0
    noise = scenario.noise or Noise()
    random_size, noisy = controller.random_size, noise.on_measurements(moved.nv)
    deviations = noise.deviations(moved.nv) if noisy else None
    step = LoopStep(
        moved,
        controller,
        clock.dt,
        tuple(gains or ()),
        parametric,
        noisy,
        delayed,
        limit,
        scenario.position_limits,
        acting,
    )
    rows = RolloutRows(rollouts)
    q, v = setup.start
    start = {
        "q": rows.of("q0", checked_q(moved, own["q0"], "q0") if "q0" in own else q, moved.nq),
        "v": rows.of("v0", own.get("v0", v), moved.nv),
    }
    fixed: dict[str, Floats] = {
        name: rows.of(name, values, values.shape[1]) for name, values in varied.items()
    }
    if parametric is not None:
        chosen = parametric.parameters.defaults if parameters is None else parameters
        fixed["parameters"] = rows.of("parameters", chosen, len(parametric.parameters.names))
    refuse_small_slips(acting, parametric, clock.dt, start["q"], fixed)
    for name, values in (gains or {}).items():
        size = prod(gain_shapes(innermost(controller))[name])
        fixed[step.gain_input(name)] = rows.of(name, columns_of(name, values), size, spread=True)
    n = rows.count
    refuse_ambiguous(given, joints, n)
    kept = clock.n_steps // record_every if record_every else 0
    require_memory(f"{n} rollouts", 8 * n * (kept + 4) * (moved.nq + 4 * moved.nv))
    start = {name: rows.spread(array) for name, array in start.items()}
    fixed = step.gain_values() | {name: rows.spread(array) for name, array in fixed.items()}
    state = controller.initial_state()
    zeros = np.zeros((n, moved.nv))
    start |= {"max_error": zeros, "squared_errors": zeros, "sound_steps": np.zeros((n, 1))}
    if limit is not None:
        start["steps_at_limit"] = zeros
    if state is not None:
        start["state"] = np.tile(state, (n, 1))
    wrenches = np.zeros((clock.n_steps, 0))
    if acting.pushes:
        wrenches = acting.wrenches(clock.dt, np.arange(clock.n_steps))
    pushed = step.pushed_steps(wrenches).tolist()
    kernels = _step_kernels(step, clock, pushed)
    stops = LaneStops.of(step) if scenario.position_limits else None
    references = setup.setpoint_of(clock.times()[1:]).q
    setpoints = Setpoint(*setup.setpoint_of(clock.control_times(controller.lead)))
    parts = [
        Part(
            kernels,
            clock,
            {name: array[first : first + PART] for name, array in start.items()},
            {
                name: array if array.ndim == 1 else array[first : first + PART]
                for name, array in fixed.items()
            },
            setpoints,
            references,
            wrenches,
            pushed,
            PartNoise(noise.seed, noise.rollout + first, deviations, random_size)
            if noisy or random_size
            else None,
            record_every,
            stops,
        )
        for first in range(0, n, PART)
    ]
    store = None if keep is None else Store(keep, scenario)
    done: dict[int, PartOutcome] = {}

    def outcome() -> BatchRollouts:
        return _batch_rollouts(scenario, clock, parts, done, record_every)

    try:
        _run_parts(parts, done, checked_threads(given.threads), executor, store, progress, n)
    except KeyboardInterrupt:
        raise BatchInterrupted(outcome()) from None
    finally:
        if store is not None:
            store.warn_of_failures()
    return outcome()


def refuse_uncompiled(scenario: Scenario) -> None:
    """Raise ArgumentError for a scenario with an option that a batch does not have."""
    for name, possible in (
        ("plant", (PLANT,)),
        ("integrator", ("semi_implicit", None)),
        ("substeps", (1,)),
    ):
        value = getattr(scenario, name)
        if value not in possible:
            raise ArgumentError(f"{name} is {shown(value)}; in a batch it is {shown(possible[0])}")
    for name in ("controller", "reference"):
        if getattr(scenario, name) is None:
            raise ArgumentError(f"{name} is None; a batch needs one")
    require_duration(scenario)


def _step_kernels(step: LoopStep, clock: Clock, pushed: list[bool]) -> StepKernels:
    """Return the kernels of a step with and without controller and pushes, for combinations that occur.

    Raises UnsupportedFeatureError for a controller that cannot be compiled.
    """
    controlled = clock.is_control_step(np.arange(clock.n_steps))
    kinds = set(zip(controlled.tolist(), pushed, strict=True))
    compiled = CompiledStep(step.text)
    return {variant: compiled.kernel(variant) for variant in sorted(kinds)}


def _run_parts(
    parts: list[Part],
    done: dict[int, PartOutcome],
    threads: int,
    executor: Executor | None,
    store: Store | None,
    progress: Progress | None,
    n: int,
) -> None:
    """Run all parts that are not stored yet; `done` is filled as they finish."""

    def finished(number: int, outcome: PartOutcome, *, stored: bool = False) -> None:
        done[number] = outcome
        if store is not None and not stored:
            store.write(parts[number], outcome)
        if progress is not None:
            progress(sum(parts[k].count for k in done), n)

    left = []
    for number, part in enumerate(parts):
        kept = None if store is None else store.read(part)
        if kept is None:
            left.append(number)
        else:
            finished(number, kept, stored=True)
    pool = ThreadPoolExecutor(threads, thread_name_prefix="dynx batch") if executor is None else executor
    futures: dict[Future[PartOutcome], int] = {}
    try:
        for number in left:
            futures[pool.submit(parts[number])] = number
        waiting = set(futures)
        while waiting:
            ended, waiting = wait(waiting, timeout=0.5, return_when=FIRST_COMPLETED)
            for future in ended:
                finished(futures[future], future.result())
    finally:
        for future in futures:
            future.cancel()
        if executor is None:
            pool.shutdown(wait=True, cancel_futures=True)
        for future, number in futures.items():
            if number not in done and future.done() and not future.cancelled() and not future.exception():
                finished(number, future.result())


def _batch_rollouts(
    scenario: Scenario, clock: Clock, parts: list[Part], done: dict[int, PartOutcome], record_every: int
) -> BatchRollouts:
    kept = clock.n_steps // record_every if record_every else 0
    nq, nv = scenario.model.nq, scenario.model.nv

    def nothing(count: int) -> PartOutcome:
        q, row = np.full((count, nq), np.nan), np.full((count, nv), np.nan)
        undone = np.full(count, -1.0)
        q_record, record = np.full((count, kept, nq), np.nan), np.full((count, kept, nv), np.nan)
        return PartOutcome(q, row, row, row, undone, q_record, record, record, row)

    outcomes = [done.get(number, nothing(part.count)) for number, part in enumerate(parts)]
    whole = PartOutcome(*(np.concatenate(arrays) for arrays in zip(*outcomes, strict=True)))
    finished = np.concatenate([np.full(part.count, k in done) for k, part in enumerate(parts)])
    diverged = np.where(whole.diverged < 0, np.nan, whole.diverged * clock.dt)
    times = clock.times()[record_every::record_every] if record_every else np.zeros(0)
    found = {**whole._asdict(), "diverged": diverged}
    return BatchRollouts(scenario, done=finished, t=times, **found)
