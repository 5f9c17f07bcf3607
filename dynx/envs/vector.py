"""`RobotVectorEnvironment`: many environments of one task, which step in one compiled kernel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dynx.envs.environment import DIVERGED as DIVERGED_KEY
from dynx.envs.environment import checked_action
from dynx.envs.ground_step import GroundContacts, GroundStep, motion_of
from dynx.envs.ground_task import GroundTask
from dynx.envs.hooks import require_settings
from dynx.envs.library import AutoresetMode, Space, VectorEnv, batch_space, spaces
from dynx.envs.randomization import Randomization, Variation, first_seed
from dynx.envs.runner import draw_on_ground, draw_robot
from dynx.envs.task import JointOptions, RobotTask
from dynx.envs.task_step import DIVERGED, INVALID, TaskStep
from dynx.envs.variation import VariedGround, VariedRobot, WaitingActions
from dynx.errors import (
    ArgumentError,
    ClosedError,
    DTypeError,
    DynxError,
    EpisodeError,
    ShapeError,
    UnsupportedFeatureError,
    nearest,
    shown,
)
from dynx.model.configuration import checked_q
from dynx.model.numbers import DIVERGENCE_SPEED, checked_array, checked_seed, whole_number
from dynx.simd.generators import Generators
from dynx.simd.threads import checked_threads
from dynx.spatial.scalar import Floats

RENDER_MODES = ("rgb_array",)

IN_WORLDS = "with vectorization_mode='sync' or 'async' environments step in worlds"

NONE_ENDED = np.zeros(0, dtype=np.intp)
"""Numbers of the environments whose episode ended, where there are none."""


def checked_seeds(seed: object, count: int) -> Sequence[int]:
    """Return the seeds of `count` environments: those given, or numbers that count up from one.

    Raises ArgumentError for anything else.
    """
    if not isinstance(seed, list | tuple | np.ndarray) or np.ndim(seed) == 0:
        first = checked_seed("seed", seed)
        return range(first, first + count)
    if len(seed) != count:
        raise ArgumentError(
            f"seed has {len(seed)} numbers; wanted that of the first environment, or {count}, one for each"
        )
    return tuple(checked_seed(f"seed[{k}]", each) for k, each in enumerate(seed))


class RobotVectorEnvironment(VectorEnv[Any, Any, Any]):
    """Environments of one task, each in a lane of a compiled kernel, with the interface of
    `gymnasium.vector.VectorEnv`.

    Autoreset is that of Gymnasium: in mode NEXT_STEP the step after the end of an episode starts the next one
    and ignores the action; in mode SAME_STEP the step that ends an episode returns the first observation of
    the next one, and ``info["final_obs"]`` has the last; in mode DISABLED ``reset(options={"reset_mask":
    mask})`` starts episodes. After ``reset(seed=s)`` environment k has the episodes of a single environment
    with the seed s + k, whatever the number of environments; on engine ``compiled`` bit for bit.

    An environment whose step diverges is truncated with the observation before that step and a reward of 0;
    ``info["diverged"]`` says why (in mode SAME_STEP that of ``info["final_info"]``).

    With ``copy=False`` observations, rewards and flags are written into the same arrays in every step, which
    is faster. Runs on one thread; not safe for several.
    """

    def __init__(
        self,
        task: RobotTask | GroundTask,
        num_envs: int = 1,
        *,
        max_episode_steps: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        copy: bool = True,
        randomize: Randomization | Mapping[str, Any] | None = None,
        render_mode: str | None = None,
        width: int = 480,
        height: int = 360,
        joint_damping: bool = True,
        joint_friction: bool = True,
        joint_armature: bool = True,
        joint_springs: bool = True,
        joint_limits: bool = True,
        threads: int | None = 1,
    ) -> None:
        """Options are those of `TaskEnvironment`. Environments of a `GroundTask` step on at most `threads`
        threads, by default on one; None stands for one per processor.

        Raises ArgumentError for an option that cannot be used, or a task with a hook that depends on more
        than its arguments, UnsupportedFeatureError for one that cannot be compiled.
        """
        if render_mode is not None and render_mode not in RENDER_MODES:
            raise ArgumentError(f"render_mode is {shown(render_mode)}{nearest(render_mode, RENDER_MODES)}")
        n = self.num_envs = whole_number("num_envs", num_envs, 1)
        require_settings(task)
        self.task = task
        """The task."""
        mode = self._mode = checked_mode(autoreset_mode)
        fps = round(1.0 / task.control_dt)
        self.metadata = {
            "render_modes": list(RENDER_MODES),
            "render_fps": fps,
            "autoreset_mode": mode,
        }
        self.render_mode = render_mode
        self._size = (width, height)
        self.single_observation_space, self.single_action_space = task.observation_space, task.action_space
        self.observation_space = batch_space(task.observation_space, n)
        self.action_space = batch_space(task.action_space, n)
        self._discrete = isinstance(task.action_space, spaces.Discrete)
        self._kinds = "iu" if self._discrete else "fiu"
        self._variation: Variation | None = None
        drawn = None if randomize is None else Randomization.read(randomize)
        joints = JointOptions(joint_damping, joint_friction, joint_armature, joint_springs, joint_limits)
        self._task_step: TaskStep
        self._waiting: WaitingActions | None = None
        varied: VariedRobot
        if isinstance(task, GroundTask):
            try:
                contacts = GroundContacts.of(task, joints)
            except UnsupportedFeatureError as error:
                raise UnsupportedFeatureError(f"{error}; {IN_WORLDS}, which keep all contacts") from None
            motion = motion_of(task, contacts)
            varied = VariedGround(motion, drawn, joints, contacts.touching.shapes)
            self._task_step = GroundStep(motion, contacts, varied)
            if varied.delayed_actions:
                self._delays = varied.delays
                self._waiting = WaitingActions(n, self._task_step.actions, varied.delayed_actions)
        else:
            varied = VariedRobot(task, drawn, joints)
            self._task_step = TaskStep(task, varied)
        self._threads = checked_threads(threads)
        if drawn is not None:
            spaces_of_one = task.observation_space, task.action_space
            self._variation = Variation(
                drawn, varied.drawn_parameters, *spaces_of_one, task.control_dt, count=n
            )
        self._layout = self._task_step.layout
        self._seeded_by: np.random.Generator | None = None
        self._copy = copy
        self._make_buffers(max_episode_steps)
        self._running = False

    def _make_buffers(self, max_episode_steps: int | None) -> None:
        """Allocate the arrays of the kernel, and views of them for all environments."""
        n = self.num_envs
        self._lanes = lanes = self._task_step.lanes(n, max_episode_steps)
        lanes.threads = self._threads
        arrays = self._arrays = lanes.arrays
        self._random = arrays["random"][:n]
        self._generators = Generators(self._random)
        self._actions = arrays["action"][:n, 0] if self._discrete else arrays["action"][:n]
        if not self._discrete:
            self._actions = self._actions.reshape(n, *(self.single_action_space.shape or ()))
        self._found, self._rewards = arrays["observation"][:n], arrays["reward"][:n, 0]
        self._flags = lanes.flags
        flags = self._flags.view(np.bool_).reshape(n, 8)
        self._terminated, self._truncated = flags[:, 0], flags[:, 1]
        dtype = self.single_observation_space.dtype
        self._observations = np.zeros((n, self._task_step.observations), dtype=dtype)
        self._ended = NONE_ENDED

    @property
    def states(self) -> Floats:
        """Copy of q, v and memory of each environment (num_envs, nq + nv + k)."""
        return np.array(self._lanes.now["state"][: self.num_envs])

    def set_states(self, states: ArrayLike) -> None:
        """Begin an episode of every environment in a state (num_envs, nq + nv + k), as `states` has them.

        A row is q [rad or m], v [rad/s or m/s] and the k numbers of memory of the task. The observation is
        that of the next step. Raises EpisodeError before the first `reset`, ClosedError after `close`,
        ShapeError, DTypeError or NotFiniteError for an invalid array, ArgumentError for a quaternion whose
        length differs from 1 by more than 1e-6. The states are then unchanged.
        """
        self._refuse_closed()
        if not self._running:
            raise EpisodeError("set_states was called before the first reset")
        array = checked_array("states", states, self._layout.size)
        if array.shape != (self.num_envs, self._layout.size):
            raise ShapeError(f"states have shape {array.shape}; wanted {(self.num_envs, self._layout.size)}")
        model = self.task.model
        q = checked_q(model, array[:, : model.nq], "states")
        now = self._lanes.now
        now["state"][: self.num_envs] = array
        now["state"][: self.num_envs, : model.nq] = q
        now["steps"][...] = 0.0
        self._ended = NONE_ENDED
        if self._variation is not None:
            self._variation.restart()

    @property
    def contact_residuals(self) -> Floats:
        """Largest violation of the laws of contact in the last step of each environment (num_envs,) [m/s].

        Raises UnsupportedFeatureError for a task without contacts.
        """
        if "residual" not in self._arrays:
            raise UnsupportedFeatureError(f"{type(self.task).__name__} has no contacts")
        return np.array(self._arrays["residual"][: self.num_envs, 0])

    @property
    def parameters(self) -> dict[str, Floats]:
        """Drawn values of the present episodes (num_envs,), by the name of the parameter."""
        return {} if self._variation is None else self._variation.by_name()

    def reset(
        self, *, seed: int | Sequence[int] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start an episode in every environment, or in those of ``options["reset_mask"]``.

        `seed` is that of the first environment, or a list with one for each. The other options are those of
        the task's start. Raises UnknownNameError for one that it does not have, ArgumentError for an invalid
        seed.
        """
        self._refuse_closed()
        seeds = None if seed is None else checked_seeds(seed, self.num_envs)
        super().reset(seed=None if seeds is None else seeds[0])
        if not isinstance(options, Mapping | None):
            raise ArgumentError(f"options is {shown(options)}; wanted a dict of options by name")
        given = dict(options or {})
        mask = checked_reset_mask(given.pop("reset_mask", None), self.num_envs, started=self._running)
        self.task.require_start_options(given)
        rows = np.flatnonzero(mask)
        if self.np_random is not self._seeded_by:
            first, self._seeded_by = first_seed(self.np_random_seed, self.np_random), self.np_random
            seeds = range(first, first + self.num_envs) if seeds is None else seeds
            self._generators.seed(seeds, rows)
            self._generators.fill(rows)
            if self._variation is not None:
                self._variation.seed(seeds, rows)
        self._start(rows, given)
        self._ended = self._ended[~mask[self._ended]]
        self._running = True
        infos: dict[str, Any] = {}
        self._add_parameters(infos, rows)
        return self._observed().astype(self.single_observation_space.dtype), infos

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Act for one control step in each environment; return observations, rewards, terminations,
        truncations and infos, arrays with one row for each.

        Raises EpisodeError before the first `reset`, and in mode DISABLED after the end of an episode;
        ArgumentError and its subclasses for an invalid action, NotFiniteError for a torque, reward or
        observation of the task that is not finite. After such an error every environment is unchanged.
        """
        if not self._running:
            self._refuse_closed()
            raise EpisodeError("step was called before the first reset")
        mode, ended = self._mode, self._ended
        if mode is AutoresetMode.DISABLED and len(ended):
            raise EpisodeError(
                f"step was called after the episode of environment {ended[0]} ended: call "
                "reset(options={'reset_mask': mask})"
            )
        if (
            type(actions) is not np.ndarray
            or actions.shape != self._actions.shape
            or actions.dtype.kind not in self._kinds
        ):
            actions = checked_actions(self._kinds, self._actions.shape, actions)
        self._actions[...] = self._acting(actions)
        if self._variation is not None and self._variation.pushes is not None:
            self._arrays["push"][: self.num_envs] = self._variation.accelerations()
        self._lanes.evaluate()
        flags = self._flags
        largest = flags.max()
        if largest >= INVALID and (flags & INVALID).any():
            raise_invalid_action(self.single_action_space, self._actions, flags & INVALID)
        if largest >= INVALID:
            self._task_step.refuse_not_finite(flags)
        self._lanes.accept()
        if self._waiting is not None:
            self._waiting.accept()
        infos: dict[str, Any] = {}
        if self._variation is not None:
            self._variation.count_step()
        if mode is AutoresetMode.NEXT_STEP:
            # The episodes that ended one step ago have started with these random numbers.
            self._renew(ended)
            self._add_parameters(infos, ended)
        # NumPy finds True in a third of the time that it takes to find integers other than 0.
        self._ended = ended = flags.astype(np.bool_).nonzero()[0] if largest else NONE_ENDED
        diverged = flags >= DIVERGED if largest >= DIVERGED else None
        if diverged is not None:
            self._add_diverged(infos, diverged)
        if mode is AutoresetMode.SAME_STEP and len(ended):
            infos = self._final_infos(ended, infos)
            self._start(ended, {})
            self._add_parameters(infos, ended)
            self._ended = NONE_ENDED
        rewards, terminated, truncated = self._rewards, self._terminated, self._truncated
        if self._copy:
            rewards, terminated, truncated = rewards.copy(), terminated.copy(), truncated.copy()
            observations = self._observed().astype(self._observations.dtype)
        else:
            observations = self._observations
            observations[...] = self._observed()
        return observations, rewards, terminated, truncated, infos

    def _acting(self, actions: Any) -> Any:
        """Return the actions that act in all environments: with noise and after delays, where these are
        drawn."""
        variation = self._variation
        if variation is None or (variation.action_noise is None and self._waiting is None):
            return actions
        # The kernel checks the actions that act.
        self._refuse_invalid(actions)
        flat = np.asarray(actions, dtype=np.float64).reshape(self.num_envs, -1)
        if variation.action_noise is not None:
            flat = variation.action_noise.added(flat, variation.noise_on_actions())
        if self._waiting is not None:
            steps = self._lanes.now["steps"][: self.num_envs, 0].astype(np.int64)
            flat = self._waiting.acting(flat, steps, self._delays(variation.values))
        return flat.reshape(self._actions.shape)

    def _refuse_invalid(self, actions: Any) -> None:
        """Raise the error of the first environment whose action is not in its space."""
        space: Any = self.single_action_space
        if self._discrete:
            rounded, low, high = np.asarray(actions), space.start, space.start + space.n - 1
        else:
            # Numbers that the space's dtype rounds to a bound are within it.
            rounded, low, high = np.asarray(actions).astype(space.dtype), space.low, space.high
        invalid = ~((rounded >= low) & (rounded <= high)).reshape(self.num_envs, -1).all(axis=1)
        # Environments that start an episode ignore their actions.
        invalid[self._ended] = False
        if invalid.any():
            raise_invalid_action(space, actions, invalid)

    def _observed(self) -> Floats:
        """Return the observations that the kernel found, with noise where it is drawn."""
        return self._found if self._variation is None else self._variation.noisy_observations(self._found)

    def _add_parameters(self, infos: dict[str, Any], rows: NDArray[np.intp]) -> None:
        """Add the drawn values of all environments to infos, with the mask of those that drew new ones."""
        if self._variation is not None and len(rows):
            fresh = np.zeros(self.num_envs, dtype=np.bool_)
            fresh[rows] = True
            infos["parameters"], infos["_parameters"] = self._variation.by_name(), fresh

    def _start(self, rows: NDArray[np.intp], options: Mapping[str, Any]) -> None:
        """Start episodes in some environments."""
        if len(rows):
            states, observations = self._task_step.starts(self._random[rows], options)
            now = self._lanes.now
            now["state"][rows], now["steps"][rows], self._found[rows] = states, 0.0, observations
            self._renew(rows)

    def _renew(self, rows: NDArray[np.intp]) -> None:
        """Draw the parameters of the episodes that some environments have started, and the random numbers of
        the next ones."""
        if len(rows):
            self._generators.fill(rows)
            if self._variation is not None:
                self._variation.start(rows)
                if "parameters" in self._arrays:
                    size = self._variation.motion_size
                    self._arrays["parameters"][rows] = self._variation.values[rows, :size]

    def _add_diverged(self, infos: dict[str, Any], diverged: NDArray[np.bool_]) -> None:
        """Add to infos why the steps of some environments were not taken."""
        why = np.full(self.num_envs, None, dtype=object)
        why[diverged] = (
            f"the velocity after the step is not finite or beyond {DIVERGENCE_SPEED:g}; smaller steps "
            "(substeps) or actions may help"
        )
        infos[DIVERGED_KEY], infos[f"_{DIVERGED_KEY}"] = why, diverged

    def _final_infos(self, rows: NDArray[np.intp], last_infos: dict[str, Any]) -> dict[str, Any]:
        """Return the last observations and infos of the episodes that ended, as Gymnasium returns them."""
        found = np.full(self.num_envs, None, dtype=object)
        final = self._found[rows]
        if self._variation is not None:
            final = self._variation.noisy_observations(final, rows)
        last = final.astype(self.single_observation_space.dtype)
        for row, observation in zip(rows.tolist(), last, strict=True):
            found[row] = observation
        mask = self._flags != 0
        return {"final_obs": found, "_final_obs": mask, "final_info": last_infos, "_final_info": mask.copy()}

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Return the pictures of all environments (height, width, 3)."""
        self._refuse_closed()
        if self.render_mode is None:
            raise ArgumentError("these environments have no render mode; make them with 'rgb_array'")
        if not self._running:
            raise EpisodeError("render was called before the first reset")
        width, height = self._size
        states = map(self._layout.state, self.states)
        if isinstance(self.task, GroundTask):
            return tuple(draw_on_ground(self.task, states, width, height))
        return tuple(draw_robot(self.task, state, width, height) for state in states)

    def close_extras(self, **kwargs: Any) -> None:
        """Release the kernels."""
        self._running = False
        del self._lanes, self._arrays, self._generators, self._random

    def _refuse_closed(self) -> None:
        if self.closed:
            raise ClosedError("this vector environment was closed")


