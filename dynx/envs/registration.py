"""Environments by their Gymnasium id, such as ``dynx/CartPole-v0``, and their constructors."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from importlib import import_module
from types import FunctionType, ModuleType
from typing import TYPE_CHECKING, Any

from dynx.argument_types import checks_types
from dynx.envs.environment import TaskEnvironment
from dynx.envs.ground_task import KERNEL_ENGINE, GroundTask
from dynx.envs.library import AutoresetMode, register, registry
from dynx.envs.randomization import Randomization
from dynx.envs.task import RobotTask, Task, checked_engine
from dynx.errors import ArgumentError, UnknownNameError, nearest, shown

if TYPE_CHECKING:
    from dynx.envs.vector import RobotVectorEnvironment

COMPILED = "compiled"
"""The engine of vector environments, whose kernels are compiled."""

MIN_CHECKED_NAME = 8
"""Length of the shortest hook whose misspelt names are refused."""

NAMESPACE = "dynx"
ENTRY_POINT = "dynx.envs.registration:make_environment"
VECTOR_ENTRY_POINT = "dynx.envs.registration:make_vector_environment"

TASKS = {
    "Acrobot-v0": "dynx.envs.tasks.acrobot:Acrobot",
    "CartPole-v0": "dynx.envs.tasks.cart_pole:CartPole",
    "Pendulum-v0": "dynx.envs.tasks.pendulum:Pendulum",
    "Push-v0": "dynx.envs.tasks.push:Push",
    "Stand-v0": "dynx.envs.tasks.stand:Stand",
    "Walk-v0": "dynx.envs.tasks.walk:Walk",
    "Reach-v0": "dynx.envs.tasks.reach:Reach",
}
"""Tasks of dynx by the name of their environment, as ``"package.module:Class"``."""

LANDER, GYMNASIUMS_LANDER = "LunarLander", "LunarLander-v3"
"""Name of a task that dynx had, and the environment of Gymnasium whose copy it was."""


def task_class(task: str | type[Task]) -> type[Task]:
    """Return a class of tasks, given itself, as ``"package.module:Class"``, or by the id or the name of its
    environment.

    Raises UnknownNameError for a name that does not exist, ArgumentError for anything else.
    """
    found: Any = task
    if isinstance(task, str):
        module, colon, name = task.partition(":")
        found = getattr(import_tasks(module), name, None) if colon else None
        if found is None:
            env_id = task_id(task)
            if not is_of_dynx(env_id):
                raise ArgumentError(
                    f"{env_id} is no task of dynx: gymnasium.make({env_id!r}) makes its environment"
                )
            return task_class(specification(env_id).kwargs["task"])
    if not (isinstance(found, type) and issubclass(found, Task)):
        raise ArgumentError(f"task is {shown(task)}; wanted a subclass of dynx.envs.Task")
    _refuse_misspelt_hooks(found)
    for base in found.__mro__[1:]:
        for name, method in vars(base).items():
            if isinstance(method, FunctionType) and not callable(getattr(found, name)):
                raise ArgumentError(
                    f"{name} of {found.__name__} is a {type(getattr(found, name)).__name__}; wanted a method"
                )
    return found


def _refuse_misspelt_hooks(kind: type[Task]) -> None:
    """Raise UnknownNameError for a public name of a task class that is one edit from that of an optional hook
    which the class leaves as it was.

    Short names have neighbours that are words, and the fields of a dataclass are options.
    """
    bases = [each for each in kind.__mro__ if each.__module__ == Task.__module__]
    own = {name for each in kind.__mro__ if each not in bases and each is not object for name in vars(each)}
    hooks = {name for each in bases for name in (*vars(each), *vars(each).get("__annotations__", ()))} - own
    for name in sorted(own - {*dir(Task), *getattr(kind, "__dataclass_fields__", ())}):
        for hook in sorted(hooks):
            if not name.startswith("_") and len(hook) >= MIN_CHECKED_NAME and is_one_edit(name, hook):
                raise UnknownNameError(f"{kind.__name__} has {shown(name)}; did you mean {shown(hook)}?")


def is_one_edit(name: str, other: str) -> bool:
    """Check whether two names differ in one letter: another, an absent or an additional one."""
    pairs = enumerate(zip(name, other, strict=False))
    k = next((k for k, (a, b) in pairs if a != b), min(len(name), len(other)))
    rests = name[k:], other[k:]
    return name != other and (
        rests[0][1:] == rests[1][1:] or rests[0][1:] == rests[1] or rests[0] == rests[1][1:]
    )


@checks_types
def make_environment(
    task: str | type[Task],
    engine: str | None = None,
    render_mode: str | None = None,
    *,
    randomize: Randomization | Mapping[str, Any] | None = None,
    width: int = 480,
    height: int = 360,
    joint_damping: bool = True,
    joint_friction: bool = True,
    joint_armature: bool = True,
    joint_springs: bool = True,
    joint_limits: bool = True,
    **options: Any,
) -> TaskEnvironment:
    """Return the environment of a task with these `options` on an engine; `gymnasium.make` calls this, and
    adds the limit of steps.

    `task` is a class, ``"package.module:Class"``, or the id of an environment of dynx, such as
    ``dynx/Pendulum-v0``.
    """
    made = task_class(task).with_options(options)
    return TaskEnvironment(
        made,
        engine,
        render_mode,
        randomize=randomize,
        width=width,
        height=height,
        joint_damping=joint_damping,
        joint_friction=joint_friction,
        joint_armature=joint_armature,
        joint_springs=joint_springs,
        joint_limits=joint_limits,
    )


def make_vector_environment(
    task: str | type[Task],
    num_envs: int = 1,
    engine: str | None = None,
    render_mode: str | None = None,
    *,
    max_episode_steps: int | None = None,
    autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
    copy: bool = True,
    randomize: Randomization | Mapping[str, Any] | None = None,
    width: int = 480,
    height: int = 360,
    joint_damping: bool = True,
    joint_friction: bool = True,
    joint_armature: bool = True,
    joint_springs: bool = True,
    joint_limits: bool = True,
    threads: int | None = 1,
    **options: Any,
) -> RobotVectorEnvironment:
    """Return environments of a task that step in one compiled kernel; `gymnasium.make_vec` calls this.

    The engine is ``compiled`` for a `RobotTask`, ``dynx`` for a `GroundTask`. Raises ArgumentError for
    another engine or another task: those step one by one or in processes, by ``vectorization_mode="sync"`` or
    ``"async"``.
    """
    # Imported here, because single environments need no compiler.
    from dynx.envs.vector import RobotVectorEnvironment

    made = task_class(task).with_options(options)
    wanted = kernel_engine(type(made))
    if engine is not None:
        checked_engine(type(made), engine)
    if wanted is None or engine not in (None, wanted):
        subject = type(made).__name__ if wanted is None else f"engine {shown(engine)}"
        one = "of one robot" if wanted is None else "such as this one"
        raise ArgumentError(
            f"{subject} does not step in a compiled kernel; wanted vectorization_mode='sync' or 'async', or "
            f"a task {one} on engine {wanted or COMPILED!r}"
        )
    assert isinstance(made, RobotTask | GroundTask)
    return RobotVectorEnvironment(
        made,
        num_envs,
        max_episode_steps=max_episode_steps,
        autoreset_mode=autoreset_mode,
        copy=copy,
        randomize=randomize,
        render_mode=render_mode,
        width=width,
        height=height,
        joint_damping=joint_damping,
        joint_friction=joint_friction,
        joint_armature=joint_armature,
        joint_springs=joint_springs,
        joint_limits=joint_limits,
        threads=threads,
    )


def kernel_engine(kind: type[Task]) -> str | None:
    """Return the engine on which tasks of a class step in compiled kernels; None for none."""
    if issubclass(kind, GroundTask):
        return KERNEL_ENGINE
    return COMPILED if issubclass(kind, RobotTask) else None


@checks_types
def register_task(env_id: str, task: str | type[Task]) -> None:
    """Register a task, so that ``gymnasium.make(env_id, engine=...)`` makes its environment.

    `env_id` has the form ``namespace/Name-v0``. The new environment replaces an environment with this id.
    """
    kind = task_class(task)
    registry.pop(env_id, None)
    register(
        env_id,
        entry_point=ENTRY_POINT,
        vector_entry_point=VECTOR_ENTRY_POINT if kernel_engine(kind) else None,
        max_episode_steps=kind.max_episode_steps,
        reward_threshold=kind.reward_threshold,
        kwargs={"task": task},
    )


def register_tasks() -> None:
    """Register the tasks of dynx, and the id of the lander that it had, which names Gymnasium's."""
    for name, task in TASKS.items():
        register_task(f"{NAMESPACE}/{name}", task)
    gone = f"{NAMESPACE}/{LANDER}-v0"
    registry.pop(gone, None)
    register(gone, entry_point=f"{__name__}:refuse_lander")


