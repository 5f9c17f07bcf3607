"""The environment that a policy is judged in, made from a task."""

from __future__ import annotations

from typing import Any

from dynx.argument_types import checks_types
from dynx.envs.library import Env, GymnasiumError, make_env
from dynx.envs.registration import is_of_dynx
from dynx.errors import ArgumentError, DynxError
from dynx.training.specification import TaskSpec


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
        raise ArgumentError(f"{task.name} cannot be made: {first_line(error)}") from error


def first_line(error: BaseException) -> str:
    return " ".join(str(error).split())[:400]
