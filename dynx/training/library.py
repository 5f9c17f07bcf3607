"""The one import of stable-baselines3: its algorithms, what it learns on, and its files of weights.

Weights are read without unpickling anything (`set_parameters` loads tensors alone), so that a policy from
somebody else runs no code of theirs.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from dynx.envs.library import spaces
from dynx.errors import ArgumentError, NotInstalledError, UnknownNameError, nearest, shown
from dynx.training.schedules import SCHEDULED, schedule_of

try:
    import torch
    from stable_baselines3 import A2C, DQN, PPO, SAC, TD3
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.logger import configure
    from stable_baselines3.common.monitor import Monitor
    from stable_baselines3.common.save_util import load_from_zip_file
    from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecEnv, VecMonitor, VecNormalize
except ImportError as error:
    raise NotInstalledError("training needs stable-baselines3: pip install 'dynx[train]'") from error

__all__ = [
    "ALGORITHMS",
    "BaseCallback",
    "DummyVecEnv",
    "Monitor",
    "SubprocVecEnv",
    "VecEnv",
    "VecMonitor",
    "VecNormalize",
    "action_of",
    "log_to",
    "new_algorithm",
    "read_weights",
    "replay_arrays",
    "restore_replay",
    "set_threads",
    "write_weights",
]

ALGORITHMS: dict[str, type[Any]] = {"ppo": PPO, "a2c": A2C, "dqn": DQN, "sac": SAC, "td3": TD3}
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

_REPLAYED = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


def new_algorithm(name: str, env: VecEnv, hyperparameters: dict[str, Any], seed: int | None) -> Any:
    """Make an algorithm with new weights.

    Raises UnknownNameError for an algorithm or a hyperparameter that does not exist, ArgumentError for a
    value that the algorithm refuses or an action space that it cannot use.
    """
    if name not in ALGORITHMS:
        raise UnknownNameError(f"no algorithm {shown(name)}{nearest(name, ALGORITHMS)}")
    algorithm = ALGORITHMS[name]
    known = [each for each in inspect.signature(algorithm.__init__).parameters if each not in _GIVEN]
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
    if "policy_kwargs" in values:
        values["policy_kwargs"] = _policy_options(values["policy_kwargs"])
    try:
        return algorithm("MlpPolicy", env, seed=seed, device="cpu", **values)
    except (AssertionError, TypeError, ValueError, RuntimeError) as error:
        raise ArgumentError(f"{name} refuses: {error}") from error


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
        return options
    if word not in ACTIVATIONS:
        raise UnknownNameError(f"no activation function {shown(word)}{nearest(word, ACTIVATIONS)}")
    return {**options, "activation_fn": ACTIVATIONS[word]}


def action_of(algorithm: Any, observation: Any, deterministic: bool) -> Any:
    """Return the action of the policy of an algorithm for one observation, or those for several (n, ...)."""
    # PyTorch divides even layers of 64 units among all cores, whose waiting for one another takes ten times
    # as long as the layer, and some hundred times where other programs run.
    restore = set_threads(1)
    try:
        action, _ = algorithm.predict(observation, deterministic=deterministic)
    finally:
        restore()
    return action


def write_weights(algorithm: Any, file: BinaryIO) -> None:
    """Write an algorithm, as its own `save` does: stable-baselines3 alone reads the file, too."""
    algorithm.save(file)


def read_weights(algorithm: Any, file: BinaryIO, source: str) -> None:
    """Read weights and the state of the optimizer into an algorithm of the same kind and size.

    Raises ArgumentError for a file with other weights.
    """
    try:
        _, weights, variables = load_from_zip_file(file, device="cpu", load_data=False)
        algorithm.set_parameters(weights, device="cpu")
        for name, value in (variables or {}).items():  # the entropy coefficient of SAC, which is no module
            getattr(algorithm, name).data = value.data
    except Exception as error:  # torch raises whatever a damaged or foreign file leads to
        reason = " ".join(str(error).split())
        raise ArgumentError(f"{shown(source, 300)} has no weights that fit: {reason[:300]}") from error


def replay_arrays(algorithm: Any) -> dict[str, NDArray[Any]] | None:
    """Return the arrays of the replay buffer; None for an algorithm that has none."""
    buffer = getattr(algorithm, "replay_buffer", None)
    if buffer is None:
        return None
    end = buffer.buffer_size if buffer.full else buffer.pos
    arrays = {name: getattr(buffer, name)[:end] for name in _REPLAYED}
    return {**arrays, "pos": np.array(buffer.pos), "full": np.array(buffer.full)}


def restore_replay(algorithm: Any, arrays: dict[str, NDArray[Any]]) -> None:
    """Fill the replay buffer of an algorithm with arrays of `replay_arrays`."""
    buffer = algorithm.replay_buffer
    for name in _REPLAYED:
        getattr(buffer, name)[: len(arrays[name])] = arrays[name]
    buffer.pos, buffer.full = int(arrays["pos"]), bool(arrays["full"])


def log_to(algorithm: Any, folder: str) -> None:
    """Have an algorithm write its curves for TensorBoard into a folder.

    Raises NotInstalledError without TensorBoard.
    """
    try:
        algorithm.set_logger(configure(folder, ["tensorboard"]))
    except (ImportError, AssertionError) as error:
        raise NotInstalledError("curves for TensorBoard need it: pip install 'dynx[train]'") from error


def set_threads(count: int) -> Callable[[], None]:
    """Let PyTorch use `count` threads; the function returned sets the number back."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    return lambda: torch.set_num_threads(before)