def refuse_lander(*_: Any, **__: Any) -> TaskEnvironment:
    """Raise UnknownNameError, which names Gymnasium's lander."""
    raise UnknownNameError(
        f"dynx has no lander of its own any more: Gymnasium's {GYMNASIUMS_LANDER} (extra train), with the "
        "same observations, actions and rewards, is trained, judged, shown and filmed instead, policies of "
        f"the old one by --task {GYMNASIUMS_LANDER}"
    )


def task_id(name: str) -> str:
    """Return the Gymnasium id of a task named as ``CartPole``, ``dynx/CartPole-v0`` or ``LunarLander-v3``.

    A bare name is a task of dynx, in its newest version. Of ``module:Env-v0`` the module is imported, which
    registers the task: the name must be the caller's, never that of a file. Raises UnknownNameError with the
    nearest name.
    """
    if name in (LANDER, f"{NAMESPACE}/{LANDER}-v0"):
        refuse_lander()
    module, colon, own = name.rpartition(":")
    if colon:
        held = getattr(import_tasks(module), own, None)
        if own not in registry and isinstance(held, type) and issubclass(held, Task):
            raise UnknownNameError(
                f"{name} is a class; wanted the id of its environment, which the module registers: "
                f"dynx.envs.register_task('own/{own}-v0', {own})"
            )
        if own not in registry:
            raise UnknownNameError(
                f"module {shown(module)} registers no task {shown(own)}{nearest(own, registry)}"
            )
    if name in registry or colon:
        return name
    versions = [each for each in registry if each.rpartition("-v")[0] == f"{NAMESPACE}/{name}"]
    if versions:
        return max(versions, key=lambda each: int(each.rpartition("-v")[2]))
    bare = [bare_name(each) for each in registry if is_of_dynx(each)]
    near = nearest(name, dict.fromkeys(bare))
    raise UnknownNameError(
        f"no task {shown(name)}{near if '?' in near else nearest(name, [*bare, *registry])}"
    )


