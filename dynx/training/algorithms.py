"""Algorithms by name, made with checked hyperparameters."""

from __future__ import annotations

import inspect
import os
import sys
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from dynx.envs.library import spaces
from dynx.errors import ArgumentError, UnknownNameError, nearest, shown
from dynx.training.library import A2C, DQN, SAC, TD3, VecEnv, torch
from dynx.training.ppo import ThreadedPPO
from dynx.training.schedules import SCHEDULED, SteadyDivergence, schedule_of

ALGORITHMS: dict[str, type[Any]] = {"ppo": ThreadedPPO, "a2c": A2C, "dqn": DQN, "sac": SAC, "td3": TD3}
"""Algorithms by the name that `dynx train --algo` takes."""

ACTIVATIONS = {
    "tanh": torch.nn.Tanh,
    "relu": torch.nn.ReLU,
    "elu": torch.nn.ELU,
    "gelu": torch.nn.GELU,
    "silu": torch.nn.SiLU,
}
"""Activation functions by the name that ``policy_kwargs={"activation_fn": ...}`` takes."""

_GIVEN = ("self", "policy", "env", "seed", "verbose", "tensorboard_log", "device", "_init_setup_model")
"""Parameters of an algorithm that training sets itself."""

_OF_NUMBERS, _OF_CHOICES = ("sac", "td3"), ("dqn",)
_REFUSED_ACTIONS: dict[str, type[Any]] = {
    **dict.fromkeys(_OF_NUMBERS, spaces.Discrete),
    **dict.fromkeys(_OF_CHOICES, spaces.Box),
}
"""Actions that an algorithm cannot learn."""

_OF_SEVERAL_KINDS = ("train_freq",)
"""Hyperparameters whose default is a number, and which may also be something else."""

_FRACTIONS = ("gamma", "gae_lambda", "tau")
"""Hyperparameters between 0 and 1; the algorithms accept others, with which nothing is learned."""

_BYTES_PER_WEIGHT = 24
"""Memory for a weight of a network and its optimizer, and for a copy (a target network) [bytes]."""

_ALGORITHM_REFUSES = (
    ArithmeticError,
    AssertionError,
    AttributeError,
    LookupError,
    MemoryError,
    RuntimeError,
    TypeError,
    ValueError,
)
"""Exceptions of stable-baselines3 and PyTorch for values of hyperparameters."""


def hyperparameters_of(name: str) -> list[str]:
    """Return the names of the hyperparameters of an algorithm."""
    parameters = inspect.signature(ALGORITHMS[name].__init__).parameters
    return [each for each in parameters if each not in _GIVEN]


def new_algorithm(
    name: str,
    env: VecEnv,
    hyperparameters: dict[str, Any],
    seed: int | None,
    *,
    most_weights: int | None = None,
) -> Any:
    """Make an algorithm with new weights, at most `most_weights` in a network.

    Raises UnknownNameError for an algorithm or a hyperparameter that does not exist, ArgumentError for a
    value that the algorithm refuses, an action space that it cannot use, and networks or buffers that are
    larger than the memory.
    """
    if name not in ALGORITHMS:
        raise UnknownNameError(f"no algorithm {shown(name)}{nearest(name, ALGORITHMS)}")
    algorithm = ALGORITHMS[name]
    known = hyperparameters_of(name)
    for each in hyperparameters:
        if each not in known:
            raise UnknownNameError(f"{name} has no hyperparameter {shown(each)}{nearest(each, known)}")
    for each, value in hyperparameters.items():
        _check_kind(each, value, inspect.signature(algorithm.__init__).parameters[each].default)
    if isinstance(env.action_space, _REFUSED_ACTIONS.get(name, ())):
        others = [
            each for each in ALGORITHMS if not isinstance(env.action_space, _REFUSED_ACTIONS.get(each, ()))
        ]
        kind = "numbers" if name in _OF_NUMBERS else "choices"
        raise ArgumentError(
            f"{name} learns actions that are {kind}, and those of the task are {env.action_space}; wanted "
            f"{', '.join(others)}"
        )
    for each in _FRACTIONS:
        value = hyperparameters.get(each, 1.0)
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value <= 1.0:
            raise ArgumentError(f"{each} is {value!r}; wanted a number between 0 and 1")
    values = {each: schedule_of(each, value) for each, value in hyperparameters.items()}
    if name != "ppo" and isinstance(values.get("learning_rate"), SteadyDivergence):
        raise ArgumentError(f"learning_rate is {hyperparameters['learning_rate']}, which ppo alone has")
    if "policy_kwargs" in values:
        values["policy_kwargs"] = _policy_options(values["policy_kwargs"])
        _check_weights(values["policy_kwargs"], env, most_weights)
    _check_buffers(hyperparameters, env)
    try:
        return algorithm("MlpPolicy", env, seed=seed, device="cpu", **values)
    except _ALGORITHM_REFUSES as error:
        raise ArgumentError(f"{name} refuses: {str(error) or type(error).__name__}") from error


