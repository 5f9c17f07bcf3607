"""A control step of a `GroundTask` in compiled kernels: motors and contacts, then the task.

One kernel takes all `substeps` of the robot with its motors and contacts (`dynx.rbd.contact_step`). Another
one evaluates the task (`dynx.envs.task_step`). Both have one environment in each lane. Where a joint reaches
a stop in a lane, the lane takes the control step again, one step of the robot at a time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dynx.backends.solvability import Solvability
from dynx.compiled.contact_step import refuse_other_joints, shapes_on_plane
from dynx.compiled.simplification import simplify_mechanism
from dynx.compiled.step import StepText, compiled
from dynx.envs.ground_task import GroundState, GroundTask
from dynx.envs.library import Space
from dynx.envs.stops import LimitWatch, StopsText
from dynx.envs.task import DESCRIBED, JointOptions, RobotTask, State
from dynx.envs.task_step import TaskLanes, TaskStep
from dynx.envs.variation import VariedGround
from dynx.errors import UnsupportedFeatureError
from dynx.model import Model
from dynx.rbd.base_parameters import regroup_inertias
from dynx.rbd.contact_step import ServoJoints, ShapesOnPlane, Sweeps, contact_step
from dynx.simd.call_sequence import CallSequence, StridedRows
from dynx.simd.kernel import Kernel
from dynx.simd.target import host
from dynx.simd.threads import run_parts
from dynx.simd.user_code.arrays import symbol_array, traced_array
from dynx.spatial.scalar import Array, Floats, maximum, minimum
from dynx.steppers.layout import Layout, RobotLayout
from dynx.world.preparation import prepare

SWEEPS = Sweeps(tolerance=1e-5, most=60)
"""When the sweeps of a step end [m/s] of a robot with one point on each body. Residuals of several points on
a body would reach 0.1 m/s with these; a robot with such points has those of `Sweeps.of_points`."""

CHUNK = 256
"""Number of environments that a thread takes at a time. Their arrays fit into the second-level cache."""

MAX_POINTS = 16
"""Largest number of points at which a robot may touch the ground. Code and time of a kernel grow with it."""


class ContactMemory(NamedTuple):
    """Numbers that kernels keep of the contacts."""

    impulses: Array
    """Impulses (m,) of the last step of the robot."""
    residual: Array
    """Largest residual (1,) [m/s] in this control step."""
    sums: Array
    """Sums (3 n,) of the impulses [N s] on each of the `contact_links` in this control step: along the normal
    and the tangents of the ground."""
    forces: Array
    """Mean forces (3 n,) [N] on them in the last control step, in world axes."""


class GroundMotion(RobotTask):
    """A `GroundTask` as the text of a kernel calls it. Its memory begins with `ContactMemory`."""

    hook_names = {  # noqa: RUF012  (declared by `RobotTask`)
        "start": "initial_state",
        "torque": "targets",
        "settle": "remember",
        "reward": "terms",
        "terminated": "is_over",
        "observation": "observe",
    }

    def __init__(self, task: GroundTask, contacts: GroundContacts) -> None:
        self.task = task
        forces = 3 * len(task.contact_links)
        self._sizes = (contacts.impulses, 1, forces, forces)
        for name in ("control_dt", "substeps", "random_size", "max_episode_steps", "reward_threshold"):
            setattr(self, name, getattr(task, name))

    @property
    def described(self) -> GroundTask:
        """The task that the user wrote."""
        return self.task

    @property
    def model(self) -> Model:
        """The robot."""
        return self.task.model

    @property
    def observation_space(self) -> Space[Any]:
        """Space of the observations."""
        return self.task.observation_space

    @property
    def action_space(self) -> Space[Any]:
        """Space of the actions."""
        return self.task.action_space

    def own_state(self, state: State) -> GroundState:
        """Return a state with the memory of the task alone, and the contact forces."""
        forces = self.contacts(state).forces.reshape(-1, 3)
        return GroundState(state.q, state.v, state.memory[sum(self._sizes) :], forces)

    def with_contacts(self, state: State, contacts: ContactMemory) -> State:
        """Return a state of the task with what the kernels keep of the contacts."""
        return State(state.q, state.v, np.concatenate([*contacts, state.memory]))

    def contacts(self, state: State) -> ContactMemory:
        """Return what the kernels keep of the contacts."""
        ends = np.cumsum(self._sizes).tolist()
        return ContactMemory(*(state.memory[end - n : end] for n, end in zip(self._sizes, ends, strict=True)))

    def require_start_options(self, options: Mapping[str, Any]) -> None:
        """Raise UnknownNameError for an option of `reset` that the task does not take."""
        self.task.require_start_options(options)

    def start(self, random: Array, **options: Any) -> State:
        """Return the state at the start of an episode."""
        first = self.task.initial_state(random, **options)
        return self.with_contacts(first, ContactMemory(*map(np.zeros, self._sizes)))

    def torque(self, robot: Any, state: State, action: Array) -> Array:
        """Return the targets, since the kernel of the robot has the motors, and the next memory."""
        own = self.own_state(state)
        return np.concatenate([self.task.targets(own, action), self.task.remember(own, action)])

    def observation(self, robot: Any, state: State) -> Array:
        """Return the observation."""
        return self.task.observe(self.own_state(state))

    def reward(self, robot: Any, before: State, action: Array, after: State) -> Any:
        """Return the sum of the terms."""
        return sum(self.reward_terms(robot, before, action, after).values())

    def reward_terms(self, robot: Any, before: State, action: Array, after: State) -> Mapping[str, Any]:
        """Return the terms of the reward by name."""
        return self.task.terms(self.own_state(before), action, self.own_state(after))

    def terminated(self, robot: Any, state: State) -> Any:
        """Check whether the episode is over."""
        return self.task.is_over(self.own_state(state))

    def info(self, robot: Any, state: State) -> dict[str, Any]:
        """Return the info of a step."""
        return self.task.describe(self.own_state(state))

    @property
    def camera(self) -> Any:
        """Camera of the pictures."""
        return self.task.camera


def motion_of(task: GroundTask, contacts: GroundContacts) -> GroundMotion:
    """Return the task as kernels call it, under its name, which messages have."""
    kind = type(type(task).__name__, (GroundMotion,), {"__module__": __name__})
    motion: GroundMotion = kind(task, contacts)
    return motion


@dataclass(frozen=True)
class GroundContacts:
    """A scene that a kernel can step: one robot, and its shapes that may touch the ground."""

    layout: Layout
    touching: ShapesOnPlane

    @classmethod
    def of(cls, task: GroundTask, joints: JointOptions = DESCRIBED) -> GroundContacts:
        """Read the scene of a task.

        Raises UnsupportedFeatureError, naming the part, for what a kernel does not have, and
        SingularMassMatrixError, naming the joints, for a robot without the mass to move.
        """
        task.refuse_other_hooks()
        name, scene = type(task).__name__, task.scene()
        for kind in ("constraints", "sensors"):
            if getattr(scene, kind):
                raise UnsupportedFeatureError(f"the scene of {name} has {kind}, which a kernel does not have")
        layout = prepare(scene, collisions=True, **vars(joints))
        for body in layout.bodies:
            if not body.fixed:
                raise UnsupportedFeatureError(f"{body.name} moves; a kernel has one robot that moves")
        touching = shapes_on_plane(layout)
        robot = layout.robots[0]
        model = robot.model
        task.require_contact_links()
        refuse_other_joints(model)
        Solvability(model).refuse_singular(joint_dynamics=bool(robot.armature.any()))
        points = sum(touching.counts)
        if points > MAX_POINTS:
            raise UnsupportedFeatureError(
                f"{model.name} may touch the ground at {points} points; a kernel has at most {MAX_POINTS}; "
                "with contacts='feet' only the feet of Stand and Walk touch it"
            )
        return cls(layout, touching)

    @property
    def robot(self) -> RobotLayout:
        """The robot."""
        return self.layout.robots[0]

    @property
    def contact_impulses(self) -> int:
        """Number of impulses of the contacts in a step."""
        return 3 * sum(self.touching.counts)

    def impulses_on(self, links: Sequence[str], impulses: Array) -> Array:
        """Return the sums (3 n,) of the impulses (m,) of the contacts on each of some links."""
        sums: Array = np.zeros((len(links), 3), dtype=object)
        first = 0
        for count, shape in zip(self.touching.counts, self.touching.shapes, strict=True):
            rows = impulses[first : first + 3 * count].reshape(count, 3)
            first += 3 * count
            if shape.parts[0] in links:
                k = links.index(shape.parts[0])
                sums[k] = sums[k] + sum(rows[1:], rows[0])
        return sums.ravel()

    @cached_property
    def impulses(self) -> int:
        """Number of impulses in a step: of the contacts, and one of each joint with a row of its own."""
        robot = self.robot
        stopped = np.isfinite(robot.lower) | np.isfinite(robot.upper) | (robot.friction > 0.0)
        return self.contact_impulses + int(np.count_nonzero(stopped))


class GroundStep(TaskStep):
    """A control step of a `GroundTask`: kernels of the robot and of the task."""

    def __init__(self, motion: GroundMotion, contacts: GroundContacts, varied: VariedGround) -> None:
        """Raises UnsupportedFeatureError for a task or parameters that kernels do not have."""
        self._contacts, self._ground = contacts, varied
        self._motion = motion
        super().__init__(motion, varied)

    def _prepare_motion(self) -> None:
        varied, model = self._ground, self._contacts.layout.robots[0].model
        n = len(model.mechanism.bodies)
        parameters = varied.parameters
        drawn = bool(parameters.scaled) or parameters.point_payload is not None
        self._mechanism = simplify_mechanism(
            replace(parameters, model=model).remainder() if drawn else model.mechanism
        )
        self._regrouped = (
            None if drawn or varied.draws("gravity_scale") else regroup_inertias(self._mechanism)
        )
        robot, task = self._contacts.layout.robots[0], self._motion.task
        self._joints = ServoJoints(
            np.full(n, task.kp, dtype=np.float64),
            np.full(n, task.kd, dtype=np.float64),
            robot.damping,
            robot.armature,
            np.full(n, task.max_torque, dtype=np.float64),
            robot.friction,
            (robot.stiffness, robot.spring_reference) if robot.stiffness.any() else None,
            (robot.lower, robot.upper) if robot.limited else None,
        )
        self._draws_masses = drawn

    def lanes(self, count: int, max_steps: int | None = None) -> GroundLanes:
        """Return lanes of environments."""
        return GroundLanes(self, count, max_steps)

    @cached_property
    def _sweeps(self) -> Sweeps:
        redundant = self._contacts.touching.has_redundant_points(self._mechanism)
        return Sweeps.of_points(redundant=True) if redundant else SWEEPS

    @property
    def substeps(self) -> int:
        """Number of steps of the robot in a control step."""
        return self._motion.substeps

    @cached_property
    def control_kernel(self) -> Kernel:
        """The kernel of all steps of the robot in a control step in which no joint reaches a stop, which says
        where one does.

        Raises UnsupportedFeatureError if it cannot be compiled.
        """
        return compiled(replace(self.robot_text(), turns=self.substeps))

    @cached_property
    def robot_kernel(self) -> Kernel:
        """The kernel of one such step; compiled when a joint first reaches a stop."""
        return compiled(self.robot_text())

    @cached_property
    def kernel_with_stops(self) -> Kernel:
        """The kernel of a step of the robot with stops; compiled when a joint first reaches one."""
        return compiled(self.robot_text(stops=True))

    @property
    def stops(self) -> bool:
        """True if joints stop at limits."""
        return self._contacts.robot.limited

    @property
    def delayed_actions(self) -> int:
        """0: a step is given the action that acts in it."""
        return 0

    def robot_text(self, *, stops: bool = False) -> StepText:
        """Return the text of a step of the robot: from ``state``, the state at the ``begin`` of the control
        step, ``action``, drawn ``parameters`` and a ``push`` to the next ``state``, in which only the memory
        of the task is the same. Without `stops` the largest distance ``beyond`` one [rad or m], in this step
        and those before, is another input and output: where there is none, stops change nothing."""
        sizes = {"state": self.layout.size, "begin": self.layout.size, "action": self.actions}
        if self._ground.drawn_parameters:
            sizes["parameters"] = len(self._ground.drawn_parameters)
        if self._ground.pushed:
            sizes["push"] = 2
        if not stops:
            sizes["beyond"] = 1

        def function(repeat: Any, **inputs: Array) -> dict[str, Array]:
            after = self._robot_step(repeat, inputs, stops=stops)
            found = {"state": symbol_array(self.layout.row(after))}
            if not stops:
                beyond = self._beyond(self.layout.state(inputs["state"]).q, after.q)
                found["beyond"] = symbol_array([maximum(beyond, inputs["beyond"][0])])
            return found

        name = type(self._motion.task).__name__
        return StepText(function, sizes, f"the motion of {name} cannot be compiled", repeats=True)

    def _robot_step(self, repeat: Any, inputs: Mapping[str, Array], *, stops: bool) -> State:
        motion, varied, contacts = self._motion, self._ground, self._contacts
        state = self.layout.state(inputs["state"])
        drawn = inputs.get("parameters", np.zeros(0))
        own = motion.own_state(state)
        # Targets hold during a control step.
        begin = motion.own_state(self.layout.state(traced_array(inputs["begin"])))
        target = symbol_array(motion.task.targets(begin, self._shaped(traced_array(inputs["action"]))))
        kept_contacts = motion.contacts(state)
        impulses = kept_contacts.impulses
        joints = varied.joints(self._joints, drawn)
        rows, first = joints.limited, contacts.contact_impulses
        if first + len(rows) != contacts.impulses:
            raise UnsupportedFeatureError(
                "joint_friction is drawn for a joint without limits or friction, which kernels do not have"
            )
        if not stops:
            joints = replace(joints, stops=None)
        # Impulses of joints without a row in this step are 0 after it.
        kept = [*range(first), *(first + rows.index(joint) for joint in joints.limited)]
        shapes = tuple(
            each._replace(friction=varied.friction(each, drawn)) for each in contacts.touching.shapes
        )
        mechanism = varied.mechanism(self._mechanism, drawn, masses=self._draws_masses)
        regrouped = self._regrouped
        if varied.pushed:
            mechanism = varied.pushed_mechanism(mechanism, inputs["push"])
            if regrouped is not None:
                regrouped = varied.pushed_mechanism(regrouped, inputs["push"])
        result = contact_step(
            mechanism,
            joints,
            replace(contacts.touching, shapes=shapes),
            self._sweeps,
            motion.step_dt,
            state.q,
            state.v,
            target,
            impulses[kept],
            repeat,
            regrouped=regrouped,
        )
        largest = maximum(result["residual"][0], kept_contacts.residual[0])
        found = np.zeros(contacts.impulses, dtype=object)
        found[kept] = result["impulses"]
        sums = kept_contacts.sums + contacts.impulses_on(motion.task.contact_links, found)
        after = State(result["q"], result["v"], own.memory)
        residual = np.array([largest], dtype=object)
        return motion.with_contacts(after, ContactMemory(found, residual, sums, kept_contacts.forces))

    def _beyond(self, before: Array, after: Array) -> Any:
        """Return how far a step moves a joint beyond a stop, or further beyond it [rad or m]; 0 for none."""
        robot, most = self._contacts.robot, 0.0
        first = len(before) - len(robot.lower)
        for x, y, low, high in zip(before[first:], after[first:], robot.lower, robot.upper, strict=True):
            if np.isfinite(low):
                most = maximum(most, minimum(x, low) - y)
            if np.isfinite(high):
                most = maximum(most, y - maximum(x, high))
        return most

    def _sizes_of_motion(self) -> dict[str, int]:
        return {"moved": self.layout.size}

    def _moved(
        self,
        inputs: Mapping[str, Array],
        before: State,
        results: dict[str, Any],
        overflow: list[Any],
        limits: LimitWatch | StopsText | None,
    ) -> State:
        motion = self._motion
        moved = self.layout.state(inputs["moved"])
        kept = motion.contacts(moved)
        results["residual"] = kept.residual
        # Rows of normal and tangents, by the axes of the ground.
        forces = kept.sums.reshape(-1, 3) @ np.array(self._contacts.touching.axes) / motion.control_dt
        kept = ContactMemory(kept.impulses, np.zeros(1), 0.0 * kept.sums, forces.ravel())
        own = motion.own_state(motion.with_contacts(motion.own_state(moved), kept))
        memory = motion.task.remember(own, self._shaped(inputs["action"]))
        return motion.with_contacts(State(own.q, own.v, memory), kept)


class GroundLanes(TaskLanes):
    """Environments of a `GroundTask` in lanes of its kernels; chunks of them on `threads` threads."""

    def __init__(self, step: GroundStep, count: int, max_steps: int | None = None) -> None:
        """`max_steps` is the number of steps after which an episode is truncated."""
        self.threads = 1
        kernels, lanes = [step.control_kernel, step.kernel], host().lanes
        rows = max(count, lanes)
        sizes = {port.name: port.size for kernel in kernels for port in (*kernel.inputs, *kernel.outputs)}
        for name in ("moved", "begin"):
            del sizes[name]
        # Two sets of the state in turn, and what the robot's steps write.
        states = np.zeros((3, rows, sizes.pop("state")))
        steps = np.zeros((2, rows, sizes.pop("steps")))
        self.arrays = {name: np.zeros((rows, size)) for name, size in sizes.items()}
        self.arrays["limit"][...] = math.inf if max_steps is None else max_steps
        self._sets = [{"state": states[turn], "steps": steps[turn]} for turn in range(2)]
        self._turn, self._moved = 0, states[2]
        chosen, turns = np.array([0, 1, 0, 1]), np.array([0, 0, 1, 1])
        edges = np.arange(0, max(rows // CHUNK, 1) + 1) * CHUNK
        edges[-1] = rows
        self._ground, self._edges = step, edges.tolist()
        self._chunks = []
        for first, last in pairwise(self._edges):
            part = slice(first, last)
            known = {name: (array[None, part], 0 * turns) for name, array in self.arrays.items()}
            known |= {
                "state": (states[:, part], turns),
                "moved": (states[:, part], 2 + 0 * turns),
                "begin": (states[:, part], turns),
                "steps": (steps[:, part], turns),
            }
            outputs = {
                "state": (states[:, part], np.array([2, 1, 2, 0])),
                "steps": (steps[:, part], 1 - turns),
            }
            self._chunks.append(
                CallSequence(
                    kernels,
                    chosen,
                    {name: StridedRows(*each) for name, each in known.items()},
                    last - first,
                    outputs={name: StridedRows(*each) for name, each in outputs.items()},
                    status="beyond" if step.stops else None,
                )
            )
        self.flags: NDArray[np.int64] = self.arrays["flags"][:count, 0].view(np.int64)

    def evaluate(self) -> None:
        """Evaluate a step from the present state; `accept` makes its end the present state."""
        if "beyond" in self.arrays:
            self.arrays["beyond"][...] = 0.0
        run_parts(self._evaluate, len(self._chunks), self.threads)

    def evaluate_starts(self) -> None:
        """Evaluate the task alone, of environments whose episodes have ended."""
        task = 2 * self._turn + 1
        run_parts(lambda chunk: self._chunks[chunk].run(task, task + 1), len(self._chunks), self.threads)

    def _evaluate(self, chunk: int) -> None:
        """Evaluate a control step of a chunk of environments."""
        calls, begin = self._chunks[chunk], 2 * self._turn
        # A lane that diverges has NaN beyond its stops, which does not end the calls.
        stopped = calls.run(begin, begin + 2)
        if stopped is not None and stopped[0] == begin:
            first, last = self._edges[chunk : chunk + 2]
            beyond = self.arrays["beyond"][first:last, 0]
            self._stop_joints(first + np.flatnonzero(beyond > 0.0))
            calls.run(begin + 1, begin + 2)

    def _stop_joints(self, rows: NDArray[np.intp]) -> None:
        """Take the steps of the robot again in lanes in which a joint passed a stop, each with stops in those
        in which it does."""
        step, begin = self._ground, self.now["state"][rows]
        given = {
            port.name: self.arrays[port.name][rows]
            for port in step.robot_kernel.inputs
            if port.name not in ("state", "begin", "beyond")
        }
        given |= {"state": begin, "begin": begin, "beyond": np.zeros((len(rows), 1))}
        for _ in range(step.substeps):
            state, beyond = _outputs(step.robot_kernel, given)
            stopped = np.flatnonzero(beyond[:, 0] > 0.0)
            if len(stopped):
                (state[stopped],) = _outputs(
                    step.kernel_with_stops, {name: array[stopped] for name, array in given.items()}
                )
            given["state"] = state
        self._moved[rows] = given["state"]


def _outputs(kernel: Kernel, inputs: Mapping[str, Floats]) -> list[Floats]:
    """Return what a kernel computes from inputs (n, size) by name."""
    n = len(inputs["state"])
    found = [np.empty((n, port.size)) for port in kernel.outputs]
    kernel([inputs[port.name] for port in kernel.inputs], found)
    return found
