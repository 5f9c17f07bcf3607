"""`simulate_batch`: many rollouts of one robot, in one kernel, on all processors.

A batch is divided into parts, which any thread or process can simulate from start to end. A store keeps the
outcomes of parts in a folder, from which a run that was killed continues: the file of a part is named by the
hash of its scenario and its inputs. A file is on the disk before it gets its name; one that is damaged or
incomplete counts as absent, and its part is computed again.
"""

from __future__ import annotations

import os
import pickle
import warnings
from collections.abc import Callable, Mapping
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from dataclasses import KW_ONLY, dataclass, replace
from functools import cached_property
from hashlib import sha256
from math import prod
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dynx.backends import backend
from dynx.backends.joint_friction import coefficients_by_joint, refuse_text
from dynx.backends.solvability import Solvability
from dynx.compiled.parametric import ParametricDynamics
from dynx.compiled.status import Status
from dynx.compiled.step import BoundSteps, CompiledStep, Stop
from dynx.errors import ArgumentError, GainError, ShapeError, shown
from dynx.files.arrays import read_arrays, write_arrays
from dynx.files.reading import checked_path
from dynx.files.writing import clear_unfinished
from dynx.model import Model
from dynx.model.configuration import checked_q
from dynx.model.numbers import MAX_INDEX, array_of, checked_array, real_array, whole_number
from dynx.sim.batch_rollouts import BatchRollouts
from dynx.sim.loop_step import PLACEHOLDER, ArrayDisturbances, LoopStep, gain_shapes, innermost
from dynx.sim.noise import Noise
from dynx.sim.plants.scene_plant import ScenePlant
from dynx.sim.scenario.options import COEFFICIENTS as COEFFICIENTS_KIND
from dynx.sim.scenario.options import FORMER_NAMES, OPTIONS, option, takes
from dynx.sim.scenario.scenario import Scenario, ScenarioArguments
from dynx.sim.setup import Setup, require_duration
from dynx.sim.step_completion import BallLaneStops, LaneStops, Settling
from dynx.simd.call_sequence import Integers
from dynx.simd.kernel import Kernel
from dynx.simd.machine import require_memory
from dynx.simd.threads import checked_threads
from dynx.spatial.scalar import Floats
from dynx.steppers.clock import Clock
from dynx.steppers.random import BLOCK_STEPS, Purpose, Streams
from dynx.trajectory.base import Setpoint


class PartOutcome(NamedTuple):
    """The outcome of `count` rollouts."""

    q: Floats  # (count, nq), at the end
    v: Floats  # (count, nv), at the end
    max_error: Floats  # (count, nv)
    rms_error: Floats  # (count, nv)
    diverged: Floats  # (count,), the number of the step that led to it, or -1
    q_record: Floats  # (count, kept, nq)
    v_record: Floats  # (count, kept, nv)
    tau_record: Floats  # (count, kept, nv)
    saturated: Floats  # (count, nv), the share of steps at the effort limit


BLOCK = 256
"""Number of steps whose calls are prepared together where no noise is drawn."""


class PartNoise(NamedTuple):
    """Noise of the measurements of a part, and random numbers of its controllers."""

    seed: int
    first: int
    """Number of the part's first rollout in the batch."""
    deviations: tuple[Floats, Floats] | None
    """Standard deviations (nv,) of q and v."""
    random_size: int


StepKernels = dict[tuple[bool, bool], Kernel]
"""Kernels by two conditions: the controller is evaluated, a push acts."""