def _memory() -> int:
    """Return the memory of this machine [bytes]; where it is not known, the largest number of bytes."""
    if sys.platform == "win32" or "SC_PHYS_PAGES" not in os.sysconf_names:
        return 2**63
    return int(os.sysconf("SC_PAGE_SIZE")) * int(os.sysconf("SC_PHYS_PAGES"))


MAX_LAYERS = 1000
"""Largest number of layers of networks; each takes a tenth of a millisecond in every call."""


def _check_weights(options: Mapping[str, Any], env: VecEnv, most: int | None) -> None:
    """Raise ArgumentError for layers that are no numbers, or have more weights than `most` or the memory."""
    layers = options.get("net_arch", [])
    lists = [*layers.values()] if isinstance(layers, dict) else [layers]
    critics = options.get("n_critics", 1)
    for each in [*lists, [critics]]:
        if not isinstance(each, list | tuple) or not all(type(width) is int and width > 0 for width in each):
            raise ArgumentError(
                "net_arch is a list of the widths of layers, or one for each network, and n_critics a "
                f"number, all above 0; got {shown(options)}"
            )
    inputs = int(spaces.flatdim(env.observation_space)) + int(spaces.flatdim(env.action_space))
    if critics * max(map(len, lists), default=0) > MAX_LAYERS:
        raise ArgumentError(f"net_arch has more than {MAX_LAYERS} layers; wanted fewer")
    weights = critics * max((sum(a * b for a, b in pairwise([inputs, *each])) for each in lists), default=0)
    if most is not None and weights > most:
        raise ArgumentError(f"net_arch describes {weights:,} weights, more than the file holds")
    if weights * _BYTES_PER_WEIGHT > _memory():
        raise ArgumentError(f"net_arch describes {weights:,} weights, which the memory does not hold")


def _check_buffers(hyperparameters: Mapping[str, Any], env: VecEnv) -> None:
    """Raise ArgumentError for a buffer of samples that is larger than the memory."""
    one = 2 * _bytes_of(env.observation_space) + _bytes_of(env.action_space)
    for name, copies in (("buffer_size", 1), ("n_steps", env.num_envs), ("batch_size", 1)):
        count = hyperparameters.get(name, 0)
        if isinstance(count, int) and count * copies * one > _memory():
            raise ArgumentError(
                f"{name} is {count:,}: the samples need {count * copies * one:,} bytes of memory"
            )


def _bytes_of(space: Any) -> int:
    """Return the size of an element of a space in a buffer [bytes]."""
    if space.shape is None or space.dtype is None:
        return 0
    return int(np.prod(space.shape)) * int(space.dtype.itemsize)


def _check_kind(name: str, value: object, default: object) -> None:
    """Refuse a value of another kind than the default of a hyperparameter, where that tells the kind."""
    wanted = None
    if name in SCHEDULED:
        return
    if isinstance(default, bool):
        wanted = None if isinstance(value, bool) else "true or false"
    elif isinstance(default, int) and name not in _OF_SEVERAL_KINDS:
        wanted = None if isinstance(value, int) and not isinstance(value, bool) else "a whole number"
    elif isinstance(default, float):
        wanted = None if isinstance(value, int | float) and not isinstance(value, bool) else "a number"
    if wanted is not None:
        raise ArgumentError(f"{name} is {value!r:.100}; wanted {wanted}")


def _policy_options(options: object) -> dict[str, Any]:
    if not isinstance(options, dict):
        raise ArgumentError(
            f"policy_kwargs is a table such as {{'net_arch': [64, 64]}}; got {shown(options)}"
        )
    word = options.get("activation_fn")
    if not isinstance(word, str):
        return {**options}  # A2C adds its optimizer to them, which no file of a run could have
    if word not in ACTIVATIONS:
        raise UnknownNameError(f"no activation function {shown(word)}{nearest(word, ACTIVATIONS)}")
    return {**options, "activation_fn": ACTIVATIONS[word]}