def checked_mode(mode: AutoresetMode | str) -> AutoresetMode:
    """Return an autoreset mode, given itself, or by its name or value. Raises ArgumentError for another."""
    for each in AutoresetMode:
        if mode is each or mode in (each.name, each.value):
            return each
    names = [each.value for each in AutoresetMode]
    raise ArgumentError(f"autoreset_mode is {shown(mode)}{nearest(mode, names)}")


def checked_reset_mask(mask: Any, n: int, *, started: bool) -> NDArray[np.bool_]:
    """Return which environments start an episode (n,), by default all."""
    if mask is None:
        return np.ones(n, dtype=np.bool_)
    array = np.asarray(mask)
    if array.dtype != np.bool_:
        raise DTypeError(f"reset_mask is {shown(mask)}; wanted an array of bool")
    if array.shape != (n,):
        raise ShapeError(f"reset_mask has shape {array.shape}; wanted ({n},)")
    if not started and not array.all():
        raise EpisodeError("the first reset must start an episode in every environment")
    return array


def checked_actions(kinds: str, shape: tuple[int, ...], actions: Any) -> NDArray[Any]:
    """Return the actions of all environments as an array of this shape, of one of these kinds of dtype.

    Raises ShapeError or DTypeError.
    """
    array = np.asarray(actions)
    if array.dtype.kind not in kinds:
        wanted = "whole numbers" if kinds == "iu" else "numbers"
        raise DTypeError(f"actions are of type {array.dtype}; wanted {wanted}")
    if array.shape != shape:
        raise ShapeError(f"actions have shape {array.shape}; wanted {shape}")
    return array


def raise_invalid_action(space: Space[Any], actions: Floats, invalid: NDArray[Any]) -> NoReturn:
    """Raise the error of the first environment with an invalid action."""
    number = int(np.flatnonzero(invalid)[0])
    action = int(actions[number]) if isinstance(space, spaces.Discrete) else actions[number]
    try:
        checked_action(space, action)
    except DynxError as error:
        raise type(error)(f"environment {number}: {error}") from None
    raise ArgumentError(f"environment {number}: action is {shown(action)}; wanted an element of {space}")