@dataclass(frozen=True)
class BatchPart:
    """Inputs of a part as arrays and machine code, so that it can be sent to another process."""

    kernels: StepKernels
    clock: Clock
    start: dict[str, Floats]
    """Initial state as arrays (count, size): q and v, maximum error and sum of squared errors of each
    coordinate (``max_error``, ``squared_errors``), the number of steps before divergence (``sound_steps``),
    the controller state (``state``), and the number of steps at the effort limit (``steps_at_limit``)."""
    fixed: dict[str, Floats]
    """Constant inputs: parameters and gains (count, size), or (size,) where all rollouts share them."""
    setpoints: Setpoint
    """Setpoints of control steps: position (n_controls, nq), velocity and acceleration (n_controls, nv)."""
    references: Floats
    """Reference configuration after each step (n_steps, nq)."""
    wrenches: Floats
    """Wrenches of the pushes in each step (n_steps, 6 per push)."""
    pushed: list[bool]
    """Whether the kernel of each step has pushes."""
    noise: PartNoise | None
    record_every: int
    stops: LaneStops | BallLaneStops | None

    def __call__(self) -> PartOutcome:
        """Simulate the rollouts of the part."""
        return _RunBuffers(self).run()

    @cached_property
    def count(self) -> int:
        """Number of rollouts."""
        return len(self.start["q"])


