"""Tasks that a file names, such as that of a policy: they open no file and import nothing.

A file of a policy may come from anyone, while `gymnasium.make` imports the module of an id
``module:Env-v0``, and options of a task may name a file (a xacro file runs Python) or a class. So a file may
name a registered environment, and options that are numbers, plain words and robots; everything else is named
by the caller.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from dynx.envs.library import registry
from dynx.envs.registration import is_of_dynx, specification
from dynx.envs.task import JointOptions
from dynx.errors import ArgumentError, RobotNotFoundError, shown
from dynx.model.library import find
from dynx.training.specification import TaskSpec, TrainingSpec

NO_OPTIONS: Mapping[str, Any] = {}

_WORD = re.compile(r"\w[\w -]*", re.ASCII)
"""Text that is neither a path, nor a module, nor an address."""

_FILE = re.compile(r"\bfilename\s*=")
"""Attribute by which a description names another file."""

_ROBOT = "robot"
"""Option of tasks of dynx that is a robot: the name of one of the library, or URDF text."""

_TASK = "task"
"""Argument by which the environments of dynx get the class of their task."""


def of_earlier_version(spec: TrainingSpec, schema: str) -> TrainingSpec:
    """Return the present meaning of what was trained when a document had this `schema`.

    The robot of a `RobotTask` had no stops before version 3, and in version 1 no joint dynamics: these are
    switched off. Worlds had both already.
    """
    version = int(schema.rpartition("/")[2])
    if version > 2:
        return spec
    known = specification(spec.task.id)
    if not is_of_dynx(spec.task.id) or known.vector_entry_point is None:
        return spec
    absent = vars(JointOptions()) if version == 1 else ("joint_limits",)
    options = {**dict.fromkeys(absent, False), **spec.task.options}
    return replace(spec, task=replace(spec.task, options=options))


def task_of_file(
    task: TaskSpec, source: str, given: Mapping[str, Any] = NO_OPTIONS, env_id: str | None = None
) -> TaskSpec:
    """Return a task that a file names, with options `given` by the caller instead of those of the file.

    `env_id` is the caller's own name for the environment. Raises ArgumentError for an environment that is not
    registered, and for options from which a file could be read or a module imported.
    """
    where = shown(source, 300)
    if env_id is None and task.id not in registry:
        raise ArgumentError(
            f"{where} is for the task {shown(task.id)}, which is not registered here; a file imports "
            f"nothing, so name the task yourself: --task {shown(task.id)}, or load_policy(..., "
            "task=TaskSpec(...))"
        )
    chosen = env_id or task.id
    of_dynx = is_of_dynx(chosen)
    if task.engine is not None:
        _check_words("engine", task.engine, where)
    for name, value in task.options.items():
        if name in given:
            continue
        if of_dynx and name == _TASK:
            raise ArgumentError(
                f"{where} names the class of its task; wanted --task or load_policy(..., task=)"
            )
        _check_words("the name of an option", name, where)
        if of_dynx and name == _ROBOT:
            _check_robot(value, where)
        else:
            _check_words(f"option {name}", value, where)
    # The caller's own choice may be an environment that has neither engines nor joint dynamics.
    engine = task.engine if env_id is None or of_dynx else None
    elsewhere = () if of_dynx else vars(JointOptions())
    options = {name: value for name, value in task.options.items() if name not in elsewhere}
    return replace(task, id=chosen, engine=engine, options={**options, **given})


def _check_words(what: str, value: object, where: str) -> None:
    for text in _texts(value):
        if text and not _WORD.fullmatch(text):
            raise ArgumentError(
                f"{what} of the task in {where} is {shown(text)}; a file gives numbers and plain words, "
                "so give it yourself: --option, or load_policy(..., task=TaskSpec(...))"
            )


def _check_robot(value: object, where: str) -> None:
    """Raise ArgumentError for a robot of a file that is neither text without files nor one of the library."""
    found = isinstance(value, str)
    if isinstance(value, str) and value.lstrip("\ufeff \t\r\n").startswith("<"):
        found = _FILE.search(value) is None
    elif isinstance(value, str):
        try:
            find(value)
        except RobotNotFoundError:
            found = False
    if not found:
        raise ArgumentError(
            f"the robot of the task in {where} is {shown(value)}; a file names a robot of the library or has "
            "its URDF text, without meshes; give another one yourself: --option robot=..., or "
            "load_policy(..., task=TaskSpec(...))"
        )


def _texts(value: object) -> Iterator[str]:
    """Yield every text in a JSON value, keys included."""
    waiting = [value]
    while waiting:
        each = waiting.pop()
        if isinstance(each, str):
            yield each
        elif isinstance(each, Mapping):
            waiting += [*each, *each.values()]
        elif isinstance(each, list | tuple):
            waiting += each