def import_tasks(module: str) -> ModuleType:
    """Import a module, which registers its tasks. Raises UnknownNameError if it cannot be imported."""
    try:
        return import_module(module)
    except (ImportError, ValueError) as error:
        top = module.partition(".")[0]
        missing = isinstance(error, ModuleNotFoundError) and error.name == top
        here = missing and (os.path.exists(f"{top}.py") or os.path.isdir(top))
        clause = "; the current folder has it, which PYTHONPATH=. adds" if here else ""
        raise UnknownNameError(f"module {shown(module)} cannot be imported: {error}{clause}") from error


def bare_id(env_id: str) -> str:
    """Return an id without its module: ``own/Walk-v0`` of ``module:own/Walk-v0``."""
    return env_id.rpartition(":")[2]


def specification(env_id: str) -> Any:
    """Return what Gymnasium knows of an id, with or without its module; None for an unknown one."""
    return registry.get(bare_id(env_id))


def is_of_dynx(env_id: str) -> bool:
    """Check whether an id is that of an environment of dynx, which takes an engine: its own tasks and those
    of `register_task`."""
    known = specification(env_id)
    return known is not None and known.entry_point == ENTRY_POINT


def bare_name(env_id: str) -> str:
    """Return the name of a task without namespace and version: CartPole of ``dynx/CartPole-v0``."""
    name = re.split("[/:]", env_id)[-1]
    return name.rpartition("-v")[0] or name