class _RunBuffers:
    """Buffers of a part while it runs: the state is read from one set and written to the next.

    There are enough sets for the delay, so that delayed measurements need no copies. All sets start with the
    initial state, which is what the controller measures until the delay has passed.
    """

    def __init__(self, part: BatchPart) -> None:
        self._part = part
        self._kernels = list(part.kernels.values())
        self._variants = {variant: number for number, variant in enumerate(part.kernels)}
        # A kernel needs at least a full vector of samples, so the last rollout is repeated.
        self._rows = rows = max(part.count, *(kernel.image.lanes for kernel in self._kernels))
        self._delay = min(part.clock.delay_steps, part.clock.n_steps)
        sets = {name: self._delay + 2 if name in ("q", "v") else 2 for name in part.start}
        self._state = {
            name: np.repeat(self._padded(array)[None], sets[name], axis=0)
            for name, array in part.start.items()
        }
        sizes = {port.name: port.size for kernel in self._kernels for port in kernel.inputs + kernel.outputs}
        self._tau = np.zeros((1, rows, sizes["v"]))
        self._settling = Settling(rows, sizes.get("modes", 0))
        clock, setpoints = part.clock, part.setpoints
        controls = np.arange(clock.n_controls)
        held = np.minimum(clock.steps_per_control, clock.n_steps - controls * clock.steps_per_control)
        common = dict(zip(("q_wanted", "v_wanted", "a_wanted"), setpoints, strict=True))
        common |= {"t": clock.control_times(0)[:, None], "steps_held": held[:, None]}
        common |= {"q_reference": part.references, "wrenches": part.wrenches}
        self._common = {name: np.ascontiguousarray(array, np.float64) for name, array in common.items()}
        self._fixed = {
            name: array[None] if array.ndim == 1 else self._padded(array)[None]
            for name, array in part.fixed.items()
        }
        self._fixed |= {**self._settling.arrays, "tau": self._tau}
        # Nobody reads these outputs, so that all rollouts write the same row.
        self._fixed |= {name: np.zeros((1, sizes[name])) for name in ("a", "commanded") if name in sizes}
        self._drawn: dict[Purpose, Floats] = {}
        if part.noise is not None:
            self._stream = Streams(part.noise.seed)
            blocks, size = (rows, BLOCK_STEPS), part.noise.random_size
            if part.noise.deviations is not None:
                self._drawn[Purpose.MEASUREMENT] = np.zeros((*blocks, 2, sizes["v"]))
            if size:
                self._drawn[Purpose.CONTROLLER] = np.zeros((*blocks, size))
        self._records: tuple[list[Floats], list[Floats], list[Floats]] = ([], [], [])

    def run(self) -> PartOutcome:
        """Take all steps."""
        part, clock, n = self._part, self._part.clock, self._part.count
        every = part.record_every or clock.n_steps
        block = BLOCK if part.noise is None else BLOCK_STEPS * clock.steps_per_control
        for first in range(0, clock.n_steps, block):
            if part.noise is not None:
                self._draw(clock.control_number(first), part.noise)
            bound = self._bound(np.arange(first, min(first + block, clock.n_steps)))
            step = first
            while step < bound.end:
                end = min(bound.end, (step // every + 1) * every)
                stop = bound.run(step, end)
                if stop is not None:
                    self._finish(bound, stop)
                    end = stop.step + 1
                step = end
                if part.record_every and step % every == 0:
                    now = (self._now("q", step), self._now("v", step), self._tau[0])
                    for kept, array in zip(self._records, now, strict=True):
                        kept.append(array[:n].copy())
        last = {name: self._now(name, clock.n_steps)[:n] for name in self._state}
        q, v, tau = (
            np.stack(kept, axis=1) if kept else np.zeros((n, 0, array.shape[1]))
            for kept, array in zip(self._records, (last["q"], last["v"], self._tau[0]), strict=True)
        )
        return PartOutcome(
            q=last["q"].copy(),
            v=last["v"].copy(),
            max_error=last["max_error"].copy(),
            rms_error=np.sqrt(last["squared_errors"] / clock.n_steps),
            # In a rollout that diverged in step k the number of steps before divergence is -1 - k.
            diverged=np.maximum(-1.0 - last["sound_steps"][:, 0], -1.0),
            q_record=q,
            v_record=v,
            tau_record=tau,
            saturated=last["steps_at_limit"] / clock.n_steps
            if "steps_at_limit" in last
            else np.zeros((n, self._tau.shape[2])),
        )

    def _now(self, name: str, step: int) -> Floats:
        """Return a part of the state before a step, of all rollouts."""
        array = self._state[name]
        return np.asarray(array[step % len(array)])

    def _bound(self, steps: Integers) -> BoundSteps:
        """Return the calls for the next steps."""
        part, clock = self._part, self._part.clock
        control, zeros = clock.control_number(steps), np.broadcast_to(np.int64(0), steps.shape)
        rows = {name: (array, zeros) for name, array in self._fixed.items()}
        rows |= {name: (array, steps % len(array)) for name, array in self._state.items()}
        written = {name: (array, (steps + 1) % len(array)) for name, array in self._state.items()}
        for name in ("q", "v"):
            array = self._state[name]
            rows[f"{name}_measured"] = array, (steps - self._delay) % len(array)
        of_steps = ("q_reference", "wrenches")
        rows |= {
            name: (array, steps if name in of_steps else control) for name, array in self._common.items()
        }
        for purpose, drawn in self._drawn.items():
            by_step = drawn.swapaxes(0, 1)
            if purpose is Purpose.CONTROLLER:
                rows["random"] = by_step, control % BLOCK_STEPS
            else:
                rows["noise_q"], rows["noise_v"] = (
                    (by_step[:, :, half], control % BLOCK_STEPS) for half in range(2)
                )
        chosen = [
            self._variants[bool(clock.is_control_step(step)), part.pushed[step]] for step in steps.tolist()
        ]
        return BoundSteps(
            self._kernels,
            np.array(chosen),
            rows,
            written,
            first=int(steps[0]),
            lanes=self._rows,
            # A rollout that diverged does not stop the others.
            bound=Status.TORQUE | Status.DIVERGED,
        )

    def _finish(self, bound: BoundSteps, stop: Stop) -> None:
        """Complete a step in which modes of dry friction are not settled, or joints passed limits."""
        step, stops = stop.step, self._part.stops
        self._settling(bound, step, self._kernels[0].image.lanes)
        status = self._settling.arrays["status"][0, :, 0].astype(np.int64)
        rows = np.flatnonzero(status & Status.AT_LIMIT)
        if stops is not None and len(rows):
            before, now = ({name: self._now(name, k) for name in self._state} for k in (step, step + 1))
            fixed = {
                name: np.broadcast_to(array, (1, self._rows, array.shape[-1]))[0]
                for name, array in self._fixed.items()
            }
            stops(rows, before, now, fixed, self._part.references[step])

    def _draw(self, number: int, noise: PartNoise) -> None:
        """Draw noise and random numbers for a block of control steps."""
        left = self._part.clock.n_controls - number
        for purpose, drawn in self._drawn.items():
            for row in range(self._part.count):
                self._stream.normal(purpose, noise.first + row, number // BLOCK_STEPS, drawn[row, :left])
        if noise.deviations is not None:
            drawn = self._drawn[Purpose.MEASUREMENT]
            np.multiply(drawn, np.array(noise.deviations), out=drawn)

    def _padded(self, array: Floats) -> Floats:
        rows = np.minimum(np.arange(self._rows), len(array) - 1)
        return np.ascontiguousarray(array[rows], dtype=np.float64)


class OutcomeStore:
    """Folder of outcomes; runs with different arguments may share it."""

    def __init__(self, folder: str | os.PathLike[str], scenario: Scenario) -> None:
        """Raises ArgumentError if the folder cannot be made or written."""
        self._folder = Path(checked_path(folder, "keep"))
        self._scenario = scenario.with_defaults().to_json()
        self._failures: list[ArgumentError] = []
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except (OSError, ValueError) as error:
            raise ArgumentError(f"keep is {shown(folder)}, where no folder can be made: {error}") from error
        if not os.access(self._folder, os.W_OK | os.X_OK):
            raise ArgumentError(f"keep is {shown(folder)}, a folder that may not be written")
        clear_unfinished(self._folder)

    def read(self, part: BatchPart) -> PartOutcome | None:
        """Return the outcome of a part, or None if it is not stored, incomplete or damaged."""
        count, nq, nv = part.count, part.start["q"].shape[1], part.start["v"].shape[1]
        kept = part.clock.n_steps // part.record_every if part.record_every else 0
        shapes: dict[str, tuple[int, ...]] = {"q": (count, nq), "diverged": (count,)}
        shapes |= dict.fromkeys(("v", "max_error", "rms_error", "saturated"), (count, nv))
        shapes |= {"q_record": (count, kept, nq)}
        shapes |= dict.fromkeys(("v_record", "tau_record"), (count, kept, nv))
        try:
            file = read_arrays(self._path(part), "a part of a batch")
            return PartOutcome(**{name: file.array(name, shape) for name, shape in shapes.items()})
        except ArgumentError:
            return None

    def write(self, part: BatchPart, outcome: PartOutcome) -> None:
        """Store the outcome on the disk. Where it cannot be written, that is noted, because the outcome is
        still valid."""
        try:
            write_arrays(self._path(part), outcome._asdict())
        except ArgumentError as error:
            self._failures.append(error)

    def warn_of_failures(self) -> None:
        """Warn if outcomes could not be written, with the first reason."""
        if self._failures:
            message = (
                f"{len(self._failures)} parts of the batch could not be stored; a run that is started again "
                f"computes them again: {self._failures[0]}"
            )
            warnings.warn(message, RuntimeWarning, stacklevel=3)

    def _path(self, part: BatchPart) -> Path:
        digest = sha256(self._scenario.encode())
        # The key has what a kernel computes and not its machine code, which differs between processors.
        arrays = (part.start, part.fixed, tuple(part.setpoints), part.references, part.wrenches, part.noise)
        code = [(which, kernel.image) for which, kernel in sorted(part.kernels.items())]
        digest.update(pickle.dumps((part.record_every, arrays, code), protocol=4))
        return self._folder / f"{digest.hexdigest()[:32]}.npz"


COEFFICIENTS = tuple(name for name, each in OPTIONS.items() if each.rows and each.kind is COEFFICIENTS_KIND)
"""Coefficients of joints that may have one row for each rollout."""

PER_ROLLOUT = tuple(name for name, each in OPTIONS.items() if each.rows)
"""Fields of a scenario that may have one row for each rollout of a batch."""


def split_rows(given: ScenarioArguments) -> tuple[Scenario, dict[str, Any]]:
    """Return the scenario that all rollouts share, and the arguments with a row for each rollout, by name.

    If a scenario is given instead of a model, arguments of `PER_ROLLOUT` replace its fields.
    """
    own = {name: getattr(given, name) for name in PER_ROLLOUT}
    own = {name: value for name, value in own.items() if value is not OPTIONS[name].default}
    scenario = given.scenario(PER_ROLLOUT)
    own |= {
        name: coefficients_by_joint(scenario.model, name, own[name]) for name in COEFFICIENTS if name in own
    }
    joints = joints_of(scenario.model)
    rows = {name: value for name, value in own.items() if _has_rows(name, value, joints)}
    return replace(scenario, **{name: own[name] for name in own if name not in rows}), rows


def joints_of(model: Model) -> int:
    """Return the number of coordinates of the joints in v."""
    return model.nv - (6 if model.floating else 0)


def _has_rows(name: str, value: Any, joints: int) -> bool:
    try:
        shape = array_of(name, value).shape
    except ShapeError:
        # Lists of different lengths are refused with the scenario.
        return False
    return len(shape) > 1 or (name in COEFFICIENTS and len(shape) == 1 and shape != (joints,))


def coefficient_rows(name: str, values: ArrayLike, joints: int) -> Floats:
    """Return the coefficients of each rollout (n, joints), from one number or one for each joint per rollout.
    Raises GainError for invalid coefficients."""
    refuse_text(name, values, joints)
    array = real_array(name, values)
    rows = array[:, None] if array.ndim == 1 else array
    if rows.ndim != 2 or rows.shape[1] not in (1, joints):
        raise GainError(
            f"{name} has shape {array.shape}; wanted one number, {joints} for the joints, "
            f"or for each rollout: (n,), (n, 1) or (n, {joints})"
        )
    if not np.isfinite(rows).all() or (rows < 0.0).any():
        raise GainError(f"{name} has entries that are negative or not finite")
    return np.ascontiguousarray(np.broadcast_to(rows, (len(rows), joints)))


def refuse_ambiguous(given: ScenarioArguments, joints: int, n: int) -> None:
    """Raise ArgumentError for coefficients in `given` that fit n joints as well as n rollouts."""
    for name in COEFFICIENTS:
        if n == joints > 1 and np.shape(getattr(given, name)) == (n,):
            raise ArgumentError(
                f"{name} has {n} numbers, and there are {n} joints and {n} rollouts: write it as (1, {n}) "
                f"for the joints or as ({n}, 1) for the rollouts"
            )


class RolloutRows:
    """Checks of arrays with one row for each rollout, which determine the number of rollouts."""

    def __init__(self, asked: int | None) -> None:
        self._asked = None if asked is None else whole_number("rollouts", asked, 1)
        self._by = "rollouts"

    @property
    def count(self) -> int:
        """Number of rollouts; 1 where no argument has several rows."""
        return 1 if self._asked is None else self._asked

    def of(self, name: str, values: ArrayLike, size: int, *, spread: bool = False) -> Floats:
        """Return `values` as a finite array (size,) or (n, size); with `spread`, one column holds for all."""
        array = real_array(name, values) if spread else checked_array(name, values, size)
        if spread and array.ndim and array.shape[-1] == 1:
            array = np.broadcast_to(array, (*array.shape[:-1], size))
        array = checked_array(name, array, size)
        if array.ndim > 2:
            raise ArgumentError(f"{name} has shape {array.shape}; wanted ({size},) or one such row a rollout")
        if array.ndim == 2 and len(array) != 1:
            if self._asked is not None and len(array) != self._asked:
                raise ArgumentError(f"{name} has {len(array)} rows, {self._by} says {self._asked}")
            self._asked, self._by = len(array), name
            if not len(array):
                raise ArgumentError(f"{name} has no rows: there would be no rollouts")
        return array

    def spread(self, array: Floats) -> Floats:
        """Return `array` with one row for each rollout (n, size)."""
        return np.array(np.broadcast_to(array, (self.count, array.shape[-1])))


def columns_of(name: str, values: ArrayLike) -> Floats:
    """Return an array (n,) as a column (n, 1); an array (n, size) stays as it is."""
    array = real_array(name, values)
    return array[:, None] if array.ndim == 1 else array


MASS_MATRICES = 1024
"""Number of rollouts whose mass matrices are in memory at a time."""


def refuse_small_slips(
    acting: ArrayDisturbances,
    parametric: ParametricDynamics | None,
    h: float,
    q: Floats,
    rows: Mapping[str, Floats],
) -> None:
    """Raise ArgumentError for a slip speed too small for steps of `h` [s] in any rollout.

    `q` (nq,) or (n, nq) is where rollouts start; `rows` are the inputs of the kernel that do not change
    during a rollout, (size,) or (n, size).
    """
    model, slip = acting.model, acting.joint_friction.slip
    if not slip or not (acting.joint_friction.present or (parametric and parametric.has_joint_dynamics)):
        return
    inputs = ("joint_friction", "joint_armature", "parameters")
    given = {"q": q, **{name: rows[name] for name in inputs if name in rows}}
    from dynx.steppers.stability import refuse_unstable_slip

    spread = {name: np.atleast_2d(array) for name, array in given.items()}
    n = max(map(len, spread.values()))
    with backend("reference", model, validate=False) as engine:
        for first in range(0, n, MASS_MATRICES):
            part = {
                name: each[first : first + MASS_MATRICES] for name, each in spread.items() if len(each) > 1
            }
            here = {**spread, **part}
            dry, armature = _coefficients(acting, here)
            if parametric is None:
                M = engine.mass_matrix(here["q"])
            else:
                M = parametric.mass_matrix(here["q"], here["parameters"])
                dry = dry + parametric.dry_friction(here["parameters"])
            M, dry = M + armature, np.broadcast_to(dry, (max(len(M), len(dry)), model.nv))
            refuse_unstable_slip(model, slip, h, M, dry, first=first if n > 1 else None)


def _coefficients(acting: ArrayDisturbances, rows: Mapping[str, Floats]) -> tuple[Floats, Floats]:
    """Return dry friction (n, nv) and the armature matrices (n, nv, nv) of rollouts."""
    own = acting.joint_friction
    friction, armature = (
        np.array([_in_place(constant, row) for row in rows[name]]) if name in rows else constant[None]
        for name, constant in (("joint_friction", own.friction), ("joint_armature", acting.armature))
    )
    dry = np.array([own.dry_for(row) for row in friction])
    return dry, armature[:, :, None] * np.eye(acting.model.nv)


def _in_place(constant: Floats, row: Floats) -> Floats:
    """Replace placeholders, which are not zero, by the coefficients of a rollout."""
    found = np.zeros(len(constant))
    found[np.flatnonzero(constant)] = row
    return found


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


@takes(BatchArguments, FORMER_NAMES, external_forces="pushes", forces="pushes")
def simulate_batch(given: BatchArguments) -> BatchRollouts:
    """Simulate many rollouts of `model` under `controller` along `reference`, by semi-implicit Euler.

    dynx compiles controller, dynamics and integrator into one kernel, in which each lane of a vector computes
    one rollout. These arguments may have one row for each rollout:

    - `parameters` (n, p) of `parametric`, a `dynx.parametric` of the model: payloads, inertias, damping, dry
      friction and armature that the controller does not know
    - `gains`: arrays (n,) or (n, size) by the name of a gain, such as ``{"kp": ...}``. A gain of your own
      controller is a public attribute that is a number or an array of numbers
    - `joint_damping`, `joint_friction`, `joint_armature`: arrays (n,), (n, 1) or (n, joints), or numbers (n,)
      by joint, such as ``{"elbow_joint": [0.1, 0.2]}``. A number, numbers (joints,) or True hold for all
      rollouts, as in `simulate`. With True, the default, values in `parameters` replace those of the
      description
    - `q0` (n, nq), `v0` (n, nv); one row holds for all rollouts. By default the rollouts begin at the start
      of the reference. If only `q0` is given, they begin at rest
    - `noise` of the measurements: rollout k has the noise of ``simulate`` with ``Noise(..., rollout=k)``

    `rollouts` is the number n of rollouts. Give it if no argument has n rows. All other options are those of
    `simulate`. dynx refuses `substeps`, and every `integrator` except semi-implicit Euler. With a payload or
    scaled masses, make `parametric` from ``plant_model(model, payload, mass_scale)``. With `record_every` = k
    the batch records every k-th state.

    The first argument may also be a robot's name or file, or a `Scenario` on the plant ``compiled``. Together
    with a scenario you can give only arguments that may differ between rollouts. `BatchRollouts.scenario` is
    the scenario that all rollouts share.

    dynx divides the batch into parts. They run on `threads` threads (None: one per processor), or in an
    `executor` of `concurrent.futures`, such as one of processes or of a cluster. The results are the same bit
    for bit. dynx stores each finished part in the folder `keep`. If you start a run again with the same
    arguments, it continues from there. If dynx cannot store a part, for example because the disk is full, the
    part is still in the result, and a RuntimeWarning names the reason. Ctrl-C raises BatchInterrupted, which
    has the finished rollouts. `progress` is called after each part.

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
    rubbing = isinstance(parametric, ParametricDynamics) and parametric.has_joint_dynamics
    if rubbing:
        # The parameters have those of the description as defaults; they count once.
        own_joints = (name for name in COEFFICIENTS if getattr(scenario, name) is True and name not in varied)
        stand_ins |= {"joint_springs": False, **dict.fromkeys(own_joints, False)}
    setup = Setup.of(replace(scenario, **stand_ins), ("joint_friction",) if rubbing else ())
    recorded = scenario.for_record()
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
    whole_number("record_every", record_every, 0, MAX_INDEX)
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
        scenario.joint_limits,
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
    stops = LaneStops.of(step) if scenario.joint_limits else None
    references = setup.setpoint_of(clock.times()[1:]).q
    setpoints = Setpoint(*setup.setpoint_of(clock.control_times(controller.lead)))
    parts = [
        BatchPart(
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
    store = None if keep is None else OutcomeStore(keep, scenario)
    done: dict[int, PartOutcome] = {}

    def outcome() -> BatchRollouts:
        return _batch_rollouts(
            recorded, clock, parts, done, record_every, own_parameters=parameters is not None
        )

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
            raise ArgumentError(f"{name} is {shown(value)}; a batch takes only {shown(possible[0])}")
    if scenario.sensors != ():
        raise ArgumentError(
            "sensors were given, and a batch records no accelerations: simulate(..., noise=Noise(rollout=k)) "
            "has the readings of its rollout k"
        )
    for name in ("controller", "reference"):
        if getattr(scenario, name) is None:
            why = {
                "controller": "; control.PD(model, kp=0.0, kd=0.0) applies no torque",
                "reference": ", also with needs_setpoint = False: errors are measured from it (such as "
                "model.neutral())",
            }
            raise ArgumentError(f"{name} is None; a batch needs one{why[name]}")
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
    parts: list[BatchPart],
    done: dict[int, PartOutcome],
    threads: int,
    executor: Executor | None,
    store: OutcomeStore | None,
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
    scenario: Scenario,
    clock: Clock,
    parts: list[BatchPart],
    done: dict[int, PartOutcome],
    record_every: int,
    *,
    own_parameters: bool,
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
    return BatchRollouts(scenario, done=finished, t=times, own_parameters=own_parameters, **found)
