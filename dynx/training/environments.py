"""Environments that a policy learns on or is judged in, made from a task."""

from __future__ import annotations

from functools import partial
from typing import Any

from dynx.argument_types import checks_types
from dynx.envs.library import AutoresetMode, Env, GymnasiumError, make_env, make_vec_env
from dynx.envs.registration import is_of_dynx, specification
from dynx.errors import ArgumentError, DynxError
from dynx.training.library import (
    CLIPPED_AT,
    DummyVecEnv,
    Monitor,
    SubprocVecEnv,
    VecEnv,
    VecMonitor,
    VecNormalize,
)
from dynx.training.specification import TaskSpec, TrainingSpec
from dynx.training.vectors import BatchedEnvironments


@checks_types
def make(task: TaskSpec, render_mode: str | None = None) -> Env[Any, Any]:
    """Make one environment of a task.

    Raises ArgumentError for a task that Gymnasium cannot make, and the errors of the task itself.
    """
    try:
        # An environment of the user's own may have no pictures, and no argument for them.
        pictures: dict[str, Any] = {} if render_mode is None else {"render_mode": render_mode}
        return make_env(task.id, **pictures, **task.arguments())
    except DynxError:
        raise
    except Exception as error:  # the class of another package raises whatever its options lead to
        if is_of_dynx(task.id) and not isinstance(error, GymnasiumError | TypeError | ImportError):
            raise  # a defect
        raise ArgumentError(f"{task.name} cannot be made: {_line(error)}") from error


def make_vector(spec: TrainingSpec) -> VecEnv:
    """Make the environments of a run: in one kernel where the task has one, else one by one, or in processes.

    With `normalize` they are wrapped in a `VecNormalize`.
    """
    if spec.processes:
        vector = VecMonitor(SubprocVecEnv([partial(_monitored, spec.task) for _ in range(spec.envs)]))
    elif _steps_in_a_kernel(spec.task):
        vector = VecMonitor(BatchedEnvironments(_make_batched(spec)))
    else:
        vector = DummyVecEnv([partial(_monitored, spec.task) for _ in range(spec.envs)])
    if not spec.normalize:
        return vector
    gamma = float(spec.hyperparameters.get("gamma", 0.99))
    return VecNormalize(vector, gamma=gamma, clip_obs=CLIPPED_AT, clip_reward=CLIPPED_AT)


def _steps_in_a_kernel(task: TaskSpec) -> bool:
    known = specification(task.id)
    in_kernel = known is not None and known.vector_entry_point is not None
    return in_kernel and is_of_dynx(task.id) and task.engine == "compiled"


def _make_batched(spec: TrainingSpec) -> Any:
    try:
        return make_vec_env(
            spec.task.id,
            num_envs=spec.envs,
            vectorization_mode="vector_entry_point",
            autoreset_mode=AutoresetMode.SAME_STEP,
            **spec.task.arguments(),
        )
    except DynxError:
        raise
    except (GymnasiumError, TypeError, ImportError) as error:
        raise ArgumentError(f"{spec.task.name} cannot be made: {_line(error)}") from error


def _monitored(task: TaskSpec) -> Env[Any, Any]:
    monitored: Env[Any, Any] = Monitor(make(task))
    return monitored


def _line(error: BaseException) -> str:
    return " ".join(str(error).split())[:400]
